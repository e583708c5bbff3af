"""Errors of what batches of photons tell, from how the batches scatter."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.render.diffuse.ratio import _of_batches

#: Variances of six sums that are expected to be one.
TRUE = np.array([0.4, 0.6, 0.8, 1.2, 1.4, 1.6])


def stated(batches: int, seed: int = 0) -> np.ndarray:
    """The covariance of the mean, by these batches."""
    rng = np.random.default_rng(seed)
    drawn = np.sqrt(batches * TRUE)[:, None] * rng.standard_normal((6, batches))
    root = _of_batches(drawn - drawn.mean(axis=1, keepdims=True))
    return root @ root.T


def test_many_batches_are_believed() -> None:
    """The scatter of 20,000 variances is 1 %."""
    found = stated(20_000)
    assert np.diag(found) == pytest.approx(TRUE, rel=0.05)
    assert np.abs(found - np.diag(np.diag(found))).max() < 0.05


def test_ten_batches_are_believed_for_their_scale() -> None:
    """And for the rest by so little that it is thrice as near to the truth as what they show."""
    every = np.array([stated(10, seed) for seed in range(200)])
    assert np.trace(every.mean(axis=0)) == pytest.approx(TRUE.sum(), rel=0.03)
    away = ((every - np.diag(TRUE)) ** 2).sum(axis=(1, 2)).mean()
    assert 3 * away < (TRUE.sum() ** 2 + (TRUE**2).sum()) / 9, "of a sample covariance (Wishart)"
    assert np.corrcoef(np.diag(every.mean(axis=0)), TRUE)[0, 1] > 0.9


def test_one_sum_has_the_scatter_of_its_batches() -> None:
    drawn = np.random.default_rng(3).standard_normal((1, 10))
    drawn -= drawn.mean()
    (root,) = _of_batches(drawn).ravel()
    assert root**2 == pytest.approx(drawn.var(ddof=1) / 10)
