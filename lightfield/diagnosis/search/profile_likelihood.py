"""Explanations with a shape (the width of a skirt, the g of a phase function) can have several minima, and
errors that the curvature at one of them does not show: profile likelihood over the shape."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise
from math import sqrt

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.problem.problem import FAR_BEHIND, Explanation, Problem
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.fitting.least_squares import Fit, Whiten, least_squares
from lightfield.fitting.parameter import Model

#: Points of a profile over the range of a shape, steps of a fit at each, what they may leave of chi-square.
#: Chosen: time against thoroughness (test_profile_likelihood.py).
_POINTS, _STEPS, _LEFT = 9, 15, 1e-2
#: Steps from every point of a grid before the best is fitted to the end. Chosen: time against thoroughness.
ROUGH_STEPS = 4
#: Within so many standard errors of a minimum a sample is not asked whether it is far behind. Chosen: a
#: little more than TWO_SIGMA asks for.
_BESIDE = 2.1
#: Where chi-square is low enough at the last point of a profile it goes on, so many times so far from the
#: minimum, and so often. Chosen: to eight errors of the curvature there.
_ON, _FARTHER = 2.0, 2
#: Chi-square, in units of the scale, by which another minimum must be lower. Chosen: a third of an error.
LOWER = 0.1
#: Chi-square by which all beyond one and beyond two standard errors is worse. Derived: a parabola.
ONE_SIGMA, TWO_SIGMA = 1.0, 4.0


def with_shapes(fit: Fit, explanation: Explanation) -> list[Array]:
    """Starts from a fit with one effect's shapes moved to each point of their grid."""
    place = {path: i for i, path in enumerate(fit.paths)}
    starts = []
    for candidate in explanation:
        for shape in candidate.grid if candidate.shapes else ():
            start = fit.u.copy()
            for parameter, value in zip(candidate.shapes, shape, strict=True):
                start[place[parameter.path]] = value
            starts.append(start)
    return starts


def restarted(problem: Problem, explanation: Explanation, fit: Fit, whiten: Whiten) -> Fit:
    """The fit, or a better one begun at another shape: a few steps from each, all the way from the best."""
    starts = with_shapes(fit, explanation)
    rough = [problem.rough(explanation, whiten, s, max_steps=ROUGH_STEPS) for s in starts]
    if not rough:
        return fit
    other = problem.fit(explanation, whiten, [min(rough, key=lambda f: f.chi2).u])
    return other if other.chi2 < fit.chi2 else fit


def _along(
    problem: Problem, fit: Fit, whiten: Whiten, path: str, phi: float, far: bool, near: bool = True
) -> list[Fit]:
    """Fits with one parameter held at points near its minimum (`near`), and over its whole range (`far`)."""
    i = fit.paths.index(path)
    parameter = fit.model.parameters[i]
    sigma = float(np.sqrt(fit.covariance(phi)[i, i]))
    known = near and bool(np.isfinite(sigma))
    grid = np.linspace(parameter.low, parameter.high, _POINTS) if far or not known else np.zeros(0)
    if known:
        grid = np.r_[grid, fit.u[i] + sigma * np.array([-2.0, -1.0, 1.0, 2.0])]
    grid = np.unique(np.clip(grid, parameter.low, parameter.high))
    led, out = _leader(problem, fit, whiten), list[Fit]()
    beside = _BESIDE * sigma if known else 0.0
    for side in (grid[grid >= fit.u[i]], grid[grid < fit.u[i]][::-1]):
        row, left = [fit], [*side.tolist()]
        while left:
            value = left.pop(0)
            held = parameter.held(float(value))
            parameters = (*fit.model.parameters[:i], held, *fit.model.parameters[i + 1 :])
            model = Model(fit.model.forward, parameters)
            start, steps = row[-1].u, _STEPS
            if abs(value - fit.u[i]) > beside:
                start, steps = led(model, start)
            row.append(least_squares(model, problem.value, whiten, start, problem.keep, steps, _LEFT))
            inside = known and not left and row[-1].chi2 < fit.chi2 + TWO_SIGMA * phi
            if inside and parameter.low < value < parameter.high and len(row) <= len(side) + _FARTHER:
                on = fit.u[i] + _ON * (value - fit.u[i])
                left.append(float(np.clip(on, parameter.low, parameter.high)))
        chi2 = [f.chi2 for f in row] + [np.inf]
        for k in range(1, len(row)):
            if chi2[k] < min(chi2[k - 1], chi2[k + 1]):  # another valley: down to its bottom
                row.append(least_squares(fit.model, problem.value, whiten, row[k].u, problem.keep))
        out += row[1:]
    return out


