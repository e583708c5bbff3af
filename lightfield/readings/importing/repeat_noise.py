"""What a few repeats scatter by: their own scatter, and that of all other places."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.special import betaln, digamma, fdtrc, gammaln

from lightfield.arrays import Array, Mask

#: So many places with repeats tell how the scatter goes with the signal; fewer keep what each says of itself.
FEWEST_PLACES = 8
#: From so many degrees of freedom on, the places' true scatter is as good as one curve.
_ONE_CURVE = 1e3
#: A part of the noise that is so much less than the scatter found (in logarithms) is none.
_NONE = -16.0
#: A place is restless whose scatter would, were it like the others, be there in so many of all tables; as the
#: others are known from few repeats, found in 0 of 200 without a wild one, 2 % where places differ by eight
#: degrees of freedom.
_CHANCE = 1e-5
#: Of so many places, at most one is looked upon as restless: where many are, that is how places are.
_PER_RESTLESS = 10


def pooled_variance(signal: Array, exposure_s: Array, own: Array, repeats: Array) -> tuple[Array, Mask]:
    """Variance of one repeat at each place, from its own repeats and from all places.

    Three repeats know their scatter to a half only, and a mean divided by it has no variance (Student 1908:
    two degrees of freedom). All places together know how scatter goes with the signal: read noise, photons'
    noise and flicker, v = a / t^2 + b |s| / t + c s^2 (the photon transfer curve, Janesick 2007, with
    signals per second). Places may differ from that curve by more than chance; how much is told by the same
    numbers, and each place gets the mean of its own variance and the curve's, weighed by what each knows
    (Smyth 2004, equations 4 to 6, with a curve for the one prior variance). A place that is not like the
    others at all (a wild repeat) tells nothing of them, and keeps its own.

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
    variance : array, shape (n,)
        As `own` where fewer than `FEWEST_PLACES` places have repeats that differ.
    restless : mask, shape (n,)
        Places that are not like the others.
    """
    known, restless = np.isfinite(own) & (own > 0), np.zeros(len(own), bool)
    bright = np.median(np.abs(signal[known])) if known.any() else 0.0
    if np.count_nonzero(known) < FEWEST_PLACES or not np.isfinite(signal).all() or bright == 0:
        return own, restless
    time = exposure_s if np.isfinite(exposure_s).all() else np.ones(len(signal))
    level, time = np.abs(signal) / bright, time / np.median(time[known])
    noise = _Noise(np.stack([1 / time**2, level / time, level**2]), np.where(known, own, 0.0), repeats - 1.0)
    prior, trend = noise.fitted(known)
    for _ in range(len(own) // _PER_RESTLESS):
        like = known & ~restless
        worst = int(np.argmax(np.where(like, noise.own / trend, 0.0)))
        others = like & (np.arange(len(own)) != worst)
        if np.count_nonzero(others) < FEWEST_PLACES:
            break
        without = noise.fitted(others)
        chance = fdtrc(noise.of[worst], without[0], own[worst] / without[1][worst])
        if chance * np.count_nonzero(like) > _CHANCE:
            break
        restless[worst] = True
        prior, trend = without
    weight = np.where(known, noise.of, 0.0) * (prior <= _ONE_CURVE)
    return np.where(restless, own, (prior * trend + weight * noise.own) / (prior + weight)), restless


@dataclass(frozen=True)
class _Noise:
    """Scatter of places, and what it may be made of.

    Parameters
    ----------
    parts : array, shape (3, n)
        Read noise, photons' noise and flicker, of any size.
    own : array, shape (n,)
        Sample variances.
    of : array, shape (n,)
        Their degrees of freedom.
    """

    parts: Array
    own: Array
    of: Array

    def fitted(self, some: Mask) -> tuple[float, Array]:
        """Degrees of freedom that the curve is worth, and the curve, shape (n,): by maximum likelihood."""
        scale = float(np.median(self.own[some]))
        ratio, of, parts = self.own[some] / scale, self.of[some], self.parts[:, some]

        def misfit(logs: Array) -> tuple[float, Array]:
            each = np.exp(logs[:3, None]) * parts
            expected = each.sum(axis=0)
            density, by_ratio, by_prior = _log_density(ratio / expected, of, float(np.exp(logs[3])))
            by_expected = (1 + by_ratio) / expected
            slope = np.append(each @ by_expected, -by_prior.sum())
            return float(np.sum(np.log(expected) - density)), slope

        bounds = [(_NONE, 12.0)] * 3 + [(np.log(0.5), np.log(2 * _ONE_CURVE))]
        starts = [[*part, 3.0] for part in np.where(np.eye(3) > 0, 0.0, -8.0)]
        fits = [minimize(misfit, start, jac=True, method="L-BFGS-B", bounds=bounds) for start in starts]
        best = min(fits, key=lambda one: float(one.fun)).x
        return float(np.exp(best[3])), scale * np.asarray(np.exp(best[:3]) @ self.parts)


def _log_density(ratio: Array, of: Array, prior: float) -> tuple[Array, Array, Array]:
    """Of a sample variance over the curve's: chi-squared over its degrees of freedom, or F.

    And its slopes by the logarithms of ratio and prior; all of shape (n,).
    """
    n, d = of / 2, prior / 2
    if prior > _ONE_CURVE:
        density = n * np.log(n) - gammaln(n) + (n - 1) * np.log(ratio) - n * ratio
        return density, (n - 1) - n * ratio, np.zeros_like(ratio)
    part = ratio * n / d
    density = n * np.log(n / d) - betaln(n, d) + (n - 1) * np.log(ratio) - (n + d) * np.log1p(part)
    by_ratio = (n - 1) - (n + d) * part / (1 + part)
    by_prior = d * (digamma(n + d) - digamma(d) - np.log1p(part)) - n + (n + d) * part / (1 + part)
    return density, by_ratio, by_prior
