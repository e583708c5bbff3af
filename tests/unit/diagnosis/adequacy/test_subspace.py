"""Bases of columns, however nearly parallel they are."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.diagnosis.adequacy.subspace import combined, orthonormal, thin_svd


def nearly_parallel(n: int = 630, k: int = 120) -> np.ndarray:
    """Spectra that differ by a trace of stray light."""
    rng = np.random.default_rng(1)
    return rng.random((n, 1)) + 1e-7 * rng.standard_normal((n, k))


def test_a_driver_that_does_not_converge_is_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    columns = nearly_parallel()
    expected = np.linalg.svd(columns, full_matrices=False)[1]

    def fails(*_: object, **__: object) -> None:
        raise np.linalg.LinAlgError("SVD did not converge")

    monkeypatch.setattr(np.linalg, "svd", fails)
    u, s, vt = thin_svd(columns)
    np.testing.assert_allclose(s, expected, rtol=1e-9, atol=1e-15 * expected[0])
    np.testing.assert_allclose(u * s @ vt, columns, atol=1e-12)
    basis = orthonormal(columns)
    assert basis.shape == (630, 1)


def test_a_basis_by_products_spans_the_same() -> None:
    rng = np.random.default_rng(2)
    columns = rng.standard_normal((50, 6)) @ rng.standard_normal((6, 9))
    one, other = orthonormal(columns), columns @ combined(columns.T @ columns)
    assert one.shape == other.shape == (50, 6)
    np.testing.assert_allclose(other.T @ other, np.eye(6), atol=1e-9)
    np.testing.assert_allclose(one @ one.T, other @ other.T, atol=1e-9)
