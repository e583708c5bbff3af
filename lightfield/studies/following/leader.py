"""How the leader moves: where its lamp is, in the frame in which it was when the run began."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lightfield.arrays import Array, Mask
from lightfield.errors import SceneError
from lightfield.scene.follower import WAY_COLUMNS, Mission
from lightfield.scene.tank import Tank
from lightfield.storage.tables import read_rows

#: Sway, heave and surge of a leader under way: amplitudes, m, and periods, s (chosen: slower than the
#: vehicle).
_AMPLITUDE_M, _PERIOD_S = np.array([0.3, 0.15, 0.2]), np.array([40.0, 55.0, 60.0])
#: A lawnmower: width of a lane, m, advance to the next, m, and speed, m/s (chosen: a survey in a tow tank).
_LANE_M, _ADVANCE_M, _SPEED_M_PER_S = 1.2, 0.4, 0.05


def way_of(mission: Mission) -> Callable[[float], Array]:
    """Place of the lamp, m, shape (3,), as a function of the time, s; zero at the beginning."""
    if mission.leader == "sway":
        return lambda t: _AMPLITUDE_M * np.sin(2 * np.pi * t / _PERIOD_S)
    if mission.leader == "lawnmower":
        return _along(*_lawnmower(mission.duration_s))
    if mission.leader == "table":
        time, *places = read_rows(str(mission.leader_table), WAY_COLUMNS)
        return _along(time, np.stack(places, axis=1))
    return lambda t: np.zeros(3)


def beyond_walls(places: Array, tank: Tank | None) -> Mask:
    """Are places, shape (..., 3), m from where the lamp was at first, outside the tank? Shape (...)."""
    if tank is None:
        return np.zeros(places.shape[:-1], bool)
    low, high = np.array(tank.box_m).T
    return np.asarray(((places < low) | (places > high)).any(axis=-1))


def check_way(mission: Mission, tank: Tank | None) -> None:
    """Refuse a lamp that drives through the walls of its tank.

    Raises
    ------
    SceneError
        Where and when it would.
    """
    way = way_of(mission)
    times = np.linspace(0.0, mission.duration_s, 1 + int(np.ceil(mission.duration_s)))
    places = np.array([way(t) for t in times])
    out = beyond_walls(places, tank)
    if tank is not None and out.any():
        at, when = places[out][0], times[out][0]
        raise SceneError(
            "the leader drives through a wall of the tank", where="follower.mission.leader",
            found=f"its lamp at [{', '.join(f'{v:.3g}' for v in at)}] m after {when:g} s",
            rule="; ".join(
                f"{low:g} <= {axis} <= {high:g}" for axis, (low, high) in zip("xyz", tank.box_m, strict=True)
            ),
            remedy="another way, a larger tank, or open water (no [tank])",
        )  # fmt: skip


def _lawnmower(duration_s: float) -> tuple[Array, Array]:
    """Times and places of its corners: lanes across, and forward from one to the next."""
    corners, side = [np.zeros(3)], 1.0
    length = 0.0
    while length < _SPEED_M_PER_S * duration_s:
        for move in ((side * _LANE_M if len(corners) > 1 else 0.5 * _LANE_M, 0.0), (0.0, -_ADVANCE_M)):
            corners.append(corners[-1] + np.array([move[0], 0.0, move[1]]))
            length += abs(move[0]) + abs(move[1])
        side = -side
    way = np.array(corners)
    lengths = np.linalg.norm(np.diff(way, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(lengths)]) / _SPEED_M_PER_S, way


def _along(time_s: Array, places: Array) -> Callable[[float], Array]:
    first = places[0]
    return lambda t: np.array([np.interp(t, time_s, axis) for axis in (places - first).T])
