"""What each absent effect, and each smooth unknown, would add to the readings at a given fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.layout import Layout
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.fitting.least_squares import Fit, Whiten
from lightfield.fitting.parameter import FitParameter, Forward
from lightfield.readings.columns import LINE_DECIMALS, PLACE_DECIMALS
from lightfield.scene.tank import OPENS_THE_TOP

#: Half width at 1/e of a structure that stands in the light, in metres: a rod, a cable. Chosen.
BUMP_WIDTH_M = 0.06
#: Cycles over the angles that the readings span: effects change slower than this. Half a cycle apart, two
#: ripples are as far from each other as their phases are; at most so many are tried, each at so many phases.
#: Chosen; on three quarters and one and a half of the first no answer hangs (test_cascade.py).
SLOWEST_RIPPLE, _RIPPLES_APART, _MOST_RIPPLES, _PHASES = 4.0, 0.5, 40, 4
#: Cosines of the time of so many readings, and of fewer. Chosen.
_TIME_TERMS, _MANY, _TIME_TERMS_OF_FEW = 6, 80, 2
#: Cosines across the beam at most; at every distance at most, of so many readings for each. Chosen: what a
#: beam does is smooth over a tenth of a scan, and a row needs five readings for a level and a slope.
_ACROSS_TERMS, _PER_PLANE_TERMS, _READINGS_PER_TERM = 10, 3, 5
#: A row of so many readings or more has all of these terms, a shorter one has one. Chosen: two of five each.
_LONG_ROW = 10
#: Places at which a bump is sought at most. Chosen: time against thoroughness.
_MOST_BUMPS = 40
#: Moments at which a step is sought: as parts of the scan from its middle, its ends left alone. Chosen; on
#: fewer no answer hangs (test_cascade.py).
_STEPS = np.linspace(-0.4, 0.4, 17)
#: Keeps the scale of a coordinate finite. Derived: rounding of doubles, with room.
_LEAST_SPAN = 1e-12


@dataclass(frozen=True)
class Template:
    """Whitened derivatives of the readings with respect to an effect's amplitudes, at one shape.

    Parameters
    ----------
    columns : array, shape (n, n_amplitudes)
    """

    candidate: Candidate
    shape: tuple[float, ...]
    columns: Array


def bank(problem: Problem, fit: Fit, whiten: Whiten, at_any_time: bool = False) -> tuple[Template, ...]:
    """Templates of every candidate form whose parameters the fit does not move.

    Parameters
    ----------
    at_any_time : bool
        Also of forms that may begin whenever (`Form`).
    """
    moved = set(fit.paths)
    there = [c.effect for c in problem.candidates if moved & {p.path for p in c.amplitudes}]
    values = fit.values
    raw: list[Array] = []
    labels: list[tuple[Candidate, tuple[float, ...], int]] = []
    for candidate in problem.candidates:
        if candidate.form.at_any_time and not at_any_time:
            continue
        if candidate.form.refines or moved & {p.path for p in candidate.parameters}:
            continue
        if not all(candidate.effect.combines_with(e) or candidate.effect is e for e in there):
            continue
        for shape in candidate.grid:
            with_shape = values | {p.path: p.value(s) for p, s in zip(candidate.shapes, shape, strict=True)}
            # All that scatters shares one phase function: its change alone is no sign of more of it, and
            # would compare two traces, with all their noise.
            shared = candidate.effect.diffuse and candidate.shapes
            at = problem.forward.predict(with_shape) if shared else fit.prediction
            for parameter in candidate.amplitudes:
                raw.append(problem.keep * slope_at(problem.forward, with_shape, parameter, at))
            labels.append((candidate, shape, len(candidate.amplitudes)))
    if not raw:
        return ()
    white = whiten(np.stack(raw, axis=1))
    templates, first = [], 0
    for candidate, shape, count in labels:
        templates.append(Template(candidate, shape, white[:, first : first + count]))
        first += count
    return tuple(templates)


def slope_at(forward: Forward, values: Mapping[str, float], parameter: FitParameter, at: Array) -> Array:
    """Change of the readings, (n,), per unit of a parameter at its neutral value, where they are `at`."""
    step = parameter.step_from(parameter.start)

    def predict(steps: int) -> Array:
        return forward.predict({**values, parameter.path: parameter.value(parameter.start + steps * step)})

    if parameter.path == OPENS_THE_TOP:  # a step, not a slope
        return np.asarray((predict(2) - predict(1)) / step)
    return np.asarray((predict(1) - at) / step)


def _cosines(coordinate: Array, terms: int) -> list[Array]:
    u = (coordinate - coordinate.min()) / max(float(np.ptp(coordinate)), _LEAST_SPAN)
    return [np.cos(k * np.pi * u) for k in range(1, terms + 1)]


def _levels(coordinate: Array) -> int:
    return len(np.unique(np.round(coordinate, PLACE_DECIMALS)))


def _transverse(layout: Layout) -> list[Array]:
    """Cosines in x and in y, as many as half their number of positions."""
    out: list[Array] = []
    for coordinate in (layout.x_m, layout.y_m):
        levels = _levels(coordinate)
        if levels > 1:
            out += _cosines(coordinate, max(1, min(_ACROSS_TERMS, levels // 2)))
    return out


def _per_plane(layout: Layout, fewer: bool) -> list[Array]:
    """A free level and slow cosines across the beam at each distance and channel; fewer than its readings."""
    label = layout.plane_and_channel
    readings = np.bincount(label)
    count = len(readings)
    terms = min(_PER_PLANE_TERMS, max(1, layout.size // (_READINGS_PER_TERM * count) - 1))
    across: list[Array] = []
    for coordinate in (layout.x_m, layout.y_m):
        levels = _levels(coordinate)
        if levels > 2:
            across += _cosines(coordinate, terms if levels >= _LONG_ROW else 1)
    shapes = [np.ones(layout.size), *across]
    return [
        (label == k) * shape
        for k, n in enumerate(readings)
        for shape in (shapes[: n - 1] if fewer else shapes)
    ]


def _bumps(layout: Layout) -> list[Array]:
    out: list[Array] = []
    for coordinate in (layout.x_m, layout.y_m):
        places = np.unique(np.round(coordinate, LINE_DECIMALS))
        if len(places) > 2:
            places = places[:: max(1, len(places) // _MOST_BUMPS)]
            out += [np.exp(-(((coordinate - place) / BUMP_WIDTH_M) ** 2)) for place in places]
    return out


def ripple_periods_rad(layout: Layout) -> Array:
    """Periods in the angle from the axis, shorter than any effect's, no shorter than readings show."""
    levels, extent = _levels(layout.angle_rad), float(np.ptp(layout.angle_rad))
    cycles = np.arange(SLOWEST_RIPPLE, levels / 2, _RIPPLES_APART)
    return np.asarray(extent / cycles[:: max(1, ceil(len(cycles) / _MOST_RIPPLES))])


