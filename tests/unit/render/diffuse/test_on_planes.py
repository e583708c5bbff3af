"""Readings of a track, told from few planes."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.formula.scattered.scattered_field import ScatteredField
from lightfield.render.diffuse.on_planes import OnPlanes, on_planes, planes_for
from lightfield.scene import Scene

NEAR_M, FAR_M = 2.0, 8.5
SCENE = Scene.from_dict(
    {
        "lamp": {"hwhm_deg": 5.0, "offset_x_m": 0.05},
        "water": {"absorption_per_m": 0.1, "scattering_per_m": 0.3},
        "tank": {"width_m": 3.0, "depth_m": 2.4, "length_m": 10.0, "behind_lamp_m": 0.5},
    }
)


def track(n: int = 300) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places all over the beam, out to twice its half width."""
    rng = np.random.default_rng(3)
    z, angle = rng.uniform(NEAR_M, FAR_M, n), rng.uniform(0, 2 * np.pi, n)
    radius = z * np.tan(np.radians(10.0)) * np.sqrt(rng.uniform(0, 1, n))
    return radius * np.cos(angle), radius * np.sin(angle), z


def told(at: OnPlanes, light: np.ndarray) -> np.ndarray:
    return np.asarray(np.exp((at.weight * np.log(light)).sum(axis=0)) * at.scale)


def test_planes_that_were_meant_stay() -> None:
    """Twenty of them, 0.2 m apart, of many readings; and a plane that is read all over, alone."""
    z = np.repeat(np.linspace(4.5, 8.5, 21), 10)
    assert planes_for(z) == pytest.approx(np.linspace(4.5, 8.5, 21))
    assert planes_for(np.full(50, 4.5)) == pytest.approx([4.5])
    at = on_planes(planes_for(z), 0.1 * z, 0.2 * z, z)
    assert at.x_m.shape == (1, len(z)) and (at.z_m[0] == z).all() and (at.scale == 1).all()


def test_scattered_light_of_a_track_is_known_from_few_planes() -> None:
    """To 0.2 %, what a smooth ratio leaves of it; to 2 % where the next plane's place was behind a wall."""
    x, y, z = track()
    planes = planes_for(z, SCENE.tank)
    assert len(planes) < 25
    at = on_planes(planes, x, y, z, tank=SCENE.tank)
    assert at.weight.sum(axis=0) == pytest.approx(1.0) and (at.weight >= -1e-3).all()
    here, there = (
        ScatteredField(*places).in_waters([SCENE], [None])[0, 0] for places in ((x, y, z), at.places)
    )
    found, off_walls = told(at, there.reshape(2, -1)), np.maximum(np.abs(x) / 1.5, np.abs(y) / 1.2) < 0.85
    assert found[off_walls] == pytest.approx(here[off_walls], rel=2e-3) and off_walls.mean() > 0.8
    assert found == pytest.approx(here, rel=0.02)


def test_a_narrow_tank_has_closer_planes_and_no_place_behind_a_wall() -> None:
    """A quarter of its width apart; what a place far away is told by is no nearer to the wall than half as
    near."""
    assert SCENE.tank is not None
    narrow = SCENE.tank.model_copy(update={"width_m": 0.8, "depth_m": 0.6, "lamp_depth_m": 0.3})
    z = np.linspace(NEAR_M, FAR_M, 400)
    planes = planes_for(z, narrow)
    assert np.diff(planes).mean() <= 0.15 < np.diff(planes_for(z)).mean()
    at = on_planes(planes, np.full(400, 0.39), np.full(400, -0.29), z, tank=narrow)
    assert (at.x_m <= 0.395 + 1e-12).all() and (at.y_m >= -0.295 - 1e-12).all()
