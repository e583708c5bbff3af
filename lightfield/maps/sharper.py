"""Numbers that are read off a map, without what its cells make of them.

A cell holds the mean of the light in it: less than on the axis, in a spot that is wider. By how much is known
of straight light, whose formula tells it at every place.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from lightfield.arrays import Array
from lightfield.maps.spot import Spot, spot_shape

#: Of x and y, m, arrays of one shape; gives an array of that shape.
Field = Callable[[Array, Array], Array]
#: Cells along a side that tell the top of what lies about an axis, at least; those so far from it do, in
#: cells, three or four along each side and the nearest most.
_AROUND, _REACHED = 3, 1.6
#: Noise of more than this part of the top tells nothing of its shape.
_TOLD = 0.2
#: Places along a side of a cell over which the mean of a shape is taken.
_PARTS = (np.arange(8) + 0.5) / 8 - 0.5
#: A spot is looked at over so many of its half widths on both sides, at so many places.
_REACH, _PLACES = 1.7, 65


def itself(field: Field, on_cells: Spot) -> Spot:
    """The spot of a field at places, which was found on the means of cells.

    Parameters
    ----------
    field : callable
        In any unit.
    on_cells : Spot
        That of the means; one that could not be measured is given back.
    """
    if on_cells.problem:
        return on_cells
    way = _REACH * np.linspace(-1.0, 1.0, _PLACES)
    x = on_cells.centre_x_m + on_cells.hwhm_x_m * way
    y = on_cells.centre_y_m + on_cells.hwhm_y_m * way
    found = spot_shape(field(*np.meshgrid(x, y)), x, y)
    return on_cells if found.problem else found


def at_the_axis(
    rest: Array, stderr: Array, x_m: Array, y_m: Array, axis_m: tuple[float, float]
) -> tuple[float, float]:
    """Light besides straight light where a beam's axis meets a plane, and its error, from the cells about it.

    It is highest there: as a parabola has it at least, as a cone has it at most, for scattered light has a
    sharp top. Told is the middle, with half of what lies between as an error; a slope across the plane does
    not count. NaN where too few cells are about the axis, or too few photons.

    Parameters
    ----------
    rest, stderr : arrays, shape (n_y, n_x)
        Means over cells; NaN where nothing is known.
    """
    nothing = float("nan"), float("nan")
    if min(len(x_m), len(y_m)) < _AROUND:
        return nothing
    (x, pitch_x), (y, pitch_y) = (
        (centres - at, float(np.median(np.diff(centres))))
        for centres, at in zip((x_m, y_m), axis_m, strict=True)
    )
    dx, dy = np.meshgrid(x, y)
    near = (np.abs(dx) <= _REACHED * pitch_x) & (np.abs(dy) <= _REACHED * pitch_y)
    near &= np.isfinite(rest) & np.isfinite(stderr)
    if np.count_nonzero(near) < _AROUND**2:
        return nothing
    u, v = np.meshgrid(_PARTS * pitch_x, _PARTS * pitch_y)
    away = np.hypot(dx[near][:, None] + u.ravel(), dy[near][:, None] + v.ravel()) / np.hypot(pitch_x, pitch_y)
    counts = np.exp(-2 * (away**2).mean(axis=1))
    slopes, tops = (dx[near] / pitch_x, dy[near] / pitch_y), []
    for shape in (away**2, away):
        columns = np.stack([np.ones(len(away)), shape.mean(axis=1), *slopes], axis=1)
        tops.append(np.linalg.pinv(columns * counts[:, None])[0] * counts)
    middle, between = 0.5 * (tops[1] + tops[0]), 0.5 * (tops[1] - tops[0])
    noise, of_between = (np.linalg.norm(weights * stderr[near]) for weights in (middle, between))
    top = float(middle @ rest[near])
    if not noise < _TOLD * top:
        return nothing
    # What noise alone makes of the way between them is counted once.
    shape = max(float(between @ rest[near]) ** 2 - of_between**2, 0.0)
    return top, float(np.sqrt(noise**2 + shape))


def without_cells(
    width_m: Array | float, on_cells_m: Array | float, itself_m: Array | float, together: Array | float = 1.0
) -> Array:
    """Half widths that were found on cells, as they are without these.

    Means over cells add to the square of a width, whatever it is; so light of another width is wider by that
    much less.

    Parameters
    ----------
    width_m : float, m
        Found on cells.
    on_cells_m, itself_m : float, m
        Of straight light: found on the same cells, and of it itself. NaN: the width is left as it is.
    together : float
        How many cells along a side were one for the first width: means add with the square of their size.
    """
    width = np.asarray(width_m, float)
    added = np.nan_to_num(np.asarray(on_cells_m, float) ** 2 - np.asarray(itself_m, float) ** 2) * together**2
    left = width**2 - added
    # Of less than half of it nothing is told: its own cells are then all there is to see.
    return np.asarray(np.where(left > 0.25 * width**2, np.sqrt(np.maximum(left, 0.0)), width))


def sharpened(render: Spot, formula: Spot, sharp: Spot) -> Spot:
    """The spot of a render without what cells make of it: the formula's on the same cells, and at places."""
    x, y = (
        float(without_cells(getattr(render, name), getattr(formula, name), getattr(sharp, name)))
        for name in ("hwhm_x_m", "hwhm_y_m")
    )
    more = {"hwhm_x_m": render.hwhm_x_m / x, "hwhm_y_m": render.hwhm_y_m / y}
    more["hwhm_m"] = float(np.sqrt(more["hwhm_x_m"] * more["hwhm_y_m"]))
    errors = {name: error * more.get(name, 1.0) for name, error in render.stderr.items()}
    return replace(render, hwhm_x_m=x, hwhm_y_m=y, stderr=errors)
