"""Why an effect cannot be tested is a record: each kind, and each condition of the table, has its words."""

from __future__ import annotations

import pytest
from pydantic import TypeAdapter

from lightfield.diagnosis.problem.candidates import UNMET
from lightfield.diagnosis.problem.untestable import Hinders, Hindrance, in_words
from lightfield.fitting import effects

RECORD = TypeAdapter(Hindrance)


@pytest.mark.parametrize("hinders", Hinders)
def test_every_hindrance_says_what_it_knows_and_reads_back(hinders: Hinders) -> None:
    told = Hindrance(hinders, profile="pencil", cells=5200, most=3000)
    assert str(told) and "{" not in str(told) and "None" not in str(Hindrance(hinders, "pencil", 1, 1))
    assert ("5200 cells" in str(told)) == (hinders is Hinders.MANY_CELLS)
    assert ("pencil" in str(told)) == (hinders is Hinders.LAMP)
    assert RECORD.validate_python(RECORD.dump_python(told, mode="json")) == told


def test_every_condition_of_the_table_has_its_hindrance() -> None:
    known = effects.table().values()
    asked = {need for one in known for need in one.needs}
    asked |= {need for one in known for form in one.forms for free in form.amplitudes for need in free.needs}
    assert asked <= set(UNMET) and len(set(UNMET.values())) == len(UNMET)


def test_several_hindrances_are_one_line() -> None:
    both = in_words([Hindrance(Hinders.NO_TIMES), Hindrance(Hinders.NO_TANK)])
    assert both == "the readings carry no times; the scene has no [tank]"
    assert in_words([]) == ""
