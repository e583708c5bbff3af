"""Scores of light that is known with an error: their mean, predicted and found."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lightfield.diagnosis.adequacy import _score
from lightfield.diagnosis.noisy_slopes import NoisySlopes
from lightfield.diagnosis.templates import Template
from lightfield.fit import Model, Parameter, least_squares

N = 80
X = np.linspace(0, 1, N)
HALO, STEADY = 1 + X, np.exp(-3 * X)
ERROR, NOISE = 0.05, 0.05
GAIN = Parameter("gain", 0.0, 10.0, 1.0, 1e-4)
HAZE = Parameter("haze", 0.0, 10.0, 1.0, 1e-4)
TILT = Parameter("tilt", -5.0, 5.0, 0.0, 1e-4)


class Noisy:
    """gain (steady + haze (1 + tilt x) halo), the halo known to 5 % at every place."""

    size = N

    def __init__(self, z: np.ndarray) -> None:
        self.halo = HALO * (1 + ERROR * z)

    def predict(self, values: Mapping[str, float]) -> np.ndarray:
        bent = values["haze"] * (1 + values.get("tilt", 0.0) * X)
        return values["gain"] * (STEADY + bent * self.halo)

    def errors(self, values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
        bent = values["haze"] * (1 + values.get("tilt", 0.0) * X)
        return np.diag(values["gain"] * bent * HALO * ERROR), np.zeros(N)

    def position_slope(self, values: Mapping[str, float]) -> np.ndarray:
        return np.zeros(N)

    def to_trace(self, found: Any) -> None:
        return None

    def factor_to_traced(self, values: Mapping[str, float]) -> float:
        return 1.0


def test_the_mean_of_a_score_is_what_shared_noise_makes_it() -> None:
    """400 draws of a light without any tilt: the score of the tilt is not zero on average, and predicted.

    Gain and haze are fitted. Beside them the score scatters by 1, its mean of 400 by 0.05.
    """
    rng = np.random.default_rng(0)
    sigma = np.hypot(NOISE, HALO * ERROR)
    candidate: Any = SimpleNamespace(amplitudes=(TILT,), shapes=())
    found, predicted = [], []
    for _ in range(400):
        forward = Noisy(rng.standard_normal(N))
        value = STEADY + HALO + NOISE * rng.standard_normal(N)

        def whiten(columns: np.ndarray) -> np.ndarray:
            return columns / (sigma if columns.ndim == 1 else sigma[:, None])

        fit = least_squares(Model(forward, (GAIN, HAZE)), value, whiten, np.ones(2), np.ones(N))
        there = forward.predict({**fit.values, TILT.path: TILT.step})
        column = whiten((there - fit.prediction) / TILT.step)
        slopes = fit.jacobian
        rest = column - slopes @ np.linalg.lstsq(slopes, column, rcond=None)[0]
        found.append(float(rest @ fit.residual / np.linalg.norm(rest)))
        problem: Any = SimpleNamespace(forward=forward, keep=np.ones(N))
        pretended = NoisySlopes(problem, whiten, fit, np.ones(2, bool))
        predicted.append(pretended.of(Template(candidate, (), column[:, None])))
    assert abs(np.mean(found)) > 5 * 0.05, "without correction the score would be believed"
    assert abs(np.mean(found) - np.mean(predicted)) < 3 * np.std(found) / np.sqrt(len(found))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_direction_of_a_score_has_the_sign_that_its_amplitude_tells(sign: float) -> None:
    """What is taken off is known along the template; a score may look along it or against it."""
    column = sign * np.exp(-((X - 0.4) ** 2))
    candidate: Any = SimpleNamespace(amplitudes=(TILT,), shapes=())
    free = np.ones((N, 1)) / np.sqrt(N)
    score = _score(Template(candidate, (), column[:, None]), free)
    rest = column - column.mean()
    along = np.sign(score.to_amplitude[0, 0]) * score.direction[:, 0]
    np.testing.assert_allclose(along, rest / np.linalg.norm(rest), atol=1e-12)
