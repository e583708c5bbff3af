"""A diagnosis as it is drawn."""

from __future__ import annotations

import analytic_readings
import numpy as np
import pytest

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.search.told_apart import separation
from lightfield.diagnosis.verdict.cautions.caution import Caution, Warns
from lightfield.diagnosis.verdict.parts import Kind, Rung
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.report.diagnosis.drawn import view_of
from lightfield.report.diagnosis.page import _about_error, _lead, _tag
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


@pytest.mark.parametrize(
    ("last", "heading", "said"),
    [
        (0.42, "The error falls", "The error falls from 2.8 % to 0.42 %"),
        (2.81, "The error stays, chi-square falls", "The error stays at 2.8 %, though chi-square falls"),
        (4.0, "The error rises, chi-square falls", "The error rises, though chi-square falls, from 2.8 %"),
    ],
)
def test_the_heading_says_what_the_error_does(last: float, heading: str, said: str) -> None:
    """ "The error falls" stood above a curve from 2.8 to 2.8 %."""
    ladder = [Rung.model_construct(error_percent=e, parameters={}) for e in (2.83, last)]
    verdict = Verdict.model_construct(ladder=ladder, noise_floor_percent=0.4, run=1, readings=105)
    assert _about_error(ladder) == heading and _lead(verdict)[0].startswith(said)
    assert _about_error(ladder[:1]) == "The error and the noise floor"


@pytest.mark.parametrize(
    ("kind", "warns", "tag"),
    [
        (Kind.IDENTIFIED, Warns.SCATTER_LESS, ("good", "identified")),
        (Kind.IDENTIFIED, Warns.SCATTER_MORE, ("open", "identified, with errors larger than stated")),
        (Kind.UNEXPLAINED, Warns.SCATTER_MORE, ("bad", "unexplained")),
    ],
)
def test_the_badge_is_not_green_beside_errors_that_were_too_small(
    kind: Kind, warns: Warns, tag: tuple[str, str]
) -> None:
    caution = Caution(warns=warns, values={"times": 2.7})
    assert _tag(Verdict.model_construct(verdict=kind, cautions=[caution])) == tag
