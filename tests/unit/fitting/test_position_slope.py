"""How readings change with their place, beside light whose scattered part is known without photons."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from lightfield.fitting.forward import SceneForward
from lightfield.fitting.position_slope import position_slope
from lightfield.formula.scattered.scattered_field import ScatteredField
from lightfield.readings import Readings
from lightfield.scene import Scene


class WithoutPhotons:
    """Scattered light as the small-angle solution has it, without an error."""

    def __init__(self, *places: np.ndarray) -> None:
        self.field = ScatteredField(*places)

    def light(self, scene: Scene, wavelengths_nm: Sequence[float | None]) -> np.ndarray:
        return self.field.light(scene, wavelengths_nm)

    def with_denser(self, other: WithoutPhotons) -> WithoutPhotons:
        return self


def test_a_lamp_that_has_faded_moves_readings_less() -> None:
    """As finite differences of the readings themselves: half the light, half the error of a wrong place."""
    z, time_s = np.array([1.0, 2.0, 3.0, 4.0]), np.array([0.0, 1800.0, 3600.0, 5400.0])
    worn = {"name": "worn", "stage": "receiver", "formula": "1 - loss*time/5400",
            "parameters": {"loss": {"range": [0.0, 0.9], "neutral": 0.0, "value": 0.5}}}  # fmt: skip
    lamp = {"hwhm_deg": 6.0, "drift_per_hour": -0.4}
    scene = Scene.from_dict({"water": {"absorption_per_m": 0.1}, "lamp": lamp, "effect": [worn]})

    def forward(along_x: float = 0.0, along_z: float = 0.0) -> SceneForward:
        places = {"x_m": 0.05 + along_x, "z_m": z + along_z, "value": np.ones(4), "time_s": time_s}
        return SceneForward(scene, Readings.from_arrays(**places, quantity="irradiance"), None)

    step = 5e-4
    aside = (forward(step).predict({}) - forward(-step).predict({})) / (2 * step)
    away = (forward(0.0, step).predict({}) - forward(0.0, -step).predict({})) / (2 * step)
    assert position_slope(forward(), {}) == pytest.approx(np.hypot(aside, away), rel=0.02)


@pytest.mark.parametrize(("scattering", "most"), [(0.1, 0.1), (0.4, 0.1), (2.0, 0.33)])
def test_how_readings_change_with_their_place_in_water_that_scatters(scattering: float, most: float) -> None:
    """Beside finite differences of scattered light, which the slope takes to go aside with the lamp."""
    x, z = (each.ravel() for each in np.meshgrid([0.0, 0.1, 0.3, 0.8], [1.5, 3.0, 6.0]))
    water = {"absorption_per_m": 0.05 + 0.25 * scattering, "scattering_per_m": scattering}
    scene = Scene.from_dict({"water": water, "lamp": {"hwhm_deg": 6.0}})

    def predicted(along_x: float, along_z: float) -> np.ndarray:
        return forward(along_x, along_z).predict({})

    def forward(along_x: float = 0.0, along_z: float = 0.0) -> SceneForward:
        places = {"x_m": x + along_x, "z_m": z + along_z, "value": np.ones(x.size)}
        readings = Readings.from_arrays(**places, quantity="irradiance")
        return SceneForward(scene, readings, lambda _, *places, **options: WithoutPhotons(*places))

    step = 5e-4
    aside = (predicted(step, 0.0) - predicted(-step, 0.0)) / (2 * step)
    away = (predicted(0.0, step) - predicted(0.0, -step)) / (2 * step)
    assert position_slope(forward(), {}) == pytest.approx(np.hypot(aside, away), rel=most)
