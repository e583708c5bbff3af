"""Light of a saved page: direct light falls by the law of Beer and Lambert on its way in water."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.explorer.saved.moving_light import moving_light
from lightfield.explorer.saved.packed_arrays import PackedArrays
from lightfield.fitting.forward import SceneForward
from lightfield.readings import Readings
from lightfield.scene import Scene

ABSORPTION = "water.absorption_per_m"


@pytest.mark.parametrize("apparent_m", [0.0, 2.0, -0.5])
def test_more_absorption_acts_on_the_way_in_water_alone(apparent_m: float) -> None:
    """Light that seems to start behind the window is not dimmed there, nor in front of it from there on only:
    by 0.2 per m over z / cos(theta)."""
    lamp = {"hwhm_deg": 10.0, "apparent_distance_m": apparent_m}
    scene = Scene.from_dict({"lamp": lamp, "water": {"absorption_per_m": 0.1}})
    x, z = (v.ravel() for v in np.meshgrid([0.0, 0.3], [2.0, 5.0, 8.0]))
    table = Readings.from_arrays(x_m=x, z_m=z, value=np.ones(len(z))).check_against(scene)
    arrays, values = PackedArrays(), {"gain": 1.0, ABSORPTION: 0.1}
    forward, moves = SceneForward(scene, table, full=1.0), {ABSORPTION: (0.0, 0.3)}
    found = moving_light(forward, values, ("gain",), moves, arrays)
    _, at, shape, _ = found["way"]
    way = np.frombuffer(bytes(arrays.bytes), "<f4", *shape, at)
    assert way == pytest.approx(z * np.hypot(1.0, x / (z + apparent_m)), rel=1e-6)
