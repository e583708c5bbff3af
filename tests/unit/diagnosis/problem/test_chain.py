"""Whitening of many readings: the factor along a chain of blocks is the Cholesky factor of the covariance."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lightfield.diagnosis.adequacy.scale import noise_scale, scale_along
from lightfield.diagnosis.problem import noise as noise_module
from lightfield.diagnosis.problem.chain import fewer_columns, low_rank
from lightfield.diagnosis.problem.layout import Layout, one_by_one
from lightfield.diagnosis.problem.noise import Budget, Noise
from lightfield.diagnosis.problem.whitening import DenseFactor, Whitener


def layout(n: int, rng: np.random.Generator, stays: int = 3, channels: int = 2, ties: bool = False) -> Layout:
    """Readings at random places in random order; with ties some share a moment, and its place."""
    channel, time = rng.integers(0, channels, n), rng.permutation(n).astype(float)
    time = np.unique(np.floor(0.7 * time) if ties else time, return_inverse=True)[1].astype(float)
    places, air = rng.normal(0, 1, (3, n)), rng.random(n) < 0.3
    if ties:
        places, air = places[:, time.astype(int)], air[time.astype(int)]
    scan = one_by_one(time[None], np.zeros(n), channel).astype(float)
    return Layout(
        *places, time, np.where(channel, 500.0, 600.0), air, channel,
        rng.integers(0, 4, n), rng.integers(0, stays, n), np.lexsort((scan, channel)), scan,
        np.unique(time, return_inverse=True)[1], 0.01 * ties * np.random.default_rng(n).random(n),
    )  # fmt: skip


def noise_of(
    n: int, seed: int, gain: float, stated: bool, stage_m: float, modes: int, smooth: float, ties: bool
) -> Noise:
    rng = np.random.default_rng(seed)
    return Noise(
        layout(n, rng, int(rng.integers(1, n + 1)), int(rng.integers(1, 4)), ties),
        0.01 * (1 + rng.random(n)), rng.random(n), Budget(gain, stage_m, 0.0, stated), rng.random(n),
        0.02 * rng.normal(size=(n, modes)), smooth * rng.random(n),
    )  # fmt: skip


@settings(max_examples=60, deadline=None)
@given(
    noise=st.builds(
        noise_of,
        n=st.integers(1, 60),
        seed=st.integers(0, 10**6),
        gain=st.sampled_from([0.0, 0.003, 0.05]),
        stated=st.booleans(),
        stage_m=st.sampled_from([0.0, 0.005]),
        modes=st.integers(0, 4),
        smooth=st.sampled_from([0.0, 0.01]),
        ties=st.booleans(),
    ),
    rho=st.sampled_from([0.0, 0.3, 0.9]),
    phi=st.floats(0.5, 4.0),
    tolerance=st.sampled_from([0.0, 0.003]),
    block=st.integers(1, 25),
)
def test_the_chain_is_the_dense_cholesky_factor(
    noise: Noise, rho: float, phi: float, tolerance: float, block: int
) -> None:
    """Product, inverse and determinant, whatever of stays, channels, serial correlation and smooth errors
    crosses the blocks. Nothing is left out here but rounding, which ties in time (correlation 1 - 1e-9) and
    the decomposition of the smooth errors enlarge."""
    n = noise.layout.size
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(noise_module, "_LEFT_OUT", 1e-11)
        whiten = Whitener(noise, rho, phi, tolerance, block)
    dense = noise.covariance(rho, phi, tolerance)
    root = whiten.coloured(np.eye(n))
    scale = np.sqrt(np.diag(dense))
    np.testing.assert_allclose(
        root @ root.T / np.outer(scale, scale), dense / np.outer(scale, scale), atol=1e-9
    )
    order = np.argsort(noise.layout.position, kind="stable") if n > block else np.arange(n)
    lower = root[np.ix_(order, order)]
    assert np.abs(np.triu(lower, 1)).max() == 0 and (np.diag(lower) > 0).all()
    columns = np.random.default_rng(1).normal(size=(n, 3))
    np.testing.assert_allclose(whiten.coloured(whiten(columns)), columns, atol=1e-9)
    np.testing.assert_allclose(whiten(columns)[:, 0], whiten(columns[:, 0]), atol=1e-9)
    white = whiten(columns)
    solved = np.linalg.solve(dense, columns)
    np.testing.assert_allclose(white.T @ white, columns.T @ solved, rtol=1e-4 if rho else 1e-6)
    assert abs(whiten.log_determinant - np.linalg.slogdet(dense)[1]) < (1e-3 if rho else 1e-6) * n
    np.testing.assert_allclose(noise.variance(phi, tolerance), np.diag(dense), rtol=1e-8)


def test_some_of_many_readings_are_whitened_like_all() -> None:
    """A fifth of 1000, two at a moment: what they share is labelled from 0 again."""
    rng = np.random.default_rng(5)
    moment = np.repeat(rng.permutation(500), 2)
    lay = replace(layout(1000, rng), spectrum=moment, common=np.full(1000, 0.02))
    noise = Noise(lay, np.full(1000, 0.01), rng.random(1000), Budget(0.003, 0.0, 0.0), np.zeros(1000))
    rows = moment >= 400
    some, dense = Whitener(noise.subset(rows), block=40), noise.covariance(0.0, 1.0, 0.0)[np.ix_(rows, rows)]
    column = rng.standard_normal(int(rows.sum()))
    assert some(column) @ some(column) == pytest.approx(column @ np.linalg.solve(dense, column), rel=1e-9)


def test_what_is_left_out_between_blocks() -> None:
    """Of the tolerated error of 800 readings, six times their own noise, as much is left out between blocks
    as is stated: chi-square and determinant stay right to that part."""
    rng = np.random.default_rng(3)
    lay = layout(800, rng)
    noise = Noise(lay, np.full(800, 0.01), np.ones(800), Budget(0.003, 0.0, 0.0), np.zeros(800))
    dense, chain = (Whitener(noise, 0.3, 1.0, 0.06, block) for block in (800, 64))
    residual = dense.coloured(rng.standard_normal(800))
    assert dense(residual) @ dense(residual) == pytest.approx(chain(residual) @ chain(residual), rel=1e-4)
    assert chain.log_determinant == pytest.approx(dense.log_determinant, rel=1e-4)


def test_columns_of_low_rank() -> None:
    """No variance differs by more than the tolerance, with far fewer columns than rows."""
    x = np.sort(np.random.default_rng(0).uniform(-1, 1, 3000))

    def between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        out = np.exp(-0.5 * (np.subtract.outer(x[a], x[b]) / 0.25) ** 2)
        return np.asarray(out, kind)

    for kind, tolerance, rounding in ((float, 1e-2, 1e-9), (float, 1e-6, 1e-9), (np.float32, 1e-4, 1e-5)):
        columns = low_rank(between, np.ones(len(x)), tolerance)
        assert columns.dtype == kind and columns.shape[1] < 40
        left = 1 - (columns.astype(float) ** 2).sum(1)
        assert left.min() > -rounding and left.max() <= tolerance + rounding
    assert low_rank(lambda a, b: np.zeros((len(a), len(b))), np.zeros(5), 1e-6).shape == (5, 0)


def test_fewer_columns_tell_the_same_covariance_but_for_its_least_directions() -> None:
    """What goes is no more than was allowed in the mean over rows, and no fewer columns can do it (Eckart and
    Young 1936, doi:10.1007/BF02288367)."""
    rng, allowed = np.random.default_rng(0), 1e-3
    own, columns = 1 + rng.random(400), rng.normal(size=(400, 60)) * np.geomspace(1, 1e-4, 60)
    kept = fewer_columns([columns[:, :20], columns[:, 20:]], own, allowed)
    left = (columns @ columns.T - kept @ kept.T) / np.outer(own, own)
    assert 0.1 * allowed < np.diag(left).mean() < 1.001 * allowed
    square = np.linalg.svd(columns / own[:, None], compute_uv=False)[::-1] ** 2
    assert np.linalg.eigvalsh(left).min() > -1e-6 * square[-1]  # rounding of single precision
    assert kept.shape[1] == 60 - int((np.cumsum(square) <= allowed * 400).sum()) < 60
    assert fewer_columns([columns], own, 0.0).shape == columns.shape


def test_many_readings_are_whitened_as_few_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fewer columns and single precision move chi-square and determinant by less than what is left out."""
    noise = noise_of(700, 3, 0.003, True, 0.0, 20, 0.01, False)
    columns = noise.sigma[:, None] * np.random.default_rng(1).normal(size=(700, 40))
    exact = Whitener(noise, 0.3, 1.0, 0.003, 100)
    monkeypatch.setattr(noise_module, "_MANY", 600)
    quick = Whitener(replace(noise), 0.3, 1.0, 0.003, 100)
    assert quick.noise.smooth_columns(0.003).shape[1] < exact.noise.smooth_columns(0.003).shape[1]
    chi2 = (exact(columns) ** 2).sum(0)
    np.testing.assert_allclose((quick(columns) ** 2).sum(0), chi2, rtol=2 * noise_module._LEFT_OUT)
    assert abs(quick.log_determinant - exact.log_determinant) < 2 * noise_module._LEFT_OUT * 700
    np.testing.assert_allclose(quick.coloured(quick(columns)), columns, rtol=1e-4, atol=1e-6)


