"""Readings taken to and fro whose places lag behind the motion: a slow detector, or play in the stage.

Where rows alternate, the light of such readings grows in time within every row whichever way it runs, which a
lamp that grows in time, undone from row to row by the water or by an offset, imitates to first order.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy import optimize

from lightfield.arrays import Array
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.problem import MANY, Explanation, Problem
from lightfield.diagnosis.search.cascade import SearchResult
from lightfield.diagnosis.verdict.cautions.caution import Caution, Warns
from lightfield.fitting.diffuse_light import has_diffuse_light
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.least_squares import Fit, Whiten
from lightfield.readings import Readings

#: Length of the mean direction below which readings are taken to and fro. Chosen: of rows that are read in
#: one direction it is 1, and there a lag is an offset.
_TO_AND_FRO = 0.5
#: Part of the readings at which the motion goes on, at least. Derived: places of a line in random order have
#: a third, rows of five three fifths.
_IN_ROWS = 0.5
#: Lags that are tried, m, and how exactly. Chosen: a detector of 0.5 s on a stage of 0.1 m/s has the largest.
_MOST_M, _EXACT_M = 0.05, 1e-4
#: Cosine of the turn at a reading up to which the motion goes on. Chosen: rows are straight.
_GOES_ON = 0.5


@dataclass(frozen=True)
class _Behind:
    """Sets of effects fitted to readings whose places lag behind the motion.

    Parameters
    ----------
    steps : array, shape (3, n)
        Direction of the motion at each reading, see `directions`.
    scale : float
        Variance of the noise, in units of the whitening.
    """

    forward: SceneForward
    problem: Problem
    whiten: Whiten
    steps: Array
    scale: float

    def fit(self, explanation: Explanation, u: Array, lag_m: float) -> Fit:
        """Of so large a lag, begun at these coordinates."""
        r = self.forward.readings
        x, y, z = np.stack([r.x_m, r.y_m, r.z_m]) - lag_m * self.steps
        there = SceneForward(self.forward.scene, replace(r, x_m=x, y_m=y, z_m=z))
        return replace(self.problem, forward=there).fit(explanation, self.whiten, [u])

    def cost(self, fit: Fit) -> float:
        """Chi-square in units of the noise, and the price of what is fitted (Schwarz 1978)."""
        return fit.chi2 / self.scale + float(np.log(self.problem.keep.sum())) * len(fit.u)

    def least(self, explanation: Explanation, u: Array) -> _Lagging:
        """Of a set the lag that meets the readings best."""
        found = optimize.minimize_scalar(
            lambda lag_m: self.fit(explanation, u, lag_m).chi2,
            bounds=(-_MOST_M, _MOST_M),
            method="bounded",
            options={"xatol": _EXACT_M},
        )
        return _Lagging(explanation, self.fit(explanation, u, float(found.x)), float(found.x))

    def best_of(self, told: Explanation, base: Array) -> _Lagging:
        """Of effects one after the other that lowers the cost most, beside the lag."""
        now, rest = self.least((), base), list(told)
        while rest:
            cost, k, more = min(
                (self.cost(more.fit), k, more)
                for k, more in enumerate(self.with_one_more(now, candidate) for candidate in rest)
            )
            if cost > self.cost(now.fit):
                break
            now = more
            del rest[k]
        return now

    def with_one_more(self, now: _Lagging, candidate: Candidate) -> _Lagging:
        whole = (*now.explanation, candidate)
        return self.least(whole, self.problem.model(whole).at(now.fit.by_path))


class _Lagging(NamedTuple):
    """A set fitted to readings with a lag, m."""

    explanation: Explanation
    fit: Fit
    lag_m: float


def lagging(forward: SceneForward, problem: Problem, finding: SearchResult) -> list[Caution]:
    """A caution where a lag, beside some effects that are told or none, costs no more than all that is told.

    Of direct light only: for scattered and reflected light another trace would be needed. Not beside a local
    unknown, whose place it would move, nor of many readings.
    """
    told = finding.closest
    if finding.size == 0 or told is None or not told.explanation or finding.unknown:
        return []
    if has_diffuse_light(forward.scene) or any(c.effect.diffuse for c in told.explanation):
        return []
    steps = directions(forward.readings)
    if steps is None or problem.layout.size > MANY or (straight := steps.any(axis=0)).mean() <= _IN_ROWS:
        return []
    if np.linalg.norm(steps[:, straight].mean(axis=1)) > _TO_AND_FRO:
        return []
    # How far the stage has moved on where it turns depends on how it does that.
    problem = replace(problem, keep=problem.keep * straight)
    behind = _Behind(forward, problem, finding.level.bench.whiten, steps, finding.scale)
    best, kept = behind.best_of(told.explanation, finding.level.base.u), float(problem.keep.sum())
    as_given = problem.fit(told.explanation, behind.whiten, [told.fit.u])
    lag_costs = behind.cost(best.fit) + float(np.log(kept))
    if lag_costs > behind.cost(as_given):
        return []
    left = ", ".join(c.name for c in best.explanation) or "the scene as it is"
    values = {
        "lag_mm": 1e3 * abs(best.lag_m),
        "lagging": best.fit.chi2 / kept,
        "as_given": as_given.chi2 / kept,
    }
    return [Caution(warns=Warns.LAGS, about=left, values=values)]


def directions(readings: Readings) -> Array | None:
    """Direction of the motion at each reading, in the order of their times, shape (3, n).

    Zero at the ends and where it turns. Of readings at one time, as of several wavelengths, it is one. None
    where times are missing, or places at one time differ.
    """
    time, places = readings.time_s, np.stack([readings.x_m, readings.y_m, readings.z_m])
    if not np.isfinite(time).all():
        return None
    moments, first, of = np.unique(time, return_index=True, return_inverse=True)
    at = places[:, first]
    if len(moments) < 3 or not np.allclose(at[:, of], places):
        return None
    step = np.diff(at, axis=1)
    length = np.linalg.norm(step, axis=0)
    unit = np.divide(step, length, out=np.zeros_like(step), where=length > 0)
    before, after = np.pad(unit, ((0, 0), (1, 0))), np.pad(unit, ((0, 0), (0, 1)))
    goes_on = (before * after).sum(axis=0) > _GOES_ON
    return np.asarray((before * goes_on)[:, of])
