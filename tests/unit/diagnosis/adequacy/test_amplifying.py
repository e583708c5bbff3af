"""Water of a fit that would have to amplify costs what the readings lose with water that does not."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.diagnosis.adequacy.amplifying import cost_of_amplifying
from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.verdict.cautions.caution import Warns
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.least_squares import Fit, least_squares
from lightfield.fitting.parameter import FitParameter, Model
from lightfield.formula.path import least_attenuation_per_m
from lightfield.readings import Readings
from lightfield.scene import Scene, Water

PLANES = np.geomspace(1.0, 9.0, 30)
CENTRE_M = 3.25
SCENE = Scene.from_dict({"lamp": {"hwhm_deg": 5.0}, "water": {"absorption_per_m": 0.11}})


def axis_readings(value: np.ndarray, sigma: np.ndarray) -> Readings:
    zero = np.zeros(len(PLANES))
    return Readings.from_arrays(
        x_m=zero, y_m=zero, z_m=PLANES, value=value, stderr=sigma, time_s=30 * np.arange(30)
    )


@pytest.mark.parametrize("gradient", [-0.0183, -0.0185])
def test_cost_is_that_of_a_fit_with_water_that_attenuates_everywhere(gradient: float) -> None:
    """Of the logarithm of the axial decay, which is linear in all three numbers: of those sets of them that
    leave no attenuation at the far end the best is nearest, and amplifies nowhere."""
    fit, exact = fit_with_gradient(gradient)
    assert 2 < exact < 10
    assert cost_of_amplifying(fit) == pytest.approx(exact, rel=0.01)


@pytest.mark.parametrize("gradient", [-0.022, -0.03])
def test_water_that_readings_insist_on_may_amplify(gradient: float) -> None:
    """A straight line is no real water's: far beyond zero it costs no more than very strong evidence."""
    fit, exact = fit_with_gradient(gradient)
    assert exact > 20
    assert cost_of_amplifying(fit) == 10


def fit_with_gradient(gradient: float) -> tuple[Fit, float]:
    """A fit to a noisy decay, and what chi-square grows by where the attenuation at its far end is zero."""
    rng = np.random.default_rng(2)
    sigma = 0.004
    depth = 0.1 * PLANES + gradient * (PLANES / 2 - CENTRE_M) * PLANES
    log = -depth + sigma * rng.standard_normal(30)
    matrix = np.stack([np.ones(30), -PLANES, -(PLANES / 2 - CENTRE_M) * PLANES], axis=1)

    def missed(columns: np.ndarray) -> float:
        rest = log - columns @ np.linalg.lstsq(columns, log, rcond=None)[0]
        return float(np.sum((rest / sigma) ** 2))

    at_far_end = np.stack([matrix[:, 0], matrix[:, 2] - (9.0 - CENTRE_M) * matrix[:, 1]], axis=1)
    value = np.exp(log) / PLANES**2
    model = Model(
        SceneForward(SCENE, axis_readings(value, sigma * value)),
        (
            FitParameter("gain", -8.0, 8.0, 0.0, 1e-4, coordinate="log"),
            FitParameter("water.absorption_per_m", 0.0, 3.0, 0.1, 1e-4),
            FitParameter("water.gradient_per_m2", -0.1, 0.1, 0.0, 1e-4),
        ),
    )
    fit = least_squares(model, value, lambda r: (r.T / (sigma * value)).T, model.start, np.ones(30))
    return fit, missed(at_far_end) - missed(matrix)


def test_water_that_attenuates_costs_nothing() -> None:
    value = np.exp(-0.1 * PLANES) / PLANES**2
    model = Model(
        SceneForward(SCENE, axis_readings(value, 0.01 * value)),
        (FitParameter("water.gradient_per_m2", -0.1, 0.1, 0.001, 1e-4),),
    )
    fit = least_squares(
        model, value, lambda r: (r.T / (0.01 * value)).T, model.start, np.ones(30), max_steps=0
    )
    assert cost_of_amplifying(fit) == 0


