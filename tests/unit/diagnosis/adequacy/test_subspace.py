"""Bases of columns, however nearly parallel they are."""

from __future__ import annotations

import numpy as np

from lightfield.diagnosis.adequacy.subspace import combined, orthonormal


def nearly_parallel(n: int = 630, k: int = 120) -> np.ndarray:
    """Spectra that differ by a trace of stray light."""
    rng = np.random.default_rng(1)
    return rng.random((n, 1)) + 1e-7 * rng.standard_normal((n, k))


def test_one_direction_of_nearly_parallel_columns_is_left() -> None:
    columns = nearly_parallel()
    basis = orthonormal(columns)
    assert basis.shape == (630, 1)


def test_a_basis_by_products_spans_the_same() -> None:
    rng = np.random.default_rng(2)
    columns = rng.standard_normal((50, 6)) @ rng.standard_normal((6, 9))
    one, other = orthonormal(columns), columns @ combined(columns.T @ columns)
    assert one.shape == other.shape == (50, 6)
    np.testing.assert_allclose(other.T @ other, np.eye(6), atol=1e-9)
    np.testing.assert_allclose(one @ one.T, other @ other.T, atol=1e-9)
