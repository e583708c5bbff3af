"""Monte Carlo errors of diffuse light at readings, as contributions that are independent of each other."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpstrf
from scipy.sparse import csr_array

from lightfield.arrays import TINY, Array
from lightfield.decompositions import eigen
from lightfield.render.diffuse.between_g import PassedOn
from lightfield.render.diffuse.shift import Shift
from lightfield.render.response.light_classes import FROM_WALLS

#: Of more readings than this the errors are gathered plane by plane, but for this part of a variance.
MANY, LEFT_OUT = 3000, 0.03
#: Cells darker than this part of the brightest have no relative error of their own.
_DARK = 1e-9
#: Readings at a time. Chosen: with all of 600 what cells give to them took 0.3 GB.
_AT_ONCE = 128


class TraceErrors(NamedTuple):
    """Monte Carlo errors of the light of one class and one trace.

    Parameters
    ----------
    passed_on : list of n_waters PassedOn
        Change of the light in one cell with the relative error in another.
    roots : array, shape (n_waters, n_waters, n_cells)
        Relative errors in every cell as independent contributions, which waters share.
    images : sparse array, shape (n_cells, n_sets)
        1 of cells that share their photons.
    """

    passed_on: list[PassedOn]
    roots: Array
    images: csr_array


class ClassLight(NamedTuple):
    """Light of one class in every cell, shape (n_waters, n_cells), its noise at every node of g, and its
    error by what the tally does not tell apart, see `open_ended`; if they are asked for."""

    value: Array
    noises: list[TraceErrors]
    uncertain: Array


def relative_modes(
    shift: Shift,
    parts: dict[int, ClassLight],
    light: Array,
    walls: csr_array,
    channel: NDArray[np.integer[Any]],
) -> Array:
    """Relative Monte Carlo errors of the light at readings as independent contributions.

    At most 1: beyond the nodes of g the light of a dim cell may come out as nothing.

    Parameters
    ----------
    parts : mapping
        By class of light, before any smoothing.
    light : array, shape (n_waters, n_cells)
        Of all classes.
    walls : sparse array, shape (n_cells, n_cells)
        By which light from walls is smoothed.
    channel : array of int, shape (n,)
        Water of each reading.

    Returns
    -------
    array, shape (n, k)
    """
    if not parts:
        return np.zeros((len(channel), 0))
    per_light = 1 / np.maximum(light, _DARK * light.max(axis=1, keepdims=True, initial=1e-290))
    if shift.asked > MANY:
        every = _by_plane(shift, parts, per_light, walls, channel)
    else:  # every contribution of every class and trace: to some readings at a time, as all take memory
        some = [slice(first, first + _AT_ONCE) for first in range(0, len(channel), _AT_ONCE)] or [slice(0)]
        every = np.concatenate(
            [_of_some(shift.shares[rows], parts, per_light, walls, channel[rows]) for rows in some]
        )
    every /= np.maximum(np.linalg.norm(every, axis=1, keepdims=True), 1)
    return every


def _of_some(
    shares: csr_array,
    parts: dict[int, ClassLight],
    per_light: Array,
    walls: csr_array,
    channel: NDArray[np.integer[Any]],
) -> Array:
    """Contributions to some readings, which the cells have shares in, shape (n, n_cells)."""
    modes = []
    for kind, (_, noises, _) in parts.items():
        spreads = []
        for water, light in enumerate(per_light):
            spread = shares[channel == water].toarray() * light
            spreads.append(np.asarray(spread @ walls) if kind in FROM_WALLS else spread)
        for noise in noises:
            found = np.zeros((len(channel), noise.roots.shape[1] * noise.images.shape[1]))
            for water, (spread, passed) in enumerate(zip(spreads, noise.passed_on, strict=True)):
                each = passed.to(spread)
                found[channel == water] = np.hstack(
                    [(each * root) @ noise.images for root in noise.roots[water]]
                )
            modes.append(found)
    return np.hstack(modes)


def _by_plane(
    shift: Shift,
    parts: dict[int, ClassLight],
    per_light: Array,
    walls: csr_array,
    channel: NDArray[np.integer[Any]],
) -> Array:
    """The modes of many readings: planes share no photons, and have fewer cells than contributions."""
    waters = len(per_light)
    of_planes = []
    for z in np.unique(shift.cell_z_m):
        cells = np.flatnonzero(shift.cell_z_m == z)
        here = np.diff(shift.shares[:, cells].indptr) > 0
        columns, among = [], dict[int, csr_array]()
        for kind, (_, noises, _) in parts.items():
            smooth = walls[cells][:, cells] if kind in FROM_WALLS else None
            for noise in noises:
                images = noise.images[cells]
                images = images[:, np.unique(images.indices)].toarray()
                rows = []
                for passed_on, root in zip(noise.passed_on, noise.roots, strict=True):
                    ratios = passed_on.smoother
                    if ratios is not None and id(ratios) not in among:
                        among[id(ratios)] = ratios[cells][:, cells]
                    mine = passed_on.among(cells, None if ratios is None else among[id(ratios)])
                    found = mine.times(np.hstack([r[cells, None] * images for r in root]))
                    rows.append(found if smooth is None else smooth @ found)
                columns.append(np.vstack(rows))
        modes = per_light[:, cells].reshape(-1, 1) * np.hstack(columns)
        modes = fewer_modes(modes).reshape(waters, len(cells), -1)
        of_planes.append((here, cells, modes))
    # In single precision: they are errors.
    every = np.zeros((len(channel), sum(modes.shape[2] for *_, modes in of_planes)), np.float32)
    first = 0
    for here, cells, modes in of_planes:
        columns_of_plane = slice(first, first := first + modes.shape[2])
        for water in np.unique(channel):
            mine = here & (channel == water)
            every[mine, columns_of_plane] = shift.shares[mine][:, cells] @ modes[water]
    return every


def as_few(modes: Array) -> Array:
    """Modes of the same covariance, no more than there are readings; shape (n, n) where there are more."""
    n, k = modes.shape
    if k <= n:
        return modes
    size = np.maximum(np.linalg.norm(modes, axis=1, keepdims=True), TINY)
    unit = modes / size
    variance, directions = eigen(unit @ unit.T)
    return np.asarray(size * directions * np.sqrt(np.maximum(variance, 0.0)))


def fewer_modes(modes: Array) -> Array:
    """Modes of nearly the same covariance, as few as that takes; a variance loses `LEFT_OUT` of it at most.

    Cholesky decomposition with pivots (Harbrecht, Peters and Schneider 2012, Appl. Numer. Math. 62, 428).

    Parameters
    ----------
    modes : array, shape (n, k)

    Returns
    -------
    array, shape (n, rank)
    """
    size = np.linalg.norm(modes, axis=1, keepdims=True)
    unit = modes / np.maximum(size, TINY)
    root, order, rank, _ = dpstrf(unit @ unit.T, tol=LEFT_OUT, lower=1)
    out = np.empty((len(modes), rank))
    out[order - 1] = np.tril(root)[:, :rank]
    return size * out