def ripples(layout: Layout, period_rad: float, phases: int) -> list[Array]:
    """Cosines of the angle from the axis at several phases of half a turn."""
    return [np.cos(2 * np.pi * layout.angle_rad / period_rad + np.pi * k / phases) for k in range(phases)]


def _scans(layout: Layout) -> dict[str, list[Array]]:
    scans: dict[str, list[Array]] = {
        "bump": _bumps(layout), "step": [], "one plane": [],
        "ripple": [c for period in ripple_periods_rad(layout) for c in ripples(layout, period, _PHASES)],
    }  # fmt: skip
    if layout.has_time:
        scans["step"] = [np.sign(layout.phase_of_scan - at) for at in _STEPS]
    if layout.plane.max() > 0:
        scans["one plane"] = [(layout.plane == k) * 1.0 for k in range(int(layout.plane.max()) + 1)]
    return scans


def smooth_unknowns(
    layout: Layout, sigma: Array, prediction: Array, rich: bool = False
) -> Mapping[str, Array]:
    """Readings' changes by unknown causes, each an array of shape (n, k), before whitening.

    "x", "plane", "time" are spans (any combination); "bump", "ripple", "step", "one plane" scans (any single
    column).
    Transverse unknowns are measured in units of the noise; those of time and of single places act as factors.

    Parameters
    ----------
    rich : bool
        Spans alone, beside which outliers are judged: at every distance fewer than its readings, for what is
        met exactly would never be one.
    """
    factor = np.clip(prediction, 0, None)
    spans: dict[str, list[Array]] = {"x": _transverse(layout), "plane": _per_plane(layout, rich), "time": []}
    if layout.has_time:
        spans["time"] = _cosines(
            layout.phase_of_scan, _TIME_TERMS if layout.size >= _MANY else _TIME_TERMS_OF_FEW
        )
    scans = {} if rich else _scans(layout)
    empty = np.zeros((layout.size, 0))
    out: dict[str, Array] = {}
    for name, columns in {**spans, **scans}.items():
        unit = sigma if name in ("x", "plane") else factor
        out[name] = unit[:, None] * np.stack(columns, axis=1) if columns else empty
    return out


def whitened_unknowns(problem: Problem, whiten: Whitener, rich: bool = False) -> dict[str, Array]:
    """`smooth_unknowns` of the readings that are kept, whitened."""
    noise = whiten.noise
    raw = smooth_unknowns(problem.layout, noise.sigma, noise.prediction, rich)
    return {
        name: whiten(problem.keep[:, None] * columns).astype(whiten.kept_as, copy=False)
        for name, columns in raw.items()
    }
