"""Standard errors, covariance, outliers: what the tests of a diagnosis stand on."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import toy_problem

from lightfield.diagnosis.adequacy.robust import (
    outliers,
    scatter_law,
    scattered,
    serial_correlation,
    unstated_error,
)
from lightfield.diagnosis.adequacy.scale import noise_scale
from lightfield.diagnosis.problem.layout import Layout, layout_of
from lightfield.diagnosis.problem.noise import Budget, Noise
from lightfield.diagnosis.problem.quoted import smooth_stderr
from lightfield.diagnosis.problem.whitening import Whitener

RNG = np.random.default_rng(5)


def layout(planes: int = 5, across: int = 21) -> Layout:
    """Read as they stand."""
    return toy_problem.layout(planes, across, in_order=True)


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


@pytest.mark.parametrize("times", [1e-4, 100, 1e4, 1e6])
@pytest.mark.parametrize("poor", [1, 5])
def test_what_is_marked_as_poor_says_nothing_of_the_others(times: float, poor: int) -> None:
    """As `import` does of repeats one of which is wild: the others have the errors that they state."""
    level = 10 ** np.linspace(-3, 0, 75)
    true = np.hypot(0.005 * level, 8e-4)
    quoted = true.copy()
    quoted[40 : 40 + poor] *= times
    others = np.delete(np.arange(75), np.arange(40, 40 + poor))
    smooth = smooth_stderr(quoted, level, np.zeros(75, int))
    np.testing.assert_allclose(smooth[others], true[others], rtol=1e-3)


@pytest.mark.parametrize("unit", [1.0, 0.3, 0.01, 1e-7])
def test_errors_of_bands_in_units_of_their_own_are_smoothed_within_each(unit: float) -> None:
    """A third band calibrated by itself: its dark error is a part of its own brightest reading."""
    level = 10 ** np.linspace(-2.5, 0, 60)
    one = np.hypot(0.005 * level, 8e-4) * np.exp(0.1 * RNG.standard_normal(60))
    true = np.hypot(0.005 * level, 8e-4)
    smooth = smooth_stderr(
        np.r_[one, one, unit * one], np.r_[level, level, unit * level], np.repeat([0, 1, 2], 60)
    )
    np.testing.assert_allclose(smooth, np.r_[true, true, unit * true], rtol=0.08)


def test_whitened_noise_is_white() -> None:
    """Draws from the covariance, whitened, have unit variance and no correlation (20000 draws: 1 %)."""
    lay = layout(3, 5)
    sigma = np.linspace(0.01, 0.02, lay.size)
    lamp = 0.03 * np.linspace(-1, 1, lay.size)[:, None]
    noise = Noise(lay, sigma, np.ones(lay.size), Budget(0.003, 0.0, 0.0), np.zeros(lay.size), lamp_modes=lamp)
    own = replace(noise, lamp_modes=None).covariance(0.4, 1.3, 0.003)
    np.testing.assert_allclose(noise.covariance(0.4, 1.3, 0.003), own + lamp @ lamp.T, atol=1e-18)
    whiten = Whitener(noise, rho=0.4, phi=1.3, tolerance=0.003)
    root = np.linalg.cholesky(noise.covariance(0.4, 1.3, 0.003))
    draws = whiten(root @ RNG.standard_normal((lay.size, 20000)))
    np.testing.assert_allclose(np.cov(draws), np.eye(lay.size), atol=0.05)


def test_an_assumed_plane_gain_needs_a_stay() -> None:
    """In random order a reading has a stay to itself: an assumed gain error must not widen it."""
    ordered, random = layout(), toy_problem.layout(5, 21)
    for lay, wide in ((ordered, True), (random, False)):
        zero = np.zeros(lay.size)
        noise = Noise(lay, zero + 0.01, np.ones(lay.size), Budget(0.003, 0.0, 0.0), zero)
        stays = np.bincount(lay.visit)[lay.visit]
        np.testing.assert_allclose(np.diag(noise.extra(0.0)), np.where(stays > 1, 0.003**2, 0.0))
        assert (stays > 1).all() == wide


def test_bands_of_one_moment_share_the_error_of_their_place() -> None:
    """Of a spectrometer on a stage that stands off by so much at every place: the readings' covariance is
    that of many such tables, with times or without. So do repeats of one band, until the stage moves."""
    rng, per_m = np.random.default_rng(3), np.array([2.0, 5.0, 0.5])  # slope of each band
    x, wavelength = np.repeat(np.linspace(-0.5, 0.5, 4), 3), np.tile([450.0, 520.0, 600.0], 4)
    slope, stage_m = np.tile(per_m, 4), 0.002

    def covariance(wavelengths: np.ndarray, time: np.ndarray) -> np.ndarray:
        zero = np.zeros(12)
        lay = layout_of(
            SimpleNamespace(
                x_m=x, y_m=zero, z_m=zero + 4.5, time_s=time, wavelength_nm=wavelengths,
                medium=np.full(12, "water"), visit=zero + np.nan,
                repeat=zero + np.nan, common_percent=zero + np.nan,
            )
        )  # fmt: skip
        return Noise(lay, zero + 0.01, zero, Budget(0.0, stage_m, 0.0), slope).extra(0.0)

    drawn = np.repeat(stage_m * rng.standard_normal((20_000, 4)), 3, axis=1) * slope
    size = stage_m * np.outer(slope, slope) * stage_m
    moments = np.repeat(np.arange(4) * 20.0, 3)
    for time in (moments, np.full(12, np.nan)):
        np.testing.assert_allclose(covariance(wavelength, time) / size, np.cov(drawn.T) / size, atol=0.04)
    one_band, alone = np.full(12, 520.0), np.diag((stage_m * slope) ** 2)
    np.testing.assert_allclose(
        covariance(one_band, np.arange(12.0)) / size, np.cov(drawn.T) / size, atol=0.04
    )
    to_and_fro = np.arange(12.0).reshape(3, 4).T.ravel()  # every place once, and all once more
    np.testing.assert_allclose(covariance(one_band, to_and_fro), alone)


def correlated(rho: float, n: int, rng: np.random.Generator) -> np.ndarray:
    noise = rng.standard_normal(n)
    for i in range(1, n):
        noise[i] = rho * noise[i - 1] + np.sqrt(1 - rho**2) * noise[i]
    return noise


def test_serial_correlation_is_recovered() -> None:
    """Correlation 0.5 of 315 readings, without the bias of what a fit of 40 smooth terms takes out; the true
    value lies below the lowest and the highest of five equally likely ones as often as it should."""
    lay = layout(15, 21)
    taken = np.linalg.qr(np.cos(np.pi * np.outer(np.arange(lay.size), np.arange(40)) / lay.size))[0]
    found, low, high = [], [], []
    for seed in range(60):
        noise = correlated(0.5, lay.size, np.random.default_rng(seed))
        one = serial_correlation(noise, taken, np.ones(lay.size), lay, 1.0)
        found.append(one.rho)
        low.append(one.levels[0])
        high.append(one.levels[-1])
    assert abs(np.mean(found) - 0.5) < 4 * np.std(found) / np.sqrt(60) + 0.025  # half a step of the grid
    # 10 % each, 4 binomial standard deviations; a step of the grid counts as half.
    for beyond in (np.array(low) - 0.5, 0.5 - np.array(high)):
        assert np.mean((beyond > 0.01) + 0.5 * (np.abs(beyond) < 0.01)) < 0.1 + 4 * 0.039


def test_noise_of_the_stated_size_is_not_strongly_correlated() -> None:
    """Correlation 0.9 that a rich fit hides would mean noise of many times the stated size."""
    lay = layout()
    rng = np.random.default_rng(3)
    x = np.linspace(0, 1, lay.size)
    taken = np.linalg.qr(np.cos(np.pi * np.outer(x, np.arange(60))))[0]
    mean = {}
    for stated in (1.0, None):
        runs = [rng.standard_normal(lay.size) for _ in range(20)]
        all_rho = [serial_correlation(r, taken, np.ones(lay.size), lay, stated).rho for r in runs]
        mean[stated] = float(np.mean(all_rho))
    assert mean[1.0] < 0.3
    assert mean[1.0] < mean[None]


def test_an_error_that_was_not_stated_is_seen_where_it_is_bright() -> None:
    """Twice the stated error at the brightest of 105 readings, nothing at the faintest; and none where all is
    as stated, but for the one set in twenty or so that a level of two standard deviations allows."""
    lay = layout()
    relative = np.exp(-2 * np.abs(lay.x_m))
    most = np.sqrt(1 + 3 * relative**2)
    rich = np.linalg.qr(np.random.default_rng(0).standard_normal((lay.size, 40)))[0]
    seen, mistaken = [], 0
    for seed in range(40):
        noise = np.random.default_rng(seed).standard_normal(lay.size)
        seen.append(unstated_error(most * noise, rich, np.ones(lay.size), 100 * relative, 4.0).max())
        mistaken += unstated_error(noise, rich, np.ones(lay.size), 100 * relative, 4.0).max() > 1
    assert 1.5 < np.mean(seen) <= 2.0
    assert mistaken <= 6


@pytest.mark.parametrize(
    ("stated", "doubted"),
    [("right", False), ("twice", False), ("half", False), ("one for all", True), ("no dark floor", True)],
)
def test_errors_of_another_shape_than_the_scatter_are_replaced(stated: str, doubted: bool) -> None:
    """Noise of 0.5 % and a dark floor of 0.1 % of the brightest, beside 40 free terms, 40 sets. What replaces
    the stated errors has the size of the noise; right shapes are left alone but for one set in ten."""
    lay = layout()
    light = np.exp(-5 * np.abs(lay.x_m))
    true = np.hypot(0.005 * light, 0.001)
    errors = {
        "right": true, "twice": 2 * true, "half": 0.6 * true,
        "one for all": np.full(lay.size, 0.005), "no dark floor": 0.005 * light,
    }[stated]  # fmt: skip
    rich = np.linalg.qr(np.random.default_rng(0).standard_normal((lay.size, 40)))[0]
    laws = []
    for seed in range(40):
        noise = true * np.random.default_rng(seed).standard_normal(lay.size)
        laws.append(scatter_law(noise / errors, rich, np.ones(lay.size), errors, light, 4.0))
    found = [law for law in laws if law is not None]
    assert len(found) >= 36 if doubted else len(found) <= 4
    if doubted:
        typical = np.exp(np.mean(np.log(np.array(found) / true), axis=0))
        assert typical.min() > 0.7 and typical.max() < 1.4


def test_scatter_below_what_instruments_repeat_is_rounding() -> None:
    """Readings that a formula made scatter by 1e-15: their errors are told to be 1e-5 of them."""
    light, errors = np.geomspace(0.01, 1.0, 60), np.full(60, 1e-3)
    rounding = 1e-15 * np.random.default_rng(0).standard_normal(60) * light
    law = scatter_law(rounding / errors, np.ones((60, 1)) / np.sqrt(60), np.ones(60), errors, light, 4.0)
    assert law is not None and (law >= 1e-5 * light).all() and law.max() < 2e-5


def test_outliers_do_not_drag_their_neighbours_along() -> None:
    """Of 105 readings beside 40 free terms, five slips of 10 to 30 sigma: found, and nothing else."""
    lay = layout()
    slips = np.array([3, 29, 52, 77, 97])
    found = np.zeros(lay.size)
    for seed in range(30):
        rng = np.random.default_rng(seed)
        taken = np.linalg.qr(rng.standard_normal((lay.size, 40)))[0]
        residual = rng.standard_normal(lay.size)
        residual[slips] += rng.choice([-1, 1], 5) * rng.uniform(10, 30, 5)
        found += outliers(residual, taken, np.ones(lay.size))
    assert found[slips].mean() > 0.9 * 30
    # One set in twenty, and three standard deviations.
    assert found.sum() - found[slips].sum() <= 0.05 * 30 + 3


def test_a_reading_that_alone_fixes_a_term_is_no_outlier() -> None:
    lay = layout()
    term = np.zeros((lay.size, 1))
    term[10] = 1.0
    residual = np.random.default_rng(1).standard_normal(lay.size)
    residual[[10, 60]] = 25.0
    bad = outliers(residual, term, np.ones(lay.size))
    assert bad[60] and not bad[10]


def test_one_wrong_reading_among_perfect_ones_is_the_outlier() -> None:
    """Readings without any noise, as a calculation gives them: no spread to measure by, still an answer."""
    basis = np.linalg.qr(np.random.default_rng(0).standard_normal((20, 3)))[0]
    residual = np.zeros(20)
    residual[3] = 1.0
    assert np.flatnonzero(outliers(residual, basis, np.ones(20))).tolist() == [3]
    assert not outliers(np.zeros(20), basis, np.ones(20)).any()


def test_a_shadow_is_not_an_outlier() -> None:
    """Wrong readings of one sign at one x in every plane are a finding; wrong readings anywhere, or here too
    high and there too low, are slips."""
    lay = layout()
    shadow = np.isclose(lay.x_m, 0.3)
    misfit = -np.ones(lay.size)
    slips = np.zeros(lay.size, bool)
    slips[[3, 40, 77]] = True
    assert not scattered(shadow, misfit, lay).any()
    assert (scattered(slips, misfit, lay) == slips).all()
    misfit[np.flatnonzero(shadow)[0]] = 1.0
    assert (scattered(shadow, misfit, lay) == shadow).all()


def test_the_scale_of_the_noise_beside_a_large_error_of_the_model() -> None:
    """A model error of twenty sigma in twenty directions, drawn as stated, twice as large or not at all, is
    not mistaken for noise that is larger or smaller than stated (the spread of 75 squares is 16 %)."""
    lay = layout()
    rng = np.random.default_rng(7)
    plain = Whitener(
        Noise(lay, np.full(lay.size, 0.01), np.ones(lay.size), Budget(0, 0, 0), np.zeros(lay.size))
    )
    rich = np.linalg.qr(rng.standard_normal((lay.size, 10)))[0]
    modes = 0.2 * np.linalg.qr(rng.standard_normal((lay.size, 20)))[0]
    for drawn in (0.0, 1.0, 2.0):
        found = []
        for _ in range(40):
            wrong = plain(drawn * modes @ rng.standard_normal(20))
            residual = 1.3 * rng.standard_normal(lay.size) + wrong
            rest = residual - rich @ (rich.T @ residual)
            found.append(noise_scale(rest, rich, plain, modes @ modes.T, np.ones(lay.size)))
        assert abs(np.mean(found) / 1.3**2 - 1) < 4 * 0.16 / np.sqrt(40)


def test_a_model_without_any_light_has_the_errors_of_the_dark() -> None:
    """A background below zero may take all light of a model: nothing divides by it."""
    dark, channel = np.zeros(60), np.zeros(60, int)
    sigma = smooth_stderr(np.tile([0.1, 0.2, 0.3], 20), dark, channel)
    assert sigma.min() >= 0.1
    assert sigma.max() <= 0.3
    assert np.ptp(sigma) == 0
    assert np.all(np.isfinite(smooth_stderr(np.full(60, np.nan), dark, channel)))


def test_next_to_no_light_is_none() -> None:
    """Of 1e-200 the square of an error over it would be no number: the same errors as of no light at all."""
    quoted, channel = np.tile([0.1, 0.2, 0.3], 20), np.zeros(60, int)
    faint = np.linspace(0, 1e-200, 60)
    with np.errstate(divide="raise", invalid="raise", over="raise"):
        sigma = smooth_stderr(quoted, faint, channel)
        law = scatter_law(quoted, np.ones((60, 1)), np.ones(60), quoted, faint, 10.0)
    assert law is None
    np.testing.assert_allclose(sigma, smooth_stderr(quoted, 0 * faint, channel))


@pytest.mark.parametrize("times", [10.0, 1000.0, 10_000.0])
def test_photons_that_know_nothing_leave_a_covariance(times: float) -> None:
    """Errors of photons in single precision, so many times the readings' own: against double precision."""
    lay = layout(10, 100)
    own, modes = np.full(lay.size, 0.01), RNG.standard_normal((lay.size, 300)) / np.sqrt(300)
    modes = (0.01 * times * modes).astype(np.float32)
    noise = Noise(lay, own, np.ones(lay.size), Budget(0.0, 0.0, 0.0), 0 * own, photon_modes=modes)
    exact = np.diag(own**2) + modes.astype(float) @ modes.T.astype(float)
    _, log_determinant = np.linalg.slogdet(exact)
    assert Whitener(noise).log_determinant == pytest.approx(log_determinant, abs=0.01)
