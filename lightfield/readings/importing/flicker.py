"""What repeats scatter by: each band by itself, and a lamp's flicker, which all bands of a spectrum share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lightfield.arrays import Array, Mask
from lightfield.readings.importing.repeat_noise import pooled_variance

#: So many degrees of freedom tell what bands have in common; so many errors of it are no chance.
_FEWEST, _SIGMAS = 8, 3.0
#: Rounds in which bands' own scatter and their weights are found, and the part of the variance that each
#: begins with at least. Chosen: a third round moves the own scatter by up to three hundredths, and 40 places
#: with three repeats know it to six.
_ROUNDS, _BEGIN = 2, 0.04


@dataclass(frozen=True)
class RepeatScatter:
    """Scatter of one repeat.

    Parameters
    ----------
    variance : array, shape (n_places, n_bands)
        NaN where none can be told.
    common : array, shape (n_places, n_bands)
        The part of it that all bands of a spectrum share.
    restless : mask, shape (n_places, n_bands)
        Places whose repeats are not like the others'.
    """

    variance: Array
    common: Array
    restless: Mask

    def of(self, place: int, band: int) -> tuple[float, float]:
        """Standard deviation, and of the part that bands share."""
        return float(np.sqrt(self.variance[place, band])), float(np.sqrt(self.common[place, band]))


def repeat_scatter(values: Sequence[Array], exposure_s: Array) -> RepeatScatter:
    """Scatter of repeats at all places, told by all of them together.

    A lamp that flickers does so to a whole spectrum: it is one factor to all bands of a repeat. Where the
    bands show one beyond chance, each band's own scatter is that about the factor, and the whole is both.

    Parameters
    ----------
    values : sequence of arrays, shape (n_repeats, n_bands)
        Of each place.
    exposure_s : array, shape (n_places,), s
    """
    with np.errstate(over="ignore", invalid="ignore"):
        mean = np.array([some.mean(axis=0) for some in values])
    repeats = np.array([len(some) for some in values])
    scatter = np.array([_variance(some) for some in values])
    variance, restless = _pooled(mean, exposure_s, scatter, repeats)
    bands = mean.shape[1]
    wild = restless.sum(axis=1)
    lit = (mean > 0) & np.isfinite(variance) & (wild == 0)[:, None]
    asked = lit & ((repeats > 1) & (lit.sum(axis=1) > 1))[:, None]
    common = np.zeros_like(variance)
    off = [_off_mean(some) for some in values]
    flicker = _flicker(off, variance, mean, asked) if bands > 1 else 0.0
    if flicker > 0:
        own = np.maximum(variance - (flicker * mean) ** 2, _BEGIN * variance)
        for _ in range(_ROUNDS):
            scattered = np.full_like(own, np.nan)
            for k in np.flatnonzero(asked.any(axis=1)).tolist():
                told = asked[k]
                scattered[k, told] = _about_factor(off[k][:, told], mean[k, told], own[k, told])
            own, _ = _pooled(mean, exposure_s, scattered, repeats)
            # Weights that knew how far the factor went at a place would prefer where it went less.
            flicker = _flicker(off, own + (flicker * mean) ** 2, mean, asked)
        shared = (flicker * mean) ** 2
        variance = np.where(lit, own + shared, variance)
        common = np.where(lit, np.minimum(shared, variance), 0.0)
    if bands > 1:  # what made a whole spectrum wild made all its bands so
        common = np.where((wild == bands)[:, None], variance, common)
    return RepeatScatter(variance, common, restless)


def _pooled(mean: Array, exposure_s: Array, own: Array, repeats: Array) -> tuple[Array, Mask]:
    """`pooled_variance` of every band, both of shape (n_places, n_bands)."""
    each = [pooled_variance(m, exposure_s, o, repeats) for m, o in zip(mean.T, own.T, strict=True)]
    return np.stack([one[0] for one in each], axis=1), np.stack([one[1] for one in each], axis=1)


def _variance(some: Array) -> Array:
    """Sample variance of every band; NaN of a single repeat, or of equal ones. Shape (n_bands,)."""
    if len(some) < 2:
        return np.full(some.shape[1], np.nan)
    with np.errstate(over="ignore", invalid="ignore"):
        return np.where(np.ptp(some, axis=0) > 0, some.var(axis=0, ddof=1), np.nan)


def _off_mean(some: Array) -> Array:
    """Deviation of repeats over their mean, shape (n_repeats, n_bands)."""
    mean = some.mean(axis=0)
    return some / np.where(mean > 0, mean, np.inf) - 1


def _flicker(off: Sequence[Array], variance: Array, mean: Array, asked: Mask) -> float:
    """Standard deviation of the factor, 0 where there is none beyond chance.

    What bands share is the mean product of their deviations; each pair of bands tells it, at each place, as
    well as their scatter lets it.

    Parameters
    ----------
    off : sequence of arrays, shape (n_repeats, n_bands)
        Deviations over the mean.
    variance, mean : array, shape (n_places, n_bands)
    asked : mask, shape (n_places, n_bands)
    """
    total, weights, freedom = 0.0, 0.0, 0
    for place in np.flatnonzero(asked.any(axis=1)).tolist():
        told = asked[place]
        here, of = off[place][:, told], len(off[place]) - 1
        relative = variance[place, told] / mean[place, told] ** 2
        pairs = np.triu_indices(len(relative), 1)
        weight = of / np.outer(relative, relative)[pairs]
        total += float(weight @ (here.T @ here)[pairs]) / of
        weights, freedom = weights + float(weight.sum()), freedom + of
    if freedom < _FEWEST:
        return 0.0
    by_chance, shared = 1 / np.sqrt(weights), total / weights
    return float(np.sqrt(shared)) if shared > _SIGMAS * by_chance else 0.0


def _about_factor(off: Array, mean: Array, own: Array) -> Array:
    """Sample variance of every band about one factor for all of them, shape (n_bands,).

    The factor of each repeat is the mean over bands, weighed by their own scatter; of a band with the weight
    w it leaves 1 - w of the variance.
    """
    weight = mean**2 / own
    weight = weight / weight.sum()
    left = off - (off @ weight)[:, None]
    return np.asarray(mean**2 * (left**2).sum(axis=0) / (len(off) - 1) / (1 - weight))
