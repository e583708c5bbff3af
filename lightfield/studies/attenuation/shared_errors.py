"""Errors of ln(water / air) that all colours of a place, or of a distance, share."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array
from lightfield.diagnosis.problem.layout import PLACE_DECIMALS, layout_of
from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
from lightfield.scene import Scene


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
    air: NDArray[np.bool_],
    places: Array,
    place: NDArray[np.int_],
    position_m: float,
    in_air: bool,
) -> Array:
    """Error of ln(water / air) of a receiver that stands beside its place across the beam, shape (n_places,).

    The light's slope there is that of the scene's beam; every visit stands anew.
    """
    if position_m == 0:
        return np.zeros(len(places))
    squared = np.zeros(len(places))
    with np.errstate(divide="ignore", invalid="ignore"):
        for step in ([position_m, 0, 0], [0, position_m, 0]):
            right, left = (direct_field(lossless, *(places + sign * np.array(step)).T) for sign in (1, -1))
            squared += np.nan_to_num(np.log(right / left) / 2, posinf=0.0, neginf=0.0) ** 2
    variance, visit = np.zeros(len(places)), layout_of(table).visit
    for medium in [air, ~air] if in_air else [~air]:
        stood = np.unique(np.stack([place[medium], visit[medium]]), axis=1)[0]
        variance += squared / np.maximum(np.bincount(stood, minlength=len(places)), 1)
    return np.sqrt(variance)


def stay_variance(
    table: Readings,
    air: NDArray[np.bool_],
    distances: Array,
    gain: float,
    position_m: float,
    in_air: bool,
    behind_m: float,
) -> Array:
    """Variance of the error that all colours of a distance share, shape (n_stays,).

    Parameters
    ----------
    behind_m : float, m
        From the window back to where the light seems to come from.
    """
    visit, z = layout_of(table).visit, np.round(table.z_m, PLACE_DECIMALS) + 0.0
    variance = np.zeros(len(distances))
    for k, distance in enumerate(distances):
        one = gain**2 + (2.0 * position_m / (distance + behind_m)) ** 2  # the slope of an inverse square
        for medium in [air, ~air] if in_air else [~air]:
            visits = len(np.unique(visit[medium & (z == distance)]))
            variance[k] += one / max(visits, 1)
    return variance
