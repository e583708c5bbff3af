"""The covariance of many readings as a chain along the scan."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.problem.chain import ChainBlock, RowNumbers
from lightfield.diagnosis.problem.noise import Noise


def links_of(
    noise: Noise, rho: float, phi: float, tolerance: float, order: RowNumbers, size: int
) -> Iterator[ChainBlock]:
    """Blocks of readings that follow each other in the scan.

    The state between them holds smooth errors, of which nothing is forgotten; the own noise of the last
    reading of each channel, of which rho is left with every step; and what readings of stays and of moments
    share that are not over.

    Parameters
    ----------
    order : array of int, shape (n,)
        Readings by `layout.position`.
    size : int
        Readings per block.
    """
    lay, n = noise.layout, noise.layout.size
    smooth, own = noise.smooth_columns(tolerance), np.sqrt(phi) * noise.sigma
    channels = np.arange(int(lay.channel.max()) + 1 if rho > 0 else 0)
    lasting = smooth.shape[1] + len(channels)
    block = np.empty(n, int)
    block[order] = np.arange(n) // size
    # Each kind of shared error has labels that no other has.
    at_once = [
        (np.where(amount > 0, label + k * n, -1), amount)
        for k, (label, amount) in enumerate((noise.stays, *noise.of_moments))
    ]
    first, last = np.full(len(at_once) * n, n), np.full(len(at_once) * n, -1)
    for label, _ in at_once:
        np.minimum.at(first, label[label >= 0], block[label >= 0])
        np.maximum.at(last, label[label >= 0], block[label >= 0])

    def columns(rows: RowNumbers, lag: Array, still: RowNumbers) -> Array:
        remembered = np.where(lay.channel[rows][:, None] == channels, rho ** lag[:, None], 0.0)
        shared = np.zeros((len(rows), len(still)))
        for label, amount in at_once:
            shared += amount[rows][:, None] * (label[rows][:, None] == still)
        return np.hstack([smooth[rows], own[rows][:, None] * remembered, shared])

    before, begin = np.zeros(0, int), lay.position[order[0]]
    for i, at in enumerate(range(0, n, size)):
        rows, place = order[at : at + size], lay.position[order[at : at + size]]
        end = lay.position[order[min(at + size, n - 1)]]
        after = np.flatnonzero((first <= i) & (last > i))
        known = {label: lasting + k for k, label in enumerate(before.tolist())}
        source = [*range(lasting), *(known.get(label, -1) for label in after.tolist())]
        decay = np.ones(len(source))
        decay[smooth.shape[1] : lasting] = rho ** (end - begin)
        out = columns(rows, place - begin, before)
        into = columns(rows, end - place, after)
        if i == 0:
            out, source = out[:, :0], [-1] * len(source)
        yield ChainBlock(noise.covariance(rho, phi, tolerance, rows), out, into, np.array(source, int), decay)
        before, begin = after, end
