"""Cases made by another simulator, when there is a folder of them: NNN/{scene.toml, data.csv, truth.json}."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from benchmarks.hidden_effects.experiment import Tracing, as_data, timed
from lightfield.readings import read_table
from lightfield.scene import Scene

Row = dict[str, Any]


def folder_of_cases() -> Path | None:
    """LIGHTFIELD_REFERENCE or the sibling folder `shared`, if it holds such cases."""
    sibling = Path(__file__).resolve().parents[3] / "shared"
    folder = Path(os.environ.get("LIGHTFIELD_REFERENCE", sibling)) / "hidden_effects"
    return folder if folder.is_dir() else None


def cases() -> list[Path]:
    """The folders of the cases, in order."""
    folder = folder_of_cases()
    return sorted(p.parent for p in folder.glob("*/truth.json")) if folder else []


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
    try:
        readings, scene = read_table(case / "data.csv"), Scene.load(case / "scene.toml")
        found, times = timed(readings, scene, Tracing())
        row |= as_data(found) | times | {"n": len(readings)}
    except Exception as error:  # a crash is an outcome too
        row |= {"verdict": "error", "error": repr(error), "effects": [], "explanations": []}
    return row
