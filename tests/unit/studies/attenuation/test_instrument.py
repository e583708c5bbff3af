"""Attenuation: what instrument and stage make of the readings, and of their errors."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
from lightfield.scene import Scene
from lightfield.studies.attenuation.apparent import apparent_attenuation
from lightfield.studies.attenuation.ratios import ratios_of


def test_a_place_that_is_off_is_off_in_the_water_too() -> None:
    """1 cm along a beam in water of 1.5 per m changes light by (2 / z + K) 1 cm: K errs as stated over 100
    experiments. Without the water's own part it was off by 1.4 of its errors in the mean, and most fits
    were said not to be straight."""
    off_m, water = 0.01, Scene.from_dict({"water": {"absorption_per_m": 1.5}})
    z, air = (v.ravel() for v in np.meshgrid(np.linspace(1.0, 4.0, 7), [False, True]))
    medium = np.where(air, "air", "water")
    budget = {"plane_gain_percent": 0.0, "position_mm": 1000 * off_m}

    def read(seed: int) -> Readings:
        rng = np.random.default_rng(seed)
        value = direct_field(water, 0 * z, 0 * z, z + off_m * rng.standard_normal(len(z)), medium=medium)
        value = value * (1 + 0.002 * rng.standard_normal(len(z)))
        return Readings.from_arrays(z_m=z, value=value, stderr=0.002 * value, medium=medium, **budget)

    several = [apparent_attenuation(ratios_of(read(seed), water)) for seed in range(100)]
    score = np.array([(one.K_per_m[0] - 1.5) / one.K_stderr[0] for one in several])
    # 100 scores: the standard error of their standard deviation is 0.07.
    assert 0.8 < score.std() < 1.2
    assert np.mean([one.estimate.errors_times > 1 for one in several]) < 0.06


def test_what_the_scene_says_of_the_instrument_is_taken_from_the_readings() -> None:
    """Light of 0.2 and 0.3 per m as an instrument shows it: with gains of its planes, the second order of
    half the wavelength, stray light, a background, and less than in proportion. K is that of the light, and
    errors of readings count by what they are in light."""
    z, truth = np.array([2.0, 3.0, 4.0, 5.0, 6.0]), np.array([0.2, 0.3])
    k, quadratic = 0.2, 0.1
    most = (1 - np.sqrt(1 - 4 * quadratic)) / (2 * quadratic)
    most /= 1 - k * most  # the brightest signal: its reading is 1, which saturation is relative to
    signal = np.exp(-np.outer(z, truth) + 0.1 * (z - 2)[:, None]) / z[:, None] ** 2
    signal[:, 1] += 0.05 * signal[:, 0]
    signal = 0.98 * signal + 0.02 * signal.mean(axis=1, keepdims=True)
    signal = 0.02 + signal * (most - 0.02) / signal.max()
    shown = signal / (1 + k * signal)
    shown = (shown * (1 - quadratic * shown)).ravel()
    detector = {
        "plane_departure": [[2.0, 0.0], [6.0, 0.4]], "second_order": 0.05, "stray_light": 0.02,
        "background": 0.02, "saturation": k, "saturation_quadratic": quadratic,
    }  # fmt: skip
    instrument = Scene.from_dict({"detector": {**detector, "bands_nm": [[390.0, 410.0], [790.0, 810.0]]}})
    readings = Readings.from_arrays(
        z_m=np.repeat(z, 2), wavelength_nm=np.tile([400.0, 800.0], 5), value=shown, stderr=1e-3 * shown,
        time_s=60.0 * np.repeat(z, 2), plane_gain_percent=0.0, position_mm=0.0, common_percent=np.zeros(10),
    )  # fmt: skip
    assert shown.max() == pytest.approx(1.0)
    found = ratios_of(readings, instrument)
    assert apparent_attenuation(found).K_per_m == pytest.approx(truth, rel=1e-6)
    # By how much the signal, less the background, changes with the reading: from the formula, in steps.
    step = 1e-6 * signal
    once = (signal + step) / (1 + k * (signal + step))
    steeper = (once * (1 - quadratic * once) - shown.reshape(-1, 2)) / step
    expected = 1e-3 * shown.reshape(-1, 2) / steeper / (signal - 0.02)
    assert found.stderr[:, 0] == pytest.approx(expected[:, 0], rel=0.02)


def test_a_lamp_that_fades_leaves_errors_what_they_are() -> None:
    """A reading of half the power is as good as its error says: 1 % of it is 1 % of the light."""
    lamp = Scene.from_dict({"lamp": {"drift_per_hour": -0.5}, "water": {"absorption_per_m": 0.2}})
    z = np.array([2.0, 3.0, 4.0])
    value = np.exp(-0.2 * z) / z**2 * np.array([1.0, 0.75, 0.5])
    time = {"time_s": [0.0, 1800.0, 3600.0]}
    found = ratios_of(Readings.from_arrays(z_m=z, value=value, stderr=0.01 * value, **time), lamp)
    assert found.stderr.ravel() == pytest.approx(0.01)
    assert apparent_attenuation(found).K_per_m == pytest.approx(0.2)
