"""Curves to hide: gains of planes, and departures that bend slowly over time, distance or wavelength."""

from __future__ import annotations

import numpy as np

from lightfield.arrays import Array
from lightfield.fitting.curves import (
    ABSORPTION,
    AMBIENT,
    BACKGROUND,
    COLOUR,
    HALO,
    PLANES,
    POWER,
    SPECTRUM,
    field_of,
)
from lightfield.fitting.effects import Effect
from lightfield.readings import Readings
from lightfield.readings.columns import LINE_DECIMALS
from lightfield.scene.curve import Nodes

#: Nodes of a hidden curve that bends, and half waves that it is made of: what a lamp, a filter or a layer
#: does. Chosen.
_NODES, _WAVES = 25, 3
#: What one amplitude is worth in the unit of the curve: of logarithms a part; of absorption 1/m, seen over
#: several metres; of a background that part of the brightest reading.
_UNIT = {
    PLANES: 1.0,
    POWER: 1.0,
    SPECTRUM: 1.0,
    BACKGROUND: 1.0,
    HALO: 1.0,
    AMBIENT: 1.0,
    ABSORPTION: 0.2,
    COLOUR: 0.2,
}
_COORDINATE = {PLANES: "z_m", ABSORPTION: "z_m", POWER: "time_s", AMBIENT: "time_s"}
_COORDINATE |= dict.fromkeys((SPECTRUM, COLOUR, HALO, BACKGROUND), "wavelength_nm")


def field_to_hide(effect: Effect) -> str | None:
    """The scene's curve that a free-form effect stands for; None where only a table can state it."""
    field = field_of(effect.paths[0])
    return field if field in _UNIT else None


def draw_curve(field: str, size: float, readings: Readings, rng: np.random.Generator) -> Nodes:
    """A curve of a given rms, over all places, times or wavelengths of some readings.

    Parameters
    ----------
    field : str
        As `field_to_hide` gives it.
    size : float
        Of its logarithm; of absorption five times as many 1/m. Of a background, which is none at its darkest
        wavelength or time, over the brightest reading.
    """
    at = np.asarray(getattr(readings, _COORDINATE[field]), float)
    if field == PLANES:
        place = np.unique(np.round(at, LINE_DECIMALS))
        value: Array = rng.standard_normal(len(place))
    else:
        place = np.linspace(at.min(), at.max(), _NODES)
        waves = np.cos(np.pi * np.outer(np.linspace(0, 1, _NODES), 1 + np.arange(_WAVES)))
        value = waves @ (rng.standard_normal(_WAVES) / (1 + np.arange(_WAVES)))
    value = value - (value.min() if field in (BACKGROUND, AMBIENT) else value.mean())
    value *= size * _UNIT[field] / float(np.sqrt(np.mean(value**2)))
    return tuple(zip(place.tolist(), value.tolist(), strict=True))
