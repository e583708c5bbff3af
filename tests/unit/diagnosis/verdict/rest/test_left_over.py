"""Local unknowns that describe the rest: which is written first, how near, and what the light is without."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from analytic_readings import readings
from local_unknown import fitted_alone

from lightfield.diagnosis.verdict.parts import Estimate, LeftOver
from lightfield.diagnosis.verdict.rest.left_over import ranked, without_it
from lightfield.fitting.effects.local import local_unknowns


def left(name: str, **parameters: Estimate) -> LeftOver:
    """A record of which the rest does not matter."""
    return LeftOver(
        name=name, formula="1", stage="path", coordinate="x", beside=[], parameters=parameters,
        removed_percent=50.0, error_percent=1.0, adequate=True, at=[0.0], factor=[1.0], stderr=[0.0],
    )  # fmt: skip


def test_what_describes_the_rest_best_is_written_first() -> None:
    """The others keep their order behind."""
    unknowns = local_unknowns(readings({}, seed=1)[0])
    names = [one.name for one in unknowns]
    first = ["plume", "dip_in_x"]
    written = [one.name for one in ranked(unknowns, [left(name) for name in first])]
    assert written == first + [name for name in names if name not in first]


@pytest.mark.parametrize(
    ("stderr", "off"),
    [
        pytest.param(0.01, 0.05 * 2.0, id="known well: a twentieth of it"),
        pytest.param(0.05, 5 * 0.05, id="known less well: five errors"),
        pytest.param(None, 0.05 * 2.0, id="no error"),
    ],
)
def test_a_ripple_is_sought_near_the_period_that_was_found(stderr: float | None, off: float) -> None:
    unknowns = local_unknowns(readings({}, seed=1)[0])
    stated = next(one for one in unknowns if one.name == "ripple_over_angle").parameters["period"].range
    assert stated[0] < 2.0 - off and 2.0 + off < stated[1]
    found = Estimate(value=2.0, stderr=stderr, unit="deg")
    first = ranked(unknowns, [left("ripple_over_angle", period=found)])[0]
    assert first.parameters["period"].range == pytest.approx((2.0 - off, 2.0 + off))


def test_a_period_at_the_end_of_its_range_is_sought_within_it() -> None:
    unknowns = local_unknowns(readings({}, seed=1)[0])
    low, high = next(one for one in unknowns if one.name == "ripple_over_angle").parameters["period"].range
    found = Estimate(value=high, stderr=high, unit="deg")
    assert ranked(unknowns, [left("ripple_over_angle", period=found)])[0].parameters["period"].range == (
        pytest.approx((low, high))
    )


def test_without_a_dip_the_light_is_that_before_it() -> None:
    """A tenth of the light is taken at x = 0.1 m by a formula written here; without it all of it is there."""
    table, believed = readings({}, seed=1)
    factor = 1 - 0.1 * np.exp(-(((table.x_m - 0.1) / 0.08) ** 2))
    base, _ = fitted_alone(table, believed, "dip_in_x")
    dimmed = replace(table, value=base.prediction * factor)
    _, fit = fitted_alone(dimmed, believed, "dip_in_x")
    assert fit.prediction == pytest.approx(dimmed.value, rel=1e-6)
    assert without_it(fit, "dip_in_x") == pytest.approx(base.prediction, rel=1e-6)
