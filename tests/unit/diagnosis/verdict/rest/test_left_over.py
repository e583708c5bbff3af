"""Local unknowns that describe the rest: which is written first, how near, and what the light is without."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from analytic_readings import readings
from local_unknown import fitted_alone

from lightfield.diagnosis.verdict.parts import Estimate, LeftOver, Reason
from lightfield.diagnosis.verdict.rest.left_over import ranked, without_it
from lightfield.diagnosis.verdict.rest.located import parameters_of
from lightfield.diagnosis.verdict.words import rest
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


def test_a_shadow_from_before_all_readings_is_told_by_its_rays() -> None:
    """Dirt on the lamp's window took a quarter of the light 2 degrees aside: its place was told beside
    distances at which it might have stood as well, and so the rays that it shades were a fifth off."""
    table, believed = readings({}, seed=1)
    base, _ = fitted_alone(table, believed, "plume")
    rays = table.x_m / table.z_m
    dimmed = replace(table, value=base.prediction * (1 - 0.25 * np.exp(-(((rays - 0.035) / 0.02) ** 2))))
    _, fit = fitted_alone(dimmed, believed, "plume")
    stderr = np.hypot(0.005 * table.value, 8e-4)
    problem = SimpleNamespace(value=dimmed.value, keep=np.ones(len(stderr)), forward=fit.model.forward)
    own = next(one for one in fit.model.forward.scene.effect if one.name == "plume")
    told = parameters_of(own, problem, fit, lambda columns: (columns.T / stderr).T, 1.0)
    z0, x0, width = (told[name] for name in ("z0", "x0", "width"))
    assert z0.reason is Reason.BEFORE_ALL
    assert x0.stderr is not None and x0.stderr < 0.05 * x0.value
    assert x0.value / z0.value == pytest.approx(0.035, rel=0.01)
    assert width.value / z0.value == pytest.approx(0.02, rel=0.02)


@pytest.mark.parametrize("reason", [None, Reason.BEFORE_ALL])
def test_of_a_shadow_on_all_distances_the_lamps_window_is_suspected(reason: Reason | None) -> None:
    """At which distance to look down into the tank was told, and nothing was there."""
    one = left("plume", z0=Estimate(value=2.0, stderr=None if reason else 0.1, unit="m", reason=reason))
    assert ("the lamp's window" in rest.sentences([one], None)) == (reason is Reason.BEFORE_ALL)
