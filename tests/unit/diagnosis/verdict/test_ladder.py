"""The rungs stand in an order in which the error falls, where there is one."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from lightfield.diagnosis.diagnose import Diagnosis, diagnose
from lightfield.diagnosis.verdict import ladder
from lightfield.diagnosis.verdict.trust import standard_errors
from lightfield.readings import Readings
from lightfield.scene import Scene

SCENE = Scene.from_dict({"lamp": {"hwhm_deg": 7.0}, "water": {"absorption_per_m": 0.11}})
GRADIENT, WARM_UP, SECONDS = 0.022, -0.12, 500.0


def read() -> Readings:
    """By formulas of their own: a beam of 6 degrees, water more turbid farther away, a lamp that fades
    at first. Beside the warm-up alone the error in per cent would rise: the far readings are the dark ones.
    """
    rng = np.random.default_rng(6)
    places = [
        (z * np.tan(np.radians(1.8 * k)), z) for z in (0.8, 1.0, 1.3, 2.0, 4.0, 9.0) for k in range(-5, 6)
    ]
    x, z = np.array(places)[rng.permutation(len(places))].T
    time_s = 30.0 * np.arange(len(x))
    r = np.hypot(x, z)
    beam = np.exp(-np.log(2) * (np.degrees(np.arctan2(np.abs(x), z)) / 6.0) ** 2)
    depth = 0.09 * r + GRADIENT * (z / 2 - 3.25) * r
    value = beam * z / r**3 * np.exp(-depth) * (1 + WARM_UP * (1 - np.exp(-time_s / SECONDS)))
    value /= value.max()
    sigma = np.hypot(0.005 * value, 0.0005)
    value = value + sigma * rng.standard_normal(len(value))
    zero = np.zeros(len(x))
    return Readings.from_arrays(x_m=x, y_m=zero, z_m=z, value=value, stderr=sigma, time_s=time_s)


@pytest.fixture
def all_that_is_lit_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """The dark readings too, of which the error in per cent rises."""
    monkeypatch.setattr(ladder, "_CLEAR", 0.0)


@pytest.mark.usefixtures("all_that_is_lit_counts")
def test_the_error_falls_from_rung_to_rung() -> None:
    found = diagnose(read(), SCENE, diffuse=None, advise=False)
    verdict = found.verdict
    assert sorted(verdict.best_set) == ["lamp_drift", "water_gradient"]
    errors = [rung.error_percent for rung in verdict.ladder]
    assert all(
        after is not None and before is not None and after < before for before, after in pairwise(errors)
    )
    assert order(found, 1.0) == ["water_gradient", "lamp_drift"]


@pytest.mark.usefixtures("all_that_is_lit_counts")
def test_below_the_noise_no_rise_of_the_error_is_one() -> None:
    """Were the readings a hundred times as uncertain, what lowers chi-square most would come first."""
    found = diagnose(read(), SCENE, diffuse=None, advise=False)
    assert order(found, 100.0) == ["lamp_drift", "water_gradient"]


@pytest.mark.parametrize("stderr", [0.002, np.nan], ids=["stated", "assumed"])
def test_noise_over_next_to_no_light_is_no_error_of_a_model(stderr: float) -> None:
    """A reading of a far plane that is hardly more than its error, in a dark ring of the lamp: over what the
    model has there it was 1000 %. Where none is clear of its error all count."""
    value = np.array([1.0, 0.5, 0.04, 0.02, 0.003])
    layout = SimpleNamespace(plane_and_channel=np.array([0, 0, 0, 1, 1]), channel=np.zeros(5, int))

    def counted(error: float) -> list[bool]:
        forward = SimpleNamespace(readings=SimpleNamespace(stderr=np.full(5, error)))
        problem = SimpleNamespace(layout=layout, value=value, keep=np.ones(5), forward=forward)
        return [bool(one) for one in ladder.bright(cast(Any, problem))]

    assert counted(stderr) == [True, True, False, True, False]
    assert counted(1.0) == [True, True, False, True, True]


def order(found: Diagnosis, factor: float) -> list[str]:
    """Of the rungs, were the errors of the readings so many times as large."""
    prepared, finding = found.basis.prepared, found.basis.finding
    sigma, best = factor * standard_errors(prepared, finding), finding.best
    assert best is not None
    fits = finding.whiten, finding.level.base, best.fit, sigma
    return [c.name for c in ladder._order(prepared.problem, best.explanation, *fits)]
