"""What lies in the tank: the size of planes, which of their cells are in water, detectors and lamp."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array
from lightfield.errors import RuleError
from lightfield.scene.detector import Detector
from lightfield.scene.follower import LEAST_STANDOFF_M, Follower
from lightfield.scene.lamp.lamp import Lamp
from lightfield.scene.parameters import told
from lightfield.scene.tank import Tank
from lightfield.scene.water.water import Water

_WIDTH_M = 2.0  # of a plane, where nothing is said and the tank has room
ROUNDING_M = 1e-9
_SLAB, _DISTANCE, _STANDOFF = "layer_centre_m", "z_m", "standoff_m"
#: What surface and panes are where there is no tank.
_NO_TANK = Tank()
#: What the ends of the tank in x, y and z follow from.
_SIZES = (("width_m",), ("depth_m", "lamp_depth_m"), ("length_m", "behind_lamp_m"))


def mirrors_follow(values: Mapping[str, Any], tank: Tank | None) -> dict[str, Any]:
    """Values to be set in a scene of a tank, with those that have to change beside them.

    A surface and its reflectance, panes and theirs: of which one alone is set, the other follows.
    """
    out, now = dict(values), tank or _NO_TANK
    surface, reflectance = values.get("tank.surface"), values.get("tank.surface_reflectance")
    if surface is None and isinstance(reflectance, float | int):
        out["tank.surface"] = "flat" if reflectance > 0 else "none"
    elif surface not in (None, now.surface) and reflectance is None:
        out["tank.surface_reflectance"] = 1.0 if surface == "flat" else 0.0
    panes, reflectance = values.get("tank.panes"), values.get("tank.pane_reflectance")
    if panes is None and now.panes == "none" and isinstance(reflectance, float | int) and reflectance > 0:
        out["tank.panes"] = "all"
    elif panes not in (None, now.panes) and reflectance is None:
        out["tank.pane_reflectance"] = 0.0 if panes == "none" else now.pane_reflectance or 1.0
    return out


def plane_size_m(detector: Detector, tank: Tank | None) -> tuple[float, float]:
    """Width and height of the detector planes, m, centred on z; where unstated, clipped to the tank.

    A lamp that is not at half the depth leaves unequal room below and above: such a plane reaches as far as
    the larger of them, and `cells_inside` tells which of it is in the water. Only where its cells are too
    coarse for that, with the one on the axis sticking out, it is as high as twice the smaller room.
    """
    width, height = detector.width_m, detector.height_m
    if width is None:
        width = _WIDTH_M if tank is None else min(_WIDTH_M, tank.width_m)
    if height is None and tank is not None:
        less, more = sorted(map(abs, tank.box_m[1]))
        height = min(width, 2 * more)
        rows = detector.pixels
        if height / rows * (0.5 if rows % 2 else 1.0) > less:
            height = min(width, 2 * less)
    return width, width if height is None else height


def rows_of_cells(detector: Detector, tank: Tank | None) -> int:
    """Rows of cells on a plane: nearly square ones, or as many as columns where the height is not stated."""
    width, height = plane_size_m(detector, tank)
    return detector.pixels if detector.height_m is None else max(1, round(height * detector.pixels / width))


def cells_inside(
    tank: Tank | None, x_m: Array, y_m: Array, pitch_x_m: float, pitch_y_m: float
) -> NDArray[np.float64]:
    """Part of the area of every cell that is in the tank, 0 to 1, shape (n_y, n_x).

    Parameters
    ----------
    tank : Tank, optional
        None: unbounded water.
    x_m, y_m : arrays, shape (n_x,) and (n_y,), m
        Centres of the cells.
    pitch_x_m, pitch_y_m : float, m
        Their size.
    """
    if tank is None:
        return np.ones((len(y_m), len(x_m)))
    shares = []
    for centres, pitch, (low, high) in zip((x_m, y_m), (pitch_x_m, pitch_y_m), tank.box_m[:2], strict=True):
        first, last = np.asarray(centres) - 0.5 * pitch, np.asarray(centres) + 0.5 * pitch
        length = np.minimum(last, high + ROUNDING_M) - np.maximum(first, low - ROUNDING_M)
        shares.append(np.clip(np.round(length / pitch, 9), 0.0, 1.0))
    in_x, in_y = shares
    return np.asarray(np.outer(in_y, in_x))


def check_all_inside(detector: Detector, lamp: Lamp, follower: Follower | None, tank: Tank | None) -> None:
    """Refuse what is outside the tank, and detectors nearer than where the light comes from.

    Raises
    ------
    RuleError
        See the checks.
    """
    if tank is not None:
        check_inside(detector, tank)
        check_lamp_inside(lamp, tank)
        if follower is not None:
            place = (follower.x_m, follower.y_m, follower.z_m)
            _check_place(place, tank, "move it, or enlarge the tank", {"follower": [*place]})
            asked = follower.mission.standoff_m
            if _STANDOFF in follower.mission.model_fields_set and asked > tank.box_m[2][1]:
                found = {f"follower.mission.{_STANDOFF}": asked}
                raise _outside(
                    f"z <= {tank.box_m[2][1]:g}", 2, tank, found, "ask for less, or enlarge the tank"
                )
    nearest = detector.distances_m[0]
    if nearest < lamp.least_distance_m:
        raise RuleError(
            "detectors are at least twice as far as the point that light seems to come from",
            "move the detector away, or write an apparent_distance_m nearer to 0",
            found={"nearest z": nearest, "lamp.apparent_distance_m": lamp.apparent_distance_m},
        )


def check_inside(detector: Detector, tank: Tank) -> None:
    """Refuse detectors outside the tank.

    Raises
    ------
    RuleError
        A position, a plane, or a part of a plane whose size was given; what is only a default is named.
    """
    if detector.positions_m is not None:
        for place in detector.positions_m:
            _check_place(place, tank, "move it, or enlarge the tank", {"detector.positions_m": [*place]})
        return
    remedy = "move it, or enlarge the tank"
    if "planes_m" not in detector.model_fields_set:
        remedy = f"give detector.planes_m (now its default, {list(detector.planes_m)}) or positions_m"
    for z in detector.planes_m:
        _check_place((0.0, 0.0, z), tank, remedy, {"detector.planes_m": z})
    low, high = tank.box_m[1]
    for name, room, ends in (
        ("width_m", tank.width_m, told(tank, "width_m")),
        ("height_m", 2 * tank.room_m[1], f"its floor at y = {low:g} m and its top at y = {high:g} m"),
    ):
        size = getattr(detector, name)
        if size is not None and size > room + ROUNDING_M:
            raise RuleError(
                f"it fits, and the tank has {ends}",
                f"at most {room:.6g}, or leave it out: the plane is then clipped to the tank",
                found={f"detector.{name}": size},
            )


def room_for_lamp_m(lamp: Lamp, tank: Tank) -> dict[str, tuple[float, float]]:
    """Least and largest offset, m, in x and y with which the lamp's window is in the tank, by field."""
    across = zip(("offset_x_m", "offset_y_m"), tank.box_m, strict=False)
    return {name: (low + lamp.radius_m, high - lamp.radius_m) for name, (low, high) in across}


