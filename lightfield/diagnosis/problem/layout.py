"""Where, when and in what order the readings were taken: all that the tests need to know of a layout."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array
from lightfield.readings import Readings
from lightfield.readings.columns import LINE_DECIMALS, PLACE_DECIMALS, WAVELENGTH_DECIMALS
from lightfield.scene.lamp.frame import angle_from_axis

Labels = NDArray[np.int_]

#: Correlation lengths of a smooth error of the model: across the beam and along it, in metres. Chosen: an
#: eighth of a scan and a third of the range of the tow tank's layout.
_ACROSS_M, _ALONG_M = 0.25, 1.5
#: A coordinate that varies by less, in metres or radians, does not vary. Chosen: rounding of a table.
LEAST_RANGE = 1e-6
#: Readings above this part of the largest one are bright: of all, or of those of their plane. Chosen: where
#: an error in per cent is one of the model, and not of the dark.
BRIGHT = 0.05
#: Added to the distance of readings in air, m, to tell them from those in water. Chosen: beyond any tank.
AIR_APART_M = 1e4
#: Of no more readings than this it is kept how alike their errors are. Chosen: memory alone.
_KEPT = 512


@dataclass(frozen=True)
class Layout:
    """Positions, channels and scan order of n readings.

    Parameters
    ----------
    x_m, y_m, z_m, time_s, wavelength_nm : array, shape (n,)
        NaN where unknown.
    air : array of bool, shape (n,)
    channel, plane, visit : array of int, shape (n,)
        Labels: wavelength; distance and medium; stay at one distance, as the table says or, where it does
        not, between two moves to another distance.
    order : array of int, shape (n,)
        Readings in scan order within each channel, channels one after the other.
    position : array, shape (n,)
        Place of each reading in the scan (0, 1, 2...): bands of one spectrum share it, and no two readings of
        one channel.
    spectrum : array of int, shape (n,)
        Labels from 0: place, time and repeat, where each channel occurs once.
    common : array, shape (n,)
        Standard error over the reading that those of one spectrum share, a part of the stated ones.
    """

    x_m: Array
    y_m: Array
    z_m: Array
    time_s: Array
    wavelength_nm: Array
    air: NDArray[np.bool_]
    channel: Labels
    plane: Labels
    visit: Labels
    order: Labels
    position: Array
    spectrum: Labels
    common: Array

    @property
    def size(self) -> int:
        return len(self.z_m)

    @property
    def has_time(self) -> bool:
        """Do the readings carry times that differ?"""
        return bool(np.isfinite(self.time_s).all() and np.ptp(self.time_s) > 0)

    @property
    def phase_of_scan(self) -> Array:
        """Time from -0.5 (first reading) to 0.5 (last), shape (n,); zeros without times."""
        if not self.has_time:
            return np.zeros(self.size)
        return np.asarray((self.time_s - self.time_s.min()) / np.ptp(self.time_s) - 0.5)

    @cached_property
    def angle_rad(self) -> Array:
        """Angle from the lamp's axis, shape (n,)."""
        return angle_from_axis(self.x_m, self.y_m, self.z_m)

    def alike(self, a: Labels, b: Labels) -> Array:
        """Correlation of an error that varies smoothly over places, between two sets of readings; none from
        water to air. Shape (len(a), len(b))."""
        one, other = self._scaled[a], self._scaled[b]
        # |p - q|^2 from one product of matrices, half as long as from differences.
        kernel = one @ other.T
        kernel -= 0.5 * (one**2).sum(axis=1)[:, None]
        kernel -= 0.5 * (other**2).sum(axis=1)
        np.exp(kernel, out=kernel)
        if self.air.any():
            kernel *= self.air[a][:, None] == self.air[b][None]
        return kernel

    def alike_among(self, rows: Labels) -> Array:
        """The same of some readings with each other; of few it is kept, for every covariance of them."""
        if len(rows) > _KEPT:
            return self.alike(rows, rows)
        key = rows.tobytes()
        if key not in self._alike:
            self._alike[key] = self.alike(rows, rows)
        return self._alike[key]

    @cached_property
    def _alike(self) -> dict[bytes, Array]:
        return {}

    def lag_of(self, rows: Labels) -> NDArray[np.int32]:
        """Readings that lie between two of some in the scan, shape (len(rows), len(rows))."""
        position = self.position[rows].astype(np.int32)
        return np.asarray(np.abs(np.subtract.outer(position, position)))

    @cached_property
    def lag(self) -> NDArray[np.int32]:
        """Between two of all: asked for where they are few, and for every covariance of them."""
        return self.lag_of(np.arange(self.size))

    @cached_property
    def one_channel(self) -> bool:
        """Are all readings of one channel?"""
        return bool((self.channel == self.channel[0]).all()) if self.size else True

    @cached_property
    def plane_and_channel(self) -> Labels:
        """Labels from 0: readings of one channel at one distance share theirs, shape (n,)."""
        label = self.plane * (1 + self.channel.max(initial=0)) + self.channel
        return np.unique(label, return_inverse=True)[1]

    @cached_property
    def moment(self) -> Labels:
        """Labels from 0: readings that were taken where the stage stood share theirs, shape (n,).

        The place is wrong once for every band of a spectrometer, and for repeats until it moves. Where no
        times are known those of one place and repeat were taken so.
        """
        if not self.has_time:
            return np.unique(self.spectrum, return_inverse=True)[1].ravel()
        at = np.stack([self.visit, self.air, *np.round([self.x_m, self.y_m, self.z_m], PLACE_DECIMALS)])
        place = np.unique(at, axis=1, return_inverse=True)[1].ravel()
        scan = np.lexsort((place, self.position))
        label = np.empty(self.size, int)
        label[scan] = np.cumsum(np.diff(place[scan], prepend=-1) != 0) - 1
        return label

    @cached_property
    def _scaled(self) -> Array:
        """Places from their middle, in the lengths over which a smooth error changes, shape (n, 3)."""
        places = np.column_stack([self.x_m / _ACROSS_M, self.y_m / _ACROSS_M, self.z_m / _ALONG_M])
        return np.asarray(places - places.mean(axis=0))

    def subset(self, rows: NDArray[np.bool_]) -> Layout:
        """Some of the readings."""
        place = np.cumsum(rows) - 1
        columns = {f.name: getattr(self, f.name)[rows] for f in fields(self) if f.name != "order"}
        columns["spectrum"] = np.unique(columns["spectrum"], return_inverse=True)[1]  # still from 0
        return Layout(**columns, order=place[self.order[rows[self.order]]])

    def varies(self, name: str) -> bool:
        """Does a coordinate ("x_m", "y_m", "z_m") take different values?"""
        return bool(np.ptp(getattr(self, name)) > LEAST_RANGE)


