"""Standard errors as a table quotes them, smoothed: a curve over the signal; and what is assumed without."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from lightfield.arrays import Array

#: Assumed when a table has hardly any standard errors: relative part, constant part over the largest reading.
#: Chosen: a spectrometer's; the summary says so, and a factor on both is estimated from the readings.
ASSUMED_RELATIVE, ASSUMED_FLOOR = 0.01, 0.001
#: Standard deviation of a normal distribution over its median absolute deviation (Rousseeuw and Croux 1993,
#: doi:10.1080/01621459.1993.10476408).
MAD_TO_SIGMA = 1.4826
#: A quoted error so many times the curve's was marked as poor on purpose. Chosen: errors of ten samples
#: scatter by a quarter, and by chance one of 25,000 is as tall.
_TALL = 2.0
#: Fewer standard errors than this say nothing about the others. Derived: the curve has three coefficients.
_FEWEST_STATED = 4
#: Fit of the variance curve: rounds of reweighting; spread of ln(variance) that is no scatter; spreads at
#: which a weight is a half; smallest variance over the median one. Chosen: the curve of 300 errors that
#: scatter by 11 % is good to 3 % (test_noise.py).
_CURVE_ROUNDS, _LEAST_SPREAD, _HALF_WEIGHT, _SMALLEST_VARIANCE = 8, 0.05, 4.0, 1e-4
#: A group has a factor of its own when so many errors are off by so many standard errors of their median,
#: which is 1.25 = sqrt(pi / 2) times that of a mean. Chosen: by chance one group in a million does.
_FEWEST_IN_GROUP, _GROUP_SIGMA, _MEDIAN_ERROR = 8, 5.0, 1.25
#: Groups have units of their own where stated errors scatter by less than this part about such a law.
#: Chosen: by chance those of one law hardly do.
_CLEARER = 0.8
#: Least part of a standard error that is a reading's own, where the rest is shared with others. Chosen: a
#: lamp's flicker is that of its temperature, some half more in the blue than in the red, and bands of a
#: spectrum agree no better than that.
OWN_PART = 0.2
#: Light below this part of the largest error is none. Derived: squares in between would be no numbers.
NO_LIGHT = 1e-100


def errors_stated(quoted: Array) -> bool:
    """Does the table quote enough standard errors to go by?"""
    return int(_stated(quoted).sum()) >= _FEWEST_STATED


def _stated(quoted: Array) -> NDArray[np.bool_]:
    """Which readings have a standard error, shape (n,)."""
    return np.asarray(np.isfinite(quoted) & (quoted > 0))


def smooth_stderr(quoted: Array, prediction: Array, group: NDArray[np.int_]) -> Array:
    """Standard error as a function of the predicted reading, shape (n,).

    Errors estimated from a few dozen samples scatter by 10 %; weights made from them would carry that scatter
    into every template. The variance is read noise + shot noise + proportional noise,
    s^2 = c0 + c1 f + c2 f^2 with c >= 0, evaluated at the prediction f, never at the noisy reading.

    Parameters
    ----------
    quoted : array, shape (n,)
        Standard errors of the table; NaN where unknown.
    prediction : array, shape (n,)
    group : array of int, shape (n,)
        Readings of one group may share a factor (integration time, channel).
    """
    top, lit = _top(quoted, prediction)
    if not errors_stated(quoted):
        level = np.clip(prediction, 0, None) / top * lit
        return np.asarray(top * np.sqrt(ASSUMED_FLOOR**2 + (ASSUMED_RELATIVE * level) ** 2))
    units = [np.full(len(prediction), top)]
    if len(groups := np.unique(group)) > 1:
        # Bands that are calibrated each by itself share a law only in parts of their own brightest reading.
        own = np.empty(len(prediction))
        for label in groups:
            mine = group == label
            own[mine] = _top(quoted[mine], prediction[mine])[0]
        units.append(own)
    laws = [_law(quoted / unit, np.clip(prediction, 0, None) / unit * lit, group) for unit in units]
    chosen = -1 if laws[-1][1] < _CLEARER * laws[0][1] else 0
    sigma = units[chosen] * laws[chosen][0]
    # A reading whose own error is far above the curve was marked as poor on purpose.
    poor = _stated(quoted) & (np.nan_to_num(quoted) > _TALL * sigma)
    return np.asarray(np.where(poor, np.nan_to_num(quoted), sigma))


def _top(quoted: Array, prediction: Array) -> tuple[float, bool]:
    """What readings are parts of, and whether that is light: a model without any, or with next to none, has
    the errors of the dark."""
    brightest, largest = float(np.max(np.abs(prediction))), float(np.nan_to_num(quoted).max(initial=0.0))
    lit = brightest > NO_LIGHT * largest
    return (brightest if lit else largest) or 1.0, lit


def _law(quoted: Array, level: Array, group: NDArray[np.int_]) -> tuple[Array, float]:
    """Smoothed errors, shape (n,), and how far the logarithms of the stated variances lie from theirs in the
    mean, where those marked as poor are not far."""
    basis = np.stack([np.ones_like(level), level, level**2], axis=1)
    known = _stated(quoted)
    variance = quoted[known] ** 2
    # Neither what was marked as poor on purpose nor what is far too small leads the first fit.
    fitted = np.maximum(variance, np.median(variance))
    robust = np.ones_like(fitted)
    curve = np.zeros(3)
    for _ in range(_CURVE_ROUNDS):
        weight = robust / fitted
        curve = nnls(basis[known] * weight[:, None], variance * weight)[0]
        fitted = np.maximum(basis[known] @ curve, _SMALLEST_VARIANCE * np.median(variance))
        misfit = np.log(variance / fitted)
        spread = MAD_TO_SIGMA * np.median(np.abs(misfit - np.median(misfit))) + _LEAST_SPREAD
        # A sum of squares feels a tall variance in proportion, of which no weight of its logarithm takes all.
        robust = np.minimum(1.0, _TALL**2 * fitted / variance) / (1 + (misfit / (_HALF_WEIGHT * spread)) ** 2)
    smooth = np.maximum(basis @ curve, _SMALLEST_VARIANCE * np.median(variance))
    factor = np.ones_like(smooth)
    for label in np.unique(group):
        members = (group == label)[known]
        if members.sum() >= _FEWEST_IN_GROUP:
            shift = float(np.median(misfit[members]))
            if abs(shift) > _GROUP_SIGMA * _MEDIAN_ERROR * spread / np.sqrt(members.sum()):
                factor[group == label] = np.exp(shift)
    off = np.abs(misfit - np.log(factor[known]))
    return np.sqrt(smooth * factor), _LEAST_SPREAD + float(np.minimum(off, 2 * np.log(_TALL)).mean())


def own_part(sigma: Array, shared: Array) -> Array:
    """What is left of standard errors without the part that other readings share, shape (n,)."""
    return np.asarray(np.sqrt(np.maximum(sigma**2 - shared**2, (OWN_PART * sigma) ** 2)))
