"""Numbers and arrays of one state: what the page paints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from lightfield.arrays import Array
from lightfield.explorer.experiment import error_by_light
from lightfield.explorer.fits import Fits
from lightfield.explorer.state import State
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.parameter import GAIN
from lightfield.render.diffuse.dense_water import trace_for

#: Planes whose evaluation is kept ready.
_KEPT_PLANES = 16


@dataclass(frozen=True)
class Evaluation:
    """One state, evaluated.

    Parameters
    ----------
    numbers : mapping
        error_percent, chi2, dof, and whether the trace answers for this water.
    arrays : mapping
        model, formula, residual (sigma): shape (n,), of the readings. map_formula, and map_render once it
        is traced: shape (SIDE, SIDE), at the plane; NaN outside the water.
    """

    numbers: Mapping[str, float | bool | None]
    arrays: Mapping[str, Array]


class Evaluator:
    """Evaluates states of one experiment."""

    def __init__(self, fits: Fits) -> None:
        self.fits, self.experiment = fits, fits.experiment
        self._plane = lru_cache(_KEPT_PLANES)(self._made)

    def of(self, state: State, plane: int, channel: int, with_maps: bool) -> Evaluation:
        """What the page paints of a state."""
        e = self.experiment
        values = self.values(state)
        model = e.forward.predict(values)
        score = self.fits.score(model, self.fits.moved(state.effects))
        residual = np.where(e.problem.keep > 0, (e.problem.value - model) / e.sigma, np.nan)
        arrays = {"model": model, "formula": formula(e.forward, values), "residual": residual}
        some, there = self._plane(plane, channel), self._at_maps(values, channel)
        arrays["map_formula"] = e.places.map_of(formula(some, there))
        if with_maps:
            arrays["map_render"] = e.places.map_of(some.predict(there))
        numbers: dict[str, float | bool | None] = {
            "error_percent": score.error_percent,
            "chi2": score.chi2,
            "dof": score.dof,
            "answers": missing_trace(e.forward, values) is None,
        }
        return Evaluation(numbers, arrays)

    def map_stderr(self, state: State, plane: int, channel: int) -> Array:
        """Standard error of the render at a plane, shape (SIDE, SIDE): photons, and what varies slowly."""
        values = self._at_maps(self.values(state), channel)
        return self.experiment.places.map_of(error_by_light(self._plane(plane, channel), values))

    def values(self, state: State) -> dict[str, float]:
        """Values that count: of the base and of effects that are on."""
        e = self.experiment
        chosen = [e.candidates[key] for key in state.effects]
        paths = [p.path for p in (*e.problem.base, *(p for c in chosen for p in c.parameters))]
        held = {path for c in chosen for path in c.effect.instead_of}
        middle = {p.path: p.value(0.5 * (p.low + p.high)) for p in e.problem.base if p.path in held}
        return {path: state.values[path] for path in paths if path in state.values} | middle

    def _at_maps(self, values: Mapping[str, float], channel: int) -> Mapping[str, float]:
        """The same values, the gain of a wavelength as that of all: maps have one."""
        names = self.experiment.forward.gains.names
        return values if len(names) == 1 else {**values, GAIN: values[names[channel]]}

    def _made(self, plane: int, channel: int) -> SceneForward:
        e = self.experiment
        return e.maps[channel].subset(e.places.rows(plane))


def missing_trace(forward: SceneForward, values: Mapping[str, float]) -> float | None:
    """Scattering coefficient of the water to trace, where these values are beyond the traces made, m^-1."""
    light = forward.light
    b = light.diffuse.dense_water(light.scenes.at(values, validate=False))
    wanted = None if b is None else trace_for(b)
    return None if wanted == light.diffuse.dense_per_m else wanted


def formula(forward: SceneForward, values: Mapping[str, float]) -> Array:
    """Readings by the closed form alone, shape (n,): direct light, as lamp and instrument make it."""
    light = forward.light
    direct = light.direct(light.scenes.at(values, validate=False), forward.readings)
    return forward.reader.read(direct, values)
