"""Outliers and serial correlation: against regressions made anew, and at their stated rates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from scipy import stats
from toy_problem import layout

from lightfield.diagnosis.adequacy import robust
from lightfield.diagnosis.adequacy.robust import outliers, scattered

N, K = 105, 12


def basis(n: int = N, k: int = K) -> np.ndarray:
    """Orthonormal cosines: what a rich model can do."""
    return np.linalg.qr(np.cos(np.pi * np.outer((np.arange(n) + 0.5) / n, np.arange(k))))[0]


def test_an_outlier_is_judged_by_a_regression_without_it() -> None:
    """t of a reading: its misfit to a regression on all others over the error of that prediction (Cook and
    Weisberg 1982, section 2.2), the regression made anew."""
    rng, columns = np.random.default_rng(0), basis(30, 4)
    residual = rng.standard_normal(30)
    for out in ([7], [0, 29], [3, 4, 5, 6]):
        judges = np.ones(30, bool)
        judges[out] = False
        t, nu = robust._studentised(residual, columns, judges)
        x, y = columns[judges], residual[judges]
        slopes, rest = np.linalg.lstsq(x, y, rcond=None)[:2]
        assert nu == len(y) - 4
        for i in out:
            error = np.sqrt(rest[0] / nu * (1 + columns[i] @ np.linalg.inv(x.T @ x) @ columns[i]))
            assert t[i] == pytest.approx(abs(residual[i] - columns[i] @ slopes) / error)
        assert not t[judges].any()


def test_a_reading_that_alone_fixes_a_parameter_is_no_outlier() -> None:
    columns = np.linalg.qr(np.column_stack([np.ones(N), np.arange(N) == 40]))[0]
    residual = np.random.default_rng(0).standard_normal(N)
    residual[40] = 1e3
    assert not outliers(residual, columns, np.ones(N)).any()
    residual[41] = 1e3
    assert np.flatnonzero(outliers(residual, columns, np.ones(N))).tolist() == [41]


def flagged(sets: int, n: int = N, spoilt: Sequence[int] = (), size: float = 0.0) -> np.ndarray:
    """Which readings are called outliers, shape (sets, n)."""
    rng, columns, out = np.random.default_rng(11), basis(n), []
    for _ in range(sets):
        residual = rng.standard_normal(n)
        residual[list(spoilt)] += size * rng.choice([-1.0, 1.0], len(spoilt))
        out.append(outliers(residual, columns, np.ones(n)))
    return np.array(out)


@pytest.mark.parametrize("n", [N, 40])
def test_good_readings_are_called_outliers_at_most_at_the_level(n: int) -> None:
    """Any in a set: two tails of OUTLIER_LEVEL where there are many readings, a tenth of it where few; within
    the limit of 99.9 % for 300 sets."""
    alarms = int(flagged(300, n).any(axis=1).sum())
    level = 2 * (robust.OUTLIER_LEVEL if n == N else robust.OUTLIER_LEVEL_FEW)
    assert alarms <= stats.binom.isf(0.001, 300, level)


@pytest.mark.slow
def test_good_readings_are_called_outliers_at_the_level() -> None:
    """5000 sets, two-sided limits of 99.9 %."""
    alarms, level = int(flagged(5000).any(axis=1).sum()), 2 * robust.OUTLIER_LEVEL
    assert stats.binom.isf(0.9995, 5000, level) <= alarms <= stats.binom.isf(0.0005, 5000, level)


def test_gross_errors_are_found_and_nothing_else() -> None:
    """Four of 105 readings 8 sigma off, in 40 sets: all but those whose own noise brings them back."""
    spoilt = [20, 45, 70, 90]
    found = flagged(40, spoilt=spoilt, size=8.0)
    expected = stats.norm.cdf(8 - stats.t.isf(robust.OUTLIER_LEVEL / N, N - K - 4) * np.sqrt(1 + K / N))
    chance = 4 * np.sqrt(expected * (1 - expected) / 160)
    assert found[:, spoilt].mean() == pytest.approx(expected, abs=chance)
    assert np.delete(found, spoilt, axis=1).sum() <= stats.binom.isf(0.001, 40, 2 * robust.OUTLIER_LEVEL)


def test_too_many_outliers_are_not_believed() -> None:
    """At most MAX_OUTLIERS of all readings are left out, those that were left out before included."""
    most = int(robust.MAX_OUTLIERS * N)
    assert flagged(5, spoilt=range(10, 10 * most + 10, 10), size=30.0).sum(axis=1).tolist() == [most] * 5
    assert (flagged(5, spoilt=range(5, 7 * most + 26, 7), size=30.0).sum(axis=1) <= most).all()
    residual = np.random.default_rng(0).standard_normal(N)
    residual[10:70:10] += 30
    keep = np.ones(N)
    keep[-6:] = 0
    assert outliers(residual, basis(), keep).sum() <= most - 6


@pytest.mark.parametrize("spoilt", [[], [20, 45, 70, 90]])
def test_what_is_left_fits_as_well_as_if_the_spoilt_ones_were_known(spoilt: list[int]) -> None:
    """Mean squared error of a regression after outliers are left out, over that of one which is told which
    readings are spoilt: unbiased, and 97 % efficient or better."""
    rng, columns, good = np.random.default_rng(2), basis(), np.ones(N, bool)
    good[spoilt] = False
    ours, oracle, mean = [], [], []
    for _ in range(200):
        residual = rng.standard_normal(N)
        residual[spoilt] += 15.0
        kept = ~outliers(residual, columns, np.ones(N))
        one, two = (np.linalg.lstsq(columns[w], residual[w], rcond=None)[0] for w in (kept, good))
        ours.append(one @ one)
        oracle.append(two @ two)
        mean.append(one)
    assert np.mean(ours) / np.mean(oracle) == pytest.approx(1, abs=0.03)
    # K means of 200 unit normals: chi-square, 99.9 %.
    bias = 200 * np.mean(mean, axis=0) ** 2
    assert bias.sum() < stats.chi2.isf(0.001, K) * np.mean(oracle) / K


def test_a_shadow_is_no_slip() -> None:
    """Three of seven readings at one distance on one side of the model stay; two, or both sides, do not."""
    lay = layout(planes=5, across=7)
    row = np.flatnonzero(lay.plane == 2)
    for members, sign, left_out in (
        (row[:3], [1, 1, 1], False), (row[:2], [1, 1], True), (row[:3], [1, -1, 1], True),
    ):  # fmt: skip
        bad, misfit = np.zeros(lay.size, bool), np.zeros(lay.size)
        bad[members], misfit[members] = True, sign
        assert scattered(bad, misfit, lay)[members].all() == left_out


def test_serial_correlation_of_independent_noise_is_small() -> None:
    """60 sets of white noise: the lowest of five equally likely levels is 0 in all but few."""
    lay, rng = layout(5, 21, in_order=True), np.random.default_rng(0)
    found = [
        robust.serial_correlation(rng.standard_normal(N), basis(), np.ones(N), lay, 1.0) for _ in range(60)
    ]
    # The 10 % quantile lies above 0 in about 10 % of the sets of no correlation.
    assert sum(one.levels[0] > 0 for one in found) <= stats.binom.isf(0.001, 60, 0.1)
    # An estimate without bias, of error s and never less than 0, is s / sqrt(2 pi) in the mean.
    error = 1 / np.sqrt(N - K)
    mean, scatter = np.mean([one.rho for one in found]), np.std([one.rho for one in found]) / np.sqrt(60)
    assert mean < error / np.sqrt(2 * np.pi) + 3 * scatter


def test_many_independent_readings_have_no_serial_correlation() -> None:
    """Of 10,000 the posterior is 0 but for parts of a million: that is none, and costs nothing to whiten."""
    lay, flat, keep = layout(100, 100, in_order=True), np.full((10_000, 1), 0.01), np.ones(10_000)
    found = [
        robust.serial_correlation(np.random.default_rng(k).standard_normal(10_000), flat, keep, lay, 1.0)
        for k in range(4)
    ]
    assert [one.rho for one in found] == [0.0] * 4 and all(set(one.levels) == {0.0} for one in found)


def test_a_weak_serial_correlation_is_not_exaggerated() -> None:
    """0.1 between neighbours of 105, in the mean of 300 sets; were none below 0 possible it would be 0.14."""
    lay, rng = layout(5, 21, in_order=True), np.random.default_rng(1)
    between = np.linalg.cholesky(0.1 ** np.abs(np.subtract.outer(np.arange(N), np.arange(N))))
    found = [
        robust.serial_correlation(between @ rng.standard_normal(N), basis(), np.ones(N), lay, 1.0).rho
        for _ in range(300)
    ]
    assert abs(np.mean(found) - 0.1) < 3 * np.std(found) / np.sqrt(300)
