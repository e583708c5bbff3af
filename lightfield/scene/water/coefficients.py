"""Absorption and scattering coefficients of a scene's water at given wavelengths."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from lightfield.arrays import Array
from lightfield.errors import SceneError
from lightfield.scene.acts import Acts
from lightfield.scene.curve import value_at
from lightfield.scene.parameters import switched_off
from lightfield.scene.water.constituents import (
    REFERENCE_NM,
    cdom_absorption_per_m,
    chlorophyll_absorption_per_m,
    chlorophyll_scattering_per_m,
    scattering_shape,
    sediment_absorption_per_m,
    sediment_scattering_per_m,
)
from lightfield.scene.water.library import list_presets, pure_water_absorption
from lightfield.scene.water.molecular import molecular_scattering_per_m
from lightfield.scene.water.phase.molecular import forward_weight
from lightfield.scene.water.phase.of_scene import phase_function
from lightfield.scene.water.water import Water
from lightfield.storage.tables import read_columns


def is_grey(water: Water) -> bool:
    """Whether absorption and scattering are the same at all wavelengths.

    Parameters
    ----------
    water : Water
        Of a scene.
    """
    return switched_off(water, Acts.COLOUR)


def absorption_per_m(water: Water, wavelength_nm: ArrayLike) -> Array:
    """Absorption coefficient a: base + grey part + points + chlorophyll + CDOM + sediment + departure.

    Parameters
    ----------
    water : Water
        Of a scene.
    wavelength_nm : array, nm
        Where.

    Returns
    -------
    array, 1/m
        Shape of `wavelength_nm`. Gradient, layer and hardening are left to the path, see `formula.path`.

    Raises
    ------
    SceneError
        A wavelength outside the base's table.
    """
    w = np.asarray(wavelength_nm, dtype=float)
    if is_grey(water):
        return np.full(w.shape, water.absorption_per_m)
    a = _base(water, w)[0] + water.absorption_per_m
    if water.absorption_at:
        known, there = zip(*water.absorption_at, strict=True)
        a = a + np.interp(w, known, there)
    if water.chlorophyll_mg_per_m3:
        a = a + chlorophyll_absorption_per_m(water.chlorophyll_mg_per_m3, w)
    if water.cdom_440_per_m:
        a = a + cdom_absorption_per_m(water.cdom_440_per_m, water.cdom_slope_per_nm, w)
    if water.sediment_g_per_m3:
        a = a + sediment_absorption_per_m(water.sediment_g_per_m3, w)
    if water.colour_departure:  # a curve that is fitted may ask for less than nothing
        a = np.maximum(a + value_at(water.colour_departure, w), 0.0)
    return a


def scattering_per_m(water: Water, wavelength_nm: ArrayLike) -> Array:
    """Scattering coefficient b: base + grey part + the particles that come with chlorophyll + sediment.

    Parameters
    ----------
    water : Water
        Of a scene; of water that changes, at time 0.
    wavelength_nm : array, nm
        Where.

    Returns
    -------
    array, 1/m
        Shape of `wavelength_nm`.

    Raises
    ------
    SceneError
        A wavelength outside the base's table.
    """
    w = np.asarray(wavelength_nm, dtype=float)
    grey = water.scattering_per_m + water.settling_per_m
    if is_grey(water):
        return np.full(w.shape, grey)
    b = _base(water, w)[1] + grey * colour_of_particles(water, w)
    if water.chlorophyll_mg_per_m3:
        b = b + chlorophyll_scattering_per_m(water.chlorophyll_mg_per_m3, w)
    if water.sediment_g_per_m3:
        b = b + sediment_scattering_per_m(water.sediment_g_per_m3, w)
    return b


def colour_of_particles(water: Water, wavelength_nm: ArrayLike) -> Array:
    """What the scene's own scattering is, over that which it states, at 550 nm: shape of `wavelength_nm`.

    Parameters
    ----------
    water : Water
        scattering_slope, scattering_departure.
    wavelength_nm : array, nm
        Where.
    """
    shape = scattering_shape(water.scattering_slope, wavelength_nm)
    if not water.scattering_departure:
        return shape
    at = value_at(water.scattering_departure, np.append(np.asarray(wavelength_nm, float), REFERENCE_NM))
    return shape * np.exp(at[:-1] - at[-1]).reshape(shape.shape)


def molecular_per_m(water: Water, wavelength_nm: ArrayLike) -> Array:
    """The part of the scattering coefficient that is molecular, 1/m: of a base of pure water.

    Bases that were measured, and tables, hold it too, but do not say how much it is.
    """
    w = np.asarray(wavelength_nm, dtype=float)
    return _base(water, w)[1] if water.base == "pure" else np.zeros_like(w)


def coefficients_in(water: Water, wavelength_nm: ArrayLike, molecular_share: float) -> tuple[Array, Array]:
    """Absorption and scattering coefficient with which a tally answers, shape of `wavelength_nm`, 1/m.

    A tally counts scatterings, of particles or of molecules, in the mixture that it was traced in; at other
    wavelengths it is another. What molecules scatter hardly reaches readings in a beam, so particles are
    counted as they are, molecules by their `forward_weight`, and the attenuation stays.

    Parameters
    ----------
    water : Water
        Of a scene.
    wavelength_nm : array, nm
    molecular_share : float
        Part of the traced scattering coefficient that is molecular.
    """
    a, b = absorption_per_m(water, wavelength_nm), scattering_per_m(water, wavelength_nm)
    if not molecular_share and water.base != "pure":
        return a, b
    weight = forward_weight(phase_function(water.phase))
    counted = b - (1 - weight) * molecular_per_m(water, wavelength_nm)
    counted /= 1 - (1 - weight) * molecular_share
    return a + b - counted, counted


def clearest_in(water: Water, bands_nm: Iterable[tuple[float, float]]) -> tuple[float, float]:
    """Wavelength within bands at which the water absorbs least, nm, and how much, 1/m; to the nanometre.

    Parameters
    ----------
    bands_nm : (from, to) of each, nm
        Where the base is known for their part of them.
    """
    each = []
    for low, high in bands_nm:
        known = known_nm(water)
        inside = np.linspace(low, high, max(2, round(high - low) + 1))
        each.append(np.clip(inside, *known) if high > known[0] and low < known[1] else inside)
    at = np.concatenate(each)
    absorption = absorption_per_m(water, at)
    least = int(absorption.argmin())
    return float(at[least]), float(absorption[least])


def known_nm(water: Water) -> tuple[float, float]:
    """First and last wavelength that the water's base is known for, nm; unlimited without a spectrum."""
    known: Array = np.zeros(0)
    if water.base == "pure":
        known = pure_water_absorption()[0]
    elif water.base == "table":
        known = read_columns(str(water.table), ("wavelength_nm", "absorption_per_m", "scattering_per_m"))[0]
    elif water.base != "none":
        known = list_presets()[water.base].wavelength_nm
    return (float(known[0]), float(known[-1])) if len(known) > 1 else (-np.inf, np.inf)


