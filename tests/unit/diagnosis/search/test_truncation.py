"""Errors beside a curve that is too short, against lamps in closed form that are no curve of a fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from analytic_readings import scene as believed
from beams import flood

from lightfield.diagnosis.adequacy.score_tests import AdequacyTest
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.problem.setup import problem_of
from lightfield.diagnosis.search.set_of_effects import ScoredSet
from lightfield.diagnosis.search.truncation import truncation_errors
from lightfield.experiments.layouts import scan
from lightfield.fitting import effects
from lightfield.fitting.forward import SceneForward

#: True half width, absorption, background and noise; the scene believes 4 deg, 0.12 and none.
HWHM, PER_M, GROUND, NOISE = 4.6, 0.105, 0.01, 0.04
TRUTH = {"water.absorption_per_m": PER_M, "detector.background": GROUND}


def gaussian(q: np.ndarray) -> np.ndarray:
    return np.exp(-np.log(2) * q**2)


def made(lamp: Callable[[np.ndarray], np.ndarray], seed: int) -> tuple[Problem, Callable]:
    """Readings on a line in five planes, and how to whiten them."""
    rng = np.random.default_rng(seed)
    table = scan(believed(), "line", "random", rng)
    r = np.sqrt(table.x_m**2 + table.z_m**2)
    theta = np.degrees(np.arctan2(np.abs(table.x_m), table.z_m))
    light = lamp(theta / HWHM) * np.exp(-PER_M * r) * table.z_m / r**3
    value = light / light.max() + GROUND
    sigma = np.hypot(NOISE * value, 0.16 * NOISE)
    value = value + sigma * rng.standard_normal(len(r))
    table = replace(table, value=value, stderr=sigma)
    chosen = [effects.get("beam_profile"), effects.get("background")]
    problem, _ = problem_of(SceneForward(believed(), table), table, chosen, None)
    return problem.with_curves(), lambda columns: (columns.T / sigma).T


def errors(lamp: Callable[[np.ndarray], np.ndarray], seed: int) -> dict[str, tuple[float, float, float]]:
    """Departure from the truth, standard error beside two functions, and with what they leave out."""
    problem, whiten = made(lamp, seed)
    short, longer = (
        tuple(c for c in problem.candidates if c.form.name in ("constant", form))
        for form in ("2 functions", "4 functions")
    )
    base = problem.fit((), whiten, [problem.model().start])
    fit = problem.fit(short, whiten, [problem.default_start(base.u, short, 0.0)])
    test = AdequacyTest(problem, whiten, {}, lambda: np.zeros((0, 0)), True)
    found = truncation_errors(ScoredSet(short, fit, 0.0, None, test), problem, longer, 1.0)
    assert not set(found) & {p.path for c in short if c.effect.is_free_form for p in c.parameters}
    return {
        path: (abs(fit.values[path] - truth), fit.stderr()[path], found[path])
        for path, truth in TRUTH.items()
    }


@pytest.mark.parametrize("seed", range(3))
def test_what_a_short_curve_takes_from_others_is_in_their_errors(seed: int) -> None:
    """Two functions are no flat top: absorption and background are off by many of their errors."""
    for off, alone, known in errors(flood, seed).values():
        assert off > 6 * alone
        assert off < 2 * known


@pytest.mark.parametrize("seed", range(3))
def test_where_a_curve_leaves_nothing_out_errors_hardly_grow(seed: int) -> None:
    """Of a Gaussian lamp they are those of the longer curve, whose functions cost precision, and a shift."""
    for off, alone, known in errors(gaussian, seed).values():
        assert alone <= known < 2.5 * alone
        assert off < 3 * known
