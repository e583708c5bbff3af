"""Fits that no slope leads to: a lamp's curve in place of its forms, what shows only beside others."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from toy_pool import more_waves, pool_of
from toy_problem import Toy, candidate, curve, layout

from lightfield.diagnosis.problem.noise import Budget, Noise
from lightfield.diagnosis.problem.setup import problem_of
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.pool import looks
from lightfield.diagnosis.search.pool.curve_of_forms import try_curves
from lightfield.diagnosis.search.pool.equivalences import TABLE, try_beside, try_declared
from lightfield.diagnosis.search.pool.evidence import evidence
from lightfield.diagnosis.search.pool.fitted_sets import Ground, Pool
from lightfield.diagnosis.search.pool.quick import Begin
from lightfield.diagnosis.search.preparation import whitened_test
from lightfield.diagnosis.search.set_of_effects import FittedSet
from lightfield.fitting import effects
from lightfield.fitting.forward import SceneForward
from lightfield.readings import Readings
from lightfield.scene import Scene
from lightfield.scene.water.constituents import (
    chlorophyll_scattering_per_m,
    scattering_shape,
    sediment_scattering_per_m,
)

SCENE = Scene.from_dict(
    {
        "lamp": {"hwhm_deg": 9.0},
        "water": {"absorption_per_m": 0.1},
        "detector": {"planes_m": [1.5, 2.5, 3.5, 4.5]},
    }
)


def soft_flood() -> Readings:
    """A lamp with an even middle and a soft edge at 8 degrees, on a faint skirt; formulas of their own."""
    rng = np.random.default_rng(4)
    places = [(x, z) for z in (1.5, 2.5, 3.5, 4.5) for x in np.linspace(-1, 1, 21)]
    x, z = np.array(places)[rng.permutation(84)].T
    far = np.hypot(x, z)
    angle = np.degrees(np.arctan2(np.abs(x), z))
    beam = 1 / (1 + np.exp((angle - 8) / 1.5)) + 0.02 * np.exp(-((angle / 25) ** 2))
    value = beam * z / far**3 * np.exp(-0.1 * far)
    value = value / value.max()
    sigma = np.hypot(0.005 * value, 1e-4)
    return Readings.from_arrays(
        x_m=x, y_m=0 * x, z_m=z, value=value + sigma * rng.normal(size=84), stderr=sigma, scale="relative"
    )


def test_a_peaked_beam_is_two_gaussians_of_which_an_acceptance_cuts_the_wider() -> None:
    """In a formula of its own, m = 1.85; from typical sizes, where the pair was fitted before, it ends in a
    valley that leaves more than twice as much."""
    x, z = (v.ravel() for v in np.meshgrid(np.linspace(-0.8, 0.8, 21), [2.0, 3.0, 4.0, 5.0, 6.0]))
    far = np.hypot(x, z)
    beam = np.exp(-np.log(2) * (np.degrees(np.arctan2(np.abs(x), z)) / 6) ** 1.85)
    value = beam * z / far**3 * np.exp(-0.1 * far)
    value = value / value.max()
    sigma = np.hypot(0.004 * value, 1e-4)
    readings = Readings.from_arrays(x_m=x, y_m=0 * x, z_m=z, value=value, stderr=sigma, scale="relative")
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 6.0}, "water": {"absorption_per_m": 0.1}})
    problem, _ = problem_of(SceneForward(scene, readings), readings, effects.table().values(), None)
    by = {c.name: c for c in problem.candidates}
    noise = Noise(problem.layout, sigma, value, Budget(0.0, 0.0, 0.0), np.zeros(len(value)))
    pool = Pool(
        Ground(whitened_test(problem, Whitener(noise, 0.0, 1.0, 0.0), np.random.default_rng(0)), 1.0, 90)
    )
    pool.finished(pool.fit((), [Begin({})]))
    peaked = pool.finished(pool.fit((by["beam_shape"],), [Begin({})]))
    pair = (by["beam_skirt"], by["acceptance"])
    before = pool.finished(
        pool.fit(pair, [Begin({"lamp.skirt_fraction": 0.02, "lamp.skirt_hwhm_deg": 15.0})])
    )
    try_declared(pool, peaked, by["beam_shape"])
    after = pool.finished(pool.nodes[before.key])
    assert after.fit.chi2 < 0.5 * before.fit.chi2


def test_a_lamps_curve_is_fitted_from_the_forms_that_stand_for_it() -> None:
    """In one fit, where the beam without them is a Gaussian that misses the readings by hundreds of sigma."""
    readings = soft_flood()
    forward = SceneForward(SCENE, readings)
    problem, _ = problem_of(forward, readings, [*effects.table().values(), *effects.curves().values()], None)
    problem = problem.with_curves()
    by = {(c.name, c.form.name): c for c in problem.candidates}
    shape, skirt = by["beam_shape", "super-Gaussian"], by["beam_skirt", "second Gaussian"]

    def whiten(a: np.ndarray) -> np.ndarray:
        return a / (readings.stderr if a.ndim == 1 else readings.stderr[:, None])

    test = SimpleNamespace(problem=problem, whiten=whiten)
    pool = Pool(Ground(test, 1.0, 80.0))
    plain = pool.finished(pool.fit((), [Begin({})]))
    forms = pool.finished(pool.fit((shape, skirt), [Begin({})]))
    assert plain.fit.chi2 > 10 * forms.fit.chi2
    # A fit that went astray is remembered, and does not stand for the one that begins at the forms.
    astray = next(c for c in problem.candidates if c.key == ("beam_profile", "7 functions"))
    lost = problem.fit((astray,), whiten, [problem.model((astray,)).start], max_steps=0)
    pool.nodes[frozenset({astray.key})] = FittedSet((astray,), replace(lost, chi2=1e6))
    try_curves(pool, forms, [shape.name])
    assert pool.nodes[frozenset({astray.key})].fit.chi2 < forms.fit.chi2
    best = min((n for n in pool.nodes.values() if "beam_profile" in n.names), key=lambda n: n.fit.chi2)
    assert best.fit.chi2 < forms.fit.chi2
    assert best.fit.chi2 < 84 + 4 * np.sqrt(2 * 84)
    assert (
        abs(best.fit.values["water.absorption_per_m"] - 0.1) < 3 * best.fit.stderr()["water.absorption_per_m"]
    )


def test_a_lamps_curve_is_there_before_light_is_scattered_or_reflected() -> None:
    """Where named forms of the beam took its place they filled all sets that such light was tried in."""
    readings = soft_flood()
    forward = SceneForward(SCENE, readings)
    known = [effects.get(name) for name in ("beam_shape", "beam_skirt", "apparent_source")]
    problem, _ = problem_of(forward, readings, [*known, *effects.curves().values()], None)
    problem = problem.with_curves()
    budget = Budget(0.0, 0.0, 0.0)
    noise = Noise(problem.layout, readings.stderr, problem.value, budget, np.zeros(problem.layout.size))
    whiten = Whitener(noise, 0.0, 1.0, 0.0)
    pool = Pool(Ground(whitened_test(problem, whiten, np.random.default_rng(0)), 1.0, 80.0))
    pool.finished(pool.fit((), [Begin({})]))
    looks.forward(pool, pool.best(), 4, 14, looks.direct)
    before = looks.polish(pool, looks.direct)
    assert {"beam_shape", "beam_skirt"} <= before.names
    bent = looks.with_curve_of_lamp(pool)
    assert "beam_profile" in bent.names and pool.cost(bent) < pool.cost(before) - 50


def of_two_names() -> Toy:
    """A curve "beam_profile" that contains "round" and "oval", and cannot follow them to the end."""
    lay = layout()
    columns = more_waves(lay)
    columns |= {"round": np.cos(2 * lay.x_m) * (lay.z_m - 5.5), "oval": np.cos(6 * lay.x_m) * (lay.z_m - 6)}
    terms = {f"beam_profile{k}": np.cos((k + 9) * lay.x_m) * lay.x_m**2 for k in range(2)}
    candidates = [candidate(name) for name in columns] + curve("beam_profile", (2,), ("round", "oval"))
    return Toy.of(candidates, columns | terms, lay)


@pytest.mark.parametrize(
    ("hidden", "level"), [({"round": 40.0}, "certain"), ({"round": 40.0, "oval": 40.0}, "simplest")]
)
def test_two_forms_of_a_beam_are_no_more_than_the_simplest(hidden: dict[str, float], level: str) -> None:
    """One alone is a beam of that form; two are the first terms of a lamp's own."""
    made = of_two_names()
    problem = made.drawn(np.random.default_rng(0), **hidden)
    pool = pool_of(made, problem)
    best = pool.fit([c for c in problem.candidates if c.name in hidden], [Begin({})])
    found = evidence(pool, best, adequate=True)
    assert len(found) == len(hidden)
    for one in found:
        assert (one.level, one.gap > 30) == (level, True)


