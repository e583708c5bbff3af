"""Fits that begin with slopes known from a neighbouring set, and keep them up to date as they go.

A step takes one prediction instead of one for every parameter: the slopes follow what a step has shown of
them (Broyden 1965, doi:10.1090/S0025-5718-1965-0198670-6), within damped Gauss-Newton steps (Marquardt 1963,
doi:10.1137/0111030). Slopes are taken anew where a step fails.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from lightfield.arrays import TINY, Array
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.diagnosis.search.followed import is_followed
from lightfield.diagnosis.search.small_sets import clipped
from lightfield.fitting.least_squares import Fit, Whiten

#: Damping to begin with, at least, and by how much it falls and rises; steps that fail before the slopes are
#: taken anew, and with new ones before it ends. Chosen (test_quick.py compares with least squares).
_DAMPING, _LEAST, _FALL, _RISE, _FAILURES, _GIVEN_UP = 1e-3, 1e-9, 10.0, 10.0, 3, 8
#: How often slopes are taken anew before a fit counts as ended. Chosen.
_RENEWALS = 6
#: Rounds for each parameter in which a step finds what it holds at bounds: a few do. Chosen: no endless loop.
_ROUNDS = 3
#: What a fit may leave of its distance from sets near the best. Chosen: what is added to it is ranked by what
#: it would save, and what is added to is fitted to the end.
_OF_DISTANCE = 0.01
#: A parameter this near to a bound that it is drawn to, as part of its range, is held there. Derived:
#: rounding of doubles, with room.
_AT = 1e-9
#: Part of its range within which a score may start an amplitude. Chosen: a start alone; half and twice alike.
_PART = 0.4


@dataclass(frozen=True)
class Begin:
    """Where a fit begins.

    Parameters
    ----------
    u : mapping
        Coordinates by path; what is missing starts where the parameter does.
    slopes : mapping of array, shape (n,)
        Whitened derivatives by path, roughly; what is missing is taken by differences.
    """

    u: Mapping[str, float]
    slopes: Mapping[str, Array] = field(default_factory=dict)


def with_effect(
    begin: Begin, candidate: Candidate, amplitudes: Array, shape: Sequence[float], columns: Array
) -> Begin:
    """The same with an effect more, as a score asks for it.

    Parameters
    ----------
    columns : array, shape (n, n_amplitudes)
        Its whitened template.
    """
    values = [*clipped(candidate, amplitudes, _PART), *shape]
    own = {p.path: float(u) for p, u in zip(candidate.parameters, values, strict=True)}
    slopes = {p.path: column for p, column in zip(candidate.amplitudes, columns.T, strict=True)}
    return Begin({**begin.u, **own}, {**begin.slopes, **slopes})


def _square(residual: Array) -> float:
    """Chi-square; infinite where light is no number: no order holds among sets that have none."""
    chi2 = float(residual @ residual)
    return chi2 if np.isfinite(chi2) else float("inf")


class _Quick:
    def __init__(self, problem: Problem, explanation: Explanation, whiten: Whiten, begin: Begin) -> None:
        self.problem, self.whiten, self.model = problem, whiten, problem.model(explanation)
        self.low, self.high = self.model.low, self.model.high
        self.u = np.clip(self.model.at(begin.u), self.low, self.high)
        self.evaluations, self.diffuse = 0, any(c.effect.diffuse for c in explanation)
        self.explanation, self.near = explanation, self.model
        self.prediction, self.residual = self._at(self.u)
        self.chi2 = _square(self.residual)
        self._come_near()
        self.slopes = np.stack(
            [
                begin.slopes[p.path] if p.path in begin.slopes else self._slope(i)
                for i, p in enumerate(self.model.parameters)
            ],
            axis=1,
        )
        self.fresh = not begin.slopes
        self.damping = _DAMPING

    def _come_near(self) -> None:
        """Slopes are taken with traced light that does not follow the lamp: its evaluation takes a hundred
        times as long, and a step shows what is missing. In dense water that leads nowhere, and light that is
        followed there costs less: slopes of width and absorption take it as it is."""
        if self.diffuse:
            forward = self.problem.forward.holding(self.model.values(self.u))
            self.near = replace(self.problem, forward=forward).model(self.explanation)

    def _at(self, u: Array) -> tuple[Array, Array]:
        prediction = self.model.predict(u)
        self.evaluations += 1
        return prediction, np.asarray(self.whiten(self.problem.keep * (self.problem.value - prediction)))

    def _slope(self, i: int) -> Array:
        parameter, moved = self.model.parameters[i], self.u.copy()
        if parameter.is_held:
            return np.zeros(len(self.residual))
        step = parameter.step_from(self.u[i])
        moved[i] += step
        # Counts where it makes scattered and reflected light anew.
        self.evaluations += int(parameter.path in self.lights)
        model = self.model if parameter.path in self.follow else self.near
        change = self.problem.keep * (model.predict(moved) - self.prediction)
        return np.asarray(self.whiten(change) / step)

    @cached_property
    def lights(self) -> frozenset[str]:
        """Parameters that make scattered and reflected light."""
        return frozenset(p.path for c in self.explanation if c.effect.diffuse for p in c.parameters)

    @cached_property
    def follow(self) -> frozenset[str]:
        """Parameters whose slopes are taken with scattered light that follows them."""
        if not (self.diffuse and is_followed(self.problem, self.model.values(self.u))):
            return frozenset()
        return frozenset(p.path for p in self.problem.base)

    def renew(self) -> None:
        self._come_near()
        self.slopes = np.stack([self._slope(i) for i in range(len(self.u))], axis=1)
        self.fresh, self.damping = True, _DAMPING

    def _step(self) -> tuple[Array, float]:
        """Damped step, and what it would gain."""
        drawn, room = self.slopes.T @ self.residual, self.high - self.low
        below = (drawn < 0) & (self.u <= self.low + _AT * room)
        above = (drawn > 0) & (self.u >= self.high - _AT * room)
        norm = np.linalg.norm(self.slopes, axis=0)
        free = ~below & ~above & (norm > TINY) & np.isfinite(norm)
        step, size = np.zeros(len(self.u)), norm[free]
        columns = self.slopes[:, free] / size
        gram, pull = columns.T @ columns, columns.T @ self.residual
        ends = (self.low - self.u)[free] * size, (self.high - self.u)[free] * size
        for _ in range(_GIVEN_UP):
            step[free] = _within(gram, pull, self.damping, *ends)
            gain = float(2 * pull @ step[free] - step[free] @ gram @ step[free])
            if not gain < 0:
                break
            # Held at bounds that they are not drawn to, parameters may promise a loss; shorter steps do not.
            self.damping *= _RISE
        step[free] /= size
        return np.clip(self.u + step, self.low, self.high) - self.u, gain

    def run(self, steps: int, tolerance: float, near: float = np.inf) -> None:
        """Steps until the next one would not be felt, see `quick_fit`."""
        failed, kept = 0, max(float(self.problem.keep.sum()), 1.0)
        for _ in range(steps):
            step, gain = self._step()
            # Where light is no number there is no way on, and none is asked for at such a place.
            little = max(tolerance * max(1.0, self.chi2 / kept), _OF_DISTANCE * (self.chi2 - near))
            if not np.isfinite(gain) or gain < little:
                return
            prediction, residual = self._at(self.u + step)
            chi2 = _square(residual)
            if chi2 < self.chi2:
                self._learn(step, self.residual - residual)
                self.u, self.prediction, self.residual, self.chi2 = self.u + step, prediction, residual, chi2
                self.damping, failed = max(self.damping / _FALL, _LEAST), 0
                continue
            failed += 1
            self.damping *= _RISE
            if failed >= _FAILURES and not self.fresh:
                self.renew()
                failed = 0
            elif failed >= _GIVEN_UP:
                return

    def _learn(self, step: Array, change: Array) -> None:
        """Slopes that give the change that a step has made."""
        weight = step * (np.linalg.norm(self.slopes, axis=0) ** 2 + TINY)
        along = float(weight @ step)
        if along > TINY and np.isfinite(change).all():
            self.slopes = self.slopes + np.outer(change - self.slopes @ step, weight / along)
            self.fresh = False

    def fit(self) -> Fit:
        model, u, prediction = self.model, self.u, self.prediction
        keep, whiten = self.problem.keep, self.whiten

        known = self.slopes if self.fresh else None

        def differentiate() -> Array:
            if known is not None:
                return known
            return np.asarray(whiten(keep[:, None] * model.jacobian(u, prediction)))

        return Fit(model, u, prediction, self.residual, self.chi2, differentiate, True, self.evaluations)


def _within(gram: Array, pull: Array, damping: float, low: Array, high: Array) -> Array:
    """Damped least squares within bounds, shape (k,): what would leave them is held there, and let go again
    where that is against its pull (Stark and Parker 1995, Comput. Stat. 10, 129, without their way between).

    Parameters
    ----------
    gram, pull : array, shapes (k, k) and (k,)
        Products of the columns with each other and with the residual.
    low, high : array, shape (k,)
        Which hold 0.
    """
    damped, step, free = gram + damping * np.eye(len(pull)), np.zeros(len(pull)), np.ones(len(pull), bool)
    for _ in range(_ROUNDS * len(pull)):
        rest = pull[free] - damped[np.ix_(free, ~free)] @ step[~free]
        found = np.linalg.solve(damped[np.ix_(free, free)], rest)
        step[free] = np.clip(found, low[free], high[free])
        inside = step[free] == found
        free[free] = inside
        if not inside.all():
            continue
        inward = (pull - damped @ step) * np.where(step > low, -1.0, 1.0) * ~free
        if not (inward > _AT * np.abs(pull).max()).any():
            break
        free[int(inward.argmax())] = True
    return step


def quick_fit(
    problem: Problem,
    explanation: Explanation,
    whiten: Whiten,
    begin: Begin,
    steps: int,
    tolerance: float,
    near: float = np.inf,
) -> Fit:
    """The fit from one place.

    Parameters
    ----------
    steps : int
        Steps at most.
    tolerance : float
        Ends when a step would lower chi-square by less than this, or than this part of the scatter.
    near : float
        Chi-square above which a hundredth of what lies between will do.
    """
    search = _Quick(problem, explanation, whiten, begin)
    search.run(steps, tolerance, near)
    return search.fit()


def finished_fit(
    problem: Problem, explanation: Explanation, whiten: Whiten, begin: Begin, steps: int, tolerance: float
) -> Fit:
    """The same to the end: until slopes taken anew ask for no further step."""
    search = _Quick(problem, explanation, whiten, begin)
    for _ in range(_RENEWALS):
        search.run(steps, tolerance)
        if search.fresh:
            break
        search.renew()
    return search.fit()
