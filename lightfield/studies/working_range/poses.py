"""How well an array on the axis can know its pose, against distance: the bounds of `studies.follower`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lightfield.arrays import Array
from lightfield.formula.own_formulas import lit
from lightfield.scene import DetectorArray, Scene
from lightfield.scene.lamp.frame import axis_at, is_tilted
from lightfield.studies.defaults import ARRAY_COUNT, ARRAY_SIDE_M
from lightfield.studies.follower.array_light import ArrayModel, FormulaLight, Light, pose_names
from lightfield.studies.follower.array_noise import SensorNoise
from lightfield.studies.follower.elements import elements_of
from lightfield.studies.follower.frames import poses_on_axis
from lightfield.studies.follower.information import UNKNOWN, Bound, nuisances_of, with_doubt
from lightfield.studies.working_range.smooth_light import smooth_light

#: The array of a scene that has none: that which the group's own later work settled on (Eren 2015, thesis,
#: University of New Hampshire, scholars.unh.edu/dissertation/2193).
ARRAY = DetectorArray(count=(ARRAY_COUNT, ARRAY_COUNT), size_m=ARRAY_SIDE_M, radius_m=0.32)

#: It reaches no farther than this part of the way from the axis to the nearest wall. Chosen: so that it fits.
_OF_ROOM = 0.5
#: Water between an array and a wall, m: enough for the finest cells of its light.
_BESIDE_M = 0.1


def array_for(scene: Scene) -> DetectorArray:
    """The scene's array; of one that has none `ARRAY`, made smaller where it would not fit into the tank."""
    if scene.array is not None or scene.tank is None:
        return scene.array or ARRAY
    part = _OF_ROOM * min(scene.tank.room_m) / elements_of(ARRAY).reach_m
    if part >= 1:
        return ARRAY
    smaller = {"size_m": round(part * ARRAY.size_m, 3), "radius_m": round(part * ARRAY.radius_m, 3)}
    return ARRAY.model_copy(update=smaller)


def with_array(
    scene: Scene, count: int | None = None, side_m: float | None = None, radius_m: float | None = None
) -> Scene:
    """The scene with another number of receivers on a side of its array, side or radius of curvature.

    Raises
    ------
    SceneError
        An impossible array.
    """
    asked = {
        "array.count": None if count is None else [count, count],
        "array.size_m": side_m,
        "array.radius_m": radius_m,
    }
    changed = {path: value for path, value in asked.items() if value is not None}
    if not changed:
        return scene
    return scene.model_copy(update={"array": array_for(scene)}).with_values(changed)


def sides_met_m(scene: Scene) -> float:
    """Distance at which an array on the axis of a tilted beam stands next to a side of its tank, m.

    Infinite where it never does, and where the beam is not tilted: `smooth_light` has its own word for these.
    """
    if scene.tank is None or not is_tilted(scene.lamp):
        return float("inf")
    reach = elements_of(array_for(scene)).reach_m
    begin, end = np.abs(np.array(axis_at(lit(scene).lamp, np.array([0.0, 1.0])))).max(axis=0)
    free = min(scene.tank.room_m) - reach - _BESIDE_M - begin
    return float(free / (end - begin) - reach) if end > begin else float("inf")


@dataclass(frozen=True)
class Known:
    """Bounds at each distance, on the axis, facing the lamp.

    Parameters
    ----------
    as_stated, relative : list of Bound
        With what the scene says is unknown; and with the common gain unknown altogether.
    nuisances : dict of str to float
        What the scene says is unknown, by its standard deviation.
    """

    as_stated: list[Bound]
    relative: list[Bound]
    nuisances: dict[str, float]
    array: DetectorArray


def known_poses(scene: Scene, z_m: Array, *, photons: float) -> list[Known]:
    """Bounds on the axis in the scene's light, and by the formula; one and the same without photons.

    Parameters
    ----------
    scene : Scene
        Its [array] and [follower], or `array_for` it and the defaults.
    z_m : array, shape (n,), m
    photons : float
        Zero: the formula alone.

    Returns
    -------
    list of Known
        With scattered light, and by the formula.
    """
    array = array_for(scene)
    told = {"array": array, "follower": scene.follower_here}
    whole = lit(scene.model_copy(update=told))
    elements, noise, names = elements_of(array), SensorNoise.of_scene(whole), pose_names(whole)[:5]
    nuisances = nuisances_of(whole)
    poses = poses_on_axis(whole.lamp, z_m)
    lights: list[Light] = [FormulaLight(whole)]
    if photons:
        lights.insert(0, smooth_light(whole, float(z_m.min()), float(z_m.max()), elements.reach_m, photons))
    found = []
    for light in lights:
        model = ArrayModel(light, elements)
        parts = model.leave_one_out()
        unknown = nuisances, nuisances | {"gain": UNKNOWN}
        pairs = [[with_doubt(model, parts, pose, names, noise, one) for one in unknown] for pose in poses]
        found.append(Known([one for one, _ in pairs], [one for _, one in pairs], nuisances, array))
    return found if photons else found * 2