@pytest.mark.parametrize(
    ("fields", "least"),
    [
        ({"gradient_per_m2": 0.02}, 0.1 + 0.02 * (0.0 - 3.25)),
        ({"gradient_per_m2": -0.02}, 0.1 - 0.02 * (8.0 - 3.25)),
        ({"layer_absorption_per_m": 0.5, "layer_centre_m": 4.0}, 0.1),
        ({"absorption_departure": ((2.0, 0.0), (5.0, -0.04), (8.0, 0.1))}, 0.06),
        ({"height_gradient_per_m2": 0.05}, 0.1 - 0.05 * 0.8),
        ({"drift_per_m_per_hour": -0.03}, 0.1 - 0.03 * 2),
        ({"settling_per_m": 0.3, "settling_time_s": 60.0}, 0.1),
        ({"scattering_per_m": 0.2, "gradient_per_m2": -0.02}, 0.3 - 0.02 * 4.75),
    ],
)  # fmt: skip
def test_least_attenuation_on_the_way(fields: dict[str, object], least: float) -> None:
    water = Water(absorption_per_m=0.1, **fields)
    found = least_attenuation_per_m(water, [525.0], [0.3, -0.8], [3.0, 8.0], [0.0, 7200.0])
    assert found == pytest.approx(least, abs=1e-9)


def test_background_and_saturation_are_no_water_that_gives_light_back() -> None:
    """On one axis a gradient that amplifies from 3.6 m on, with saturation, follows them as well."""
    rng = np.random.default_rng(11)
    light = np.exp(-0.09 * PLANES) / PLANES**2
    light = light / light.max() + 0.01
    value = light / (1 + 0.16 * light / light.max())
    sigma = np.hypot(0.005 * value, 0.0005 * value.max())
    value = value + sigma * rng.standard_normal(30)
    verdict = diagnose(axis_readings(value, sigma), SCENE, diffuse=None, advise=False).verdict
    assert "background" in verdict.best_set
    for accepted in verdict.explanations:
        gradient = accepted.parameters.get("water.gradient_per_m2")
        if gradient is not None:
            far = accepted.parameters["water.absorption_per_m"].value + gradient.value * (9.0 - CENTRE_M)
            assert far > 0 or accepted.weight < 0.01


def test_a_gradient_that_goes_below_zero_at_the_far_end_is_a_gradient() -> None:
    """By 0.03 per m at 9.5 m, on fifteen planes of a lamp whose power drifts: not gains of the planes."""
    rng = np.random.default_rng(5)
    z = np.repeat(np.linspace(3.5, 9.5, 15), 15)
    x = np.tile(np.linspace(-0.7, 0.7, 15), 15)
    order = rng.permutation(len(z))
    x, z = x[order], z[order]
    time_s = 30.0 * np.arange(len(z))
    angle = np.degrees(np.arctan2(np.abs(x), z))
    path = np.hypot(x, z)
    attenuation = 0.08 - 0.018 * (z / 2 - CENTRE_M)
    light = 2.0 ** -((angle / 5) ** 2) * np.exp(-attenuation * path) / path**2 * (z / path) ** 4
    light *= 1 - 0.05 * time_s / 3600
    sigma = np.hypot(0.008 * light, 0.001 * light.max())
    value = light + sigma * rng.standard_normal(len(z))
    readings = Readings.from_arrays(x_m=x, y_m=0 * x, z_m=z, value=value, stderr=sigma, time_s=time_s)
    verdict = diagnose(readings, SCENE, diffuse=None, advise=False).verdict
    assert "water_gradient" in verdict.best_set
    assert "plane_gain" not in verdict.best_set
    (told,) = [c for c in verdict.cautions if c.warns is Warns.AMPLIFIES]
    assert told.values["least_per_m"] == pytest.approx(0.08 - 0.018 * (9.5 - CENTRE_M), abs=0.005)
    assert "give light back" in told.sentence
