"""Readings without noise, of one effect at a time, as seen by three layouts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.planned import planned_in
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.problem.setup import problem_of, spectral
from lightfield.diagnosis.problem.whitening import unwhitened
from lightfield.experiments.layouts import scan
from lightfield.fitting import effects
from lightfield.fitting.forward import SceneForward
from lightfield.readings import Readings
from lightfield.scene import Scene

#: Errors of a reading, of itself and of the brightest.
OWN, FLOOR = 0.004, 1e-4
#: By how many of them the readings of an effect differ from those without any, all that is always free
#: refitted; and the sizes over the typical one from which that size is reached.
SIGMA, _TIMES, _PART = 30.0, 4.0, 0.3
_DETECTOR = {"planes_m": [2.0, 3.0, 4.0, 5.0, 6.0], "width_m": 1.6}
_COLOURS_NM = (450.0, 500.0, 550.0, 600.0)

LAYOUTS: Mapping[str, tuple[str, dict[str, Any]]] = {
    "line": ("line", {"water": {"absorption_per_m": 0.1}, "detector": _DETECTOR}),
    "grid": ("grid", {"water": {"absorption_per_m": 0.1}, "detector": _DETECTOR}),
    "colours": (
        "half",
        {
            "water": {"base": "pure", "absorption_per_m": 0.03},
            "detector": _DETECTOR | {"bands_nm": [[c - 5.0, c + 5.0] for c in _COLOURS_NM]},
        },
    ),
}


@dataclass(frozen=True)
class Shown:
    """Readings of one effect alone.

    Parameters
    ----------
    effect : Candidate
        Of the problem that the readings pose.
    values : mapping
        Its parameters, and what is always free.
    """

    effect: Candidate
    values: Mapping[str, float]
    problem: Problem
    readings: Readings


def shown(layout: str) -> Iterator[Shown]:
    """Every form of every named effect of direct light that the layout may tell, upwards and downwards."""
    kind, parts = LAYOUTS[layout]
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 6.0}, **parts})
    readings = scan(scene, kind, "random", np.random.default_rng(1))
    scene = spectral(scene, readings)
    table = [effect for effect in effects.table().values() if not effect.diffuse]
    readings, forward = planned_in(readings, scene, None)
    problem, _ = problem_of(forward, readings, table, None)
    unlit = problem.fit((), unwhitened, [problem.model().start]).values
    for one in problem.candidates:
        for sign in (1.0, -1.0):
            if sign > 0 or not one.one_sided:
                made = _readings(scene, forward, readings, {**unlit, **_values(one, sign * _TIMES)})
                delta = _delta(scene, forward, made, table)
                if delta > 1.0:
                    times = sign * _TIMES * SIGMA / delta
                    values = {**unlit, **_values(one, times)}
                    made = _readings(scene, forward, readings, values)
                    again = problem_of(_with(forward, scene, made), made, table, None)[0]
                    mine = next((c for c in again.candidates if c.key == one.key), None)
                    if mine is not None:
                        yield Shown(mine, values, again, made)


def _values(one: Candidate, times: float) -> dict[str, float]:
    """Its parameters at a size over the typical one, well within their range."""
    out = {}
    for parameter, typical in zip(one.amplitudes, one.typical, strict=True):
        low, high = _PART * (parameter.low - parameter.start), _PART * (parameter.high - parameter.start)
        out[parameter.path] = parameter.value(parameter.start + float(np.clip(times * typical, low, high)))
    for parameter, at in zip(one.shapes, one.grid[len(one.grid) // 2], strict=True):
        out[parameter.path] = parameter.value(at)
    return out


def _readings(scene: Scene, forward: SceneForward, table: Readings, values: Mapping[str, float]) -> Readings:
    value: Array = forward.predict(values)
    return replace(table, value=value, stderr=np.hypot(OWN * value, FLOOR * value.max()))


def _with(forward: SceneForward, scene: Scene, table: Readings) -> SceneForward:
    return SceneForward(scene, table, light=forward.light)


def _delta(scene: Scene, forward: SceneForward, made: Readings, table: list[effects.Effect]) -> float:
    """By how many errors readings are missed by what is always free alone."""
    problem, _ = problem_of(_with(forward, scene, made), made, table, None)

    def whiten(a: Array) -> Array:
        return a / (made.stderr if a.ndim == 1 else made.stderr[:, None])

    return float(np.sqrt(problem.fit((), whiten, [problem.model().start]).chi2))
