"""In scattered light that the search alone has traced no weak effect is certain."""

from __future__ import annotations

import pytest
from analytic_readings import readings

from lightfield.diagnosis.certainty import Certainty
from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.search.pool import evidence

ASKED = ["background", "beam_offset", "beam_tilt", "lamp_drift"]


@pytest.mark.parametrize("rough", [False, True])
def test_what_an_error_of_the_light_may_be_is_not_certain(
    monkeypatch: pytest.MonkeyPatch, rough: bool
) -> None:
    """A background of ten sigma, beside an offset and a drift of 200 and 46."""
    hidden = {"detector.background": 0.003, "lamp.offset_x_m": 0.06, "lamp.drift_per_hour": 0.3}
    monkeypatch.setattr(evidence, "is_of_the_search_alone", lambda *_: rough)
    table, believed = readings(hidden, seed=4)
    verdict = diagnose(table, believed, diffuse=None, only=ASKED, advise=False).verdict
    levels = {one.effect: one.level for one in verdict.found}
    assert levels.pop("background") == (Certainty.SIMPLEST if rough else Certainty.CERTAIN)
    assert levels == {"beam_offset": Certainty.CERTAIN, "lamp_drift": Certainty.CERTAIN}
