"""Bounded least squares of a forward model in a whitened metric."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array

Whiten = Callable[[Array], Array]


class Forward(Protocol):
    """Predicts readings from parameter values; paths that are not given keep the scene's values."""

    @property
    def size(self) -> int: ...

    def predict(self, values: Mapping[str, float]) -> Array: ...

    def errors(self, values: Mapping[str, float]) -> tuple[Array, Array]: ...

    def position_slope(self, values: Mapping[str, float]) -> Array: ...

    def to_trace(self, found: Iterable[Mapping[str, float]]) -> float | None: ...

    def factor_to_traced(self, values: Mapping[str, float]) -> float: ...


@dataclass(frozen=True)
class Parameter:
    """One number that a fit moves.

    Parameters
    ----------
    path : str
        Scene parameter, or "gain" with its channel.
    low, high, start : float
        Bounds and start, in the fit's own coordinate.
    step : float
        Step of finite differences, in the fit's own coordinate.
    coordinate : str
        "linear", "log", or "inverse-square" (the fit moves (10/value)^2, 0 standing for infinitely wide).
    """

    path: str
    low: float
    high: float
    start: float
    step: float
    coordinate: str = "linear"

    def value(self, u: float) -> float:
        """Scene value at the fit's coordinate `u`."""
        if self.coordinate == "log":
            return float(np.exp(u))
        if self.coordinate == "inverse-square":
            return float(10.0 / np.sqrt(u)) if u > 0 else 0.0
        return float(u)

    def width(self, u: float) -> float:
        """Width of the allowed range as a scene value, by the slope at `u`."""
        return abs(self.high - self.low) * abs(self.slope(u))

    def coordinate_of(self, value: float) -> float:
        """Coordinate of the fit at the scene value."""
        if self.coordinate == "log":
            return float(np.log(value))
        if self.coordinate == "inverse-square":
            return float((10.0 / value) ** 2) if value > 0 else 0.0
        return float(value)

    def slope(self, u: float) -> float:
        """Derivative of the scene value with respect to the fit's coordinate."""
        if self.coordinate == "log":
            return float(np.exp(u))
        if self.coordinate == "inverse-square":
            return float(-5.0 * u**-1.5) if u > 0 else 0.0
        return 1.0


@dataclass(frozen=True)
class Model:
    """A forward model with some of its parameters free."""

    forward: Forward
    parameters: tuple[Parameter, ...]

    @property
    def low(self) -> Array:
        return np.array([p.low for p in self.parameters])

    @property
    def high(self) -> Array:
        return np.array([p.high for p in self.parameters])

    @property
    def start(self) -> Array:
        return np.array([p.start for p in self.parameters])

    def values(self, u: Array) -> dict[str, float]:
        """Scene values at the coordinates `u`."""
        return {p.path: p.value(x) for p, x in zip(self.parameters, u, strict=True)}

    def predict(self, u: Array) -> Array:
        """Readings at the coordinates `u`, shape (n_readings,)."""
        return self.forward.predict(self.values(u))

    def jacobian(self, u: Array, prediction: Array) -> Array:
        """Forward differences that never leave the bounds, shape (n_readings, n_parameters).

        Zero for a parameter whose bounds hold it.
        """
        columns = np.zeros((len(prediction), len(self.parameters)))
        for i, parameter in enumerate(self.parameters):
            if parameter.low == parameter.high:
                continue
            step = parameter.step if u[i] + parameter.step <= parameter.high else -parameter.step
            moved = u.copy()
            moved[i] += step
            columns[:, i] = (self.predict(moved) - prediction) / step
        return columns


#: Dampings tried from one point; steps between true derivatives, and how good those steps must be.
_TRIALS, _OLDEST, _GOOD = 9, 2, 0.5
#: Damping that leaves a Newton step, but for directions that are not determined at all.
_NEWTON, _UNDAMPED = 1e-9, 1e-8


@dataclass(frozen=True)
class Fit:
    """A fitted model.

    Parameters
    ----------
    u : array, shape (n_parameters,)
        Coordinates at the minimum.
    prediction, residual : array, shape (n_readings,)
        Model readings; whitened residual, zero where a reading is left out.
    chi2 : float
        Sum of the squared whitened residuals.
    differentiate : callable
        Gives `jacobian`.
    """

    model: Model
    u: Array
    prediction: Array
    residual: Array
    chi2: float
    differentiate: Callable[[Array, Array], Array] = field(repr=False, compare=False)
    converged: bool
    evaluations: int = field(default=0, compare=False)

    @cached_property
    def jacobian(self) -> Array:
        """Whitened derivatives at the minimum, shape (n_readings, n_parameters)."""
        return self.differentiate(self.u, self.prediction)

    @property
    def values(self) -> dict[str, float]:
        """Fitted scene values by path."""
        return self.model.values(self.u)

    @property
    def paths(self) -> tuple[str, ...]:
        return tuple(p.path for p in self.model.parameters)

    def covariance(self, scale: float = 1.0) -> Array:
        """Covariance of the coordinates, shape (n_parameters, n_parameters); NaN rows where undetermined."""
        norm = np.linalg.norm(self.jacobian, axis=0)
        moving = (norm > 0) & ~self.at_bound()
        out = np.full((len(norm), len(norm)), np.nan)
        if not moving.any():
            return out
        scaled = self.jacobian[:, moving] / norm[moving]
        inverse = np.linalg.pinv(scaled.T @ scaled, rcond=1e-12, hermitian=True)
        out[np.ix_(moving, moving)] = scale * inverse / np.outer(norm[moving], norm[moving])
        return out

    def stderr(self, scale: float = 1.0) -> dict[str, float]:
        """Standard error of every scene value; NaN where it is undetermined or at a bound."""
        sigma = np.sqrt(np.diag(self.covariance(scale)))
        return {
            p.path: float(s * abs(p.slope(x)))
            for p, x, s in zip(self.model.parameters, self.u, sigma, strict=True)
        }

    def at_bound(self) -> NDArray[np.bool_]:
        """Which parameters lie at a bound, shape (n_parameters,)."""
        width = 1e-6 * (self.model.high - self.model.low)
        return (self.u <= self.model.low + width) | (self.u >= self.model.high - width)