def test_readings_that_share_photons_are_one_block() -> None:
    """Of 600 the factor is the dense one, and nobody has asked how few columns tell what they share."""
    noise = noise_of(600, 3, 0.003, True, 0.0, 20, 0.01, False)
    columns = np.random.default_rng(1).normal(size=(600, 5))
    white, dense = Whitener(noise, 0.3)(columns), np.linalg.cholesky(noise.covariance(0.3, 1.0, 0.0))
    np.testing.assert_allclose(white, np.linalg.solve(dense, columns), rtol=1e-9, atol=1e-9)
    assert not noise._smooth_columns


@pytest.mark.parametrize("k", [0, 1, 2, 30])
def test_a_dense_factor_is_that_of_numpy(k: int) -> None:
    rng = np.random.default_rng(k)
    square, columns = rng.normal(size=(50, 60)), rng.normal(size=(50, k))
    covariance = square @ square.T
    root, factor = np.linalg.cholesky(covariance), DenseFactor(covariance.copy())
    assert factor.log_determinant == pytest.approx(np.linalg.slogdet(covariance)[1], rel=1e-12)
    np.testing.assert_allclose(factor.white(columns), np.linalg.solve(root, columns), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(factor.coloured(columns), root @ columns, rtol=1e-12, atol=1e-12)


def test_what_is_no_covariance_has_no_factor() -> None:
    with pytest.raises(np.linalg.LinAlgError):
        DenseFactor(np.array([[1.0, 2.0], [2.0, 1.0]]))


@pytest.mark.parametrize("rho", [0.0, 0.4])
@pytest.mark.parametrize("stage_m", [0.0, 0.01])
def test_the_scale_of_the_noise_is_that_of_the_dense_covariance(rho: float, stage_m: float) -> None:
    """Both are the same restricted likelihood; a minimum is looked for to 1e-5."""
    rng = np.random.default_rng(5)
    n = 240
    noise = Noise(
        layout(n, rng, stays=8), 0.01 * (1 + rng.random(n)), rng.random(n), Budget(0.01, stage_m, 0.0),
        rng.random(n), 0.01 * rng.normal(size=(n, 3)), 0.01 * rng.random(n),
    )  # fmt: skip
    keep = np.ones(n)
    if rho == 0:  # correlated readings that are left out are treated in another way
        keep[[3, 77]] = 0.0
    plain = Whitener(
        replace(noise, budget=Budget(0.0, 0.0, 0.0), photon_modes=None, response_error=None), rho
    )
    rich = np.linalg.qr(plain(keep[:, None] * plain.coloured(rng.normal(size=(n, 12)))))[0]
    raw = Whitener(noise, rho, 1.7, 0.003).coloured(rng.standard_normal(n))
    residual = plain(keep * raw)
    few = noise_scale(residual, rich, plain, noise.extra(0.003), keep)
    assert scale_along(residual, rich, plain, noise, 0.003, keep) == pytest.approx(few, rel=2e-4)


def test_whitening_many_readings_takes_little_memory() -> None:
    """Of 6000 readings with gains, serial correlation and a tolerance no matrix of 6000 x 6000 (288 MB) is
    ever made."""
    n, rng = 6000, np.random.default_rng(0)
    z, x = np.repeat(np.linspace(4, 8, 6), n // 6), np.tile(np.linspace(-1, 1, n // 6), 6)
    place = np.arange(n)
    lay = Layout(
        x, np.zeros(n), z, 20.0 * place, np.full(n, 525.0), np.zeros(n, bool), 0 * place, place // 1000,
        place // 50, place, place.astype(float), place, np.zeros(n),
    )  # fmt: skip
    noise = Noise(lay, np.full(n, 0.01), np.ones(n), Budget(0.003, 0.0, 0.0), np.zeros(n))
    tracemalloc.start()
    white = Whitener(noise, 0.5, 1.0, 0.003)(rng.standard_normal((n, 2)))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert np.isfinite(white).all() and peak < 8 * n * n


@pytest.mark.parametrize("block", [None, 64])
def test_a_factor_that_was_forgotten_is_made_again(block: int | None) -> None:
    noise = noise_of(300, 3, 0.003, True, 0.0, 5, 0.01, False)
    columns = np.random.default_rng(1).normal(size=(300, 5))
    whiten = Whitener(noise, 0.3, 1.0, 0.003, block)
    before = whiten(columns)
    whiten.forget()
    assert "_factor" not in vars(whiten) and not noise._smooth_columns
    np.testing.assert_array_equal(whiten(columns), before)
    np.testing.assert_allclose(whiten.coloured(before), columns, rtol=1e-9, atol=1e-9)
