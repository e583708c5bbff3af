"""What few repeats know of their scatter, against scatter that is known."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.readings.importing.repeat_noise import FEWEST_PLACES, pooled_variance

PLACES = 60


def repeated(seed: int, repeats: int, spread: float = np.inf) -> tuple[np.ndarray, ...]:
    """Signal, exposure, repeats and their true variance: read noise, photons' noise and flicker.

    Places differ by a chi-squared of `spread` degrees of freedom.
    """
    rng = np.random.default_rng(seed)
    signal = np.exp(rng.uniform(0, 6, PLACES))
    exposure = np.where(signal > 30, 0.1, 1.0)
    variance = 4 / exposure**2 + 0.5 * signal / exposure + (0.004 * signal) ** 2
    if np.isfinite(spread):
        variance = variance * spread / rng.chisquare(spread, PLACES)
    return signal, exposure, signal + rng.normal(size=(repeats, PLACES)) * np.sqrt(variance), variance


def pulls(seed: int, repeats: int, spread: float = np.inf) -> tuple[float, float]:
    """Mean squared error of the means over its stated one: by all places, and by each place alone."""
    signal, exposure, values, _ = repeated(seed, repeats, spread)
    mean, own = values.mean(axis=0), values.var(axis=0, ddof=1)
    pooled, _ = pooled_variance(mean, exposure, own, np.full(PLACES, repeats))
    return tuple(float(np.mean((mean - signal) ** 2 / (v / repeats))) for v in (pooled, own))


def test_three_repeats_state_their_error_with_all_places() -> None:
    """Alone it is (n - 1) / (n - 3) of one too small: for three there is no mean at all. Of 20 tables of 60
    places it is known to 0.04; a curve of three parts found from 120 degrees of freedom adds some 0.05."""
    found = np.array([pulls(seed, 3) for seed in range(20)])
    assert abs(found[:, 0].mean() - 1) < 0.2
    assert found[:, 1].mean() > 3


def test_the_curve_is_that_of_the_noise() -> None:
    _, exposure, values, true = repeated(1, 12)
    own = values.var(axis=0, ddof=1)
    pooled, restless = pooled_variance(values.mean(axis=0), exposure, own, np.full(PLACES, 12))
    # 660 degrees of freedom for three parts: each place's variance to some 10 %; its own, to 43 %.
    assert np.sqrt(np.mean((pooled / true - 1) ** 2)) < 0.15
    assert not restless.any()


def test_a_wild_repeat_is_found_and_tells_nothing_of_the_others() -> None:
    """One of three repeats at one place is of another light; its place keeps the large error."""
    squares = []
    for seed in range(20):
        signal, exposure, values, _ = repeated(seed, 3)
        bright = int(np.argmax(signal))  # of a faint one five times the light is within its noise
        values[1, bright] *= 5
        mean, own = values.mean(axis=0), values.var(axis=0, ddof=1)
        pooled, restless = pooled_variance(mean, exposure, own, np.full(PLACES, 3))
        assert np.flatnonzero(restless).tolist() == [bright]
        assert pooled[bright] == own[bright]
        squares.append(np.delete((mean - signal) ** 2 / (pooled / 3), bright).mean())
    assert abs(np.mean(squares) - 1) < 0.2


def test_places_that_differ_among_themselves_are_not_restless() -> None:
    """Scatter of four degrees of freedom from place to place: some are far off; so places are."""
    found = 0
    for seed in range(20):
        _, exposure, values, _ = repeated(seed, 6, spread=4.0)
        found += pooled_variance(
            values.mean(axis=0), exposure, values.var(axis=0, ddof=1), np.full(PLACES, 6)
        )[1].sum()
    assert found <= 1


def test_a_single_spectrum_gets_the_error_of_its_like() -> None:
    _, exposure, values, true = repeated(3, 6)
    own, repeats = values.var(axis=0, ddof=1), np.full(PLACES, 6)
    own[[4, 9]], repeats[[4, 9]] = np.nan, 1
    pooled, _ = pooled_variance(values.mean(axis=0), exposure, own, repeats)
    assert pooled[[4, 9]] == pytest.approx(true[[4, 9]], rel=0.3)


def test_few_places_say_each_its_own() -> None:
    _, exposure, values, _ = (v[..., : FEWEST_PLACES - 1] for v in repeated(4, 3))
    own = values.var(axis=0, ddof=1)
    assert pooled_variance(values.mean(axis=0), exposure, own, np.full(len(own), 3))[0] is own