def _leader(problem: Problem, fit: Fit, whiten: Whiten) -> Callable[[Model, Array], tuple[Array, int]]:
    """Where a fit begins, and its steps: of many readings, what a sample shows to be far behind is left as it
    has it."""
    if problem.sample is None or not isinstance(whiten, Whitener):
        return lambda _, start: (start, _STEPS)
    rows, some = problem.sample

    def rough(model: Model, start: Array, steps: int) -> Fit:
        there = replace(model, forward=some.forward)
        return least_squares(there, some.value, whiten.of(rows), start, some.keep, steps, _LEFT)

    @cache
    def far() -> float:
        best = rough(fit.model, fit.u, 0).chi2
        return best + FAR_BEHIND * max(1.0, best / len(some.value))

    def led(model: Model, start: Array) -> tuple[Array, int]:
        found = rough(model, start, _STEPS)
        return (found.u, 0) if found.chi2 > far() else (start, _STEPS)

    return led


def lowest(problem: Problem, explanation: Explanation, fit: Fit, whiten: Whiten) -> Fit:
    """The fit, or a better one in another valley over the shapes."""
    points = [
        there
        for candidate in explanation
        for shape in candidate.shapes
        for there in _along(problem, fit, whiten, shape.path, 1.0, far=True, near=False)
    ]
    best = min(points, key=lambda f: f.chi2, default=fit)
    if best.chi2 > fit.chi2 - LOWER:
        return fit
    other = problem.fit(explanation, whiten, [best.u])
    return other if other.chi2 < fit.chi2 else fit


def profiled(
    problem: Problem, explanation: Explanation, fit: Fit, whiten: Whiten, phi: float, far: bool = True
) -> tuple[Fit, Mapping[str, float]]:
    """The lowest minimum over the shapes, and the standard errors that the profile asks for.

    The stated error is such that one of it covers all that lies within 1, two of it all within 4 of the
    lowest chi-square (Rolke, Lopez and Conrad 2005, doi:10.1016/j.nima.2005.05.068, for the intervals).

    Parameters
    ----------
    phi : float
        Pure-error variance in units of the whitening.
    far : bool
        Look for other valleys too.

    Returns
    -------
    fit : Fit
    errors : mapping
        By path, in the scene's unit; empty without shapes.
    """
    shapes = [p.path for c in explanation for p in c.shapes]
    points: list[Fit] = []
    for _ in range(2 if shapes else 0):
        points = [there for path in shapes for there in _along(problem, fit, whiten, path, phi, far)]
        lowest = min(points, key=lambda f: f.chi2)
        if lowest.chi2 > fit.chi2 - LOWER * phi:
            break
        other = problem.fit(explanation, whiten, [lowest.u])
        fit = other if other.chi2 < fit.chi2 else fit
    errors = dict.fromkeys(fit.values if points else (), 0.0)
    for path in shapes:
        for inside, sigmas in _inside(fit, points, path, phi):
            for name, value in inside.items():
                errors[name] = max(errors[name], abs(value - fit.values[name]) / sigmas)
    return fit, errors


def _inside(
    fit: Fit, points: Sequence[Fit], path: str, phi: float
) -> Iterator[tuple[Mapping[str, float], float]]:
    """Values within one and within two standard errors by chi-square, and which of the two.

    At the points of a profile along one parameter, and between neighbours where chi-square passes either
    bound: there its root is taken to be straight, and so are the values beside it.
    """
    row = sorted((fit, *points), key=lambda there: there.values[path])
    roots = [sqrt(max(there.chi2 - fit.chi2, 0.0) / phi) for there in row]
    for there, root in zip(row, roots, strict=True):
        if root <= sqrt(TWO_SIGMA):
            yield there.values, 1.0 if root <= sqrt(ONE_SIGMA) else 2.0
    for (one, a), (other, b) in pairwise(zip(row, roots, strict=True)):
        for bound, sigmas in ((sqrt(ONE_SIGMA), 1.0), (sqrt(TWO_SIGMA), 2.0)):
            if min(a, b) < bound < max(a, b):
                t = (bound - a) / (b - a)
                at = {name: value + t * (other.values[name] - value) for name, value in one.values.items()}
                yield at, sigmas