def check_lamp_inside(lamp: Lamp, tank: Tank) -> None:
    """Refuse a lamp outside the tank.

    Raises
    ------
    RuleError
        Its window does not fit in there.
    """
    for axis, (name, (low, high)) in enumerate(room_for_lamp_m(lamp, tank).items()):
        offset = getattr(lamp, name)
        if not low - ROUNDING_M <= offset <= high + ROUNDING_M:
            window = {"lamp.radius_m": lamp.radius_m} if lamp.radius_m else {}
            found = {f"lamp.{name}": offset, **window}
            remedy = "move the lamp, or enlarge the tank"
            raise _outside(f"{low:g} <= {name} <= {high:g}", axis, tank, found, remedy)


def follower_in(follower: Follower | None, tank: Tank | None, detector: Detector) -> Follower:
    """The follower of a scene, its distances where it says nothing of them as far as the scene reaches.

    It is at the default distance, or in the middle of the planes where they end sooner, or of the water
    before the lamp where the tank does; and so far away it is asked to stay, if not at the default distance.
    """
    found, first, last = follower or Follower(), detector.distances_m[0], detector.distances_m[-1]
    if _DISTANCE not in found.model_fields_set:
        if tank is not None and found.z_m > tank.box_m[2][1]:
            found = found.model_copy(update={_DISTANCE: 0.5 * tank.box_m[2][1]})
        elif found.z_m > last:
            found = found.model_copy(update={_DISTANCE: 0.5 * (first + last)})
    mission = found.mission
    docks = mission.task == "dock" and found.z_m <= mission.dock_m
    if _STANDOFF in mission.model_fields_set or mission.standoff_m <= last or docks:
        return found
    staying = mission.model_copy(update={_STANDOFF: max(found.z_m, LEAST_STANDOFF_M)})
    return found.model_copy(update={"mission": staying})


def water_in(water: Water, tank: Tank | None) -> Water:
    """The water of a scene; a slab whose place it does not say is at the default distance, or in the middle
    of the water before the lamp where the tank ends sooner."""
    if _SLAB in water.model_fields_set:
        return water
    centre = float(Water.model_fields[_SLAB].default)
    if tank is not None and centre > tank.box_m[2][1]:
        centre = 0.5 * tank.box_m[2][1]
    if centre == water.layer_centre_m:
        return water
    found = water.model_copy(update={_SLAB: centre})
    found.model_fields_set.discard(_SLAB)  # nobody said it: it follows the tank
    return found


def _check_place(
    place: tuple[float, float, float], tank: Tank, remedy: str, found: Mapping[str, object]
) -> None:
    for k, (value, (low, high)) in enumerate(zip(place, tank.box_m, strict=True)):
        if not low <= value <= high:
            raise _outside(f"{low:g} <= {'xyz'[k]} <= {high:g}", k, tank, found, remedy)


def _outside(rule: str, axis: int, tank: Tank, found: Mapping[str, object], remedy: str) -> RuleError:
    why = ", ".join(told(tank, name) for name in _SIZES[axis])
    return RuleError(f"nothing is outside the tank, {rule} by {why}", remedy, found=found)
