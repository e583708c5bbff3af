"""Gross outliers, serial correlation and noise scale, judged beside the richest linear model so that no
effect is lost.

Points that carry a missing effect look like outliers of the base model. Here a reading is an outlier only
when the base model, every effect's template and every smooth unknown together cannot reach it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from lightfield.diagnosis.layout import Layout
from lightfield.diagnosis.noise import Whitener
from lightfield.diagnosis.subspace import beside, orthonormal
from lightfield.diagnosis.templates import Template
from lightfield.fit import Fit

Array = NDArray[np.float64]

MAX_OUTLIERS = 0.08
_MANY = 80
#: An overstated part of the error budget must not make the readings look better than they can be.
_SMALLEST_SCALE = 0.5


@dataclass(frozen=True)
class Serial:
    """Lag-one correlation of the noise in scan order and its standard error."""

    rho: float
    stderr: float


def rich_basis(
    fit: Fit, templates: tuple[Template, ...], unknowns: Mapping[str, Array], with_time: bool = True
) -> Array:
    """Orthonormal basis of base model, effects and smooth unknowns, shape (n, k)."""
    n = len(fit.residual)
    parts = [fit.jacobian, *(t.columns for t in templates), unknowns["x"]]
    if n >= _MANY:
        parts.append(unknowns["plane"])
    if with_time:
        parts.append(unknowns["time"])
    return orthonormal(np.hstack(parts))


def outliers(fit: Fit, rich: Array, keep: Array) -> NDArray[np.bool_]:
    """Readings that even the rich model misses: externally studentised residual of a Cauchy regression.

    Parameters
    ----------
    rich : array, shape (n, k)
        Orthonormal basis from `rich_basis`.
    """
    residual, n = fit.residual, len(keep)
    weight = keep.copy()
    misfit = residual
    for _ in range(8):
        root = np.sqrt(weight)
        misfit = residual - rich @ np.linalg.lstsq(rich * root[:, None], residual * root, rcond=None)[0]
        inflate = np.sqrt(n / max(n - 0.8 * rich.shape[1], 0.25 * n))
        spread = 1.4826 * float(np.median(np.abs(misfit[keep > 0]))) * inflate
        weight = keep / (1 + (misfit / (2.5 * spread)) ** 2)
    leverage = np.clip((rich**2 * weight[:, None]).sum(1), 0, 0.95)
    good = (weight > 0.4) & (keep > 0)
    sigma = np.sqrt((misfit[good] ** 2).sum() / max(float((1 - leverage[good]).sum()), 5.0))
    studentised = np.abs(misfit) / (sigma * np.sqrt(1 - leverage))
    nu = max(float(keep.sum()) - rich.shape[1], 6.0)
    threshold = stats.t.isf((0.005 if n >= _MANY else 0.0005) / n, 0.7 * nu)
    bad = (studentised > threshold) & (keep > 0)
    most = max(int(MAX_OUTLIERS * n) - int(n - keep.sum()), 0)
    if bad.sum() > most:
        bad &= studentised >= np.sort(np.where(bad, studentised, 0.0))[-most] if most else False
    return np.asarray(bad)


def scattered(bad: NDArray[np.bool_], layout: Layout) -> NDArray[np.bool_]:
    """Outliers without those that share a place: a shadow or a cloud is a finding, not a slip of the pen.

    Parameters
    ----------
    bad : array of bool, shape (n,)
        All readings left out so far.
    """
    alone = bad.copy()
    for coordinate in (layout.x_m, layout.y_m, layout.z_m):
        _, label = np.unique(np.round(coordinate, 3), return_inverse=True)
        size, hit = np.bincount(label), np.bincount(label, weights=bad)
        together = (hit >= 3) & (hit > 0.4 * size) & (len(size) > 2)
        alone &= ~together[label]
    return alone


def serial_correlation(
    residual: Array, rich: Array, keep: Array, layout: Layout, rng: np.random.Generator
) -> Serial:
    """Lag-one correlation of the residual in scan order, corrected for what the rich model took out by
    simulation.

    Parameters
    ----------
    residual : array, shape (n,)
        Whitened residual beside `rich`.
    """
    order, place = layout.order, layout.position
    kept = keep[order] > 0
    gap = np.diff(place[order])
    pair = kept[1:] & kept[:-1] & (np.diff(layout.channel[order]) == 0) & (gap > 0) & (gap <= 2)
    if pair.sum() < 20:
        return Serial(0.0, 0.0)

    def lag_one(rows: Array) -> Array:
        sorted_rows = rows[order]
        product = (sorted_rows[1:] * sorted_rows[:-1])[pair].sum(0)
        square = 0.5 * (sorted_rows[1:] ** 2 + sorted_rows[:-1] ** 2)[pair].sum(0)
        return np.asarray(product / square)

    seen = float(lag_one(residual[:, None])[0])
    levels = np.array([0.0, 0.25, 0.5, 0.75, 0.9])
    mean, spread = [], 0.0
    same = np.diff(layout.channel[order]) == 0
    for rho in levels:
        noise = rng.standard_normal((layout.size, 100))
        for i in range(1, layout.size):
            if rho and same[i - 1]:
                noise[i] = rho * noise[i - 1] + np.sqrt(1 - rho**2) * noise[i]
        unsorted = np.empty_like(noise)
        unsorted[order] = noise
        found = lag_one(beside(rich, unsorted * keep[:, None]))
        mean.append(float(found.mean()))
        spread = float(found.std()) if rho == 0 else spread
    slope = max((mean[1] - mean[0]) / 0.25, 0.2)
    return Serial(float(np.interp(seen, mean, levels)), spread / slope)


def noise_scale(residual: Array, rich: Array, plain: Whitener, extra: Array, keep: Array) -> float:
    """Variance factor of the quoted errors, the rest of the error budget taken off first.

    Parameters
    ----------
    residual : array, shape (n,)
        Residual whitened by the quoted errors alone (`plain`).
    extra : array, shape (n, n)
        Covariance of the other terms of the budget.
    """
    if keep.sum() - rich.shape[1] < 4:  # nothing is left to estimate it from
        return 1.0
    rest = beside(rich, residual[:, None])[:, 0]
    white = plain(plain(extra).T)
    expected = float(np.trace(white) - np.einsum("ij,ij->", rich, white @ rich))
    nu = max(float(keep.sum()) - rich.shape[1], 5.0)
    return max(_SMALLEST_SCALE, (float(rest @ rest) - expected) / nu)