def layout_of(readings: Readings) -> Layout:
    """The layout of a reading table."""
    x, y, z = (np.asarray(getattr(readings, k), float) for k in ("x_m", "y_m", "z_m"))
    time = np.asarray(readings.time_s, float)
    wavelength = np.asarray(readings.wavelength_nm, float)
    air = np.asarray(readings.medium) == "air"
    _, channel = np.unique(
        np.nan_to_num(np.round(wavelength, WAVELENGTH_DECIMALS), nan=-1.0), return_inverse=True
    )
    _, plane = np.unique(np.round(z, LINE_DECIMALS) + AIR_APART_M * air, return_inverse=True)
    known = bool(np.isfinite(time).all())
    sequence = time if known else np.arange(len(z), dtype=float)
    by_time = np.argsort(sequence, kind="stable")
    named = np.asarray(readings.visit, float)
    if np.isfinite(named).all():
        _, visit = np.unique(np.stack([plane, named], axis=1), axis=0, return_inverse=True)
    elif known and np.ptp(time) > 0:
        turn = np.r_[True, np.diff(plane[by_time]) != 0]
        visit = np.empty(len(z), int)
        visit[by_time] = np.cumsum(turn) - 1
    else:
        visit = plane.copy()
    repeat = np.nan_to_num(np.asarray(readings.repeat, float), nan=-1.0)
    position = np.arange(len(z))
    if known and np.ptp(time) > 0:
        moment = np.stack([sequence, air, *np.round([x, y, z], PLACE_DECIMALS)])
        position = one_by_one(moment, repeat, channel)
    of_spectrum = np.nan_to_num([x, y, z, time, repeat], nan=-1.0)
    spectrum = np.unique([air, *of_spectrum], axis=1, return_inverse=True)[1].ravel()
    return Layout(
        x, y, z, time, wavelength, air, channel, plane, visit,
        np.lexsort((position, channel)), position.astype(float),
        spectrum, np.nan_to_num(np.asarray(readings.common_percent, float)) / 100,
    )  # fmt: skip


def one_by_one(moment: Array, repeat: Array, channel: Labels) -> Labels:
    """Places in the scan, shape (n,): those of one time by place, and there one after the other by repeat.

    A correlation along the scan is that of a reading with the next. Repeats and sensors that share a time are
    readings all the same, each with noise of its own.

    Parameters
    ----------
    moment : array, shape (k, n)
        Time, first, and place.
    repeat : array, shape (n,)
    channel : array of int, shape (n,)
        Readings of several channels at one moment are one spectrum.
    """
    at = np.unique(moment, axis=1, return_inverse=True)[1].ravel()
    order = np.lexsort((repeat, channel, at))
    first = np.r_[True, (np.diff(at[order]) != 0) | (np.diff(channel[order]) != 0)]
    since = np.arange(len(order)) - np.maximum.accumulate(np.where(first, np.arange(len(order)), 0))
    place = np.empty((2, len(order)), int)
    place[:, order] = at[order], since
    return np.asarray(np.unique(place, axis=1, return_inverse=True)[1].ravel())
