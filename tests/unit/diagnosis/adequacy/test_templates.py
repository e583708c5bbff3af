"""What an absent effect would add to the readings: a derivative in its own size, and nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lightfield.diagnosis import plan
from lightfield.diagnosis.adequacy.score_tests import AdequacyTest
from lightfield.diagnosis.adequacy.templates import bank, smooth_unknowns
from lightfield.diagnosis.problem.layout import layout_of
from lightfield.diagnosis.problem.setup import problem_of
from lightfield.experiments.layouts import scan
from lightfield.fitting import effects
from lightfield.fitting.forward import SceneForward
from lightfield.readings import Readings
from lightfield.scene import Scene


class Haze:
    """Light scattered once, b / (1 - g) times a smooth halo; no errors."""

    def __init__(self, x_m: np.ndarray) -> None:
        self.halo = 1e-3 / (1 + x_m**2)

    def light(self, scene: Scene, wavelengths_nm: Sequence[float | None]) -> np.ndarray:
        strength = scene.water.scattering_per_m / (1 - float(scene.get("water.phase.g")))
        return np.array([strength * self.halo for _ in wavelengths_nm])

    def errors(self, scene: Scene, *_: Any) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros((len(self.halo), 0)), np.zeros(len(self.halo))

    def with_denser(self, other: Any) -> Haze:
        return self


def haze(scene: Scene, x_m: np.ndarray, *_: Any, **options: float) -> Haze:
    return Haze(np.asarray(x_m))


def test_water_that_scatters_already_is_not_asked_for_another_phase_function() -> None:
    """More of the same particles: d/db is halo / (1 - g) at every g, though g itself would move all light."""
    scene = Scene.from_dict({"water": {"absorption_per_m": 0.1, "scattering_per_m": 0.2}})
    table = scan(scene, "line", "random", np.random.default_rng(0))
    clean = SceneForward(scene, table, haze).predict({})
    readings = replace(table, value=clean, stderr=np.full(len(clean), 1e-4))
    problem, _ = problem_of(SceneForward(scene, readings, haze), readings, [effects.get("scattering")], None)
    fit = problem.fit((), lambda columns: columns, [problem.model().start], max_steps=0)
    templates = bank(problem, fit, lambda columns: columns)
    assert {t.shape for t in templates} >= {(0.924,), (0.8,), (0.97,)}
    gain = np.exp(fit.u[0])
    distance = np.hypot(table.x_m, table.z_m)
    lost = gain * distance * SceneForward(scene, readings).predict({})
    for template in templates:
        expected = gain * Haze(np.asarray(table.x_m)).halo / (1 - template.shape[0]) - lost
        assert template.columns[:, 0] == pytest.approx(expected, abs=0.01 * np.abs(expected).max())


class Lid(Haze):
    """Light that a closed top sends back: none of an open one, which also lets the light of walls out."""

    def light(self, scene: Scene, wavelengths_nm: Sequence[float | None]) -> np.ndarray:
        reflects = scene.tank.surface_reflectance if scene.tank else 0.0
        return np.array([(2 * reflects - 0.5 * (reflects > 0)) * self.halo for _ in wavelengths_nm])


def lid(scene: Scene, x_m: np.ndarray, *_: Any, **options: float) -> Lid:
    return Lid(np.asarray(x_m))


def test_a_surface_is_known_by_what_more_of_it_does_and_not_by_the_step_from_an_open_top() -> None:
    """2 halo per unit of reflectance, at the places that are read and at those that a plan proposes."""
    scene = Scene.from_dict(
        {"water": {"absorption_per_m": 0.1}, "tank": {"width_m": 3.0, "depth_m": 2.4, "length_m": 10.0}}
    )
    table = scan(scene, "line", "random", np.random.default_rng(0))
    clean = SceneForward(scene, table, lid).predict({})
    readings = replace(table, value=clean, stderr=np.full(len(clean), 1e-4))
    forward = SceneForward(scene, readings, lid)
    problem, _ = problem_of(forward, readings, [effects.get("surface_reflection")], None)
    fit = problem.fit((), lambda columns: columns, [problem.model().start], max_steps=0)
    (template,) = bank(problem, fit, lambda columns: columns)
    expected = 2 * np.exp(fit.u[0]) * Haze(np.asarray(table.x_m)).halo
    assert template.columns[:, 0] == pytest.approx(expected, rel=1e-6)
    test = AdequacyTest(problem, lambda columns: columns, {}, lambda: np.zeros((forward.size, 2)), True)
    scores, _ = test.score(fit)
    elsewhere = plan._effects(problem, fit, scores, {"surface_reflection": 0.5}, forward)
    assert elsewhere["surface_reflection"].there[:, 0] == pytest.approx(expected, rel=1e-6)


def test_no_smooth_unknown_meets_a_plane_exactly() -> None:
    """A slip in the one reading of a plane was no outlier beside a level of that plane's own."""
    x = np.r_[np.zeros(6), np.linspace(-0.5, 0.5, 9)]
    z = np.r_[1.0, 1.5, 1.5, 2.0, 2.0, 2.0, np.full(9, 3.0)]
    error, time = np.full(15, 0.01), 10.0 * np.arange(15)
    table = Readings.from_arrays(x_m=x, y_m=0 * x, z_m=z, value=np.ones(15), stderr=error, time_s=time)
    layout, ones = layout_of(table), np.ones(15)
    found = smooth_unknowns(layout, ones, ones, rich=True)["plane"]
    columns = {at: found[:, (found[z == at] != 0).any(axis=0)] for at in np.unique(z)}
    ranks = {at: int(np.linalg.matrix_rank(own)) if own.size else 0 for at, own in columns.items()}
    assert ranks[1.0] == 0 and ranks[1.5] == 1 and 1 <= ranks[2.0] <= 2 and ranks[3.0] == 2


def test_noise_is_not_judged_beside_what_may_begin_at_any_time() -> None:
    """Forty beginnings of a switch follow much of it; among sets of effects they are asked."""
    scene = Scene.from_dict({"water": {"absorption_per_m": 0.1}})
    table = scan(scene, "line", "random", np.random.default_rng(0))
    clean = SceneForward(scene, table).predict({})
    readings = replace(table, value=clean, stderr=np.full(len(clean), 1e-4))
    problem, _ = problem_of(SceneForward(scene, readings), readings, [effects.get("background")], None)
    fit = problem.fit((), lambda columns: columns, [problem.model().start], max_steps=0)
    own = bank(problem, fit, lambda columns: columns)
    assert {t.candidate.form.name for t in own} == {"constant", "drifting"}
    test = AdequacyTest(problem, lambda columns: columns, {}, lambda: np.zeros((len(clean), 2)), True)
    for at_any_time, names in ((False, set()), (True, {"switched", "on for a while"})):
        scores, _ = test.score(fit, at_any_time)
        asked = [score.template.candidate.form.name for score in scores]
        assert set(asked) - {"constant", "drifting"} == names
    assert asked.count("switched") == 10 and asked.count("on for a while") == 30
