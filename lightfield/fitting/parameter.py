"""What a fit moves: parameters with bounds, and a forward model with some of its parameters free."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal, Protocol

import numpy as np

from lightfield.arrays import Array

#: What the lower end of a parameter is, see `FitParameter`.
Lowest = Literal["edge", "none", "sudden"]
#: Path of the reading per unit of light, or the beginning of one per wavelength.
GAIN = "gain"


def is_gain(path: str) -> bool:
    """Is it a reading per unit of light, of all channels or of one?"""
    return path.startswith(GAIN)


class Forward(Protocol):
    """Predicts readings from parameter values; paths that are not given keep the scene's values."""

    def predict(self, values: Mapping[str, float]) -> Array: ...


#: Below this (10/value)^2 what is infinitely wide is meant. Derived: a scene takes widths of up to 1e5.
_UNLIMITED = 1e-8


@dataclass(frozen=True)
class FitParameter:
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
        "linear", "log", "square" (the fit moves value^2, as of what counts only by its spread), or
        "inverse-square" (the fit moves (10/value)^2, 0 standing for infinitely wide).
    limits : tuple of float
        What a scene can have, in the fit's own coordinate.
    lowest : str
        What its lower end is: an "edge" of what is plausible, or a value like others, at which there is
        "none" of something (a face reflects nothing) or a change is "sudden".
    """

    path: str
    low: float
    high: float
    start: float
    step: float
    coordinate: str = "linear"
    limits: tuple[float, float] = (-np.inf, np.inf)
    lowest: Lowest = "edge"

    @property
    def is_held(self) -> bool:
        """Do the bounds leave it no room?"""
        return self.low == self.high

    def held(self, u: float) -> FitParameter:
        """The same, held at the coordinate `u`."""
        return replace(self, low=u, high=u, start=u)

    def end_near(self, u: float) -> float:
        """The bound that is nearer to the coordinate `u`."""
        return self.low if u - self.low <= self.high - u else self.high

    def is_answer(self, u: float) -> bool:
        """Is `u`, at a bound, the end that is a value like others?"""
        return self.lowest != "edge" and self.end_near(u) == self.low

    def value(self, u: float) -> float:
        """Scene value at the fit's coordinate `u`."""
        if self.coordinate == "log":
            return float(np.exp(u))
        if self.coordinate == "square":
            return float(np.sqrt(u)) if u > 0 else 0.0
        if self.coordinate == "inverse-square":
            return float(10.0 / np.sqrt(u)) if u > _UNLIMITED else 0.0
        return float(u)

    def width(self, u: float) -> float:
        """Width of the allowed range as a scene value, by the slope at `u`."""
        return abs(self.high - self.low) * abs(self.slope(u))

    def coordinate_of(self, value: float) -> float:
        """Coordinate of the fit at the scene value."""
        if self.coordinate == "log":
            return float(np.log(value))
        if self.coordinate == "square":
            return float(value**2)
        if self.coordinate == "inverse-square":
            return float((10.0 / value) ** 2) if value > 0 else 0.0
        return float(value)

    def step_from(self, u: float) -> float:
        """Step of a difference that does not leave the bounds."""
        return self.step if u + self.step <= self.high else -self.step

    def slope(self, u: float) -> float:
        """Derivative of the scene value with respect to the fit's coordinate."""
        if self.coordinate == "log":
            return float(np.exp(u))
        if self.coordinate == "square":
            return float(0.5 * u**-0.5) if u > 0 else 0.0
        if self.coordinate == "inverse-square":
            return float(-0.5 * 10.0 * u**-0.5 / u) if u > _UNLIMITED else 0.0
        return 1.0


@dataclass(frozen=True)
class Model:
    """A forward model with some of its parameters free."""

    forward: Forward
    parameters: tuple[FitParameter, ...]

    @property
    def low(self) -> Array:
        return np.array([p.low for p in self.parameters])

    @property
    def high(self) -> Array:
        return np.array([p.high for p in self.parameters])

    @property
    def start(self) -> Array:
        return np.array([p.start for p in self.parameters])

    def at(self, known: Mapping[str, float]) -> Array:
        """Coordinates that are known by path, and the start of the others."""
        return np.array([known.get(p.path, p.start) for p in self.parameters])

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
            if parameter.is_held:
                continue
            step = parameter.step_from(u[i])
            moved = u.copy()
            moved[i] += step
            columns[:, i] = (self.predict(moved) - prediction) / step
        return columns
