"""How Monte Carlo results are compared in the tests: against the error that they state, nothing else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy import stats

from lightfield.render.response.grid import Grid
from lightfield.render.response.response import TransportResponse


def normal_scores(mean: np.ndarray, truth: np.ndarray, stderr: np.ndarray, batches: int) -> np.ndarray:
    """Deviation in units of the stated error, as a standard normal number.

    An error that comes from a few batches makes the ratio follow Student's t with batches - 1 degrees of
    freedom; equal probabilities turn that into normal scores.
    """
    t = np.asarray((mean - truth) / stderr)
    upper = stats.norm.isf(stats.t.sf(np.abs(t), batches - 1))
    return np.sign(t) * np.minimum(upper, 30.0)


def chi_square_p(scores: np.ndarray) -> float:
    """Probability of a larger sum of squares of so many independent standard normal numbers."""
    return float(stats.chi2.sf((scores**2).sum(), scores.size))


def cell_average(grid: Grid, field: Callable[..., np.ndarray], order: int = 6) -> np.ndarray:
    """Average of field(x, y, z) over every cell by Gauss-Legendre quadrature, shape (n_planes, n_y, n_x)."""
    node, weight = np.polynomial.legendre.leggauss(order)
    x = grid.x_m[:, None] + 0.5 * grid.pitch_x_m * node
    y = grid.y_m[:, None] + 0.5 * grid.pitch_y_m * node
    value = field(*np.broadcast_arrays(
        x[None, None, :, None, :], y[None, :, None, :, None], grid.z_m[:, None, None, None, None]
    ))  # fmt: skip
    return np.einsum("zyxji,j,i->zyx", value, 0.5 * weight, 0.5 * weight)


def with_rows(response: TransportResponse, kept: np.ndarray) -> TransportResponse:
    """The response of some histories only, for example of light that met one wall."""
    return replace(
        response,
        tally=response.tally[:, kept],
        histories=response.histories[kept],
        excess_m=response.excess_m[kept],
    )


def same_light_p(one: np.ndarray, other: np.ndarray, shuffles: int = 2000) -> float:
    """Probability of a larger difference between two sets of maps, by exchanging their batches.

    The difference is the sum of squared t-values over all cells. One photon reaches several cells, so cells
    are not independent and the sum is no chi-square; exchanging whole batches keeps what they have in common.

    Parameters
    ----------
    one, other : arrays, shape (n_batches, ...)
    """
    both = np.concatenate([one.reshape(len(one), -1), other.reshape(len(other), -1)])
    both = both[:, (both > 0).all(axis=0)]
    rng = np.random.default_rng(1)

    def difference(order: np.ndarray) -> float:
        first, second = both[order[: len(one)]], both[order[len(one) :]]
        variance = first.var(axis=0, ddof=1) / len(first) + second.var(axis=0, ddof=1) / len(second)
        return float(((first.mean(axis=0) - second.mean(axis=0)) ** 2 / variance).sum())

    found = difference(np.arange(len(both)))
    larger = sum(difference(rng.permutation(len(both))) >= found for _ in range(shuffles))
    return (1 + larger) / (1 + shuffles)
