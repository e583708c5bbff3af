"""Whether Mitsuba can really render on this machine's GPU, found out where a crash does no harm."""

from __future__ import annotations

import ctypes
import functools
import hashlib
import importlib.metadata
import os
import subprocess
import sys
from pathlib import Path

from lightfield.storage.cache import cache_dir
from lightfield.storage.files import write_text

VARIANT = "cuda_ad_spectral"
_TRIAL_TIMEOUT_S = 180
_DRIVER = Path("/proc/driver/nvidia/version")

# A ray against a sphere needs driver, device, OptiX and a working compiler: all that a render needs.
_TRIAL = """
import sys, mitsuba as mi
mi.set_variant(sys.argv[1])
scene = mi.load_dict({"type": "scene", "ball": {"type": "sphere"}})
hit = scene.ray_intersect(mi.Ray3f(mi.Point3f(0, 0, -5), mi.Vector3f(0, 0, 1)))
sys.exit(0 if abs(hit.t[0] - 4) < 1e-3 else "the ray missed: " + str(hit.t))
"""


@functools.cache
def cuda_problem() -> str:
    """Why the GPU cannot be used; "" when it can.

    A missing driver is seen at once. Otherwise a tiny ray trace runs in a process of its own, for seconds.
    Success is remembered in the cache for this driver, device selection and Dr.Jit version.
    """
    if problem := _driver_problem():
        return problem
    remembered = _memory()
    if remembered is not None and remembered.exists():
        return ""
    problem = trial_problem(VARIANT)
    if not problem and remembered is not None:
        write_text(remembered, "works\n")
    return problem


def trial_problem(variant: str) -> str:
    """Trace one ray with a Mitsuba variant in a process of its own; "" when it hits where it should."""
    try:
        trial = subprocess.run(
            [sys.executable, "-c", _TRIAL, variant],
            capture_output=True,
            text=True,
            timeout=_TRIAL_TIMEOUT_S,
            check=False,
        )
    except (OSError, subprocess.SubprocessError) as error:
        return f"the trial did not run ({error})"
    if trial.returncode == 0:
        return ""
    lines = [line.strip() for line in trial.stderr.splitlines() if line.strip()]
    return f"the trial render failed (exit {trial.returncode}): {lines[-1] if lines else 'no message'}"


def _driver_problem() -> str:
    try:
        ctypes.CDLL(os.environ.get("DRJIT_LIBCUDA_PATH") or "libcuda.so.1")
    except OSError:
        return "no NVIDIA driver (libcuda.so.1) on this machine"
    return ""


def _memory() -> Path | None:
    try:
        driver = _DRIVER.read_text()
    except OSError:
        return None
    parts = [driver, os.environ.get("CUDA_VISIBLE_DEVICES", ""), importlib.metadata.version("drjit")]
    return cache_dir() / f"cuda-{hashlib.sha256('|'.join(parts).encode()).hexdigest()[:16]}.ok"
