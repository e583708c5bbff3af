"""Light of a saved page: direct light falls by the law of Beer and Lambert on its way in water."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from perturbed import TAKEN, changed

from lightfield.explorer.saved.moving_light import moving_light, why_fixed
from lightfield.explorer.saved.packed_arrays import PackedArrays
from lightfield.fitting.forward import SceneForward
from lightfield.formula.readout import readout
from lightfield.readings import Readings
from lightfield.scene import Scene
from lightfield.scene.acts import Acts
from lightfield.scene.all_parameters import paths_on

ABSORPTION = "water.absorption_per_m"
DRY = SimpleNamespace(layout=SimpleNamespace(air=np.zeros(1, bool)))


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


@pytest.mark.parametrize("path", paths_on(Acts.READOUT))
def test_a_page_moves_a_readout_that_it_can_compute_and_says_of_others_why_it_does_not(path: str) -> None:
    """It adds what the background moves by, and takes light in proportion: else it is told, or refused."""
    scene = changed(Scene.from_dict({"detector": {"background": 0.3}}), path)

    def read(light: np.ndarray, moved: float = 0.0) -> np.ndarray:
        at = {"detector.background": scene.detector.background + moved}
        return readout(scene.with_values(at), light, 1.0, TAKEN)

    light = np.array([0.1, 0.5, 1.0])
    offset, slope = read(0 * light), read(np.ones(3)) - read(0 * light)
    in_proportion = read(light) == pytest.approx(slope * light + offset, rel=1e-9)
    added = read(light, 0.2) == pytest.approx(read(light) + 0.2, rel=1e-9)
    mixes = path in ("detector.stray_light", "detector.second_order")  # `moving_light` sees it, and refuses
    assert (in_proportion and added) or mixes or why_fixed(DRY, scene) is not None  # type: ignore[arg-type]
    assert mixes == (not in_proportion and why_fixed(DRY, scene) is None)  # type: ignore[arg-type]
