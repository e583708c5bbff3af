"""Gross outliers and serial correlation, judged beside the richest linear model so that no effect is lost.

Points that carry a missing effect look like outliers of the base model. Here a reading is an outlier only
when the base model, every effect's template and every smooth unknown together cannot reach it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from lightfield.arrays import TINY, Array
from lightfield.decompositions import eigen, solved
from lightfield.diagnosis.adequacy.likelihood import log_evidence, profile
from lightfield.diagnosis.adequacy.subspace import orthonormal
from lightfield.diagnosis.adequacy.templates import Template
from lightfield.diagnosis.problem.layout import Layout
from lightfield.diagnosis.problem.quoted import MAD_TO_SIGMA, NO_LIGHT
from lightfield.fitting.least_squares import LOOSE, OPEN, Fit
from lightfield.readings.blindness import LEAST_ERROR
from lightfield.readings.columns import LINE_DECIMALS

#: Largest part of the readings that is left out. Chosen: four times the part that slips usually spoil
#: (`setup.OUTLIER_PERCENT`); more is a finding, see `slips`.
MAX_OUTLIERS = 0.08
#: From so many readings on every plane's unknowns can be fitted beside all else. Chosen.
_MANY = 80
#: One-tailed chance that any good reading of a table is called an outlier: of many readings, and of few,
#: whose loss costs more. Chosen: both tails make ALPHA, and a tenth; test_robust.py holds that it is kept.
OUTLIER_LEVEL, OUTLIER_LEVEL_FEW = 0.005, 0.0005
#: Readings this many spreads off are proposed as outliers: by chance one of 370. Derived: the normal law;
#: what is judged one is farther off.
_PROPOSED = 3.0
#: Where the weights of the Cauchy regression are a half, in spreads: 2.385 makes it 95 % efficient on normal
#: errors (Holland and Welsch 1977, doi:10.1080/03610927708827533). Rounds: it only proposes.
_CAUCHY, _CAUCHY_ROUNDS = 2.5, 8
#: Part of a degree of freedom that a column takes from a spread about a robust fit, and the least that is
#: left of all. Chosen: less than one, for a median is not the mean square that least squares minimises.
_TAKEN_PER_COLUMN, _LEAST_LEFT = 0.8, 0.25
#: A spread is no smaller than this part of the largest misfit: most may fit exactly. Chosen: above rounding.
_EXACT = 1e-9
#: Outliers that share a place are no slips when there are so many, and so large a part of that place. Chosen:
#: two of seven neighbours may be slips of one hand, three on one side of the model hardly.
_TOGETHER, _TOGETHER_PART = 3, 0.4
#: Correlations considered, all equally likely. Of both signs: were none below 0, independent noise of 120
#: readings would pass for one of 0.13 on average, and errors of fits be a tenth too large (test_robust.py).
_RHO_GRID = np.linspace(-0.5, 0.95, 30)
#: Correlations closer than this are one. Derived: eigenvalues of that of 1e-3 lie between 0.998 and 1.002 of
#: those of none, and chi-square with them.
SAME_RHO = 1e-3
#: A correlation needs so many pairs of neighbours in the scan. Chosen: its error is then 0.2.
_FEWEST_PAIRS = 20
#: A posterior is known by so many quantiles, each in the middle of an equal part of it. Chosen.
_QUANTILES = 5
#: Another law of the errors: dark floors tried and the largest that needs no statement, over the largest
#: reading. Chosen: the latter is twice `quoted.ASSUMED_FLOOR`.
_FLOORS, _DARK = np.logspace(-5, 0, 11), 2e-3
#: By how much its log likelihood must be larger, and beside how many readings to spare. Chosen: at 0.5 right
#: errors are replaced in more than one set of ten, at 18 wrong ones stay (test_noise.py).
_OVERWHELMING, _ENOUGH = 6.0, 20
#: Errors in proportion to the reading that are tried, from none to the largest that is believed; by how much
#: the log evidence must grow. Chosen: two standard deviations.
_PROPORTIONS, _EVIDENT = 11, 2.0


@dataclass(frozen=True)
class Serial:
    """Lag-one correlation of the noise in scan order: what is known of it beside the richest model.

    Parameters
    ----------
    rho : float
        Mean of the posterior, or 0 where that is less, or next to it: noise that alternates is put down to
        chance.
    levels : tuple of float
        Equally likely values, 0 for those below, which stand for the posterior in simulations.
    """

    rho: float = 0.0
    levels: tuple[float, ...] = (0.0,)


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


def outliers(residual: Array, basis: Array, keep: Array) -> NDArray[np.bool_]:
    """Readings that a model misses: externally studentised residuals (Cook and Weisberg 1982, section 2.2).

    A Cauchy regression proposes them. Each is then judged by least squares on the readings that are left,
    with the error of the prediction itself: a reading that alone fixes a parameter is never an outlier.

    Parameters
    ----------
    residual : array, shape (n,)
        Whitened residual of the fit.
    basis : array, shape (n, k)
        Orthonormal basis of what the model can still do.
    """
    n, usable = len(keep), keep > 0
    bad = usable & (_cauchy_misfit(residual, basis, keep) > _PROPOSED)
    most = max(int(MAX_OUTLIERS * n) - int(n - keep.sum()), 0)
    level = (OUTLIER_LEVEL if n >= _MANY else OUTLIER_LEVEL_FEW) / n
    while bad.any():
        t, nu = _studentised(residual, basis, usable & ~bad)
        proposed = np.flatnonzero(bad)
        weakest = int(proposed[t[proposed].argmin()])
        if t[weakest] > -special.stdtrit(nu, level) and bad.sum() <= most:
            break
        bad[weakest] = False
    return np.asarray(bad)


def _cauchy_misfit(residual: Array, basis: Array, keep: Array) -> Array:
    """|misfit| of a Cauchy regression in units of its robust spread."""
    n, weight, misfit = len(keep), keep.copy(), np.abs(residual)
    spread = 1.0
    for _ in range(_CAUCHY_ROUNDS):
        root = np.sqrt(weight)
        misfit = residual - basis @ solved(basis * root[:, None], residual * root)
        inflate = np.sqrt(n / max(n - _TAKEN_PER_COLUMN * basis.shape[1], _LEAST_LEFT * n))
        spread = MAD_TO_SIGMA * float(np.median(np.abs(misfit[keep > 0]))) * inflate
        spread = max(spread, _EXACT * float(np.abs(misfit).max()), TINY)
        weight = keep / (1 + (misfit / (_CAUCHY * spread)) ** 2)
    return np.asarray(np.abs(misfit) / spread)


def _studentised(residual: Array, basis: Array, judges: NDArray[np.bool_]) -> tuple[Array, int]:
    """|misfit| of readings that were not used over its standard error, shape (n,), and degrees of freedom."""
    others = basis[~judges]
    # The basis is orthonormal over all readings: what the judges see of it is what the others leave.
    square, directions = eigen(np.eye(basis.shape[1]) - others.T @ others)
    firm = square > LOOSE
    loose, inverse = others @ directions, 1 / square[firm]
    along = directions.T @ (basis.T @ (judges * residual))
    misfit = residual - basis @ (directions[:, firm] @ (inverse * along[firm]))
    nu = max(int(judges.sum()) - int(firm.sum()), 1)
    sigma = max(np.sqrt((misfit[judges] ** 2).sum() / nu), _EXACT * np.abs(misfit).max(), TINY)
    # Directions that the judges leave open could have produced any misfit.
    open_part = (loose[:, ~firm] ** 2).sum(1) > OPEN
    variance = 1 + loose[:, firm] ** 2 @ inverse
    out = np.zeros(len(residual))
    out[~judges] = np.where(open_part, 0.0, np.abs(misfit[~judges]) / (sigma * np.sqrt(variance)))
    return out, nu


def scattered(bad: NDArray[np.bool_], misfit: Array, layout: Layout) -> NDArray[np.bool_]:
    """Outliers without those that share a place and a sign: a shadow or a cloud is a finding, not a slip of
    the pen.

    Parameters
    ----------
    bad : array of bool, shape (n,)
        All readings left out so far.
    misfit : array, shape (n,)
        Reading minus model.
    """
    alone = bad.copy()
    for coordinate in (layout.x_m, layout.y_m, layout.z_m):
        _, label = np.unique(np.round(coordinate, LINE_DECIMALS), return_inverse=True)
        size, hit = np.bincount(label), np.bincount(label, weights=bad)
        above = np.bincount(label, weights=bad & (misfit > 0))
        one_side = (above == 0) | (above == hit)
        together = (hit >= _TOGETHER) & (hit > _TOGETHER_PART * size) & (len(size) > 2) & one_side
        alone &= ~together[label]
    return alone


def serial_correlation(
    residual: Array, rich: Array, keep: Array, layout: Layout, stated: float | None
) -> Serial:
    """Posterior of an AR(1) correlation in scan order from the restricted likelihood (Patterson and Thompson
    1971, doi:10.1093/biomet/58.3.545), which does not mistake for independence what the rich model took out.

    Correlated noise is quiet from one reading to the next, so that the stated errors have a say: noise of
    the stated size is not both correlated and rough. Their scale has a wide Student prior.

    Parameters
    ----------
    residual : array, shape (n,)
        Whitened by the quoted errors alone.
    rich : array, shape (n, k)
        Orthonormal basis of what the rich model can do.
    stated : float, optional
        Expected variance of the residual; None where the table quotes no errors.
    """
    order = layout.order[keep[layout.order] > 0]
    gap, same = np.diff(layout.position[order]), np.diff(layout.channel[order]) == 0
    if (same & (gap <= 2)).sum() < _FEWEST_PAIRS:
        return Serial()
    rows = np.column_stack([rich, residual])[order]
    evidence = []
    for rho in _RHO_GRID:
        lag = np.where(same, rho ** np.maximum(gap, 1.0), 0.0)[:, None]
        root = np.sqrt(1 - lag**2)
        white = np.vstack([rows[:1], (rows[1:] - lag * rows[:-1]) / root])
        evidence.append(log_evidence(white, stated) - float(np.log(root).sum()))
    weight = np.exp(np.array(evidence) - max(evidence))
    share, parts = np.cumsum(weight) / weight.sum(), (np.arange(_QUANTILES) + 0.5) / _QUANTILES
    levels = tuple(max(float(_RHO_GRID[int(np.searchsorted(share, p))]), 0.0) for p in parts)
    rho = float(weight @ _RHO_GRID / weight.sum())
    return Serial(rho if rho > SAME_RHO else 0.0, levels)


def scatter_law(
    residual: Array,
    rich: Array,
    keep: Array,
    sigma: Array,
    prediction: Array,
    most: float,
    alike: float = 1.0,
) -> Array | None:
    """Standard errors from the scatter itself, shape (n,), where the stated ones have another shape.

    Stated errors may be too small or too large by a factor. But one error for bright and dark readings alike,
    or one in per cent without a dark floor, weighs the readings wrongly, and no factor mends that. The law
    tried instead is s^2 = c0 + c2 f^2; its likelihood is the restricted one of the residual beside the rich
    model (Patterson and Thompson 1971).

    Parameters
    ----------
    residual : array, shape (n,)
        Whitened by the stated errors.
    rich : array, shape (n, k)
        Whitened likewise.
    sigma, prediction : array, shape (n,)
        Stated errors and model.
    most : float
        Largest factor on a stated variance that is believed beside a dark floor.
    alike : float
        So many readings that share their errors are one piece of evidence.

    Returns
    -------
    array or None
        None: the stated errors are as good as any, or too small for more than a wrong shape.
    """
    kept = keep > 0
    level = np.clip(prediction, 0, None)[kept]
    top, stated = float(level.max()), sigma[kept]
    rows = np.column_stack([rich, residual])[kept]
    if top <= NO_LIGHT * stated.max() or len(rows) - rich.shape[1] < _ENOUGH:
        return None
    best, _ = profile(rows)
    law = None
    for floor in _FLOORS:
        shape = np.hypot(floor * top, level)
        evidence, variance = profile(rows * (stated / shape)[:, None])
        evidence -= float(np.log(shape / stated).sum())
        limit = most * stated**2 + (_DARK * top) ** 2
        if (
            evidence > best + (alike * _OVERWHELMING if law is None else 0.0)
            and (variance * shape**2 < limit).all()
        ):
            least = max(float(np.sqrt(variance)), LEAST_ERROR)
            best, law = evidence, least * np.hypot(floor * top, np.clip(prediction, 0, None))
    return law


def unstated_error(residual: Array, rich: Array, keep: Array, relative: Array, most: float) -> Array:
    """Factor on the stated errors for an error in proportion to the reading that they leave out, shape (n,).

    Stated errors tell how well a reading repeats; what goes with its place (position, a restless lamp,
    photons of a simulation) is often missing, and counts where it is bright.

    Parameters
    ----------
    residual : array, shape (n,)
        Whitened by the stated errors.
    relative : array, shape (n,)
        Reading over its stated error.
    most : float
        Largest factor on a variance that is believed.
    """
    kept = keep > 0
    rows, bright = np.column_stack([rich, residual])[kept], relative[kept] ** 2
    if not bright.any():
        return np.ones_like(relative)
    evidence, shares = [], np.linspace(0.0, 1.0, _PROPORTIONS) * (most - 1) / float(bright.max())
    for share in shares:
        root = np.sqrt(1 + share * bright)[:, None]
        evidence.append(log_evidence(rows / root, 1.0) - float(np.log(root).sum()))
    best = int(np.argmax(evidence))
    # Without evidence the stated errors are taken as they are.
    share = shares[best] if evidence[best] - evidence[0] > _EVIDENT else 0.0
    return np.asarray(np.sqrt(1 + share * relative**2))
