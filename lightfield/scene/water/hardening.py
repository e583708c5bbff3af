"""Attenuation that differs within a band: what is dimmed most is gone first, and what is left goes farther.

    -ln T = K r - (q r)^2 / 2

is the mean over attenuations that are spread normally about K, with a standard deviation of q: along one way
in closed form, over many ways at once from a few attenuations that stand for all.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lightfield.arrays import Array
from lightfield.scene.water.water import Water

#: Gauss-Hermite quadrature of a normal distribution: deviations in units of its own, and their shares.
_DEVIATIONS, _WEIGHTS = np.polynomial.hermite_e.hermegauss(5)
_SHARES = _WEIGHTS / _WEIGHTS.sum()


def hardening_depth(water: Water, path_m: Any) -> Any:
    """Optical depth that a path has less than K r, (q r)^2 / 2.

    Parameters
    ----------
    water : Water
        hardening_per_m (q).
    path_m : array of NumPy or Dr.Jit, m
        Way through the water.
    """
    spread = water.hardening_per_m * path_m
    return 0.5 * (spread * spread)


def within_band(hardening_per_m: float) -> tuple[Array, Array]:
    """Changes of the attenuation within a band, 1/m, and the share of each; without a spread one, of 0.

    Parameters
    ----------
    hardening_per_m : float, 1/m
    """
    if not hardening_per_m:
        return np.zeros(1), np.ones(1)
    return hardening_per_m * _DEVIATIONS, _SHARES
