"""A search is not held in a valley in which all of its sets lie."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.diagnosis.diagnose import diagnose
from lightfield.readings import Readings
from lightfield.scene import Scene

BEHIND_M, ASIDE_M, DARK, DARK_PER_HOUR, POWER_PER_HOUR = 0.12, 0.02, 0.01, 0.5, 0.05
SCENE = {
    "lamp": {"hwhm_deg": 12.0},
    "water": {"absorption_per_m": 0.08},
    "detector": {"planes_m": [1.5, 2.5, 3.5, 4.5]},
}


def read(seed: int) -> Readings:
    """By formulas of their own: a lamp of 12.6 degrees, c = 0.095 per m, one reading a minute in disorder."""
    rng = np.random.default_rng(seed)
    aside = np.arange(-0.6, 0.61, 0.1)
    places = [(x, 0.0, z) for z in SCENE["detector"]["planes_m"] for x in aside]
    places += [(0.0, y, z) for z in SCENE["detector"]["planes_m"] for y in (-0.4, -0.2, 0.2, 0.4)]
    x, y, z = np.array(places)[rng.permutation(len(places))].T
    hour = np.arange(len(x)) / 60

    def light(x, y, z):
        across2 = (x - ASIDE_M) ** 2 + y**2
        far = np.sqrt(across2 + (z + BEHIND_M) ** 2)
        beam = np.exp(-np.log(2) * (np.arctan2(np.sqrt(across2), z + BEHIND_M) / np.radians(12.6)) ** 2)
        return beam * np.exp(-0.095 * far * z / (z + BEHIND_M)) / far**2 * (z + BEHIND_M) / far

    value = light(x, y, z) / light(ASIDE_M, 0.0, 1.5) * (1 + POWER_PER_HOUR * hour)
    value = value + DARK * (1 + DARK_PER_HOUR * hour)
    sigma = 0.004 * value
    value = value + sigma * rng.standard_normal(len(value))
    return Readings.from_arrays(x_m=x, y_m=y, z_m=z, value=value, stderr=sigma, time_s=3600 * hour)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [5, 6, 9, 10])
def test_a_faint_background_is_not_taken_for_water_that_absorbs_nothing(seed: int) -> None:
    """Water as clear as 0.01 per metre, a negative background and a skirt follow these readings nearly as
    well: every set that began there stayed there, and the skirt was "certain"."""
    verdict = diagnose(read(seed), Scene.from_dict(SCENE), diffuse=None, advise=False).verdict
    assert sorted(verdict.best_set) == ["apparent_source", "background", "beam_offset", "lamp_drift"]
    absorption = verdict.ladder[-1].parameters["water.absorption_per_m"]
    assert abs(absorption.value - 0.095) < 3 * absorption.stderr
