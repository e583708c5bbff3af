"""Light between the traced g: what smoothed ratios leave of the noise, and that the stated errors know it.

Made-up light of four nodes in 21 cells on a plane, its ratios quadratic across the beam, with an independent
relative noise of 3 % in every cell of every node.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from lightfield.render.diffuse.between_g import BetweenG, PassedOn
from lightfield.render.diffuse.shift import SMOOTH_RATIOS, smoother
from lightfield.render.diffuse.trace_errors import as_few
from lightfield.render.reflected.room import lagrange
from lightfield.render.response.grid import positions_grid

X = np.linspace(-1, 1, 21)
T = np.array([1.4, 2.0, 2.6, 3.5])  # -ln(1 - g) of the nodes
PART = np.array([1, 2, 2, 1]) / 6
NOISE, DRAWS = 0.03, 600


@pytest.fixture(scope="module")
def smooth() -> sparse.csr_array:
    return smoother(positions_grid(X, 0 * X, 0 * X + 4.5), *SMOOTH_RATIOS)


@pytest.fixture(scope="module")
def between(smooth: sparse.csr_array) -> BetweenG:
    return BetweenG((), PART, smooth)


def light() -> np.ndarray:
    """Shape (n_nodes, 1 water, n_cells)."""
    mean = np.exp(-((X / 0.4) ** 2)) + 0.02
    ratios = 1 + 0.4 * np.outer(T - PART @ T, X**2 - 0.3)
    return np.asarray((mean * ratios)[:, None])


def at(between: BetweenG, found: np.ndarray, t: float, errors: bool = False):
    return between.light(found, lagrange(T.tolist(), t), errors)


@pytest.mark.parametrize("t", [1.4, 1.9, 2.6, 3.2])
def test_without_noise_it_is_the_interpolation(between: BetweenG, t: float) -> None:
    value, _ = at(between, light(), t)
    plain = np.tensordot(lagrange(T.tolist(), t), light(), axes=1)
    np.testing.assert_allclose(value, plain, rtol=1e-10)


def test_a_dark_cell_stays_dark(between: BetweenG) -> None:
    found = light()
    found[:, 0, 0] = 0.0
    value, _ = at(between, found, 2.2, errors=True)
    assert value[0, 0] == 0 and np.isfinite(value).all()


@pytest.mark.parametrize("t", [1.7, 2.0, 2.3, 3.0])
def test_noise_is_less_hardly_depends_on_g_and_is_stated(between: BetweenG, t: float) -> None:
    """Against plain interpolation between the nodes: noise of the light, and of its difference over g."""
    rng = np.random.default_rng(0)
    step = 0.1
    ours, plain = [], []
    for _ in range(DRAWS):
        found = light() * (1 + NOISE * rng.standard_normal((4, 1, 21)))
        ours.append([at(between, found, u)[0][0] for u in (t, t + step)])
        plain.append([np.tensordot(lagrange(T.tolist(), u), found, axes=1)[0] for u in (t, t + step)])
    here, there = (np.array(v) / at(between, light(), t)[0][0] for v in (ours, plain))
    scatter, before = here[:, 0].std(axis=0), there[:, 0].std(axis=0)
    change, change_before = ((v[:, 1] - v[:, 0]).std(axis=0) for v in (here, there))
    value, passed_on = at(between, light(), t, errors=True)
    variance = sum((node[0].to(np.eye(21)) ** 2).sum(axis=1) for node in passed_on)
    stated = NOISE * np.sqrt(variance) / value[0]
    np.testing.assert_allclose(scatter, stated, rtol=0.15)  # 600 draws: 3 % of each, 21 cells
    assert np.sqrt((scatter**2).mean()) < 0.9 * np.sqrt((before**2).mean())
    assert np.sqrt((change**2).mean()) < 0.75 * np.sqrt((change_before**2).mean())


def test_errors_are_passed_on_alike_from_either_side(smooth: sparse.csr_array) -> None:
    """To readings from cells, and to cells from errors: one matrix, made here in full."""
    rng = np.random.default_rng(1)
    own, after, before = rng.random((3, 21))
    passed = PassedOn(own, after, before, smooth)
    matrix = np.diag(own) + np.diag(after) @ smooth.toarray() @ np.diag(before)
    np.testing.assert_allclose(passed.to(np.eye(21)), matrix, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(passed.times(np.eye(21)), matrix, rtol=1e-12, atol=1e-14)
    some = np.array([3, 4, 5, 9])
    few = passed.among(some, smooth[some][:, some])
    np.testing.assert_allclose(few.times(np.eye(4)), matrix[np.ix_(some, some)], rtol=1e-12, atol=1e-14)


def test_fewer_modes_are_the_same_errors() -> None:
    """Of more contributions than readings: their covariance stays, of readings of very different size too."""
    modes = np.random.default_rng(2).standard_normal((6, 40)) * 10.0 ** -np.arange(6)[:, None]
    few = as_few(modes)
    assert few.shape == (6, 6)
    size = np.linalg.norm(modes, axis=1)
    assert np.abs((few @ few.T - modes @ modes.T) / np.outer(size, size)).max() < 1e-12
    assert as_few(modes[:, :4]).shape == (6, 4)