def _step(hessian: Array, gradient: Array, free: NDArray[np.bool_], damping: float) -> Array:
    """Damped step of the free coordinates, in a metric that their scales do not matter to; 0 for the rest."""
    step = np.zeros(len(free))
    scale = np.sqrt(np.diag(hessian))
    scaled = hessian / np.outer(scale, scale) + damping * np.eye(len(scale))
    step[free] = np.linalg.solve(scaled, gradient / scale) / scale
    return step


def least_squares(
    model: Model,
    value: Array,
    whiten: Whiten,
    start: Sequence[float] | Array,
    keep: Array | None = None,
    max_steps: int = 40,
    tolerance: float = 1e-4,
) -> Fit:
    """Minimise |whiten(value - prediction)|^2 by Levenberg-Marquardt steps projected onto the bounds.

    The damping follows what steps brought of what they promised (Nielsen 1999, report IMM-REP-1999-05). After
    a step that did as promised the derivatives are corrected along it (Broyden 1965, Math. Comp. 19, 577);
    the last step is always taken with true ones.

    Parameters
    ----------
    value : array, shape (n_readings,)
    whiten : callable
        Multiplies columns by the inverse Cholesky factor of the noise covariance.
    start : array, shape (n_parameters,)
    keep : array of 0 and 1, shape (n_readings,), optional
        Readings left out carry 0.
    tolerance : float
        Stop when a step would lower the sum of squares by less than this, in sigma^2, or in the scatter that
        the model leaves where that is larger.
    """
    weight = np.ones(len(value)) if keep is None else keep
    low, high = model.low, model.high

    def differentiate(at: Array, there: Array) -> Array:
        return np.asarray(whiten(weight[:, None] * model.jacobian(at, there)))

    u = np.clip(np.asarray(start, float), low, high)
    prediction = model.predict(u)
    residual = whiten(weight * (value - prediction))
    chi2 = float(residual @ residual)
    damping, evaluations, converged = 1e-3, 1 + len(u), False
    slopes, age = differentiate(u, prediction), 0
    for _ in range(max_steps):
        gradient, hessian = slopes.T @ residual, slopes.T @ slopes
        diagonal = np.diag(hessian) + 1e-300
        free = ~(((u <= low) & (gradient < 0)) | ((u >= high) & (gradient > 0))) & (diagonal > 1e-290)
        little, better = tolerance * max(1.0, chi2 / len(value)), False
        step = partial(_step, hessian[np.ix_(free, free)], gradient[free], free)
        # What is to be gained without bounds and damping: no trial for what would not be felt.
        trials = 0 if gradient @ step(_NEWTON) < little else _TRIALS if age == 0 else 1
        for _ in range(trials):
            trial = np.clip(u + step(damping), low, high)
            trial_prediction = model.predict(trial)
            evaluations += 1
            trial_residual = whiten(weight * (value - trial_prediction))
            trial_chi2 = float(trial_residual @ trial_residual)
            if np.isfinite(trial_chi2) and trial_chi2 < chi2:
                better = True
                break
            if age == 0:
                damping *= 7
        # A damped step may gain little where there is much to gain, along what the readings hardly determine.
        if age == 0 and (not better or (chi2 - trial_chi2 < little and damping <= _UNDAMPED)):
            converged = True
        if better:
            gain, moved = chi2 - trial_chi2, trial - u
            promised = float(moved @ (2 * gradient - hessian @ moved))
            change = residual - trial_residual - slopes @ moved
            u, prediction, residual, chi2 = trial, trial_prediction, trial_residual, trial_chi2
            # Less after a step that did as promised, more after one that did not.
            kept = min(gain / promised, 1.0) if promised > 0 else 0.5
            damping = max(damping * max(1 / 8, 1 - (2 * kept - 1) ** 3), _NEWTON)
        if converged:
            break
        if better and age < _OLDEST and gain > max(little, _GOOD * promised):
            metric = diagonal * moved
            slopes, age = slopes + np.outer(change, metric / (metric @ moved)), age + 1
        else:
            slopes, age = differentiate(u, prediction), 0
            evaluations += len(u)
    return Fit(model, u, prediction, residual, chi2, differentiate, converged, evaluations)
