"""Figures of the working range where there is little to draw."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lightfield.report.working_range import pose_figure
from lightfield.scene import Scene
from lightfield.studies.working_range.study import working_range


def test_what_is_known_nowhere_leaves_the_axis_about_what_is_asked(tmp_path: Path) -> None:
    """One ring that leans outwards does not part a step aside from a turn: its axes ended at 1e8 degrees."""
    at, lean = np.arange(8) * np.pi / 4, np.radians(20.0)
    rows = [(0.2 * np.cos(a), 0.2 * np.sin(a), 0.0, np.sin(lean) * np.cos(a), np.sin(lean) * np.sin(a),
             -np.cos(lean)) for a in at]  # fmt: skip
    table = tmp_path / "ring.csv"
    lines = [",".join(f"{v:.6f}" for v in row) for row in rows]
    table.write_text("\n".join(["x_m,y_m,z_m,nx,ny,nz", *lines]), encoding="utf-8")
    scene = Scene.from_dict(
        {"water": {"absorption_per_m": 0.1}, "array": {"layout": "table", "table": str(table)}}
    )
    across, along, turned = pose_figure(working_range(scene, None)).axes[:3]
    assert across.get_ylim()[1] <= 1.0 and turned.get_ylim()[1] <= 50.0
    said = ["not known" in "".join(t.get_text() for t in axis.texts) for axis in (across, along, turned)]
    assert said == [True, False, True]
