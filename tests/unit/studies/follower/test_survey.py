"""What an array can know, in words: what it cannot, and why."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lightfield.report.follower.page import survey_page
from lightfield.scene import Scene
from lightfield.studies.follower.array_light import Space
from lightfield.studies.follower.information import is_told
from lightfield.studies.follower.survey import Survey, survey


def surveyed(folder: Path, tilts_deg: list[float], scattering: float = 0.0, photons: float = 0) -> Survey:
    """Rings of eight, 0.1 m apart, whose elements lean outwards by so much; and one in the middle."""
    rows = [(0.0, 0.0, 0.0, 0.0, 0.0, -1.0)]
    for k, tilt in enumerate(np.radians(tilts_deg), 1):
        for at in np.arange(8) * np.pi / 4:
            out = np.array([np.cos(at), np.sin(at)])
            rows.append((*(0.1 * k * out), 0.0, *(np.sin(tilt) * out), -np.cos(tilt)))
    table = folder / "elements.csv"
    table.write_text(
        "x_m,y_m,z_m,nx,ny,nz\n" + "".join(",".join(f"{v:.6f}" for v in row) + "\n" for row in rows)
    )
    tables = {
        "lamp": {"hwhm_deg": 7.0},
        "water": {"absorption_per_m": 0.09, "scattering_per_m": scattering},
        "array": {"layout": "table", "table": str(table)},
    }
    scene = Scene.from_dict(tables)
    return survey(scene, Space.of_scene(scene), photons=photons)


@pytest.mark.usefixtures("undrawn")
def test_coordinates_that_do_the_same_are_named_with_what_parts_them(tmp_path: Path) -> None:
    """A step aside and a turn change the readings of one ring alike, in proportion to a place aside."""
    ring = surveyed(tmp_path, [20.0])
    assert ring.tied == (("x", "yaw"), ("y", "pitch"))
    says = "To the readings of this array x and yaw do the same, and y and pitch: each is known only as far"
    assert says in ring.as_text() and says in survey_page(ring) and "array optimise" in ring.as_text()
    lines = ring.as_text().splitlines()
    assert len(ring.axis) == 3 and len(lines) == len(set(lines)), "one pose is told once"
    assert ring.as_data()["tied"] == [["x", "yaw"], ["y", "pitch"]]


@pytest.mark.usefixtures("undrawn")
def test_who_parts_them_is_told_nothing(tmp_path: Path) -> None:
    """Two rings, of which the inner leans more."""
    parted = surveyed(tmp_path, [30.0, 5.0])
    assert parted.tied == () and "do the same" not in parted.as_text() + survey_page(parted)


def test_noise_of_a_trace_does_not_part_them(tmp_path: Path) -> None:
    """A bound of 0.7 m ± 94 % was taken for something known, and why it is not was not told."""
    ring = surveyed(tmp_path, [20.0], scattering=0.05, photons=1e6)
    assert is_told("x", ring.axis[1].sigma["x"]) and ring.tied == (("x", "yaw"), ("y", "pitch"))
