"""Decimal commas, as spreadsheets of many countries write them."""

from __future__ import annotations

from pathlib import Path

import pytest

from lightfield.errors import MeasurementError
from lightfield.readings import read_table


def test_the_head_has_the_decimal_mark_of_the_columns(tmp_path: Path) -> None:
    """Of a table of decimal commas it was said that its head is not TOML, and that comments begin with ##."""
    path = tmp_path / "readings.csv"
    head = '# position_mm = 0,5\n# plane_gain_percent = 1,5e-1  # of a ruler\n# operator = "A, B"\n'
    path.write_text(f"{head}z_m;value\n4,5;0,9\n")
    found = read_table(path)
    assert (found.budget.position_mm, found.budget.plane_gain_percent) == (0.5, 0.15)
    assert found.metadata == {"operator": "A, B"}


def test_a_comma_beside_points_is_refused_with_its_remedy(tmp_path: Path) -> None:
    path = tmp_path / "readings.csv"
    path.write_text("# position_mm = 0,5\nz_m;value\n4.5;0.9\n")
    with pytest.raises(
        MeasurementError, match=r"line 1: .* a point, as in the columns: # position_mm = 0\.5$"
    ):
        read_table(path)