def test_waves_are_tried_beside_a_surface_and_nowhere_else() -> None:
    """From typical sizes, in place of another effect of the set."""
    lay = layout()
    columns = more_waves(lay)
    names = ["surface_reflection", "waves", "odd"]
    every = {name: columns[key] for name, key in zip(names, ("fan", "late", "odd"), strict=True)}
    made = Toy.of([candidate(name) for name in every], every, lay)
    problem = made.drawn(np.random.default_rng(0), surface_reflection=20.0, odd=20.0)
    by = {c.name: c for c in problem.candidates}
    pool = pool_of(made, problem)
    both = pool.fit((by["surface_reflection"], by["odd"]), [Begin({})])
    try_beside(pool, both, by["surface_reflection"])
    assert not any("waves" in node.names for node in pool.nodes.values())
    try_beside(pool, both, by["odd"])
    assert frozenset({by["surface_reflection"].key, by["waves"].key}) in pool.nodes


@pytest.mark.parametrize(
    ("name", "path", "of"),
    [
        ("sediment", "water.sediment_g_per_m3", sediment_scattering_per_m),
        ("chlorophyll", "water.chlorophyll_mg_per_m3", chlorophyll_scattering_per_m),
    ],
)
def test_matter_that_scatters_is_particles_with_a_slope(name: str, path: str, of: Any) -> None:
    """What is in the water scatters alike then in every colour; without any nothing is tried. No fit of one
    effect more or less led there: sediment and a colour of the beam stood for CDOM, scattering and its slope,
    which cost 5.7 less."""
    (line,) = (line for line in TABLE if line.single == name)
    assert line.together == ("scattering", "scattering_slope")
    (start,) = line.starts({path: 0.3, "water.scattering_per_m": 0.02}, 5.0)
    nm = np.array([420.0, 550.0, 680.0])
    alone = scattering_shape(start["water.scattering_slope"], nm) * (start["water.scattering_per_m"] - 0.02)
    assert alone == pytest.approx(of(0.3, nm), rel=1e-6)
    assert line.starts({path: 0.0}, 5.0) == []


def test_what_helped_an_imitation_is_left_out_beside_what_it_imitates(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A tilt and "odd" stand for an acceptance and a turned detector: these need no "odd" beside them."""
    lay = layout()
    columns = more_waves(lay)
    every = {"acceptance": columns["fan"], "detector_tilt": columns["late"], "odd": columns["odd"]}
    every["beam_tilt"] = every["acceptance"] + every["detector_tilt"] - every["odd"] + 0.3 * columns["braid"]
    made = Toy.of([candidate(name) for name in every], every, lay)
    problem = made.drawn(np.random.default_rng(0), acceptance=30.0, detector_tilt=30.0)
    by = {c.name: c for c in problem.candidates}
    pool = pool_of(made, problem)
    monkeypatch.setattr(type(problem.forward.light.diffuse), "width_deg", 5.0, raising=False)
    imitation = pool.fit((by["beam_tilt"], by["odd"]), [Begin({})])
    try_declared(pool, imitation, by["beam_tilt"])
    assert pool.best().names == {"acceptance", "detector_tilt"}
