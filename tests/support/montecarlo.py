"""How Monte Carlo results are compared in the tests: against the error that they state, nothing else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product

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


def least_p(difference: np.ndarray, *errors: tuple[np.ndarray, float]) -> float:
    """Probability that a place of so many differs by more than the place that differs most.

    Student's t at every place, of as many degrees of freedom as all errors together have (Welch 1947,
    Biometrika 34, 28); times the number of places (Bonferroni), which holds however they hang together.

    Parameters
    ----------
    difference : array, shape (n,)
    errors : (standard error, degrees of freedom)
        Of either side, and of whatever else is stated; of infinitely many where no batches tell it.
    """
    parts = np.array([np.broadcast_to(error, difference.shape) for error, _ in errors]) ** 2
    freedom = np.array([many for _, many in errors])[:, None]
    together = parts.sum(axis=0)
    many = together**2 / np.maximum((parts**2 / freedom).sum(axis=0), 1e-9 * together**2)
    p = 2 * stats.t.sf(np.abs(difference) / np.sqrt(together), many)
    return float(min(1.0, p.min() * p.size))


def turned_p(away: np.ndarray) -> float:
    """Probability of a larger difference from nothing in all cells together, by turning the signs of batches.

    A batch is as likely above as below what it is compared with, in all cells together, whatever they share.
    Also of two traces of unlike variance, batch less batch, of which `same_light_p` objects too often. Of ten
    batches it is 0.002 at least.

    Parameters
    ----------
    away : array, shape (n_batches, ...)
    """
    away = away.reshape(len(away), -1)
    away = away[:, (away != 0).all(axis=0)]
    turned = np.array(list(product((1.0, -1.0), repeat=len(away))))
    mean = turned @ away / len(away)
    # The squares stay as they are: what the mean leaves of them is the variance.
    variance = ((away**2).mean(axis=0) - mean**2) / (len(away) - 1)
    difference = (mean**2 / variance).sum(axis=1)
    return float(np.mean(difference >= difference[0] * (1 - 1e-9)))


#: Seeds of a study of how often a comparison objects to light that is right, and how rarely that study itself
#: may fail.
SEEDS, RARELY = 200, 1e-3


def keeps_its_rate(p_of: Callable[[int], float]) -> None:
    """Does a comparison object as often as it says, and not more often, whatever the random sequence?

    Parameters
    ----------
    p_of : callable
        The comparison's probability for a seed.
    """
    found = np.array([p_of(seed) for seed in range(SEEDS)])
    for level in (0.01, 0.05, 0.2):
        objections = int((found < level).sum())
        print(f"{objections} of {SEEDS} below {level:g}, expected {SEEDS * level:g} at most")
        assert objections <= stats.binom.isf(RARELY, SEEDS, level)


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
