"""Light of every place and colour of a table: means over the repeats in one medium, with their errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array, Mask
from lightfield.diagnosis.problem.quoted import ASSUMED_RELATIVE
from lightfield.errors import MeasurementError
from lightfield.formula.readout import Taken, halves, signal_of, spectra, time_factor
from lightfield.readings import Readings
from lightfield.readings.columns import PLACE_DECIMALS, WAVELENGTH_DECIMALS
from lightfield.scene import Scene
from lightfield.studies.attenuation.remark import Remark, Studied

#: Readings below so many of their standard errors have no useful logarithm: its bias, half the squared
#: relative error, would reach the error of a stay (0.3 %).
FAINT_SIGMA = 12.0
#: Repeats from which an error that the table does not state is taken.
_FEWEST_REPEATS = 3


class PairMeans(NamedTuple):
    """Mean of the repeats of every place and colour, and its standard error; NaN where there are none."""

    mean: Array
    error: Array


@dataclass(frozen=True, eq=False)
class Pairs:
    """Places, shape (n_places, 3), m, and colours, nm, of a table, and which of them each reading is of."""

    places: Array
    place: NDArray[np.int_]
    wavelength_nm: Array
    colour: NDArray[np.int_]

    @classmethod
    def of(cls, table: Readings) -> Pairs:
        places, place = _labels(table.x_m, table.y_m, table.z_m, decimals=PLACE_DECIMALS)
        colours, colour = _labels(table.wavelength_nm, decimals=WAVELENGTH_DECIMALS)
        return cls(places, place, colours[:, 0], colour)

    @property
    def shape(self) -> tuple[int, int]:
        return len(self.places), len(self.wavelength_nm)

    @property
    def number(self) -> NDArray[np.int_]:
        """Number of the place and colour of each reading."""
        return self.place * len(self.wavelength_nm) + self.colour

    def means(self, light: Array, relative: Array, chosen: Mask) -> PairMeans:
        """Of the chosen among the readings."""
        pair, size = self.number[chosen], self.shape[0] * self.shape[1]
        count = np.bincount(pair, minlength=size)
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = np.bincount(pair, light[chosen], size) / count
            error = np.sqrt(np.bincount(pair, (relative * light)[chosen] ** 2, size)) / count
        return PairMeans(mean.reshape(self.shape), error.reshape(self.shape))

    def first(self, which: Mask) -> str:
        """Place and wavelength of the first of some pairs, shape (n_places, n_colours), in words."""
        k, colour = np.argwhere(which)[0]
        (x, y, z), at = self.places[k], self.wavelength_nm[colour]
        aside = f"x = {x:g}, y = {y:g}, " if x or y else ""
        return f"{aside}z = {z:g} m" + (f", {at:g} nm" if np.isfinite(at) else "")


def light_as_steady(table: Readings, scene: Scene, air: Mask, full: float) -> tuple[Array, Array]:
    """The light that was read as if the lamp were steady, and its derivative by the reading.

    Without what the scene says of background, planes' gains, saturation, stray light and second order.
    """
    spectrum = spectra(table.x_m, table.y_m, table.z_m, air, table.time_s)
    overlap = halves(spectrum, table.wavelength_nm)
    taken = Taken(air, spectrum, table.time_s, overlap, table.z_m, table.wavelength_nm)
    light, slope = signal_of(scene, table.value, full, taken)
    if np.isnan(light).any():
        raise MeasurementError(
            "readings are larger than this instrument shows", where=table.source or None,
            found=f"{int(np.isnan(light).sum())} of {len(light)}",
            rule="what detector.saturation leaves of any light",
            remedy="correct detector.saturation, or mark what saturates in the column saturated",
        )  # fmt: skip
    steady = time_factor(scene, table.time_s)
    return light / steady, slope / steady


def relative_errors(
    table: Readings, light: Array, slope: Array, pair: NDArray[np.int_], air: Mask
) -> tuple[Array, list[Remark]]:
    """Standard error over the light of each reading, from the table, from repeats, or assumed; and what was
    assumed."""
    with np.errstate(divide="ignore", invalid="ignore"):
        stated = np.abs(table.stderr * slope / light)
    missing = ~(np.isfinite(stated) & (table.stderr > 0))
    if not missing.any():
        return stated, []
    _, label, count = np.unique(2 * pair + air, return_inverse=True, return_counts=True)
    label = label.ravel()
    mean = np.bincount(label, light) / count
    squared = np.bincount(label, (light - mean[label]) ** 2)
    # What lies within its own scatter around nothing has no relative error: an absolute one, of all such.
    dark = mean**2 * count * (count - 1) < FAINT_SIGMA**2 * squared
    free = np.where(dark, 0, count - 1)
    if count.max() >= _FEWEST_REPEATS and free.sum() > 0:
        scatter = float(np.sqrt((squared[~dark] / mean[~dark] ** 2).sum() / free.sum()))
        studied = Studied.STDERR_FROM_REPEATS
    else:
        scatter, studied = ASSUMED_RELATIVE, Studied.STDERR_ASSUMED
    error = np.full(len(light), scatter)
    if dark.any():
        absolute = np.sqrt(squared[dark].sum() / (count - 1)[dark].sum())
        with np.errstate(divide="ignore"):
            error = np.where(dark[label], absolute / np.abs(light), scatter)
    note = Remark(studied, int(missing.sum()), percent=100 * scatter)
    return np.where(missing, error, stated), [note]


def _labels(*columns: Array, decimals: int) -> tuple[Array, NDArray[np.int_]]:
    """Different rows of rounded columns, shape (n, n_columns), and which of them each is."""
    rows, label = np.unique(np.round(np.stack(columns, 1), decimals) + 0.0, axis=0, return_inverse=True)
    return rows, label.ravel()
