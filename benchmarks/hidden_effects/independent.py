"""Cases made by another simulator, when there is a folder of them: NNN/{scene.toml, data.csv, truth.json}."""

from __future__ import annotations

import json
from pathlib import Path

from benchmarks.hidden_effects.experiment import Tracing, as_data, timed
from benchmarks.runs import Row, attempted
from lightfield.readings import read_table
from lightfield.scene import Scene


def run(case: Path) -> Row:
    """Diagnose one case."""
    truth = json.loads((case / "truth.json").read_text())
    hidden = truth["hidden"]
    row: Row = {
        "case": case.name, "stratum": "independent", "label": " + ".join(hidden) or "nothing",
        "hidden": sorted(h for h in hidden if not h.startswith("unknown")),
        "unknown": next((h for h in hidden if h.startswith("unknown")), ""), "any_of": [],
        "layout": truth["layout"], "noise": truth["noise"], "delta": truth["detectability_sigma"],
    }  # fmt: skip
    return attempted(row | {"effects": [], "explanations": []}, _run, case)


def _run(case: Path) -> Row:
    readings, scene = read_table(case / "data.csv"), Scene.load(case / "scene.toml")
    found, times = timed(readings, scene, Tracing())
    return as_data(found) | times | {"n": len(readings)}
