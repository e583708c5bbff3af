"""No known effect explains the readings: is the misfit at least a function of one coordinate?"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lightfield.arrays import TINY, Array
from lightfield.decompositions import solved
from lightfield.diagnosis.adequacy.subspace import beside, orthonormal
from lightfield.diagnosis.adequacy.templates import ripple_periods_rad, ripples
from lightfield.diagnosis.problem.layout import BRIGHT, LEAST_RANGE, Layout
from lightfield.diagnosis.problem.problem import Problem
from lightfield.fitting.least_squares import Fit, Whiten
from lightfield.readings.columns import LINE_DECIMALS

#: Linearisations of a free factor, parts of a step that are tried, and how weak a direction of the step is
#: left alone: a function of the angle can stand in for the beam width. Chosen.
_ITERATIONS, _STEPS, _WEAK = 10, (1.0, 0.3, 0.1), 1e-3
#: Most free levels of a coordinate and readings for each; where there are more, cosines take their place: so
#: many, and readings for each. Chosen: the mean of four has half the noise of one.
_MAX_LEVELS, _MAX_COSINES, _READINGS_PER_TERM = 40, 30, 4
#: More of the time, of which every reading has its own; fewer of the signal, with which it changes slowly.
#: Chosen.
_MAX_TIME_COSINES, _READINGS_PER_TIME_COSINE, _SIGNAL_COSINES = 40, 6, 5
#: Slow changes with the angle that may come with a ripple. Chosen: slower than `templates.SLOWEST_RIPPLE`.
_SLOW_TERMS = 4
#: Columns of a factor are the same when less than this part is left. Chosen: far above rounding.
_SAME_COLUMN = 1e-6
#: Signals below this part of the largest are one. Chosen, as `quoted.ASSUMED_FLOOR`.
_DARKEST = 1e-3
#: Keeps the scale of a coordinate, and a misfit, finite. Derived: rounding of doubles, with room.
_LEAST = 1e-12


@dataclass(frozen=True)
class FreeFactor:
    """How well a free factor that depends on one coordinate alone describes the readings.

    Parameters
    ----------
    score : float
        Sum of squares over the variance scale, plus ln(n) for each of the `terms`.
    explained : float
        Part of the misfit of the base model (beyond noise) that it takes away.
    worst_at : float
        Where along the coordinate the factor departs most from one; NaN for a label.
    period_deg : float, optional
        Of a factor that is periodic in the angle.
    at_one : bool
        It is one everywhere but at one place along the coordinate.
    """

    name: str
    score: float
    terms: int
    explained: float
    worst_at: float
    period_deg: float | None = None
    at_one: bool = False


def _levels(coordinate: Array, limit: int) -> Array | None:
    values, label = np.unique(np.round(coordinate, LINE_DECIMALS), return_inverse=True)
    if not 2 <= len(values) <= limit:
        return None
    return np.asarray((label[:, None] == np.arange(len(values))) * 1.0)


def _cosines(coordinate: Array, terms: int) -> Array:
    u = (coordinate - coordinate.min()) / max(float(np.ptp(coordinate)), _LEAST)
    return np.cos(np.pi * np.outer(u, np.arange(1, terms + 1)))


def _spans(layout: Layout, prediction: Array) -> Mapping[str, tuple[Array, Array]]:
    """Basis (n, k) and coordinate (n,) of each family that the layout can show."""
    n = layout.size
    limit, terms = (min(most, n // _READINGS_PER_TERM) for most in (_MAX_LEVELS, _MAX_COSINES))
    out: dict[str, tuple[Array, Array]] = {}
    for name, coordinate in (("x", layout.x_m), ("y", layout.y_m)):
        if np.ptp(coordinate) > LEAST_RANGE:
            basis = _levels(coordinate, limit)
            out[name] = (_cosines(coordinate, terms) if basis is None else basis, coordinate)
    angle = np.degrees(layout.angle_rad)
    if np.ptp(angle) > LEAST_RANGE:
        out["angle"] = (_cosines(angle, terms), angle)
    if layout.plane.max() > 0:
        out["plane"] = ((layout.plane[:, None] == np.arange(layout.plane.max() + 1)) * 1.0, layout.z_m)
    if layout.has_time:
        minutes = (layout.time_s - layout.time_s.min()) / 60
        out["time"] = (_cosines(minutes, min(_MAX_TIME_COSINES, n // _READINGS_PER_TIME_COSINE)), minutes)
    if (top := prediction.max()) > 0:  # a dark model has no signal to depend on
        level = np.log10(np.maximum(prediction, _DARKEST * top))
        out["signal"] = (_cosines(level, _SIGNAL_COSINES), prediction)
    if layout.channel.max() > 0:
        out["wavelength"] = (
            (layout.channel[:, None] == np.arange(layout.channel.max() + 1)) * 1.0,
            layout.wavelength_nm,
        )
    return out


def _ripple(problem: Problem, whiten: Whiten, base: Fit) -> list[tuple[str, Array, Array, float]]:
    """The best ripple of the angle, on top of slow changes: name, basis, coordinate and period, degrees."""
    layout, factor = problem.layout, problem.keep * base.prediction
    angle, best = np.degrees(layout.angle_rad), (0.0, 0.0)
    slow = _cosines(angle, _SLOW_TERMS)
    free = orthonormal(np.hstack([base.jacobian, whiten(factor[:, None] * slow)]))
    residual = beside(free, base.residual[:, None])
    for period in ripple_periods_rad(layout).tolist():
        waves = whiten(factor[:, None] * np.stack(ripples(layout, period, 2), axis=1))
        explained = float(((orthonormal(beside(free, waves)).T @ residual) ** 2).sum())
        best = max(best, (explained, period))
    if best[1] == 0:
        return []
    basis = np.hstack([slow, np.stack(ripples(layout, best[1], 2), axis=1)])
    return [("angle", basis, angle, float(np.degrees(best[1])))]


def _one_plane(problem: Problem, whiten: Whiten, base: Fit) -> tuple[Array, float] | None:
    """The plane that departs most from the others, as one that stands elsewhere does: its basis and distance.

    Nearer or farther it is brighter and narrower, or the other way round; moved aside it has a slope.
    """
    layout, factor = problem.layout, problem.keep * base.prediction
    angle = layout.angle_rad / max(float(layout.angle_rad.max()), _LEAST)
    shapes = np.stack([np.ones(layout.size), angle**2, layout.x_m, layout.y_m], axis=1)
    free = orthonormal(base.jacobian)
    residual = beside(free, base.residual[:, None])
    best: tuple[float, Array, float] | None = None
    for k in range(int(layout.plane.max()) + 1):
        here = layout.plane == k
        basis = orthonormal(here[:, None] * shapes, _SAME_COLUMN)
        columns = beside(free, whiten(factor[:, None] * basis))
        explained = float(((orthonormal(columns).T @ residual) ** 2).sum())
        if best is None or explained > best[0]:
            best = explained, basis, float(layout.z_m[here].mean())
    return None if best is None or layout.plane.max() == 0 else best[1:]


def _factor_fit(problem: Problem, whiten: Whiten, base: Fit, basis: Array) -> tuple[float, int, Array]:
    """Least squares of base model times (1 + basis @ a), re-linearised; chi-square, terms and factor."""
    unit = orthonormal(basis - basis.mean(0), _SAME_COLUMN)
    model, keep, value = base.model, problem.keep, problem.value
    u, factor = base.u.copy(), np.ones(problem.layout.size)
    best = (base.chi2, factor)
    for _ in range(_ITERATIONS):
        prediction = model.predict(u)
        residual = whiten(keep * (value - prediction * factor))
        nuisance = whiten((keep * factor)[:, None] * model.jacobian(u, prediction))
        shape = whiten((keep * prediction)[:, None] * unit)
        both = np.hstack([nuisance, shape])
        length = np.linalg.norm(both, axis=0) + TINY
        step = solved(both / length, residual, _WEAK) / length
        for part in _STEPS:
            moved = np.clip(u + part * step[: len(u)], model.low, model.high)
            scaled = factor + part * unit @ step[len(u) :]
            rest = whiten(keep * (value - model.predict(moved) * scaled))
            if (chi2 := float(rest @ rest)) < best[0]:
                best, u, factor = (chi2, scaled), moved, scaled
                break
        else:
            break
    return best[0], unit.shape[1], best[1]


def free_factors(problem: Problem, whiten: Whiten, base: Fit, phi: float) -> list[FreeFactor]:
    """Families of free factors, best first.

    Parameters
    ----------
    whiten : callable
        Without serial correlation, which would take a misfit in time for noise.
    phi : float
        Pure-error variance scale.
    """
    n = int(problem.keep.sum())
    noise = phi * (n - len(base.u))
    out: list[FreeFactor] = []

    def tell(
        name: str, chi2: float, terms: int, worst_at: float, period: float | None = None, at_one: bool = False
    ) -> None:
        explained = float((base.chi2 - chi2 - phi * terms) / max(base.chi2 - noise, _LEAST))
        score = chi2 / phi + terms * np.log(n)
        out.append(FreeFactor(name, score, terms, explained, worst_at, period, at_one))

    families = [(name, *span, None) for name, span in _spans(problem.layout, base.prediction).items()]
    for name, basis, coordinate, period in [*families, *_ripple(problem, whiten, base)]:
        chi2, terms, factor = _factor_fit(problem, whiten, base, basis)
        departure = np.abs(factor - np.median(factor)) * (base.prediction > BRIGHT * base.prediction.max())
        # What was chosen of many counts as a number more.
        tell(name, chi2, terms + (period is not None), float(coordinate[departure.argmax()]), period)
    if (one := _one_plane(problem, whiten, base)) is not None:
        chi2, terms, _ = _factor_fit(problem, whiten, base, one[0])
        tell("plane", chi2, terms + 1, one[1], at_one=True)
    return sorted(out, key=lambda c: c.score)
