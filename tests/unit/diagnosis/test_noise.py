"""Standard errors, covariance, outliers: what the tests of a diagnosis stand on."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from lightfield.diagnosis.layout import layout_of
from lightfield.diagnosis.noise import Budget, Noise, Whitener, smooth_stderr
from lightfield.diagnosis.robust import scattered, serial_correlation

RNG = np.random.default_rng(5)


def layout(n_planes: int = 5, n_x: int = 21, order: str = "plane"):
    z, x = (a.ravel() for a in np.meshgrid(np.arange(n_planes) + 4.5, np.linspace(-1, 1, n_x), indexing="ij"))
    n = len(x)
    time = 20.0 * (np.arange(n) if order == "plane" else np.random.default_rng(0).permutation(n))
    return layout_of(
        SimpleNamespace(
            x_m=x, y_m=np.zeros(n), z_m=z, time_s=time, wavelength_nm=np.full(n, 525.0),
            medium=np.full(n, "water"), visit=np.full(n, np.nan),
        )
    )  # fmt: skip


def test_smoothed_errors_follow_the_law_and_not_the_scatter() -> None:
    """Errors from 40 samples scatter by 11 %; the curve through 300 of them must be good to 3 %."""
    level = 10 ** RNG.uniform(-4, 0, 300)
    true = np.hypot(0.01 * level, 0.0008)
    quoted = true * np.sqrt(RNG.chisquare(39, 300) / 39)
    smooth = smooth_stderr(quoted, level, np.zeros(300, int))
    assert np.abs(smooth / true - 1).max() < 0.03


def test_a_reading_marked_as_poor_stays_poor() -> None:
    level = np.linspace(0.1, 1, 60)
    quoted = 0.01 * level
    quoted[17] *= 10
    smooth = smooth_stderr(quoted, level, np.zeros(60, int))
    assert smooth[17] == quoted[17]
    assert smooth[18] < 2 * 0.01 * level[18]


def test_whitened_noise_is_white() -> None:
    """Draws from the covariance, whitened, have unit variance and no correlation (20000 draws: 1 %)."""
    lay = layout(3, 5)
    sigma = np.linspace(0.01, 0.02, lay.size)
    noise = Noise(lay, sigma, np.ones(lay.size), Budget(0.003, 0.0, 0.0), np.zeros(lay.size))
    whiten = Whitener(noise, rho=0.4, phi=1.3, tolerance=0.003)
    root = np.linalg.cholesky(noise.covariance(0.4, 1.3, 0.003))
    draws = whiten(root @ RNG.standard_normal((lay.size, 20000)))
    np.testing.assert_allclose(np.cov(draws), np.eye(lay.size), atol=0.05)


def test_an_assumed_plane_gain_needs_a_stay() -> None:
    """In random order a reading has a stay to itself: an assumed gain error must not widen it."""
    ordered, random = layout(order="plane"), layout(order="random")
    for lay, wide in ((ordered, True), (random, False)):
        zero = np.zeros(lay.size)
        noise = Noise(lay, zero + 0.01, np.ones(lay.size), Budget(0.003, 0.0, 0.0), zero)
        stays = np.bincount(lay.visit)[lay.visit]
        np.testing.assert_allclose(np.diag(noise.extra(0.0)), np.where(stays > 1, 0.003**2, 0.0))
        assert (stays > 1).all() == wide


def test_serial_correlation_is_recovered() -> None:
    """Lag-one correlation 0.5 of 315 readings, without the bias of what a fit of 40 terms takes out."""
    lay = layout(15, 21)
    found, stated = [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        noise = rng.standard_normal(lay.size)
        for i in range(1, lay.size):
            noise[i] = 0.5 * noise[i - 1] + np.sqrt(0.75) * noise[i]
        taken = np.linalg.qr(rng.standard_normal((lay.size, 40)))[0]
        rest = noise - taken @ (taken.T @ noise)
        one = serial_correlation(rest, taken, np.ones(lay.size), lay, rng)
        found.append(one.rho)
        stated.append(one.stderr)
    assert abs(np.mean(found) - 0.5) < 4 * np.mean(stated) / np.sqrt(12)


def test_a_shadow_is_not_an_outlier() -> None:
    """Wrong readings at one x in every plane are a finding; wrong readings anywhere are slips."""
    lay = layout()
    shadow = np.isclose(lay.x_m, 0.3)
    slips = np.zeros(lay.size, bool)
    slips[[3, 40, 77]] = True
    assert not scattered(shadow, lay).any()
    assert (scattered(slips, lay) == slips).all()
