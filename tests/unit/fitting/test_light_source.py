"""Light at places that lag behind the motion of the detector."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lightfield.fitting.forward import SceneForward
from lightfield.readings import Readings
from lightfield.render.at_readings import rendered_light
from lightfield.scene import Scene

LAG_M = 0.004
CLEAR = Scene.from_dict({"lamp": {"hwhm_deg": 5.0}, "water": {"absorption_per_m": 0.1}})
TURBID = CLEAR.with_values({"water.scattering_per_m": 0.3})


def to_and_fro() -> Readings:
    row = np.linspace(-0.6, 0.6, 9)
    x = np.concatenate([row, row[::-1]])
    z = np.repeat([4.0, 6.0], 9)
    return Readings.from_arrays(
        x_m=x, z_m=z, value=np.ones(18), time_s=10.0 * np.arange(18), quantity="irradiance"
    )


def where_it_reads(table: Readings) -> Readings:
    """The same without times, at the places that are read: each row behind along its own direction."""
    x = table.x_m - LAG_M * np.repeat([1.0, -1.0], 9)
    return replace(table, x_m=x, time_s=np.full(18, np.nan))


class Moving:
    """Scattered light that moves with the lamp and falls with the distance, as `slopes_of_rest` has it."""

    def __init__(self, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> None:
        self.x, self.z = x, z

    def light(self, scene: Scene, wavelengths_nm: list[float | None]) -> np.ndarray:
        aside = self.x - scene.lamp.offset_x_m
        return np.asarray([1e-3 * np.exp(-(aside**2) - 0.1 * self.z) / self.z**2])


@pytest.mark.parametrize("scene", [CLEAR, TURBID])
def test_light_is_that_of_the_places_behind(scene: Scene) -> None:
    """Straight light exactly; scattered light by its slope, to a thousandth of it for 4 mm."""
    table = to_and_fro()
    lagging = scene.with_values({"detector.lag_m": LAG_M})

    def predicted(of: Scene, at: Readings) -> np.ndarray:
        return SceneForward(of, at, lambda _, *places, **options: Moving(*places)).predict({})

    now, there = predicted(lagging, table), predicted(scene, where_it_reads(table))
    assert now == pytest.approx(there, rel=1e-12 if scene is CLEAR else 1e-4)
    assert np.abs(now / predicted(scene, table) - 1).max() > 0.01


def test_some_of_the_readings_keep_their_motion() -> None:
    """Every other one: from one of them to the next it would be another, at a row's end."""
    table, few = to_and_fro(), np.arange(18) % 3 != 0
    forward = SceneForward(CLEAR, table)
    values = {"detector.lag_m": LAG_M, "gain": 1.0}
    assert forward.subset(few).predict(values) == pytest.approx(forward.predict(values)[few])


def test_a_fresh_render_reads_the_same_places() -> None:
    table = to_and_fro()
    light, _ = rendered_light(CLEAR.with_values({"detector.lag_m": LAG_M}), table)
    there, _ = rendered_light(CLEAR, where_it_reads(table))
    assert light == pytest.approx(there, rel=1e-9)
