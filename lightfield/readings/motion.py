"""How a detector moved from reading to reading, and which places it reads where it lags behind."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lightfield.arrays import Array, Mask

#: Cosine of the turn at a reading up to which the motion goes on. Chosen: rows are straight.
_GOES_ON = 0.5
#: Part of the readings at which it goes on, at least, where they were taken on the way. Derived: places of a
#: line in random order have a third, rows of five three fifths.
_IN_ROWS = 0.5
#: Length of the mean direction up to which readings are taken to and fro. Chosen: of rows that are read in
#: one direction it is 1, and there a lag is an offset.
_TO_AND_FRO = 0.7


class Motion(NamedTuple):
    """Of a detector that reads n times.

    Parameters
    ----------
    way : array, shape (3, n)
        Direction at each reading, a unit vector; 0 where nothing moves. At the beginning of a row, after a
        turn, it is that in which the row goes on.
    goes_on : array of bool, shape (n,)
        Where it comes and leaves in much the same direction.
    """

    way: Array
    goes_on: Mask

    @property
    def to_and_fro(self) -> bool:
        """Are readings taken on the way, some one way and some the other?"""
        mean = self.way[:, self.way.any(axis=0)].mean(axis=1) if self.way.any() else np.ones(3)
        return bool(self.goes_on.mean() > _IN_ROWS and np.linalg.norm(mean) <= _TO_AND_FRO)

    def behind(self, lag_m: float, *places: Array) -> tuple[Array, ...]:
        """Where it reads while it passes places, x, y and z in m, each of shape (n,)."""
        return tuple(at - lag_m * way for at, way in zip(places, self.way, strict=True))

    def some(self, rows: Mask) -> Motion:
        """At some of the readings, as it was."""
        return Motion(self.way[:, rows], self.goes_on[rows])


def motion_of(x_m: Array, y_m: Array, z_m: Array, time_s: Array) -> Motion | None:
    """How a detector moved, in the order of its times; readings at one time, as of several wavelengths, share
    it.

    Parameters
    ----------
    x_m, y_m, z_m : arrays, shape (n,), m
    time_s : array, shape (n,), s

    Returns
    -------
    Motion, or None where times are missing, or places at one time differ
    """
    time, places = np.asarray(time_s, float), np.stack([x_m, y_m, z_m])
    if not np.isfinite(time).all():
        return None
    moments, first, of = np.unique(time, return_index=True, return_inverse=True)
    at = places[:, first]
    if len(moments) < 3 or not np.allclose(at[:, of], places):
        return None
    step = np.diff(at, axis=1)
    length = np.linalg.norm(step, axis=0)
    unit = np.divide(step, length, out=np.zeros_like(step), where=length > 0)
    before, after = np.pad(unit, ((0, 0), (1, 0))), np.pad(unit, ((0, 0), (0, 1)))
    goes_on = (before * after).sum(axis=0) > _GOES_ON
    begins = ~goes_on & np.append(goes_on[1:], False) & ~np.insert(goes_on[:-1], 0, False)
    still = ~before.any(axis=0)
    return Motion(np.where(begins | still, after, before)[:, of], goes_on[of])
