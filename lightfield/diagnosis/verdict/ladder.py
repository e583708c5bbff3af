"""The ladder: base model, one effect more, one more; each rung with its error, fitted and stored."""

from __future__ import annotations

import heapq
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.layout import BRIGHT
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.diagnosis.problem.quoted import smooth_stderr
from lightfield.diagnosis.search.pool.quick import Begin, quick_fit
from lightfield.fitting.curves import PLANES, field_of
from lightfield.fitting.least_squares import Fit, Whiten

#: Steps of a fit without one plane, from that with it; what a rung's may leave of chi-square. Chosen.
_STEPS, _LEFT = 12, 1e-5
#: Of more effects than this, fits in between and without one plane take the slopes of a neighbouring one, and
#: may leave this of chi-square. Measured: with all their derivatives they take minutes in scattered light.
_FEW, _ROUGHLY = 2, 1e-2
#: Fits in between after which no more orders of the rungs are compared; factor from which a rise of the error
#: in per cent is seen, how much it counts beside its height, and what one to no number counts. Chosen.
_MOST, _SEEN, _RISES, _NO_NUMBER = 40, 1.01, 50.0, 1e3
#: Standard errors above which a reading is clear of them. Chosen: noise over next to no light is no error of
#: a model (three readings of fewer, in the dark rings of a lamp, made that of its explanation 130 %).
_CLEAR = 5.0


@dataclass(frozen=True)
class Step:
    """One rung.

    Parameters
    ----------
    error_percent : float
        Rms of (reading - model) / model over the bright readings.
    held_out_percent : float
        The same, each plane predicted by a fit to the others; NaN with a single plane.
    chi2_per_dof : float
        In units of the covariance at the quoted scale.
    """

    label: str
    explanation: Explanation
    fit: Fit
    error_percent: float
    chi2_per_dof: float
    held_out_percent: float


def bright(problem: Problem) -> NDArray[np.bool_]:
    """Readings that count in the error in per cent, shape (n,), bool: above 5 % of their plane's largest, and
    clear of their own errors where any is."""
    group, value, layout = problem.layout.plane_and_channel, problem.value, problem.layout
    top = np.zeros(int(group.max()) + 1)
    np.maximum.at(top, group, np.where(problem.keep > 0, value, 0.0))
    lit = (value > BRIGHT * top[group]) & (problem.keep > 0)
    clear = lit & (value > _CLEAR * smooth_stderr(problem.forward.readings.stderr, value, layout.channel))
    return np.asarray(clear if clear.any() else lit)


def percent(problem: Problem, prediction: Array, which: NDArray[np.bool_]) -> float:
    """Rms of the residual over the model in per cent; NaN without readings, or where the model is dark."""
    return rms_over(problem.value[which] - prediction[which], prediction[which])


def rms_over(part: Array, model: Array) -> float:
    """Rms of residuals or errors over the model, shape (n,), in per cent; NaN of none, or of a dark model."""
    if not len(model):
        return float("nan")
    # Of no light, or of next to none, there is no part: what comes of it is no finite number.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        rms = float(100 * np.sqrt(np.mean((part / model) ** 2)))
    return rms if np.isfinite(rms) else float("nan")


def held_out(problem: Problem, explanation: Explanation, fit: Fit, whiten: Whiten) -> float:
    """Error in per cent of every plane as predicted by a fit to all others; NaN for gains of planes."""
    plane, counted = problem.layout.plane, bright(problem)
    if plane.max() == 0 or any(field_of(p.path) == PLANES for c in explanation for p in c.amplitudes):
        return float("nan")
    prediction = fit.prediction.copy()
    for k in range(int(plane.max()) + 1):
        others = replace(problem, keep=problem.keep * (plane != k))
        if others.keep.sum() > len(fit.u):
            if len(explanation) <= _FEW:
                refit = others.fit(explanation, whiten, [fit.u], max_steps=_STEPS)
            else:
                refit = _nearby(others, explanation, whiten, fit.u, fit)
            prediction[plane == k] = refit.prediction[plane == k]
    return percent(problem, prediction, counted)


def adds(candidate: Candidate) -> bool:
    """Is it an effect more, and not one of the scene's that is left out or of another size?"""
    return not candidate.is_stated and not any(p.is_held for p in candidate.amplitudes)


def _label(candidate: Candidate) -> str:
    """What a rung changes."""
    if adds(candidate):
        return f"+ {candidate.name}"
    return f"- {candidate.name}" if all(p.is_held for p in candidate.amplitudes) else f"~ {candidate.name}"


def removed(steps: Sequence[Step], scale: float) -> list[float | None]:
    """Share of the base model's misfit beyond noise that each rung removes, in per cent; None for the base.

    Parameters
    ----------
    scale : float
        Pure-error variance in units of the whitening.
    """
    base, last = steps[0].fit, steps[-1].fit
    spare = max(len(base.residual) - len(last.u), 1)
    whole = base.chi2 - min(last.chi2, scale * spare)
    out: list[float | None] = [None]
    for before, after in pairwise(steps):
        out.append(100 * (before.fit.chi2 - after.fit.chi2) / whole if whole > 0 else None)
    return out


