"""The bounded least squares against problems with a known answer."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import numpy as np
import pytest

from lightfield.fitting import least_squares as fit_module
from lightfield.fitting.least_squares import Model, Parameter, least_squares

T = np.linspace(0, 4, 41)


class Decay:
    """a exp(-k t) + c."""

    size = len(T)

    def predict(self, values: Mapping[str, float]) -> np.ndarray:
        return values["a"] * np.exp(-values["k"] * T) + values.get("c", 0.0)

    def errors(self, values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros((self.size, 0)), np.zeros(self.size)

    def position_slope(self, values: Mapping[str, float]) -> np.ndarray:
        return np.zeros(self.size)


def model(low_c: float = -1.0) -> Model:
    return Model(
        Decay(),
        (
            Parameter("a", -5, 5, 0.0, 1e-6, "log"),
            Parameter("k", 0.0, 10.0, 1.0, 1e-6),
            Parameter("c", low_c, 1.0, 0.1, 1e-6),
        ),
    )


def test_exact_data_give_the_exact_answer() -> None:
    data = 2.5 * np.exp(-0.7 * T) + 0.3
    fit = least_squares(model(), data, lambda a: a / 0.01, model().start, tolerance=1e-10)
    assert fit.chi2 < 1e-8
    np.testing.assert_allclose([fit.values[k] for k in "akc"], [2.5, 0.7, 0.3], rtol=1e-6)


def test_corrected_derivatives_save_evaluations_and_lose_nothing(monkeypatch) -> None:
    """Against derivatives taken anew at every step."""
    data = 2.5 * np.exp(-0.7 * T) + 0.3 + 0.01 * np.sin(9 * T)
    starts = [np.array([a, k, c]) for a in (-1.0, 2.0) for k in (0.3, 3.0) for c in (-0.5, 0.5)]
    found = []
    for oldest in (fit_module._OLDEST, 0):
        monkeypatch.setattr(fit_module, "_OLDEST", oldest)
        fits = [least_squares(model(), data, lambda a: a / 0.01, start) for start in starts]
        assert all(f.converged for f in fits)
        found.append((sum(f.evaluations for f in fits), np.array([f.chi2 for f in fits])))
    (few, chi2), (many, expected) = found
    assert few < 0.9 * many
    np.testing.assert_allclose(chi2, expected, atol=2e-4)


def test_errors_are_those_of_the_linear_theory() -> None:
    """Spread of the estimate over 200 data sets equals the quoted error (its own error is 5 %)."""
    rng = np.random.default_rng(1)
    clean = 2.5 * np.exp(-0.7 * T) + 0.3
    fits = [
        least_squares(model(), clean + 0.02 * rng.standard_normal(len(T)), lambda a: a / 0.02, model().start)
        for _ in range(200)
    ]
    spread = np.std([f.values["k"] for f in fits])
    quoted = np.median([f.stderr()["k"] for f in fits])
    assert 0.85 < spread / quoted < 1.15


def test_a_parameter_at_its_bound_has_no_error() -> None:
    data = 2.5 * np.exp(-0.7 * T) - 0.2
    bounded = model(low_c=0.0)
    fit = least_squares(bounded, data, lambda a: a / 0.01, bounded.start)
    assert fit.at_bound().tolist() == [False, False, True]
    assert np.isnan(fit.stderr()["c"]) and np.isfinite(fit.stderr()["k"])


def test_readings_left_out_do_not_count() -> None:
    data = 2.5 * np.exp(-0.7 * T) + 0.3
    data[7] = 100.0
    keep = np.ones(len(T))
    keep[7] = 0.0
    fit = least_squares(model(), data, lambda a: a / 0.01, model().start, keep)
    assert fit.chi2 < 1e-4


def test_an_infinite_width_is_zero_in_the_scene() -> None:
    width = Parameter("w", 0.0, 25.0, 0.0, 1e-3, "inverse-square")
    assert width.value(0.0) == 0.0
    assert width.value(width.coordinate_of(8.0)) == 8.0


class Given:
    """Any prediction of u and v."""

    def __init__(self, predict: Callable[[float, float], np.ndarray]) -> None:
        self._predict = predict

    size = 50

    def predict(self, values: Mapping[str, float]) -> np.ndarray:
        return self._predict(values["u"], values["v"])

    def errors(self, values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros((self.size, 0)), np.zeros(self.size)

    def position_slope(self, values: Mapping[str, float]) -> np.ndarray:
        return np.zeros(self.size)

    def to_trace(self, found: Iterable[Mapping[str, float]]) -> float | None:
        return None

    def factor_to_traced(self, values: Mapping[str, float]) -> float:
        return 1.0

    def model(self, step: float) -> Model:
        return Model(self, tuple(Parameter(name, -1e6, 1e6, 0.0, step) for name in "uv"))


@pytest.mark.parametrize("apart", [1e-2, 1e-3, 3e-4])
def test_what_is_hardly_determined_is_found_all_the_same(apart: float) -> None:
    """Two columns that are nearly one: 30 in chi-square are to be gained along their difference, beside
    scatter ten times as large as stated."""
    one, other, noise = np.linalg.qr(np.random.default_rng(2).standard_normal((50, 3)))[0].T
    data = 0.05 * one + np.sqrt(30) * other + np.sqrt(470) * noise
    given = Given(lambda u, v: (u + v) * one + v * apart * other)
    fit = least_squares(given.model(1.0), data, lambda a: a, np.zeros(2), tolerance=1e-3)
    assert fit.converged
    assert fit.chi2 < 470.05


def test_a_step_far_better_than_promised_is_taken() -> None:
    """Light of e^-300 at the start: the first step gains 1e200 times what its derivatives promise."""
    given = Given(lambda u, v: np.full(50, np.exp(-300 * (1 - min(u, 1.0)))))
    model = Model(given, (Parameter("u", 0.0, 1.0, 0.0, 1e-6), Parameter("v", 0.0, 0.0, 0.0, 1.0)))
    fit = least_squares(model, np.ones(50), lambda a: a, np.zeros(2))
    assert fit.u[0] == pytest.approx(1.0)
