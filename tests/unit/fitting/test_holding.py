"""Slopes beside scattered light: it stays as it is while only the lamp changes, and is made anew else."""

from __future__ import annotations

import numpy as np
import pytest
from analytic_readings import readings

from lightfield.fitting.forward import SceneForward


class Glow:
    """Scattered light in proportion to the scattering coefficient and to the width of the beam."""

    def __init__(self, n: int) -> None:
        self.n, self.asked = n, 0

    def light(self, scene, wavelengths_nm) -> np.ndarray:
        self.asked += 1
        return np.full((1, self.n), 1e-3 * scene.water.scattering_per_m * scene.lamp.hwhm_deg)


@pytest.fixture
def glowing() -> tuple[SceneForward, Glow]:
    table, scene = readings(seed=1)
    glow = Glow(len(table))
    return SceneForward(scene, table, lambda *places, **options: glow), glow


HERE = {"water.scattering_per_m": 0.1, "lamp.hwhm_deg": 4.0}


def test_at_the_same_place_nothing_changes(glowing: tuple[SceneForward, Glow]) -> None:
    forward, _ = glowing
    assert np.allclose(forward.holding(HERE).predict(HERE), forward.predict(HERE), rtol=1e-12)


def test_the_lamp_moves_direct_light_alone(glowing: tuple[SceneForward, Glow]) -> None:
    forward, glow = glowing
    near, wider = forward.holding(HERE), {**HERE, "lamp.hwhm_deg": 4.1}
    asked = glow.asked
    change = near.predict(wider) - near.predict(HERE)
    assert glow.asked == asked, "nothing is scattered anew"
    direct = [forward.predict({**v, "water.scattering_per_m": 0.0}) for v in (wider, HERE)]
    thinner = np.exp(-0.1 * np.hypot(forward.readings.x_m, forward.readings.z_m))
    assert np.allclose(change, (direct[0] - direct[1]) * thinner, rtol=1e-6)


def test_other_water_is_made_anew(glowing: tuple[SceneForward, Glow]) -> None:
    forward, glow = glowing
    near, denser = forward.holding(HERE), {**HERE, "water.scattering_per_m": 0.2}
    assert np.allclose(near.predict(denser), forward.predict(denser), rtol=1e-12)
    assert glow.asked > 1
