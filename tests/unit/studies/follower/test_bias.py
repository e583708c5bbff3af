"""Bias and spread of estimates from a wrong model, against estimates from many noisy readings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from lightfield.errors import SceneError, UsageError
from lightfield.scene import Scene
from lightfield.studies.follower.array_light import ArrayModel, FormulaLight, Space
from lightfield.studies.follower.array_noise import SensorNoise
from lightfield.studies.follower.belief import belief
from lightfield.studies.follower.bias import bias_study
from lightfield.studies.follower.calibration import (
    CALIBRATIONS,
    CLEAR,
    EXACT,
    FITTED,
    RELATIVE,
    believed,
    slope_per_m,
)
from lightfield.studies.follower.elements import grid, on_sphere
from lightfield.studies.follower.frames import POSE
from lightfield.studies.follower.information import UNKNOWN, bound
from lightfield.studies.follower.pose_search import find_minima

SCENE = Scene.from_dict(
    {
        "lamp": {"hwhm_deg": 3.81},
        "water": {"absorption_per_m": 0.05, "scattering_per_m": 0.05},
        "array": {"size_m": 0.26, "radius_m": 0.19},
    }
)
WIDER = SCENE.with_values({"lamp.hwhm_deg": 4.2, "water.absorption_per_m": 0.1})
HEMISPHERE = on_sphere(grid((5, 5), 0.26), 0.19)
NOISE, FIVE = SensorNoise(brightest=0.01), POSE[:5]
POSE_0 = np.array([0.25, 0.1, 6.0, 0.05, 0.0, 0.0])
SPACE = Space(0.4, 4.5, 8.5)


@pytest.mark.parametrize("prior", [0.0, np.inf])
def test_bias_and_spread_are_those_of_many_estimates(prior: float) -> None:
    """The wrong formula is fitted to 400 noisy readings of another lamp in other water."""
    truth, formula = (ArrayModel(FormulaLight(s), HEMISPHERE) for s in (WIDER, SCENE))
    found = belief(truth, formula, POSE_0, FIVE, NOISE, prior)
    readings, rng = truth.readings(POSE_0[None])[0], np.random.default_rng(7)
    variance = NOISE.variance(readings)
    draws = find_minima(
        formula,
        readings + np.sqrt(variance) * rng.standard_normal((400, 25)),
        variance,
        FIVE,
        np.tile(found.believed, (400, 1)),
        nuisances={"gain": prior} if prior else {},
    ).poses[:, :5]
    sigma = np.sqrt(np.diag(found.covariance))
    # Means to sigma / sqrt(400), deviations to 1 / sqrt(800) of themselves, at 4 of these; the cost is not
    # quite a
    # parabola over its own noise where the gain is free.
    np.testing.assert_array_less(
        np.abs(draws.mean(axis=0) - found.believed[:5]), (0.2 + 0.1 * (prior > 0)) * sigma
    )
    np.testing.assert_allclose(draws.std(axis=0), sigma, rtol=4 / np.sqrt(800) + 0.05 * (prior > 0))
    assert np.abs(found.bias[:3]).max() > 5 * sigma[0]  # there is something to see


@pytest.mark.parametrize("prior", [0.0, 0.05])
def test_a_flat_array_on_the_axis_believes_itself_turned(prior: float) -> None:
    """By symmetry the search stays straight, on a saddle: the least of many from elsewhere lies lower."""
    flat, straight = grid((5, 5), 0.6), np.array([0.0, 0.0, 6.5, 0.0, 0.0, 0.0])
    wider = SCENE.with_values({"lamp.hwhm_deg": 4.2})
    truth, formula = (ArrayModel(FormulaLight(s), flat) for s in (wider, SCENE))
    found = belief(truth, formula, straight, FIVE, NOISE, prior)
    readings = truth.readings(straight[None])[0]
    starts = straight + np.random.default_rng(1).uniform(-0.3, 0.3, (40, 6)) * [1, 1, 2, 1, 1, 0]
    sought = {"gain": prior} if prior else {}
    variance = NOISE.variance(readings)
    every = find_minima(formula, readings, variance, FIVE, starts, nuisances=sought)
    stuck = find_minima(formula, readings, variance, FIVE, straight[None], nuisances=sought)
    free = 25 - 5 - (prior > 0)
    assert found.misfit * free == pytest.approx(every.chi2.min(), rel=1e-4)
    assert stuck.chi2[0] > every.chi2.min() + 0.05 and stuck.poses[0, 3:5] == pytest.approx(0, abs=1e-6)
    # Of all sides, which are one, the one about the upright axis.
    assert np.degrees(found.bias[3:5]) == pytest.approx([16.3 if prior == 0 else 5.5, 0.0], abs=0.5)


def test_one_distance_tells_no_attenuation() -> None:
    with pytest.raises(UsageError, match=r"found '6 m alone'.*second distance"):
        bias_study(SCENE, Space(0.2, 6.0, 6.0), photons=0)


def test_four_readings_do_not_tell_five_coordinates() -> None:
    """By their sum the distance, if the gain is known; without it nothing. As the bound has it."""
    model, pose = ArrayModel(FormulaLight(SCENE), grid((2, 2), 0.2)), np.array([0, 0, 6.0, 0, 0, 0])
    for prior, told in ((0.0, [False, False, True, False, False]), (np.inf, [False] * 5)):
        nuisances = {"gain": UNKNOWN} if prior else {}
        known = bound(model, pose, FIVE, NOISE, nuisances).covariance
        spread = belief(model, model, pose, FIVE, NOISE, prior).covariance
        assert np.isfinite(np.diag(known)).tolist() == np.isfinite(np.diag(spread)).tolist() == told
        assert spread[2, 2] == pytest.approx(known[2, 2], rel=1e-3)


def test_the_right_model_has_no_bias_and_the_spread_of_the_bound() -> None:
    model = ArrayModel(FormulaLight(SCENE), HEMISPHERE)
    for prior in (0.0, np.inf):
        found = belief(model, model, POSE_0, FIVE, NOISE, prior)
        np.testing.assert_allclose(found.bias, 0, atol=1e-9)
        expected = bound(model, POSE_0, FIVE, NOISE, {"gain": UNKNOWN} if prior else {})
        # The curvature is a difference of differences: step 1e-3 m over light that changes within some 0.05
        # m.
        sigma = np.sqrt(np.diag(found.covariance))
        np.testing.assert_allclose(sigma, list(expected.sigma.values()), rtol=2e-3)


def test_calibrations_of_a_formula_that_is_right_are_right() -> None:
    """Where nothing scatters K is c, and every gain one; the wrong water is off by what its K says."""
    light = FormulaLight(SCENE)
    assert slope_per_m(light, 4.5, 8.5) == pytest.approx(0.1, rel=1e-12)
    for calibration in (EXACT, FITTED, RELATIVE):
        model, prior = believed(light, HEMISPHERE, calibration, SPACE)
        assert model.gain == pytest.approx(1.0, rel=1e-12)
        assert np.isinf(prior) == (calibration == RELATIVE)


@pytest.mark.parametrize(
    "lamp", [{"offset_x_m": 0.3}, {"tilt_x_deg": 4.0, "tilt_y_deg": -3.0}, {"apparent_distance_m": 0.5}]
)
def test_a_lamp_that_is_aside_tilted_or_far_behind_its_window_hides_no_attenuation(
    lamp: dict[str, float],
) -> None:
    """Where nothing scatters the formula is right: K on the beam's axis is c, and no calibration is biased.

    Beside the beam its slope looked like attenuation: 0.3 m aside of it K was -0.03 per m.
    """
    tilted = SCENE.with_values({f"lamp.{name}": value for name, value in lamp.items()})
    light = FormulaLight(tilted)
    assert slope_per_m(light, 4.5, 8.5) == pytest.approx(0.1, rel=1e-9)
    found = bias_study(tilted, SPACE, (0.02, 0.1), photons=0).axis
    right = found.sel(calibration=[EXACT, FITTED, RELATIVE]).bias_z
    np.testing.assert_allclose(right.where(found.sigma_z < 100).fillna(0.0), 0.0, atol=1e-5)


def test_a_study_has_every_water_calibration_and_place() -> None:
    """The formula is its own truth here: in the water of its calibration nothing is wrong."""
    found = bias_study(SCENE, SPACE, (0.02, 0.1), photons=0)
    assert found.axis.bias_z.shape == (2, len(CALIBRATIONS), 3)
    assert found.plane.bias_x.shape == (len(CALIBRATIONS), 5, 5)
    assert np.abs(found.axis.bias_z.isel(scattering_per_m=0)).max() < 1e-6
    assert "K and gain from clear water" in found.as_text()
    assert len(found.as_data()["axis"]["bias_z"]) == 2


@pytest.mark.parametrize("z", [4.5, 6.5, 8.5])
def test_a_calibration_that_is_kept_errs_by_what_the_water_swallows(z: float) -> None:
    """On the axis it believes z + d with (z + d)^2 exp(0.07 (z + d)) = z^2 exp(0.15 z), at b = 0.1."""
    one, truth = grid((1, 1), 0.1), FormulaLight(SCENE.with_values({"water.scattering_per_m": 0.1}))
    formula, prior = believed(truth, one, CLEAR, SPACE)
    found = belief(ArrayModel(truth, one), formula, np.array([0, 0, z, 0, 0, 0.0]), ("z",), NOISE, prior)
    expected = brentq(lambda d: 2 * np.log(1 + d / z) + 0.07 * d - 0.08 * z, 0, 20)
    assert found.bias[2] == pytest.approx(expected, rel=1e-4)


def test_water_that_is_more_than_a_number_is_refused() -> None:
    pure = SCENE.with_values({"water.base": "pure", "water.absorption_per_m": 0.0})
    settling = SCENE.with_values({"water.settling_per_m": 0.1})
    for water, named in ((pure, r"water\.base"), (settling, r"water\.settling_per_m")):
        with pytest.raises(SceneError, match=named):
            bias_study(water, SPACE, photons=0)


def test_a_space_that_no_light_reaches_is_refused_before_any_trace(monkeypatch) -> None:
    monkeypatch.setattr("lightfield.studies.follower.bias.light_of", None)
    with pytest.raises(
        UsageError, match=r"no light is left so far.*found '9000 m'.*nearer detector\.planes_m"
    ):
        bias_study(SCENE, Space(near_m=3.0, far_m=9000.0, half_width_m=0.4))


def test_a_place_that_may_be_anywhere_is_no_number_of_millimetres() -> None:
    study = bias_study(SCENE, SPACE, (0.0,), photons=0)
    assert "not determined" not in study.as_text()
    lost = replace(study, axis=study.axis.assign(sigma_z=1e9 * study.axis.sigma_z))
    assert lost.as_text().count("not determined") == len(CALIBRATIONS) * lost.axis.z_m.size
