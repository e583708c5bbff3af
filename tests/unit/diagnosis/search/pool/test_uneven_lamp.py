"""Lamps that are wider on one side, by formulas of their own: no tilt, no turned receiver."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from lightfield.diagnosis.certainty import Certainty
from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.problem.noise import Budget, Noise
from lightfield.diagnosis.problem.setup import problem_of
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.pool.evidence import evidence
from lightfield.diagnosis.search.pool.fitted_sets import Ground, Pool
from lightfield.diagnosis.search.pool.quick import Begin
from lightfield.diagnosis.search.pool.uneven_lamp import (
    may_be_detail,
    of_an_uneven_lamp,
    sigma_beside_any_lamp,
)
from lightfield.diagnosis.search.preparation import whitened_test
from lightfield.diagnosis.search.set_of_effects import FittedSet
from lightfield.diagnosis.verdict.cautions.caution import Warns
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.fitting.effects import registry
from lightfield.fitting.forward import SceneForward
from lightfield.readings import Readings
from lightfield.scene import Scene

#: Effects of the lamp's pose and of the receiver, none of which is in these readings.
OTHERS = {"beam_tilt", "detector_tilt", "acceptance", "cosine_error", "beam_ellipticity"}
SCENE = {"lamp": {"hwhm_deg": 10.0}, "water": {"absorption_per_m": 0.12}}


def verdict_on(seed: int, wider: float = 0.0, brighter: float = 0.0, tail: float = 0.0) -> Verdict:
    """A lamp of 10 degrees, wider or brighter towards +x, its tails those of a power law or a Gaussian's."""
    rng = np.random.default_rng(seed)
    x, z = (v.ravel() for v in np.meshgrid(np.linspace(-1.2, 1.2, 17), [2, 3, 4, 5, 6.5], indexing="ij"))
    order = rng.permutation(len(x))
    x, z = x[order], z[order]
    far, across = np.hypot(x, z), np.degrees(np.arctan2(np.abs(x), z)) / 10
    off = across / (1 + wider * np.sign(x))
    beam = (1 + (np.sqrt(2) - 1) * off**2) ** -2 if tail else np.exp(-np.log(2) * off**2)
    value = beam * (1 + brighter * np.tanh(0.8 * across) * np.sign(x)) * np.exp(-0.12 * far) * z / far**3
    value = value / value.max()
    sigma = 0.005 * value + 2e-4
    table = Readings.from_arrays(
        x_m=x, y_m=0 * x, z_m=z, value=value + sigma * rng.normal(size=len(x)), stderr=sigma, scale="relative"
    )
    return diagnose(table, Scene.from_dict(SCENE), diffuse=None, advise=False).verdict


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3))])
def test_a_lopsided_beam_is_named_with_its_size(seed: int) -> None:
    verdict = verdict_on(seed, wider=0.06)
    assert verdict.certain == verdict.best_set == ["beam_asymmetry"]
    size = verdict.ladder[-1].parameters["lamp.asymmetry_x"]
    assert abs(size.value - 0.06) < 3.5 * size.stderr < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_lamp_that_is_uneven_otherwise_is_no_certain_tilt(seed: int) -> None:
    """Tilt, turned and narrow receiver together follow it: functions of the direction, as the lamp is."""
    verdict = verdict_on(seed, brighter=0.15, tail=1.0)
    named = OTHERS & set(verdict.best_set)
    assert named and not named & set(verdict.certain)
    assert all(one.other_lamp for one in verdict.found if one.effect in named)
    uneven = [c for c in verdict.cautions if c.warns is Warns.UNEVEN_LAMP]
    assert [set(c.about.split(", ")) & OTHERS for c in uneven if c.about] == [named]
    assert "turn the lamp by 90 degrees" in uneven[0].sentence


def test_which_effects_may_be_one_lamp() -> None:
    """Two that act by direction beside a beam with a shape of its own, one beside a lamp's curve."""

    def alike(*names: str) -> list[str]:
        return [
            c.name for c in of_an_uneven_lamp(SimpleNamespace(name=n, effect=registry.get(n)) for n in names)
        ]

    assert alike("beam_profile", "beam_tilt", "background", "detector_tilt") == ["beam_tilt", "detector_tilt"]
    assert alike("beam_tilt", "beam_asymmetry") == ["beam_tilt", "beam_asymmetry"]
    assert alike("beam_skirt", "beam_ellipticity", "acceptance") == ["beam_ellipticity", "acceptance"]
    assert alike("beam_asymmetry", "beam_offset", "scattering") == ["beam_asymmetry"]
    assert alike("beam_tilt", "beam_ellipticity") == ["beam_tilt", "beam_ellipticity"]
    assert alike("beam_profile", "beam_tilt", "beam_offset", "lamp_size") == ["beam_tilt"]
    # A Gaussian lamp is even, an oval one has a curve along its radius; an offset is no direction.
    assert alike("beam_tilt", "detector_tilt") == alike("beam_asymmetry", "background") == []
    assert alike("beam_profile", "beam_ellipticity") == alike("beam_skirt", "beam_tilt") == []
    assert alike("beam_profile", "beam_offset", "lamp_size") == []


