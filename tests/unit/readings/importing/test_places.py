"""Tables that have the places in them: what is wrong with one is told once."""

from __future__ import annotations

from pathlib import Path

import pytest

from lightfield.errors import MeasurementError
from lightfield.readings.importing.places import read_places
from lightfield.readings.problems import Problems


def test_a_value_that_cannot_be_read_is_told_once(tmp_path: Path) -> None:
    """Also where its error is stated in per cent of it."""
    table, problems = tmp_path / "own.csv", Problems("own.csv")
    table.write_text("z (m),v,error (%)\n2,1O0,0.5\n3,5O,0.5\n4,30,0.5\n5,20,0.5\n")
    read_places(str(table), {"z_m": "z (m)", "value": "v", "stderr": "error (%)"}, [(500.0, 550.0)], problems)
    assert [one.lines for one in problems.found] == [(2,), (3,)]


def test_a_row_says_what_an_index_would(tmp_path: Path) -> None:
    """Also the first one, where it has words and the next has blanks there."""
    table, problems = tmp_path / "own.csv", Problems("own.csv")
    table.write_text(
        "depth (cm),v,n,what,where\n200,9,1,Signal,AIR\n300,4,2,,\n0,1,3,dark,\n0,4,4,lamp,oil\n"
    )
    columns = {"z_m": "depth (cm)", "value": "v", "role": "what", "medium": "where"}
    shots, _ = read_places(str(table), columns, [(500.0, 550.0)], problems)
    entries = [(one.entry.role, one.entry.medium, one.entry.z_m) for one in shots[:3]]
    assert entries == [("signal", "air", 2.0), ("signal", "water", 3.0), ("dark", "water", 0.0)]
    assert [(one.what, one.lines) for one in problems.found] == [
        ("unknown medium", (5,)),
        ("unknown role", (5,)),
    ]


def test_no_error_without_its_value(tmp_path: Path) -> None:
    table = tmp_path / "own.csv"
    table.write_text("z_m,525,530,535,s\n2,9,8,7,1\n3,4,3,2,1\n")
    problems = Problems("own.csv")
    read_places(str(table), {"z_m": "z_m", "stderr": "s"}, [(500.0, 550.0)], problems)
    with pytest.raises(MeasurementError, match="errors of no value"):
        problems.raise_any()


def test_the_last_column_may_have_blanks(tmp_path: Path) -> None:
    """A blank at the end of a row is a cell where other rows have one, and none where every row ends so."""
    table, problems = tmp_path / "own.csv", Problems("own.csv")
    for text, errors in (
        ("z_m,v,s\n2,9,0.1\n3,4,\n4,2,0.3\n", [0.1, float("nan"), 0.3]),
        ("z_m\tv\ts\n2\t9\t0.1\n3\t4\t\n4\t2\t0.3\n", [0.1, float("nan"), 0.3]),
        ("z_m,v,s\n2,9,0.1,\n3,4,0.2,\n", [0.1, 0.2]),
    ):
        table.write_text(text)
        columns = {"z_m": "z_m", "value": "v", "stderr": "s"}
        shots, _ = read_places(str(table), columns, [(500.0, 550.0)], problems)
        assert [shot.stated for shot in shots] == pytest.approx(errors, nan_ok=True) and not problems
