"""Local unknowns as candidates: where the rest is that no effect of the table explains."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import TINY, Array
from lightfield.diagnosis.problem.candidates import Candidate, Setting, candidates
from lightfield.diagnosis.problem.layout import Layout
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.fitting.effects.local import (
    local_unknowns,
    ripple_periods_s,
    shows_corners,
    turns_of_a_square,
)
from lightfield.fitting.effects.own import effects_of
from lightfield.fitting.parameter import FitParameter
from lightfield.readings import Readings
from lightfield.readings.columns import LINE_DECIMALS

#: Starts of a fit: along the readings, in width, in distance. Chosen: a tenth of a scan is met by one.
_PLACES, _WIDTHS, _DISTANCES, _LEVELS, _LEAST = 21, 2, 3, 41, 1e-6
#: The same of a power of the angle, with which corners of a beam grow; and for a first look. Chosen.
_POWERS, _POWERS_AT_ONCE = 4, (2.0, 4.0)
#: For a first look: widths of dips as parts of a scan, how many; steps at so many moments, and clouds between
#: so many planes, at most. Chosen: a fit that looks closer begins where one of them shows.
_PARTS, _SHAPES_WIDE, _MOST_STEPS, _MOST_EDGES = (0.02, 0.25), 5, 200, 6
#: Such a part of a square is none. Derived: rounding of doubles, squared, with room.
_ROUNDING = 1e-20
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


def left_by_an_unknown(
    layout: Layout, misfit: Array, prediction: Array, keep: Array, moves: Array, signal: Array
) -> float:
    """Part of a misfit that the best local unknown leaves, beside all that the model can move; 1: none shows.

    Linear least squares of one amplitude of each, at many places and widths, and two of a ripple in time at
    every period.

    Parameters
    ----------
    misfit, prediction : array, shape (n,)
        In units of the readings' errors.
    moves : array, shape (n, k)
        What the model's parameters move, in these units.
    signal : array, shape (n,)
        The model's readings.
    """
    held = np.linalg.qr(keep[:, None] * moves)[0] if moves.size else np.zeros((len(misfit), 0))

    def beyond(columns: Array) -> Array:
        return np.asarray(columns - held @ (held.T @ columns))

    whole, misfit = float(((keep * misfit) ** 2).sum()), beyond(keep * misfit)
    total = float((misfit**2).sum())
    if total <= _ROUNDING * whole:
        return 1.0
    light = keep * prediction
    shapes = beyond(light[:, None] * np.concatenate(list(_shapes(layout, signal)), axis=1))
    norm = (shapes**2).sum(axis=0)
    taken = (shapes.T @ misfit) ** 2 / np.where(norm > TINY, norm, np.inf)
    most = max(float(taken.max(initial=0.0)), _by_a_ripple(layout, misfit, light, beyond))
    return max(1 - most / total, TINY)


def _shapes(layout: Layout, signal: Array) -> Iterator[Array]:
    """Steps with the reading and in time, dips along x, y and time, plumes that rise before all readings,
    clouds that pass, and four corners of a beam, each of shape (n, k)."""
    level = np.sort(signal)
    yield (signal[:, None] > (0.5 * (level[1:] + level[:-1]))[_some(len(level) - 1)]).astype(float)
    for at in (layout.x_m, layout.y_m, layout.x_m / layout.z_m, layout.y_m / layout.z_m):
        yield _dips(at)
    if layout.has_time:
        when = np.unique(layout.time_s)
        yield (layout.time_s[:, None] > 0.5 * (when[1:] + when[:-1])[_some(len(when) - 1)]).astype(float)
        dips, planes = _dips(layout.time_s), np.unique(np.round(layout.z_m, LINE_DECIMALS))
        for beyond in (-np.inf, *(0.5 * (planes[1:] + planes[:-1]))[_some(len(planes) - 1, _MOST_EDGES)]):
            yield dips * (layout.z_m > beyond)[:, None]
    if shows_corners(layout.x_m, layout.y_m):
        turn = turns_of_a_square(layout.x_m, layout.y_m)
        outward = (layout.angle_rad / layout.angle_rad.max())[:, None] ** _POWERS_AT_ONCE
        yield np.hstack([np.cos(turn)[:, None] * outward, np.sin(turn)[:, None] * outward])


def _dips(at: Array) -> Array:
    """Along a coordinate of the readings, (n,): at many places, of some widths; (n, k)."""
    low, high = float(at.min()), float(at.max())
    if high == low:
        return np.zeros((len(at), 0))
    places = np.linspace(low, high, 2 * _PLACES - 1)
    widths = (high - low) * np.geomspace(*_PARTS, _SHAPES_WIDE)
    off = (at[:, None] - places)[:, :, None] / widths
    return np.exp(-(off**2)).reshape(len(at), -1)


def _some(count: int, most: int = _MOST_STEPS) -> NDArray[np.int_]:
    """So many places among these, evenly."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(int)) if count else np.zeros(0, int)


def _by_a_ripple(layout: Layout, misfit: Array, light: Array, beyond: Callable[[Array], Array]) -> float:
    """Of the square of a misfit what the best ripple of the lamp's power in time takes."""
    ends = ripple_periods_s(layout.time_s) if layout.has_time else None
    if ends is None:
        return 0.0
    span = float(np.ptp(layout.time_s))
    cycles = np.arange(span / ends[1], span / ends[0], _CYCLES_APART)
    phase = 2 * np.pi * cycles[:, None] * layout.time_s / span
    waves = np.stack([np.cos(phase), np.sin(phase)], axis=1) * light
    waves = beyond(waves.reshape(-1, layout.size).T).T.reshape(waves.shape)
    gram, drawn = waves @ waves.transpose(0, 2, 1), waves @ misfit
    taken = np.einsum("ki,ki->k", drawn, np.linalg.solve(gram + TINY * np.eye(2), drawn[..., None])[..., 0])
    return float(taken.max())


def finely(candidate: Candidate) -> Candidate:
    """With starts as near to each other as a narrow structure needs."""
    points = product(*map(_starts, candidate.shapes))
    return replace(candidate, grid=tuple(tuple(map(float, at)) for at in points))


def _starts(shape: FitParameter) -> Array:
    what, low, high = shape.path.rpartition(".")[2], max(shape.low, _LEAST), shape.high
    if what == "period":  # the longest is all angles
        return np.asarray(high / np.arange(1.0, high / low + _CYCLES_APART, _CYCLES_APART))
    if what == "level":
        return np.geomspace(low, high, _LEVELS)
    if what in ("width", "duration"):
        return np.geomspace(low, high, _WIDTHS + 2)[1:-1]
    return np.linspace(shape.low, high, {"z0": _DISTANCES, "power": _POWERS}.get(what, _PLACES))
