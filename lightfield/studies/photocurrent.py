"""Noise of a photocurrent: of its electrons, of what flows in the dark, and of the amplifier."""

from __future__ import annotations

import numpy as np

from lightfield.arrays import Array

#: Charge of the electron, C (exact in the SI, 2019).
ELECTRON_C = 1.602176634e-19


def variance(current_a: Array, dark_a: float, amplifier: float, bandwidth_hz: float) -> Array:
    """Variance of a current, A^2: (2 q (i + i_d) + i_n^2) B.

    Shot noise (Schottky 1918, doi:10.1002/andp.19183622304), and white noise of the amplifier.

    Parameters
    ----------
    current_a : array, A
    dark_a : float, A
        Ambient light, and dark current.
    amplifier : float, A Hz^-0.5
        Referred to the input.
    """
    return np.asarray((2 * ELECTRON_C * (current_a + dark_a) + amplifier**2) * bandwidth_hz)
