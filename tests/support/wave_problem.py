"""A problem of one effect whose chi-square has more than one valley."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from toy_problem import Untraced

from lightfield.diagnosis.problem.layout import Layout
from lightfield.diagnosis.problem.problem import Problem
from lightfield.fitting.parameter import FitParameter

SIGMA, OMEGA = 0.05, 1.0


class Wave:
    """A sin^2 of unknown frequency and depth, which counts its predictions: read at whole numbers, w and
    pi - w are the same."""

    light = Untraced()

    def __init__(self, x: np.ndarray, calls: list[int]) -> None:
        self.x, self.size, self.calls = x, len(x), calls

    def predict(self, values: Mapping[str, float]) -> np.ndarray:
        self.calls.append(self.size)
        return np.asarray(values["base"] + values["depth"] * np.sin(values["omega"] * self.x) ** 2)

    def subset(self, rows: np.ndarray) -> Wave:
        return Wave(self.x[rows], self.calls)


def wave_problem(x: np.ndarray, seed: int = 0, lay: Layout | None = None) -> tuple[Problem, Any]:
    """The problem, and the effect that is in its readings."""
    forward = Wave(x, [])
    noise = SIGMA * np.random.default_rng(seed).standard_normal(len(x))
    value = forward.predict({"base": 1.0, "depth": 0.5, "omega": OMEGA}) + noise
    depth = FitParameter("depth", 0.0, 2.0, 0.0, 1e-4)
    omega = FitParameter("omega", 0.5, np.pi - 0.5, 2.0, 1e-4)
    wave = SimpleNamespace(
        amplitudes=(depth,), shapes=(omega,), parameters=(depth, omega), grid=((0.8,), (1.3,), (2.0,)),
        effect=SimpleNamespace(instead_of=()),
    )  # fmt: skip
    base = (FitParameter("base", 0.0, 3.0, 1.0, 1e-4),)
    return Problem(cast(Any, forward), cast(Any, lay), value, np.ones(len(x)), base, (cast(Any, wave),)), wave
