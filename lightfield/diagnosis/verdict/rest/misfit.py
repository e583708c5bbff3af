"""The coordinate of what nothing explains: one answer of free factors and of local unknowns together.

Each stands beside a set of effects: what is certain all the same, the best set, or what a local unknown has
left of it. The rest of the best set may only imitate what is unknown, or may be right; which of all these
describes the readings best, for the numbers that it takes, decides (Schwarz 1978,
doi:10.1214/aos/1176344136), so that the headline and the curve of the rest speak of one thing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.adequacy.families import free_factors
from lightfield.diagnosis.certainty import Certainty
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.cascade import SearchResult
from lightfield.diagnosis.search.preparation import Prepared
from lightfield.diagnosis.verdict.next_measurement import REPEATS, NextMeasurement, in_a_row, repeat
from lightfield.diagnosis.verdict.parts import LeftOver, Misfit, PlaceToRead
from lightfield.diagnosis.verdict.rest.left_over import Local, without_it
from lightfield.diagnosis.verdict.trust import error_scale
from lightfield.fitting.least_squares import Fit
from lightfield.fitting.parameter import FitParameter, Model

#: A coordinate is named when a factor along it takes away this part of the misfit. Chosen: a third; of a
#: misfit that is a function of one coordinate alone it takes nearly all (test_families.py).
_NAMED = 0.35
#: And said to lie at one place along it alone when it takes away this part. Chosen: daylight beside a window,
#: over half of two planes, was said to lie in one of them.
_ALONE = 0.75


@dataclass(frozen=True)
class _Description:
    """A factor along one coordinate beside a set of effects.

    Parameters
    ----------
    score : float
        Chi-square in units of the noise, plus ln(n) for every number beside the base model's.
    explained : float
        Part of what is left beside the effects that it takes away.
    prediction : array, shape (n,)
        Of the effects alone.
    """

    score: float
    explained: float
    misfit: Misfit
    prediction: Array


@dataclass(frozen=True)
class _Linear:
    """A forward model near a fit, by its slopes there: other factors move what was fitted but little."""

    parameters: tuple[FitParameter, ...]
    fit: Fit
    slopes: Array

    def predict(self, values: Mapping[str, float]) -> Array:
        u = np.array([p.coordinate_of(values[p.path]) for p in self.parameters])
        return np.asarray(self.fit.prediction + self.slopes @ (u - self.fit.u))


def unexplained(
    prepared: Prepared, finding: SearchResult, local: Sequence[Local]
) -> tuple[Misfit | None, NextMeasurement]:
    """On what the rest depends, where it is a function of one coordinate, and where to read again.

    Parameters
    ----------
    local : sequence of Local
        Local unknowns that describe what the best set leaves, the best first.
    """
    problem = prepared.problem
    # A misfit without any smoothness was taken for noise: what is noise is then for the quoted errors to say.
    scale, plain = error_scale(prepared, finding), Whitener(prepared.noise, 0.0, 1.0, 0.0)
    found = [_local(problem, plain, one, scale) for one in local[:1]]
    beside = [_refitted(problem, finding, plain)]
    if finding.closest is not None and not finding.unknown:
        beside.append((finding.closest.explanation, _linear(problem, finding.closest.fit, plain)))
    if not finding.unknown:
        found += [d for effects, fit in beside for d in _factors(problem, plain, effects, fit, scale)]
    found = [d for d in found if not d.misfit.at_one or d.explained > _ALONE]
    best = min(found, key=lambda d: d.score, default=None)
    prediction = beside[0][1].prediction if best is None else best.prediction
    z = np.abs(problem.keep * (problem.value - prediction) / prepared.noise.sigma)
    spot = _spot(problem, int(z.argmax()))
    # Of readings that scatter alone every factor takes a part away, by chance.
    alone = min(fit.chi2 / scale + _numbers(problem, effects) for effects, fit in beside)
    named = best is not None and best.explained > _NAMED and best.score < alone
    misfit = best.misfit if best is not None and named else None
    return misfit, repeat(spot, misfit)


def beyond_errors(problem: Problem) -> NextMeasurement:
    """Where to read again what scatters more than its errors say, and as no effect would."""
    return in_a_row(_spot(problem, int((problem.keep * problem.value).argmax())))


def along(misfit: Misfit | None, left: Sequence[LeftOver]) -> list[LeftOver]:
    """Local unknowns along the coordinate that is named first: they are drawn and told."""
    return sorted(left, key=lambda one: misfit is not None and one.coordinate != misfit.coordinate)


def _spot(problem: Problem, at: int) -> PlaceToRead:
    lay = problem.layout
    return PlaceToRead(
        x_m=float(lay.x_m[at]), y_m=float(lay.y_m[at]), z_m=float(lay.z_m[at]),
        medium="air" if lay.air[at] else "water", repeats=REPEATS,
    )  # fmt: skip


def _refitted(problem: Problem, finding: SearchResult, plain: Whitener) -> tuple[Explanation, Fit]:
    """The base model, and what is certain all the same."""
    every = finding.many.evidence if finding.many else ()
    known = tuple(e.candidate for e in every if e.level == Certainty.PARTIAL)
    like = finding.closest.fit if known and finding.closest else finding.level.base
    return known, problem.fit(known, plain, [problem.model(known).at(like.by_path)])


def _linear(problem: Problem, fit: Fit, plain: Whitener) -> Fit:
    """A fit as it is, whitened plainly, in the model that is linear about it."""
    own = fit.model
    slopes = own.jacobian(fit.u, fit.prediction)
    model = Model(_Linear(own.parameters, fit, slopes), own.parameters)
    residual = plain(problem.keep * (problem.value - fit.prediction))
    whitened = np.asarray(plain(problem.keep[:, None] * slopes))
    chi2 = float(residual @ residual)
    return replace(fit, model=model, residual=residual, chi2=chi2, differentiate=lambda: whitened)


def _numbers(problem: Problem, effects: Explanation) -> float:
    """What the parameters of effects add to a score."""
    return float(np.log(problem.keep.sum()) * sum(len(c.parameters) for c in effects))


def _factors(
    problem: Problem, plain: Whitener, effects: Explanation, fit: Fit, scale: float
) -> list[_Description]:
    """Free factors along every coordinate."""
    more = _numbers(problem, effects)
    return [
        _Description(
            one.score + more, one.explained,
            Misfit(
                coordinate=one.name, worst_at=one.worst_at, period_deg=one.period_deg, at_one=one.at_one
            ),
            fit.prediction,
        )
        for one in free_factors(problem, plain, fit, scale)
    ]  # fmt: skip


def _local(problem: Problem, plain: Whitener, one: Local, scale: float) -> _Description:
    """A local unknown, on the same footing."""
    residual = plain(problem.keep * (problem.value - one.fit.prediction))
    score = float(residual @ residual) / scale + _numbers(problem, one.explanation)
    record = one.record
    # A step is where it begins, all else where the readings depart most.
    along, size = np.array(record.at), np.abs(np.array(record.factor) - 1.0)
    if record.coordinate in ("time", "signal"):
        size = np.abs(np.gradient(record.factor))
    elif record.read_at:
        size, along = np.interp(record.read_at, along, size), np.array(record.read_at)
    period = record.parameters.get("period")
    misfit = Misfit(
        coordinate=record.coordinate,
        worst_at=float(along[size.argmax()]),
        period_deg=period.value if period is not None and record.coordinate == "angle" else None,
        period_s=period.value if period is not None and record.coordinate == "time" else None,
        like=record.name,
    )
    return _Description(score, record.removed_percent / 100, misfit, without_it(one.fit, record.name))
