"""Water that changes while readings are taken: absorption that grows steadily, particles that settle."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from lightfield.arrays import Array
from lightfield.scene.acts import Acts
from lightfield.scene.parameters import switched_off
from lightfield.scene.water.coefficients import colour_of_particles
from lightfield.scene.water.constituents import REFERENCE_NM
from lightfield.scene.water.water import Water

_SECONDS = 3600.0


def ages(water: Water) -> bool:
    """Does the water change in time?"""
    return not switched_off(water, Acts.AGEING)


def growth_per_m(water: Water, time_s: ArrayLike, wavelength_nm: ArrayLike = REFERENCE_NM) -> Array:
    """Attenuation coefficient over that at time 0, 1/m: d t - b_s (1 - exp(-t / tau)).

    Parameters
    ----------
    water : Water
        drift_per_m_per_hour (d), settling_per_m (b_s), settling_time_s (tau).
    time_s : array, s
        NaN (unknown) counts as 0.
    wavelength_nm : array, nm, optional
        Of each, where what settles has a colour.
    """
    t = np.nan_to_num(np.asarray(time_s, dtype=float))
    settled = -np.expm1(-t / water.settling_time_s)
    if water.scattering_slope or water.scattering_departure:
        settled = settled * colour_of_particles(water, wavelength_nm)
    return np.asarray(water.drift_per_m_per_hour * t / _SECONDS - water.settling_per_m * settled)


def at_time(water: Water, time_s: float) -> Water:
    """The water of one moment, which changes no more."""
    absorbed = water.absorption_per_m + water.drift_per_m_per_hour * time_s / _SECONDS
    left = water.settling_per_m * float(np.exp(-time_s / water.settling_time_s))
    now = {"absorption_per_m": absorbed, "settling_per_m": 0.0, "drift_per_m_per_hour": 0.0}
    return water.model_copy(update=now | {"scattering_per_m": water.scattering_per_m + left})


def moments(water: Water, time_s: ArrayLike, path_m: ArrayLike, count: int) -> tuple[Array, Array]:
    """A few moments whose waters stand for all: what light has beside its attenuation lies between.

    Polynomials through the zeros of a Chebyshev polynomial, in the part of the particles that has settled
    or, where none do, in time; the attenuation along the straight line is that of each time itself.

    Parameters
    ----------
    time_s : array, shape (n,), s
        NaN (unknown) counts as 0.
    path_m : array, shape (n,), m
        Straight lines from the lamp in the water.
    count : int
        Moments at most.

    Returns
    -------
    moments : array, shape (k,), s
    shares : array, shape (k, n)
        Light at time i is the sum over k of shares[k, i] x light at moment k.
    """
    t, tau = np.nan_to_num(np.asarray(time_s, dtype=float)), water.settling_time_s
    settles, first = bool(water.settling_per_m), float(t.min())
    # From the first reading on: of particles that settled long before it nothing would be left to tell.
    u = -np.expm1(-(t - first) / tau) if settles else t
    low, high = float(u.min()), float(u.max())
    if low == high:
        return t[:1], np.ones((1, len(t)))
    path = np.asarray(path_m, dtype=float)
    unit = np.cos((np.arange(count) + 0.5) * np.pi / count)
    at = 0.5 * (low + high) + 0.5 * (high - low) * unit
    shares = np.ones((count, len(t)))
    for k in range(count):
        for j in range(count):
            if j != k:
                shares[k] *= (u - at[j]) / (at[k] - at[j])
    chosen = first - tau * np.log1p(-at) if settles else at
    return chosen, shares * np.exp((growth_per_m(water, chosen)[:, None] - growth_per_m(water, t)) * path)
