"""Local unknowns as candidates: where the rest is that no effect of the table explains."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from lightfield.arrays import TINY, Array
from lightfield.diagnosis.problem.candidates import Candidate, Setting, candidates
from lightfield.diagnosis.problem.layout import Layout
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.fitting.effects.local import local_unknowns, ripple_periods_s
from lightfield.fitting.effects.own import effects_of
from lightfield.fitting.parameter import FitParameter
from lightfield.readings import Readings

#: Starts of a fit: along the readings, in width, in distance. Chosen: a tenth of a scan is met by one.
_PLACES, _WIDTHS, _DISTANCES, _LEAST = 21, 2, 3, 1e-6
#: Two ripples that differ by so many cycles over all angles are as far from each other as their phases are.
#: Derived, as `templates._RIPPLES_APART`.
_CYCLES_APART = 0.5


def with_unknowns(problem: Problem, readings: Readings) -> tuple[Problem, Explanation]:
    """The problem in a scene that may hold a local unknown, and these as candidates: one at a time.

    What the scene has by the same name, a hypothesis of the user's, is none.
    """
    forward = problem.forward
    known = {effect.name for effect in forward.scene.effect}
    unknown = [effect for effect in local_unknowns(readings) if effect.name not in known]
    forward = forward.with_light(forward.light.with_effects(unknown))
    names = {effect.name for effect in unknown}
    low, high = forward.scene.detector.bands_nm[0]
    signal = float(np.max(np.abs(problem.value[problem.keep > 0])))
    setting = Setting(forward.scene, problem.layout, signal, float(high - low), forward.gains.is_absolute)
    mine = [
        replace(effect, apart_from=tuple(names - {effect.name}))
        for effect in effects_of(forward.scene)
        if effect.name in names
    ]
    possible, _ = candidates(setting, mine, [p.path for p in problem.base])
    return replace(problem, forward=forward), tuple(map(finely, possible))


def left_by_a_ripple(layout: Layout, misfit: Array, prediction: Array, keep: Array) -> float:
    """Part of a misfit that the best ripple of the lamp's power in time leaves; 1 where none shows.

    Linear least squares of two amplitudes at every period.

    Parameters
    ----------
    misfit, prediction : array, shape (n,)
        In units of the readings' errors.
    """
    ends = ripple_periods_s(layout.time_s) if layout.has_time else None
    total = float(((keep * misfit) ** 2).sum())
    if ends is None or total == 0:
        return 1.0
    span = float(np.ptp(layout.time_s))
    cycles = np.arange(span / ends[1], span / ends[0], _CYCLES_APART)
    phase = 2 * np.pi * cycles[:, None] * layout.time_s / span
    waves = np.stack([np.cos(phase), np.sin(phase)], axis=1) * (keep * prediction)
    gram, drawn = waves @ waves.transpose(0, 2, 1), waves @ (keep * misfit)
    taken = np.einsum("ki,ki->k", drawn, np.linalg.solve(gram + TINY * np.eye(2), drawn[..., None])[..., 0])
    return 1 - float(taken.max()) / total


def finely(candidate: Candidate) -> Candidate:
    """With starts as near to each other as a narrow structure needs."""
    points = product(*map(_starts, candidate.shapes))
    return replace(candidate, grid=tuple(tuple(map(float, at)) for at in points))


def _starts(shape: FitParameter) -> Array:
    what, low, high = shape.path.rpartition(".")[2], max(shape.low, _LEAST), shape.high
    if what == "period":  # the longest is all angles
        return np.asarray(high / np.arange(1.0, high / low + _CYCLES_APART, _CYCLES_APART))
    if what in ("width", "duration"):
        return np.geomspace(low, high, _WIDTHS + 2)[1:-1]
    return np.linspace(shape.low, high, _DISTANCES if what == "z0" else _PLACES)
