"""Cases of another simulator, NNN/{scene.toml, data.csv, truth.json}, and what a diagnosis says of them."""

from __future__ import annotations

import json
import resource
import sys
import time
from pathlib import Path

import numpy as np

from benchmarks import runs
from benchmarks.many_effects.experiment import as_data
from benchmarks.runs import Row
from lightfield.diagnosis.diagnose import diagnose
from lightfield.readings import read_table
from lightfield.scene import Scene

#: What a curve stands for in the truth.
CURVE = {"beam_profile": "lamp"}
#: Exponentials in the unit of processor time.
UNIT = 100_000_000


def unit_seconds() -> float:
    """Processor time of 1e8 exponentials by NumPy: what another machine, or a busy one, takes longer for
    everything takes longer for this too."""
    numbers, begun = np.linspace(-1.0, 0.0, 1_000_000), time.process_time()
    for _ in range(UNIT // len(numbers)):
        np.exp(numbers)
    return time.process_time() - begun


def kept(store: Path) -> dict[str, Row]:
    """Results by the names of their cases, as far as there are any."""
    return {row["case"]: row for row in runs.read(store)}


def run_and_keep(case: Path, store: Path) -> Row:
    """`run` in a process of its own, whose peak memory is that of this case; stored and told."""
    with runs.start(processes=1) as pool:
        row = pool.submit(run, case).result()
    runs.append(store, row)
    print(case.name, row["verdict"], row["best_set"], f"{row['cpu_seconds']:.0f} s", file=sys.stderr)
    return row


def run(case: Path) -> Row:
    """Diagnose one case."""
    truth = json.loads((case / "truth.json").read_text())
    row: Row = {
        "case": case.name, "hidden": truth["hidden"], "lamp": truth["lamp"], "layout": truth["layout"],
        "delta": truth["detectability_sigma"],
    }  # fmt: skip
    unit = unit_seconds()
    readings, scene = read_table(case / "data.csv"), Scene.load(case / "scene.toml")
    begun = time.process_time()
    verdict = diagnose(readings, scene).verdict
    return (
        row
        | {
            "readings": len(readings),
            "cpu_seconds": time.process_time() - begun,
            "unit_seconds": unit,
            "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        }
        | as_data(verdict)
    )


def right(row: Row, name: str) -> bool:
    """Was it hidden, or is it the curve of a lamp that is no Gaussian?"""
    return name in row["hidden"] or bool(row["lamp"] and CURVE.get(name) == "lamp")


def found(row: Row) -> list[str]:
    """Hidden effects in the best set."""
    return [name for name in row["hidden"] if name in row["best_set"]]


def wrong(row: Row, names: list[str]) -> list[str]:
    """Names of what was not hidden."""
    return [name for name in names if not right(row, name)]


def explained(row: Row) -> bool:
    return bool(row["verdict"] in ("identified", "ambiguous"))