def _order(
    problem: Problem, explanation: Explanation, whiten: Whiten, base: Fit, full: Fit, sigma: Array
) -> tuple[Candidate, ...]:
    """The effects in the order in which each lowers the misfit most beside those before it.

    Where the error in per cent rises on that way, as it can while chi-square falls where the model is nearly
    dark, the way on which it is lowest from rung to rung, and rises least. Below the noise no rise is one.
    """
    known, counted = full.by_path, bright(problem)
    floor = rms_over(sigma[counted], full.prediction[counted])
    fits = {frozenset[int](): base, frozenset(range(len(explanation))): full}

    def fitted(order: tuple[int, ...], before: Fit) -> Fit:
        if (key := frozenset(order)) not in fits:
            part = tuple(explanation[i] for i in order)
            start = np.array([*before.u, *(known[p.path] for p in part[-1].parameters)])
            if len(explanation) <= _FEW:
                starts = [start, problem.default_start(base.u, part), _without_the_last(before, part, known)]
                fits[key] = problem.fit(part, whiten, starts)
            else:
                fits[key] = _nearby(problem, part, whiten, start, full)
                if fits[key].chi2 > before.chi2:  # more effects are no worse: those slopes lead elsewhere
                    fits[key] = problem.fit(part, whiten, [start], tolerance=_ROUGHLY)
        return fits[key]

    def longer(order: tuple[int, ...]) -> list[tuple[tuple[int, ...], Fit]]:
        there = [(*order, i) for i in range(len(explanation)) if i not in order]
        return [(one, fitted(one, fits[frozenset(order)])) for one in there]

    def error(order: tuple[int, ...]) -> float:
        told = percent(problem, fits[frozenset(order)].prediction, counted)
        return floor if told < floor else told

    way: tuple[int, ...] = ()
    rises = False
    while len(way) < len(explanation):
        before = error(way)
        way = min(longer(way), key=lambda one: one[1].chi2)[0]
        rises = rises or not error(way) <= _SEEN * before
    # What every way costs so far; when there is no time left, the first to its end.
    ways: list[tuple[float, tuple[int, ...]]] = [(0.0, ())]
    while rises:
        cost, order = heapq.heappop(ways)
        if len(order) == len(explanation):
            way = order
            break
        for one, _ in longer(order):
            more = _cost_of_rung(error(order), error(one)) if len(fits) < _MOST else 0.0
            heapq.heappush(ways, (cost + more, one))
    return tuple(explanation[i] for i in way)


def _without_the_last(before: Fit, part: Explanation, known: Mapping[str, float]) -> Array:
    """Where a set does what it does without its last effect: more of them are no worse from there."""
    last = part[-1]
    return np.array([*before.u, *(p.start for p in last.amplitudes), *(known[p.path] for p in last.shapes)])


def _cost_of_rung(before: float, after: float) -> float:
    """Of a ladder in steps of the error's logarithm: how high a rung lies, and how far it rises."""
    if not np.isfinite(after):
        return _NO_NUMBER
    log = np.log1p(after)
    return float(log + _RISES * max(log - np.log1p(before), 0.0)) if after > _SEEN * before else float(log)


def _nearby(problem: Problem, part: Explanation, whiten: Whiten, start: Array, like: Fit) -> Fit:
    """A fit that begins with the slopes of another one."""
    model = problem.model(part)
    slopes = dict(zip(like.paths, like.jacobian.T, strict=True))
    begin = Begin({p.path: float(u) for p, u in zip(model.parameters, start, strict=True)}, slopes)
    return quick_fit(problem, part, whiten, begin, _STEPS, _ROUGHLY)


def climb(
    problem: Problem,
    explanation: Explanation,
    whiten: Whiten,
    starts: Sequence[Fit],
    phi: float,
    sigma: Array,
    with_held_out: bool = True,
) -> list[Step]:
    """The rungs of an explanation: its effects are added in the order in which they lower the misfit most.

    Parameters
    ----------
    starts : sequence of Fit
        Fits whose coordinates may serve as starts: the base, and the explanation's own.
    phi : float
        Variance scale of the whitening, taken back out of chi-square.
    sigma : array, shape (n,)
        Standard errors of the readings.
    """
    base, full = starts[0], starts[-1]
    order = _order(problem, explanation, whiten, base, full, sigma)
    # What takes the place of a base parameter comes first: the rest would be bent to do its work.
    order = tuple(sorted(order, key=lambda c: not c.effect.instead_of))
    bent = any(c.effect.instead_of for c in order)
    steps: list[Step] = []
    counted, n = bright(problem), int(problem.keep.sum())
    fit = base
    for k in range(len(order) + 1):
        part = order[:k]
        if k:
            known = full.by_path
            own = [known[p.path] for p in order[k - 1].parameters]
            if k < len(order):
                left, start = _LEFT if len(order) <= _FEW else _ROUGHLY, np.concatenate([fit.u, own])
                before, fit = fit, problem.fit(part, whiten, [start], tolerance=left)
                if fit.chi2 > before.chi2:  # beside less than the whole set its own size may be far too large
                    less = _without_the_last(before, part, known)
                    fit = problem.fit(part, whiten, [start, less], tolerance=left)
            else:  # the best set as it is told: from elsewhere it may come to another minimum
                fit = problem.fit(part, whiten, [problem.model(part).at(known)], max_steps=0)
        label = "base" if not k else _label(order[k - 1])
        dof = max(n - len(fit.u), 1)
        steps.append(
            Step(
                label,
                part,
                fit,
                percent(problem, fit.prediction, counted),
                fit.chi2 * phi / dof,
                held_out(problem, part, fit, whiten) if with_held_out and (k or not bent) else float("nan"),
            )
        )
    return steps
