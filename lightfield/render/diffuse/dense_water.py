"""In which water to trace what the readings' water asks for.

A trace answers for waters near its own: far from it few photons carry all the weight. Clear waters share one;
denser ones have traces in geometric steps.
"""

from __future__ import annotations

import numpy as np

from lightfield.arrays import Array

#: Scattering of the water of the first trace. Waters that scatter less than the second number are answered by
#: it alone; denser ones by a trace in water that scatters as much as the third, or a power of the step more.
CLEAR_PER_M, CLEAR_TO_PER_M, _DENSE_FROM_PER_M, _DENSE_STEP = 0.2, 0.3, 0.43, 1.7
#: How far a trace reaches into denser water, as a factor in b; and the power of such a factor by which fits
#: fall short at least (0.06 to 0.1 where the farthest reading is 5 m away, 0.2 to 0.4 at 8.5 m).
REACH, _FALLS_SHORT = 1.05, 0.12


def dense_water(scattering_per_m: Array) -> float | None:
    """The largest of several scattering coefficients, m^-1; None where the first trace will do.

    Parameters
    ----------
    scattering_per_m : array, shape (n_wavelengths,)
    """
    most = float(scattering_per_m.max())
    return most if most > CLEAR_TO_PER_M else None


def trace_for(scattering_per_m: float, traced_per_m: float | None = None) -> float:
    """Scattering coefficient of the trace that dense water asks for, m^-1.

    Rather that of denser water than of clearer: photons that scattered too often weigh little there, while
    here they would be missing.

    Parameters
    ----------
    scattering_per_m : float
        Of the water.
    traced_per_m : float, optional
        Set when the water was found by a fit with the trace of another one. In denser water the rare photons
        that should carry the light are mostly missed, and a fit stops short of the truth.
    """
    b = scattering_per_m
    if traced_per_m is not None:
        b *= max(b / traced_per_m, 1.0) ** _FALLS_SHORT
    steps = np.ceil(np.log(b / (REACH * _DENSE_FROM_PER_M)) / np.log(_DENSE_STEP))
    return float(_DENSE_FROM_PER_M * _DENSE_STEP ** max(steps, 0))
