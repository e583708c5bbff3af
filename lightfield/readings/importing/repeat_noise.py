"""What a few repeats scatter by: their own scatter, and that of all other places."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize
from scipy.special import betaln, gammaln

from lightfield.arrays import Array

#: So many places with repeats tell how the scatter goes with the signal; fewer keep what each says of itself.
FEWEST = 8
#: From so many degrees of freedom on, the places' true scatter is as good as one curve.
_ONE_CURVE = 1e3
#: A part of the noise that is so much less than the scatter found (in logarithms) is none.
_NONE = -16.0


def pooled_variance(signal: Array, exposure_s: Array, own: Array, repeats: Array) -> Array:
    """Variance of one repeat at each place, from its own repeats and from all places.

    Three repeats know their scatter to a half only, and a mean divided by it has no variance (Student 1908:
    two degrees of freedom). All places together know how scatter goes with the signal: read noise, photons'
    noise and flicker, v = a / t^2 + b |s| / t + c s^2 (the photon transfer curve, Janesick 2007, with
    signals per second). Places may differ from that curve by more than chance; how much is told by the same
    numbers, and each place gets the mean of its own variance and the curve's, weighed by what each knows
    (Smyth 2004, equations 4 to 6, with a curve for the one prior variance).

    Parameters
    ----------
    signal : array, shape (n,)
        Mean of the repeats, per second where exposures are known.
    exposure_s : array, shape (n,), s
        Unknown ones are nan: then all count as equal.
    own : array, shape (n,)
        Sample variance; nan for a single one or equal ones.
    repeats : array, shape (n,)

    Returns
    -------
    array, shape (n,)
        As `own` where fewer than `FEWEST` places have repeats that differ.
    """
    known = np.isfinite(own) & (own > 0)
    if np.count_nonzero(known) < FEWEST or not np.isfinite(signal).all():
        return own
    time = exposure_s if np.isfinite(exposure_s).all() else np.ones(len(signal))
    level = np.abs(signal) / np.median(np.abs(signal[known]))
    time = time / np.median(time[known])
    parts = np.stack([1 / time**2, level / time, level**2])
    of, scale = repeats - 1.0, float(np.median(own[known]))

    def curve(logs: Array) -> Array:
        return np.asarray(np.exp(logs[:3]) @ parts)

    def misfit(logs: Array) -> float:
        expected = curve(logs)[known]
        prior = float(np.exp(logs[3]))
        return -float(
            np.sum(_log_density(own[known] / scale / expected, of[known], prior) - np.log(expected))
        )

    bounds = [(_NONE, 12.0)] * 3 + [(np.log(0.5), np.log(2 * _ONE_CURVE))]
    starts = [[*part, 3.0] for part in np.where(np.eye(3) > 0, 0.0, -8.0)]
    fits = [minimize(misfit, start, method="L-BFGS-B", bounds=bounds) for start in starts]
    best = min(fits, key=lambda one: float(one.fun)).x
    prior = float(np.exp(best[3]))
    trend = scale * curve(best)
    if prior > _ONE_CURVE:
        return trend
    weight = np.where(known, of, 0.0)
    return np.asarray((prior * trend + weight * np.where(known, own, 0.0)) / (prior + weight))


def _log_density(ratio: Array, of: Array, prior: float) -> Array:
    """Of a sample variance over the curve's: chi-squared over its degrees of freedom, or F."""
    n, d = of / 2, prior / 2
    if prior > _ONE_CURVE:
        return np.asarray(n * np.log(n) - gammaln(n) + (n - 1) * np.log(ratio) - n * ratio)
    return np.asarray(
        n * np.log(n / d) - betaln(n, d) + (n - 1) * np.log(ratio) - (n + d) * np.log1p(ratio * n / d)
    )
