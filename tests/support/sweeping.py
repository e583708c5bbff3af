"""Running `lightfield sweep` as a process, for the tests of interruption."""

from __future__ import annotations

import contextlib
import io
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import xarray as xr

from lightfield.cli import main
from lightfield.render.backend import use_backend

SCENE = """
name = "small tank"
[water]
absorption_per_m = 0.1
scattering_per_m = 0.2
[tank]
wall_albedo = 0.2
[detector]
planes_m = [2.0, 3.0]
width_m = 1.0
pixels = 12
"""
# Three traces, one for each beam; four blocks of six or nine waters for each trace.
VARY = ("--vary", "lamp.hwhm_deg=3,4,5", "--vary", "water.scattering_per_m=0:0.3:11",
        "--vary", "water.absorption_per_m=0.05,0.1,0.2")  # fmt: skip
BUDGET = ("--max-photons", "2e4", "--rel-error", "0.5")
# Small blocks, so that a small sweep has many of them.
SMALL_BLOCK = 11
SMALL_BLOCKS = f"import lightfield.sweep.sweep_plan as p; p.BLOCK_CASES = {SMALL_BLOCK}; "
MAIN = "import sys; from lightfield.cli import main; sys.exit(main(sys.argv[1:]))"


def command(scene: Path, store: Path, *more: str, before: str = "", vary: Sequence[str] = VARY) -> list[str]:
    """Command line of a sweep; `before` is run in the process first."""
    words = ["sweep", str(scene), *vary, *BUDGET, "-o", str(store), *more]
    return [sys.executable, "-c", SMALL_BLOCKS + before + "\n" + MAIN, *words]


def in_process(
    scene: Path, store: Path, *more: str, vary: Sequence[str] = VARY
) -> subprocess.CompletedProcess[str]:
    """Run a sweep to its end in this process, where another one is not what is asked about."""
    words = ["sweep", str(scene), *vary, *BUDGET, "-o", str(store), *more]
    output, errors = io.StringIO(), io.StringIO()
    with (
        mock.patch("lightfield.sweep.sweep_plan.BLOCK_CASES", SMALL_BLOCK),
        contextlib.redirect_stdout(output),
        contextlib.redirect_stderr(errors),
    ):
        code = main(words)
    return subprocess.CompletedProcess(words, code, output.getvalue(), errors.getvalue())


def sweep(
    scene: Path, store: Path, *more: str, before: str = "", vary: Sequence[str] = VARY, **options: Any
) -> subprocess.CompletedProcess[str]:
    """Run a sweep to its end."""
    words = command(scene, store, *more, before=before, vary=vary)
    return subprocess.run(words, capture_output=True, text=True, timeout=120, check=False, **options)


def start(scene: Path, store: Path, *more: str, before: str = "", **options: Any) -> subprocess.Popen[str]:
    """Start a sweep in a process group of its own."""
    pipe = subprocess.PIPE
    words = command(scene, store, *more, before=before)
    return subprocess.Popen(words, stdout=pipe, stderr=pipe, text=True, start_new_session=True, **options)


def wait_for_blocks(process: subprocess.Popen[str], store: Path, count: int) -> None:
    """Return once so many blocks are on disk; fail when the process ends before."""
    deadline = time.monotonic() + 90
    while blocks_done(store) < count:
        assert process.poll() is None, f"ended early: {process.communicate()}"
        assert time.monotonic() < deadline
        time.sleep(0.02)


def blocks_done(store: Path) -> int:
    """Blocks in the journal."""
    journal = store / ".lightfield" / "journal.jsonl"
    return journal.read_text().count('"block"') if journal.exists() else 0


def same(one: np.ndarray, other: np.ndarray, sums: np.ndarray | None = None) -> bool:
    """Are arrays equal: bit by bit, or to single precision on a card, whose sums have no order?

    A standard error is a difference of `sums`, and known to the single precision of those.
    """
    if use_backend().kind == "cuda" and one.dtype.kind == other.dtype.kind == "f":
        scale = other if sums is None else sums
        tolerance = 1e-6 * float(np.abs(scale[np.isfinite(scale)]).max(initial=0.0))
        return one.shape == other.shape and np.allclose(one, other, 1e-5, tolerance, equal_nan=True)
    return one.tobytes() == other.tobytes()


def differences(one: Path, other: Path) -> list[str]:
    """Variables that are not the `same` in two stores, and chunks that only one of them has."""
    a, b = xr.open_zarr(one), xr.open_zarr(other)
    assert a.attrs["complete"] == b.attrs["complete"] == "yes"
    found = [name for name in {*a.variables, *b.variables}
             if name not in a or name not in b or a[name].dtype != b[name].dtype
             or not same(a[name].values, b[name].values, _sums(b, str(name)))]  # fmt: skip
    return found + sorted(_files(one) ^ _files(other))


def _sums(data: xr.Dataset, name: str) -> np.ndarray | None:
    """Values whose standard errors a variable holds."""
    value = name.removesuffix("_stderr")
    return data[value].values if value != name and value in data else None


def _files(store: Path) -> set[str]:
    hidden = store / ".lightfield"
    return {str(f.relative_to(store)) for f in store.rglob("*") if f.is_file() and hidden not in f.parents}


def finite_everywhere(store: Path) -> bool:
    """Every case was evaluated."""
    data = xr.open_zarr(store)
    return bool((data.status == 1).all()) and bool(np.isfinite(data.irradiance.values).all())