def pool_beside_a_lamp(**hidden: float) -> tuple[Pool, FittedSet]:
    """A lamp of 10 degrees read on five lines, and fitted with the finest of its curves, an offset, a
    background and a drift."""
    rng = np.random.default_rng(0)
    x, z = (v.ravel() for v in np.meshgrid(np.linspace(-1.2, 1.2, 25), [2, 3, 4, 5, 6.5], indexing="ij"))
    order = rng.permutation(len(x))
    x, z, time_s = x[order], z[order], 20.0 * np.arange(len(x))
    off = x - hidden.get("lamp.offset_x_m", 0.0)
    far, across = np.hypot(off, z), np.degrees(np.arctan2(np.abs(off), z)) / 10
    value = 2.0 ** -(across**2) * np.exp(-0.12 * far) * z / far**3
    value = value / value.max() * (1 + hidden.get("lamp.drift_per_hour", 0.0) * time_s / 3600)
    value = value + hidden.get("detector.background", 0.0)
    sigma = np.hypot(0.005 * value, 3e-4)
    table = Readings.from_arrays(
        x_m=x, y_m=0 * x, z_m=z, value=value + sigma * rng.normal(size=len(x)), stderr=sigma, time_s=time_s
    )
    names = ("beam_profile", "beam_offset", "background", "lamp_drift")
    scene = Scene.from_dict(SCENE)
    problem, _ = problem_of(SceneForward(scene, table), table, [registry.get(n) for n in names], None)
    problem = problem.with_curves()
    noise = Noise(problem.layout, sigma, table.value, Budget(0.0, 0.0, 0.0), np.zeros(len(x)))
    whiten = Whitener(noise, 0.0, 1.0, 0.0)
    pool = Pool(Ground(whitened_test(problem, whiten, np.random.default_rng(0)), 1.0, 100.0))
    finest = max((c for c in problem.candidates if c.name == names[0]), key=lambda c: len(c.amplitudes))
    others = [next(c for c in problem.candidates if c.name == name) for name in names[1:]]
    return pool, pool.finished(pool.fit((finest, *others), [Begin({})]))


def test_beside_a_curve_as_fine_as_they_go_what_a_lamp_may_do_is_told() -> None:
    """Functions by the dozen: what they leave out of an edge or a ring others fill; but no round lamp is
    moved aside, or changes while it is read at random."""
    hidden = {"lamp.offset_x_m": 0.03, "detector.background": 4e-4, "lamp.drift_per_hour": -0.1}
    pool, node = pool_beside_a_lamp(**hidden)
    others = [c for c in node.explanation if c.name != "beam_profile"]
    found = {c.name: sigma_beside_any_lamp(pool, node, c) for c in others}
    # The offset by differences of readings right and left: 0.03 m d ln(light) / dx over the errors.
    assert found["beam_offset"] > 50 and found["lamp_drift"] > 10
    assert [c.name for c in node.explanation if may_be_detail(pool, node, c)] == ["background"]
    coarse = [c for c in pool.problem.candidates if c.name == "beam_profile" and not c.form.refines][-1]
    less = pool.fit((coarse, *others), [Begin({})])
    assert not any(may_be_detail(pool, less, c) for c in less.explanation)


def test_where_more_is_left_than_errors_leave_a_lamp_may_do_the_rest() -> None:
    """Of kinked lamps a curve leaves twice the errors' variance, and scattering was the simplest."""
    pool, node = pool_beside_a_lamp(**{"lamp.offset_x_m": 0.03, "detector.background": 4e-4})

    def levels() -> dict[str, Certainty]:
        return {one.candidate.name: one.level for one in evidence(pool, node, adequate=True)}

    assert (levels()["background"], levels()["beam_offset"]) == (Certainty.SIMPLEST, Certainty.CERTAIN)
    pool.ground.test.errors_stated, pool.ground.test.scale = True, 2.0
    assert (levels()["background"], levels()["beam_offset"]) == (Certainty.ONE_OF, Certainty.CERTAIN)


def test_what_is_not_there_does_not_show_beside_any_lamp() -> None:
    """Noise alone: squares of what shows are those of one or two standard normal numbers."""
    pool, node = pool_beside_a_lamp()
    others = [c for c in node.explanation if c.name != "beam_profile"]
    shown = [sigma_beside_any_lamp(pool, node, c) for c in others]
    assert 0 < max(shown) < 4


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 7])
def test_what_a_lamp_with_an_edge_leaves_over_is_no_certain_background(seed: int) -> None:
    """A trapezoid over the angle, of which smooth curves leave a rest; an offset and a drift besides. Not all
    is explained, or all is: the curve's advice is given."""
    rng = np.random.default_rng(seed)
    x, z = (v.ravel() for v in np.meshgrid(np.linspace(-1, 1, 31), [3, 4.5, 6, 7.5, 9], indexing="ij"))
    order = rng.permutation(len(x))
    x, z, hour = x[order], z[order], np.arange(len(x)) / 120
    far, across = np.hypot(x - 0.03, z), np.degrees(np.arctan2(np.abs(x - 0.03), z)) / 8
    beam = np.clip((1.35 - across) / 0.7, 0, 1) + 0.004 * np.exp(-((across / 4) ** 2))
    value = beam * np.exp(-0.08 * far) * z / far**3 * (1 + 0.05 * hour)
    value = value / value.max()
    sigma = np.hypot(0.007 * value, 5e-4)
    table = Readings.from_arrays(
        x_m=x, y_m=0 * x, z_m=z, value=value + sigma * rng.normal(size=len(x)), stderr=sigma,
        time_s=3600 * hour, scale="relative", position_mm=0.0,
    )  # fmt: skip
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 9.0}, "water": {"absorption_per_m": 0.065}})
    verdict = diagnose(table, scene, diffuse=None, advise=False).verdict
    assert "background" in verdict.best_set and "background" not in verdict.certain
    (finest,) = (c for c in verdict.cautions if c.warns is Warns.FINEST_CURVE)
    assert "state its table" in finest.sentence
