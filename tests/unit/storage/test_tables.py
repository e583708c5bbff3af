"""Tables that a scene names: what parts their cells, and their decimal mark."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.errors import SceneError
from lightfield.scene.lamp.photometry import beam_table
from lightfield.storage.tables import read_columns


@pytest.mark.parametrize("separator", [";", "\t"])
def test_cells_may_be_parted_by_semicolons_and_have_decimal_commas(tmp_path, separator):
    path = tmp_path / "beam.csv"
    path.write_text("angle_deg;intensity\n0;1,0\n1,5;0,25\n".replace(";", separator))
    angle, intensity = read_columns(str(path), ("angle_deg", "intensity"))
    assert (angle.tolist(), intensity.tolist()) == ([0, 1.5], [1, 0.25])
    path.write_text("angle_deg;intensity\n0;1,000\n1.5;0,25\n")
    with pytest.raises(SceneError, match="decimal points and decimal commas"):
        read_columns(str(path), ("angle_deg", "intensity"))


def test_a_beam_of_two_sides_says_how_sides_are_written(tmp_path):
    path = tmp_path / "beam.csv"
    path.write_text("angle_deg,intensity\n-10,0.5\n0,1\n10,0.4\n")
    with pytest.raises(SceneError, match="one side phi_deg 0, the other phi_deg 180"):
        beam_table(str(path))
    path.write_text("phi_deg,angle_deg,intensity\n0,0,1\n0,10,0.5\n180,0,1\n180,10,0.4\n")
    table = beam_table(str(path))
    assert np.allclose(table.at(np.radians(10.0), 0.0), 0.5)


def test_half_planes_too_many_are_named(tmp_path):
    path = tmp_path / "beam.csv"
    rows = [f"{phi},{angle},1" for phi in range(0, 200, 15) for angle in (0, 10)]
    path.write_text("\n".join(["phi_deg,angle_deg,intensity", *rows]) + "\n")
    with pytest.raises(SceneError, match="without those beyond 180 deg they are one"):
        beam_table(str(path))
