"""Errors of ln(water / air) that all colours of a place, or of a distance, share."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from lightfield.arrays import Array, Mask
from lightfield.diagnosis.problem.layout import layout_of
from lightfield.diagnosis.problem.quoted import OWN_PART
from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
from lightfield.readings.columns import PLACE_DECIMALS
from lightfield.scene import Scene
from lightfield.studies.attenuation.common_errors import POOR_FIT, Design, misfit_p

#: Where the scatter is too small for chance (`POOR_FIT`), so small a chance of it is allowed for: the part of
#: a colour's own is rather taken for too large. One standard deviation.
_ALLOWED = 0.16
#: Least part of the variance that is a band's own: `quoted.own_part` has the same of the errors.
_LEAST_OWN = OWN_PART**2
#: Logarithms that places share freely are known no better than this beforehand: a factor of e.
_FREE = 1.0


def of_places(together: Sequence[tuple[Array, Array]]) -> Array:
    """Error of ln(water / air) that the colours of a place share, shape (n_places,).

    Parameters
    ----------
    together : sequence of (mean, error), shape (n_places, n_colours)
        In each medium.
    """
    variance = np.zeros(len(together[0][0]))
    for mean, error in together:
        known = np.isfinite(mean) & (mean > 0)
        part = np.where(known, error / np.where(known, mean, 1.0), 0.0) ** 2
        variance += part.sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    return np.sqrt(variance)


def sideways(
    lossless: Scene,
    table: Readings,
    media: Sequence[Mask],
    places: Array,
    place: NDArray[np.int_],
    position_m: float,
) -> Array:
    """Error of ln(water / air) of a receiver that stands beside its place across the beam, shape (n_places,).

    The light's slope there is that of the scene's beam; every visit stands anew.

    Parameters
    ----------
    media : sequence of array of bool, shape (n,)
        Readings in water, and those in air where they are divided by these.
    place : array of int, shape (n,)
        Which of the places each reading is of.
    """
    if position_m == 0:
        return np.zeros(len(places))
    squared = np.zeros(len(places))
    with np.errstate(divide="ignore", invalid="ignore"):
        for step in ([position_m, 0, 0], [0, position_m, 0]):
            right, left = (direct_field(lossless, *(places + sign * np.array(step)).T) for sign in (1, -1))
            squared += np.nan_to_num(np.log(right / left) / 2, posinf=0.0, neginf=0.0) ** 2
    variance, visit = np.zeros(len(places)), layout_of(table).visit
    for medium in media:
        stood = np.unique(np.stack([place[medium], visit[medium]]), axis=1)[0]
        variance += squared / np.maximum(np.bincount(stood, minlength=len(places)), 1)
    return np.sqrt(variance)


def stay_variance(
    table: Readings,
    media: Sequence[Mask],
    distances: Array,
    gain: float,
    position_m: float,
    behind_m: float,
    falls_per_m: float,
) -> Array:
    """Variance of the error that all colours of a distance share, shape (n_stays,).

    Parameters
    ----------
    media : sequence of array of bool, shape (n,)
        As of `sideways`.
    behind_m : float, m
        From the window back to where the light seems to come from.
    falls_per_m : float, 1/m
        By how much the logarithm of light falls in water besides, see `falls`.
    """
    visit, z = layout_of(table).visit, np.round(table.z_m, PLACE_DECIMALS) + 0.0
    variance = np.zeros(len(distances))
    for k, distance in enumerate(distances):
        spread = 2.0 / (distance + behind_m)  # the slope of an inverse square
        for medium, slope in zip(media, (spread + falls_per_m, spread), strict=False):
            visits = len(np.unique(visit[medium & (z == distance)]))
            variance[k] += (gain**2 + (slope * position_m) ** 2) / max(visits, 1)
    return variance


def falls(y: Array, path_m: Array) -> float:
    """Roughly the attenuation, 1/m, in the mean over the colours: not below zero.

    Parameters
    ----------
    y : array, shape (n_places, n_colours)
        ln(water / air); NaN where nothing was read.
    path_m : array, shape (n_places,), m
    """
    known = np.isfinite(y) & np.isfinite(path_m)[:, None]
    count = np.maximum(known.sum(axis=0), 1)
    path, value = (np.where(known, v, 0.0) for v in (path_m[:, None], y))
    path, value = (np.where(known, v - v.sum(axis=0) / count, 0.0) for v in (path, value))
    spread = (path**2).sum(axis=0)
    told = spread > 0
    slope = -(path * value).sum(axis=0)[told] / spread[told]
    return max(float(slope.mean()), 0.0) if told.any() else 0.0


def own_share(y: Array, stderr: Array, path_m: Array) -> float:
    """Part of the variance stated of ln(water / air) that is each colour's own; 1 where that may be all.

    Colours scatter about each other by their own errors alone: about straight lines and one free deviation
    for each place the sum of squares tells these, whatever is common (a lamp that flickers, a gain, light
    that does not fall in a straight line).

    Parameters
    ----------
    y, stderr : array, shape (n_places, n_colours)
        NaN where nothing was read.
    path_m : array, shape (n_places,), m
    """
    ones = np.ones_like(y)
    lines = np.stack([ones, -path_m[:, None] * ones], axis=2)
    several = np.isfinite(y).sum(axis=1) > 1
    # What is common to all is in their lines already: a constant, and a slope.
    dof = int(np.isfinite(y[several]).sum()) - 2 * y.shape[1] - max(int(several.sum()) - 2, 0)
    if dof < 1:
        return 1.0
    design = Design(stderr[several], lines[several], np.eye(several.sum()), np.full(several.sum(), _FREE))
    chi2 = design.estimate(y[several]).chi2
    if misfit_p(chi2, dof) < 1 - POOR_FIT:
        return 1.0
    return float(np.clip(chi2 / stats.chi2.ppf(_ALLOWED, dof), _LEAST_OWN, 1.0))
