"""Decompositions where LAPACK's quick driver gives up."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.decompositions import eigen, solved, thin_svd


def nearly_parallel(n: int = 630, k: int = 120) -> np.ndarray:
    """Spectra that differ by a trace of stray light."""
    rng = np.random.default_rng(1)
    return rng.random((n, 1)) + 1e-7 * rng.standard_normal((n, k))


def fails(*_: object, **__: object) -> None:
    raise np.linalg.LinAlgError("did not converge")


def test_singular_values_by_the_other_driver(monkeypatch: pytest.MonkeyPatch) -> None:
    columns = nearly_parallel()
    expected = np.linalg.svd(columns, full_matrices=False)[1]
    monkeypatch.setattr(np.linalg, "svd", fails)
    u, s, vt = thin_svd(columns)
    np.testing.assert_allclose(s, expected, rtol=1e-9, atol=1e-15 * expected[0])
    np.testing.assert_allclose(u * s @ vt, columns, atol=1e-12)


def test_eigenvalues_by_the_other_driver(monkeypatch: pytest.MonkeyPatch) -> None:
    gram = nearly_parallel(60, 40).T @ nearly_parallel(60, 40)
    expected = np.linalg.eigvalsh(gram)
    monkeypatch.setattr(np.linalg, "eigh", fails)
    values, vectors = eigen(gram)
    np.testing.assert_allclose(values, expected, atol=1e-13 * expected[-1])
    np.testing.assert_allclose(vectors * values @ vectors.T, gram, atol=1e-13 * expected[-1])
    np.testing.assert_allclose(vectors.T @ vectors, np.eye(40), atol=1e-12)


@pytest.mark.parametrize("least", [None, 1e-6])
def test_least_squares_by_another_driver_are_the_same(
    monkeypatch: pytest.MonkeyPatch, least: float | None
) -> None:
    """Also of columns of which one says nothing of its own."""
    rng = np.random.default_rng(3)
    columns = rng.standard_normal((30, 4))
    columns[:, 3] = columns[:, 0] + columns[:, 1]
    target = rng.standard_normal((30, 2))
    wanted = solved(columns, target, least)
    assert np.allclose(columns.T @ (columns @ wanted - target), 0, atol=1e-12)

    monkeypatch.setattr(np.linalg, "lstsq", fails)
    np.testing.assert_allclose(solved(columns, target, least), wanted, rtol=1e-9)
