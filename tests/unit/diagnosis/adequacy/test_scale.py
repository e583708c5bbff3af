"""The scale of the noise: unbiased, as well known as can be, and near what is stated beside few readings."""

from __future__ import annotations

import numpy as np
import pytest
from toy_problem import layout

from lightfield.diagnosis.adequacy.likelihood import SCALE_SPREAD
from lightfield.diagnosis.adequacy.scale import SMALLEST_SCALE, STATED_COUNT_AS, likeliest_scale, noise_scale
from lightfield.diagnosis.problem.noise import Budget, Noise
from lightfield.diagnosis.problem.whitening import Whitener

K = 12


def basis(n: int) -> np.ndarray:
    """Orthonormal cosines: what a rich model can do."""
    return np.linalg.qr(np.cos(np.pi * np.outer((np.arange(n) + 0.5) / n, np.arange(K))))[0]


def plain_noise(n: int) -> tuple[Noise, Whitener]:
    lay = layout(5, n // 5)
    noise = Noise(lay, np.full(n, 0.01), np.ones(n), Budget(0.0, 0.0, 0.0), np.zeros(n))
    return noise, Whitener(noise)


@pytest.mark.parametrize("phi", [1.0, 2.5])
@pytest.mark.parametrize("gain", [0.0, 0.01])
def test_the_scale_of_the_noise_is_unbiased_and_efficient(phi: float, gain: float) -> None:
    """150 sets of 100 readings beside 12 free terms: the mean scale is the true one, and without other errors
    its spread that of chi-square, sqrt(2 / nu) of it, the least there is (Cramer and Rao). With a gain of
    every stay as large as the noise, which are known, hardly more."""
    n = 100
    noise, plain = plain_noise(n)
    rich, nu = basis(n), n - K
    stay = noise.layout.plane
    extra = gain**2 * (stay[:, None] == stay[None])
    rng, found = np.random.default_rng(4), []
    for _ in range(150):
        errors = np.sqrt(phi) * rng.standard_normal(n) + gain / 0.01 * rng.standard_normal(5)[stay]
        residual = errors - rich @ (rich.T @ errors)
        found.append(noise_scale(residual, rich, plain, extra, np.ones(n)))
    least = phi * np.sqrt(2 / nu)
    assert np.mean(found) == pytest.approx(phi, abs=4 * np.std(found) / np.sqrt(150))
    # The standard deviation of 150 is known to 6 %; five gains take five directions of 88.
    assert np.std(found) == pytest.approx(least, rel=0.25)


def test_beside_few_readings_the_scale_is_near_what_is_stated() -> None:
    """300 sets of eight readings to spare, whose errors are stated as well as stated errors are: ln(scale) of
    what both tell is off by sqrt(2 / (8 + 8)), of the readings alone, though none below a half is
    believed, by more. Of 88 to spare
    errors stated half as large as they are are told to be twice as large, but for a twentieth."""
    rng, off = np.random.default_rng(5), []
    n = K + 8
    plain, rich = plain_noise(n)[1], basis(n)
    for _ in range(300):
        log = SCALE_SPREAD * rng.standard_normal()
        residual = np.exp(log / 2) * rng.standard_normal(n)
        residual -= rich @ (rich.T @ residual)
        both = [noise_scale(residual, rich, plain, np.zeros((n, n)), np.ones(n), k) for k in (0, 8)]
        off.append(np.log(both) - log)
    alone, with_stated = np.sqrt(np.mean(np.square(off), axis=0))
    assert STATED_COUNT_AS == 8
    assert with_stated == pytest.approx(np.sqrt(2 / 16), rel=0.15) and alone > 1.15 * with_stated
    found = likeliest_scale(lambda low, high: lambda x: 88 * x + 352 * np.exp(-x), 4.0, STATED_COUNT_AS)
    assert found == pytest.approx((352 + 8) / 96, rel=1e-4)


def test_a_scale_below_the_smallest_is_not_believed() -> None:
    _, plain = plain_noise(100)
    residual = 0.1 * np.random.default_rng(0).standard_normal(100)
    found = noise_scale(residual, basis(100), plain, np.zeros((100, 100)), np.ones(100))
    assert found == pytest.approx(SMALLEST_SCALE, rel=1e-3)


def test_the_likeliest_scale_is_the_least_of_the_deviance() -> None:
    """Of nu ln(phi) + S / phi the least is at S / nu."""
    nu, square = 40, 130.0
    found = likeliest_scale(lambda low, high: lambda x: nu * x + square * np.exp(-x), square / nu)
    assert found == pytest.approx(square / nu, rel=1e-4)
