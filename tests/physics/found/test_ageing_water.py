"""Light in water that changes in time, beside what the water of each moment gives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lightfield.fitting.diffuse_light import DiffuseLight
from lightfield.fitting.light_source import LightSource
from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
from lightfield.render.at_readings import rendered_light
from lightfield.scene import Scene
from lightfield.scene.water.ageing import at_time


class Halo:
    """Scattered light b r (1 + b r / 2) exp(-1.05 c r): once and twice, on ways a little longer than r."""

    r_m, longer = 8.5, 1.05

    def light(self, scene: Scene, wavelengths_nm: Any) -> np.ndarray:
        water = scene.water
        assert water.settling_per_m == water.drift_per_m_per_hour == 0, "asked for in the water of a moment"
        b, c = water.scattering_per_m, water.scattering_per_m + water.absorption_per_m
        br = b * self.r_m
        return np.full((1, 60), br * (1 + 0.5 * br) * np.exp(-self.longer * c * self.r_m))


class HaloOfMany(Halo):
    """The same, which tells of all waters at once."""

    def in_waters(self, scene: Scene, waters: list[Any], wavelengths_nm: Any) -> np.ndarray:
        scenes = [scene.model_copy(update={"water": water}) for water in waters]
        return np.stack([self.light(one, wavelengths_nm) for one in scenes])


def traced_as(halo: Any) -> Any:
    """What gives this light, whatever is asked."""
    return lambda *_, **__: halo


@pytest.mark.parametrize("halo", [Halo, HaloOfMany])
def test_scattered_light_follows_the_water_of_its_time(halo: type[Halo]) -> None:
    """A few moments stand for all 60, within 0.1 % of what the water of each time gives."""
    scene = Scene.from_dict(
        {
            "water": {
                "absorption_per_m": 0.1, "settling_per_m": 0.3, "settling_time_s": 1000.0,
                "drift_per_m_per_hour": 0.005,
            }
        }
    )  # fmt: skip
    time = np.linspace(0, 3600, 60)
    table = Readings.from_arrays(z_m=np.full(60, Halo.r_m), value=np.ones(60), time_s=time)
    source = LightSource.of(scene, table, traced_as(halo()), None)
    direct = direct_field(scene, table.x_m, table.y_m, table.z_m, time_s=time)
    told = source.light({}) - direct
    each = [scene.model_copy(update={"water": at_time(scene.water, float(t))}) for t in time]
    truth = np.array([Halo().light(one, None)[0, 0] for one in each])
    assert np.abs(told - truth).max() < 1e-3 * truth.max()
    assert np.ptp(truth) > 0.5 * truth.max()


class FromWalls(Halo):
    """On ways half as long again."""

    longer = 1.5


TANK = {"width_m": 3.0, "depth_m": 2.0, "length_m": 12.0, "wall_albedo": 0.3}


@pytest.mark.parametrize(("halo", "around", "within"), [(Halo, {}, 2e-4), (FromWalls, {"tank": TANK}, 6e-4)])
def test_light_follows_water_that_only_drifts(halo: Any, around: dict[str, Any], within: float) -> None:
    """By 0.1 per m within the hour: two or three moments stand for what the water of each time gives.

    Of exp(-d t) for d t up to u the polynomial through Chebyshev's n misses (u/2)^n / (2^(n-1) n!): 1.1e-4
    and 4e-4 for the longer parts of the ways.
    """
    water = {"absorption_per_m": 0.1, "scattering_per_m": 0.1, "drift_per_m_per_hour": 0.1}
    scene = Scene.from_dict({"water": water} | around)
    time = np.linspace(0, 3600, 60)
    table = Readings.from_arrays(z_m=np.full(60, halo.r_m), value=np.ones(60), time_s=time)
    told = DiffuseLight.of(scene, table, traced_as(halo()), None).light(scene)
    each = [scene.model_copy(update={"water": at_time(scene.water, float(t))}) for t in time]
    truth = np.array([halo().light(one, None)[0, 0] for one in each])
    np.testing.assert_allclose(told, truth, rtol=within)
    assert np.ptp(truth) > 0.5 * truth.max()


def test_the_render_follows_the_water_of_its_time() -> None:
    """At two times the full render is that of the two waters, which are traced by themselves."""
    water = {"absorption_per_m": 0.1, "settling_per_m": 0.3, "settling_time_s": 1000.0}
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 5.0}, "water": water | {"drift_per_m_per_hour": 0.02}})
    time = np.array([0.0, 0.0, 1500.0, 1500.0])
    at = {"x_m": np.array([0.0, 1.6, 0.0, 1.6]), "z_m": np.full(4, 5.0)}
    table = Readings.from_arrays(**at, value=np.ones(4), time_s=time)
    settings: dict[str, Any] = {"max_photons": 4e5, "rel_error": 1e-3, "symmetry": True}
    light, stderr = rendered_light(scene, table, **settings)
    for t in (0.0, 1500.0):
        here = time == t
        moment = scene.model_copy(update={"water": at_time(scene.water, t)})
        other, error = rendered_light(moment, table.subset(here), seed=2, **settings)
        assert np.all(np.abs(light[here] - other) < 4 * np.hypot(stderr[here], error))
    assert light[2] > 1.3 * light[0] and light[3] < 0.7 * light[1]  # the beam clears, the halo goes
