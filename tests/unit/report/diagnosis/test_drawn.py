"""A diagnosis as it is drawn."""

from __future__ import annotations

import analytic_readings
import numpy as np
import pytest

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.search.told_apart import separation
from lightfield.diagnosis.verdict.parts import Rung
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.report.diagnosis.drawn import view_of
from lightfield.report.diagnosis.page import _lead
from lightfield.report.diagnosis.view import Separation


def test_distances_that_are_drawn_are_those_of_fits_to_the_end() -> None:
    """To two digits, or to where nobody would see it."""
    table, believed = analytic_readings.readings({"detector.background": 0.02}, seed=3)
    found = diagnose(table, believed, only=["background", "beam_skirt", "beam_shape"])
    seen = view_of(found)
    drawn = seen.separation
    assert isinstance(drawn, Separation) and len(drawn.names) > 1
    # A prediction counts the effects that its label adds.
    for one in seen.predictions:
        assert one.effects == sum(word == "+" for word in one.label.split())
    finding, problem = found.finding, found.prepared.problem
    by_name = {tried.names: tried for tried in [*finding.tried, *finding.accepted]}
    chosen = [by_name[name] for name in drawn.names]
    to_the_end = [
        [separation(problem, finding.whiten, j.fit, k, finding.level.phi).separation_sigma for k in chosen]
        for j in chosen
    ]
    off = ~np.eye(len(chosen), dtype=bool)
    assert drawn.sigma[off] == pytest.approx(np.array(to_the_end)[off], rel=0.05, abs=0.3)


def test_an_error_of_many_per_cent_is_written_out() -> None:
    """The first line of a page said 2.8e+02 %."""
    rungs = [Rung.model_construct(error_percent=e, parameters={}) for e in (280.7, 0.98)]
    verdict = Verdict.model_construct(ladder=rungs, noise_floor_percent=1.02, run=1, readings=315)
    assert _lead(verdict)[0].startswith("The error falls from 280 % to 0.98 %; the noise floor is 1 %")
