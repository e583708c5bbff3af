"""Where and in which order readings are taken."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from os import PathLike, fspath
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array
from lightfield.errors import UsageError
from lightfield.readings import Readings, read_table
from lightfield.readings.columns import LAYOUT
from lightfield.scene import Scene
from lightfield.scene.tank import walls_m

Order = Literal["random", "plane", "rows"]
LAYOUTS = ("line", "half", "grid", "fine", "column", "air")
#: Where the scene lists single positions, these are the layout.
LISTED = "positions"

SECONDS_PER_READING = 20.0
#: From the axis, the part of the room that layouts use where the planes reach the walls. Chosen.
_CLEAR = 0.9


def positions(scene: Scene, kind: str) -> dict[str, Array]:
    """Positions of a layout on the scene's planes.

    Parameters
    ----------
    kind : str
        "line": x on both sides; "half": x from 0; "grid": x and y; "fine": more planes; "column": x and y up
        to the surface; "air": "line" in water and again in air; "positions": those that the scene lists.

    Raises
    ------
    UsageError
        No such layout for this scene.
    """
    single = scene.detector.positions_m
    known = LAYOUTS if single is None else (LISTED,)
    if kind not in known:
        kinds = "has planes" if single is None else "lists single positions"
        raise UsageError(
            "unknown layout",
            found=kind,
            rule=f"this scene {kinds}: {', '.join(known)}, or a table of places, FILE.csv",
        )
    if single is not None:
        listed = dict(zip(("x_m", "y_m", "z_m"), np.array(single, float).T, strict=True))
        return {**listed, "medium": np.repeat("water", len(single))}
    planes: NDArray[Any] = np.array(scene.detector.planes_m)
    reach, (wall, (low, high), (_, end)) = 0.5 * scene.plane_size_m[0], walls_m(scene.tank)
    across = reach if reach < max(wall) else _CLEAR * max(wall)  # no receiver is in a wall
    x: NDArray[Any] = np.linspace(-across, across, 21)
    y: NDArray[Any] = np.zeros(1)
    if kind == "half":
        x = np.linspace(0, across, 11)
    elif kind == "grid":
        x = np.linspace(-0.9 * reach, 0.9 * reach, 7)
        y = np.linspace(max(-0.9 * reach, 0.9 * low), min(0.9 * reach, 0.9 * high), 7)
    elif kind == "fine":
        gaps = np.diff(planes) if len(planes) > 1 else 0.2 * planes
        ends = [planes[:1] - gaps[:1], planes[-1:] + gaps[-1:]]
        planes = np.unique(np.concatenate([planes, 0.5 * (planes[1:] + planes[:-1]), *ends]))
        planes = planes[(planes > 0.1 * scene.detector.planes_m[0]) & (planes < end)]
    elif kind == "column":
        x = min(0.3, 0.9 * reach) * np.array([-1.0, 0.0, 1.0])
        top = high - min(0.1, 0.5 * high)
        y = np.linspace(max(-0.9 * reach, 0.9 * low), min(top, reach), 12)
    media = ("air", "water") if kind == "air" else ("water",)
    # As a person writes them down: 0.2, not 0.19999999999999996; nor -0.0.
    written = [np.round(axis, 6) + 0.0 for axis in (planes, y, x)]
    gz, gy, gx = (np.tile(a.ravel(), len(media)) for a in np.meshgrid(*written, indexing="ij"))
    return {"x_m": gx, "y_m": gy, "z_m": gz, "medium": np.repeat(media, gx.size // len(media))}


def scan(scene: Scene, kind: str | Readings, order: Order, rng: np.random.Generator) -> Readings:
    """A layout, or the places of a table, with times and no values yet; all bands are read at once."""
    bands = scene.detector.bands_nm
    centres = [float(np.mean(band)) for band in bands] if len(bands) > 1 else [np.nan]
    places = positions(scene, kind) if isinstance(kind, str) else places_of(kind)
    return table_at(places, centres, scene, order, rng)


def layout_named(name: str | PathLike[str] | None, scene: Scene) -> str | Readings | None:
    """A layout by its name, or the table of places that a file holds."""
    if name is None or not fspath(name).lower().endswith(".csv"):
        return None if name is None else fspath(name)
    return read_table(Path(name), scene, LAYOUT)


def places_of(table: Readings) -> dict[str, Array]:
    """Where a table is read, in its order, and when, if it says so of every row; several wavelengths at one
    place are one reading.

    A place is visited as often as one of its wavelengths stands there.
    """
    columns = {name: getattr(table, name) for name in ("x_m", "y_m", "z_m", "medium")}
    places = zip(*(column.tolist() for column in columns.values()), strict=True)
    times, visits = Counter[tuple[object, ...]](), dict[tuple[object, ...], int]()
    for row, (place, colour) in enumerate(zip(places, np.nan_to_num(table.wavelength_nm), strict=True)):
        times[place, colour] += 1
        visits.setdefault((place, times[place, colour]), row)
    if np.isfinite(table.time_s).all():
        columns["time_s"] = table.time_s
    return {name: column[list(visits.values())] for name, column in columns.items()}


def table_at(
    places: Mapping[str, Array],
    wavelengths_nm: Sequence[float],
    scene: Scene,
    order: Order,
    rng: np.random.Generator,
) -> Readings:
    """Readings of a scene at some places with times, and no values yet; all wavelengths are read at once.

    Parameters
    ----------
    places : mapping of arrays, shape (n,)
        x_m, y_m, z_m, medium; time_s where it is known.
    wavelengths_nm : sequence of float
        NaN: the scene's band.
    order : "random", "plane" or "rows"
        "plane": as the places are listed; "rows": so too, but every other row along x backwards. "random"
        is that of the times which are known.
    """
    n, colours = len(places["x_m"]), len(wavelengths_nm)
    sequence = rng.permutation(n) if order == "random" else np.arange(n)
    if order == "rows":
        sequence = _to_and_fro(places)
    time = SECONDS_PER_READING * sequence
    if order == "random" and "time_s" in places:
        time = places["time_s"]
    bare = Readings.from_arrays(
        **{name: np.repeat(column, colours) for name, column in places.items() if name != "time_s"},
        value=np.ones(n * colours),
        stderr=np.full(n * colours, np.nan),
        wavelength_nm=np.tile(wavelengths_nm, n),
        time_s=np.repeat(time, colours),
        quantity=scene.detector.quantity,
    )
    return bare.check_against(scene)


def _to_and_fro(places: Mapping[str, Array]) -> NDArray[np.int_]:
    """Which of all each place is in a scan whose every other row along x is read backwards, shape (n,)."""
    rows = np.stack([places["y_m"], places["z_m"], np.asarray(places["medium"]) == "air"])
    begins = np.flatnonzero(np.r_[True, (np.diff(rows, axis=1) != 0).any(axis=0)])
    runs = np.split(np.arange(rows.shape[1]), begins[1:])
    return np.concatenate([run[::-1] if k % 2 else run for k, run in enumerate(runs)])
