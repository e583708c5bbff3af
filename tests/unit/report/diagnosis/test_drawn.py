"""A diagnosis as it is drawn."""

from __future__ import annotations

import analytic_readings
import numpy as np
import pytest

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.search.told_apart import separation
from lightfield.report.diagnosis.drawn import view_of
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
