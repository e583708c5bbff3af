"""Columns of places that are called otherwise."""

from __future__ import annotations

from pathlib import Path

import pytest

from lightfield.errors import MeasurementError
from lightfield.readings import read_table
from lightfield.readings.load_warning import Remarks


@pytest.mark.parametrize("name", ["x", "x_mm", "X (cm)"])
def test_places_by_another_name_are_not_taken_for_the_axis(tmp_path: Path, name: str) -> None:
    """Readings at x and y were replicates on the axis, to be numbered; at x_mm "no beam through water"."""
    path = tmp_path / "readings.csv"
    path.write_text(f"z_m,value,{name}\n1,2,3\n1,3,4\n")
    with pytest.raises(
        MeasurementError, match=r"line 1: the column '.*' is none .*, and x_m is missing"
    ) as e:
        read_table(path)
    assert "call it x_m, its numbers in metres" in str(e.value) and "there already" not in str(e.value)


@pytest.mark.parametrize("name", ["err", "std", "sd", "Error (%)", "sigma"])
def test_errors_by_another_name_are_told(tmp_path: Path, name: str) -> None:
    """They were kept without a word, and the noise was estimated."""
    path = tmp_path / "readings.csv"
    path.write_text(f"z_m,value,{name}\n1,2,3\n2,1,4\n")
    told = [w for w in read_table(path).warnings if w.code is Remarks.UNUSED_COLUMN]
    assert [w.values for w in told] == [{"unused": name, "missing": "stderr"}]