def _base(water: Water, w: Array) -> tuple[Array, Array]:
    """Absorption and scattering of the base water."""
    if water.base == "none":
        return np.zeros_like(w), np.zeros_like(w)
    if water.base == "pure":
        return _pure(w.tobytes(), w.shape, water.temperature_c, water.salinity_psu)
    if water.base == "table":
        known, a, b = read_columns(
            str(water.table), ("wavelength_nm", "absorption_per_m", "scattering_per_m")
        )
    else:
        preset = list_presets()[water.base]
        known, a, b = preset.wavelength_nm, preset.absorption_per_m, preset.scattering_per_m
    if len(known) > 1:
        _inside(w, known, water.base)
    return np.interp(w, known, a), np.interp(w, known, b)


@lru_cache(maxsize=64)
def _pure(
    wavelengths: bytes, shape: tuple[int, ...], temperature_c: float, salinity_psu: float
) -> tuple[Array, Array]:
    """Remembered, because a fit asks for the same wavelengths thousands of times."""
    w = np.frombuffer(wavelengths).reshape(shape)
    known, absorption, gradient = pure_water_absorption()
    _inside(w, known, "pure")
    a = np.interp(w, known, absorption) + (temperature_c - 20.0) * np.interp(w, known, gradient)
    return a, molecular_scattering_per_m(w, temperature_c, salinity_psu)


def _inside(w: Array, known: Array, name: str) -> None:
    if w.size and (w.min() < known[0] or w.max() > known[-1]):
        raise SceneError(
            "wavelength outside the water's table", where=f'water.base "{name}"',
            found=f"{w.min():g} to {w.max():g} nm", rule=f"{known[0]:g} to {known[-1]:g} nm",
            remedy="choose bands inside the table, or another base",
        )  # fmt: skip
