"""The effects that the scene itself has are hypotheses too: are they in the readings, at the stated size?

Each is asked beside the best explanation of the readings: are they worse without it (refitted with the
effect switched off), and is another size better (refitted with its amplitudes free)? Shapes stay as stated.
An effect whose stated size is contradicted and that can be left out is refuted: the readings bound it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import special

from lightfield.arrays import TINY
from lightfield.diagnosis.adequacy.level import ALPHA
from lightfield.diagnosis.adequacy.subspace import INDEPENDENT, beside, orthonormal
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.problem.untestable import Hinders, Hindrance, Untestable
from lightfield.diagnosis.search.cascade import SearchResult
from lightfield.diagnosis.search.preparation import Prepared
from lightfield.diagnosis.search.set_of_effects import ScoredSet
from lightfield.diagnosis.verdict.parts import CONTRADICTED_SIGMA, Estimate, Judgement, StatedEffect
from lightfield.fitting import effects
from lightfield.fitting.least_squares import Fit
from lightfield.fitting.parameter import GAIN
from lightfield.scene import Scene

#: Why what no test moved is held as stated.
_NO_EFFECT, _NOT_ASKED = (Hindrance(Hinders.NO_EFFECT),), (Hindrance(Hinders.NOT_ASKED),)

#: An effect can be left out when the readings are worse without it by less than this, in sigma.
#: Chosen: noise alone makes it that in one case of 370.
_REMOVABLE_SIGMA = 3.0
#: A value is told with an effect of the scene free, where its error is then so many times as large. Chosen.
_LESS_SURE = 1.5
#: Chi-square by which a 95 % limit is worse than the best value, bounded on one side or on two (Wilks 1938,
#: doi:10.1214/aoms/1177732360); test_refutation.py refits at the limit.
_ONE_SIDE, _TWO_SIDES = float(special.chdtri(1, 0.10)), float(special.chdtri(1, 0.05))


@dataclass(frozen=True)
class Judged:
    """What the readings say of one effect that the scene has.

    Parameters
    ----------
    free : Fit
        With its amplitudes free, and its shapes too where the search freed them.
    sigma_from_stated, sigma_to_remove : float
        How much worse the readings are met with the stated values, and without the effect; None for what
        cannot be switched off.
    limit : float or None
        Of its one amplitude's distance from the neutral value, 95 %.
    errors : mapping
        Smallest standard errors by path.
    held : Fit, optional
        What is reported beside it, where that holds it as stated.
    beside : tuple of str
        Effects of the best explanation that were free with it.
    """

    candidate: Candidate
    free: Fit
    sigma_from_stated: float
    sigma_to_remove: float | None
    limit: float | None
    contradicted: bool
    errors: Mapping[str, float] = field(default_factory=dict)
    held: Fit | None = None
    beside: tuple[str, ...] = ()

    @property
    def judgement(self) -> Judgement:
        """What to call it; what is far off and yet not contradicted has a rival that explains as much."""
        removable = self.sigma_to_remove is not None and self.sigma_to_remove < _REMOVABLE_SIGMA
        if self.contradicted:
            return Judgement.ABSENT if removable else Judgement.CONTRADICTED
        far = self.sigma_from_stated > CONTRADICTED_SIGMA
        return Judgement.UNDECIDED if removable or far else Judgement.SUPPORTED


def _removed(candidate: Candidate) -> Candidate:
    """The effect switched off: held at its neutral values, where shapes mean nothing."""
    off = tuple(p.held(n) for p, n in zip(candidate.amplitudes, candidate.neutral, strict=True))
    return replace(candidate, amplitudes=off, shapes=(), grid=((),))


def _as_stated(candidate: Candidate) -> Candidate:
    """The effect with its amplitudes free, and its shapes as in the scene."""
    return replace(candidate, shapes=(), grid=((),))


def _sigmas(worse: float, parameters: int) -> float:
    """Growth of chi-square by holding some parameters, as standard deviations of a Gaussian."""
    p = float(special.chdtrc(parameters, max(worse, 0.0)))
    return float(-special.ndtri(p / 2)) if p > TINY else float(np.sqrt(worse))


def pruned(prepared: Prepared, finding: SearchResult) -> SearchResult:
    """The finding whose explanations leave out what the scene has and the readings do as well without."""
    accepted = [_without(prepared.problem, one) for one in finding.accepted]
    if all(one is other for one, other in zip(accepted, finding.accepted, strict=True)):
        return finding
    return replace(finding, accepted=accepted)


def _without(problem: Problem, tried: ScoredSet) -> ScoredSet:
    for candidate in tried.explanation:
        if not (candidate.is_stated and tried.test and tried.adequacy):
            continue
        rest = tuple(_removed(c) if c is candidate else c for c in tried.explanation)
        fit = problem.fit(rest, tried.test.whiten, [problem.model(rest).at(tried.fit.by_path)])
        worse = (fit.chi2 - tried.fit.chi2) / tried.adequacy.phi
        adequacy = tried.test(fit)
        if _sigmas(worse, len(candidate.parameters)) < _REMOVABLE_SIGMA and adequacy.passes(ALPHA):
            errors = {path: error for path, error in tried.errors.items() if path in fit.paths}
            tried = replace(
                tried, explanation=rest, fit=fit, adequacy=adequacy, bic=tried.bic + worse, errors=errors
            )
    return tried


def judged_effects(prepared: Prepared, finding: SearchResult, untestable: Untestable) -> list[Judged]:
    """Every testable effect that the scene has, in the order of the table of effects.

    Parameters
    ----------
    untestable : mapping
        Effects that these readings cannot show, with reasons.
    """
    stated: dict[str, Candidate] = {}
    for candidate in prepared.problem.candidates:
        if candidate.is_stated and candidate.name not in untestable:
            stated.setdefault(candidate.name, candidate)
    return [_judged(prepared.problem, finding, candidate) for candidate in stated.values()]


def _judged(problem: Problem, finding: SearchResult, candidate: Candidate) -> Judged:
    whiten, best = finding.whiten, finding.best
    explanation = best.explanation if best else ()
    fit = best.fit if best else finding.level.base
    mine = next((c for c in explanation if c.name == candidate.name), None)
    others = tuple(c for c in explanation if c.name != candidate.name)
    changed = _as_stated(candidate) if mine is None or not mine.shapes else mine

    def fitted(*more: Candidate) -> Fit:
        whole = (*others, *more)
        begun = problem.model(whole).at(fit.by_path)
        return problem.fit(whole, whiten, [begun])

    free, kept, gone = fitted(changed), fitted(), fitted(_removed(candidate))
    phi = finding.adequacy_of(best).phi
    if finding.size is None:  # what nothing explains must not decide
        phi = max(phi, free.chi2 / max(finding.n - len(free.u), 1))
    far = _sigmas((kept.chi2 - free.chi2) / phi, len(changed.parameters))
    if finding.size is None:
        contradicted = False
    elif finding.identified and mine is not None:
        contradicted = True
    else:
        everywhere = all(candidate.name in one.names for one in finding.accepted) or mine is None
        contradicted = everywhere and far > CONTRADICTED_SIGMA
    return Judged(
        candidate,
        free,
        far,
        _sigmas((gone.chi2 - free.chi2) / phi, len(changed.parameters)),
        _limit(free, changed, phi),
        contradicted,
        held=kept if mine is None else None,
        beside=tuple(sorted(c.name for c in others)),
    )


def _limit(free: Fit, candidate: Candidate, phi: float) -> float | None:
    """95 % limit of one amplitude's distance from its neutral value, by the curvature at its best value.

    The best value may lie at the bound, where the readings would rather have less than nothing: chi-square
    then rises with a slope.
    """
    if len(candidate.amplitudes) != 1 or candidate.amplitudes[0].coordinate != "linear":
        return None
    (parameter,), (off,) = candidate.amplitudes, candidate.neutral
    i = free.paths.index(parameter.path)
    others = [k for k, at in enumerate(free.at_bound()) if k != i and not at]
    along = beside(orthonormal(free.jacobian[:, others], INDEPENDENT), free.jacobian[:, [i]])[:, 0]
    curvature = float(along @ along)
    if curvature == 0:
        return None
    one_sided = off <= parameter.low or off >= parameter.high
    rise = phi * (_ONE_SIDE if one_sided else _TWO_SIDES)
    ends = []
    for side in (1.0, -1.0):
        slope = min(side * float(along @ free.residual), 0.0)
        u = free.u[i] + side * (slope + np.sqrt(slope**2 + curvature * rise)) / curvature
        ends.append(float(np.clip(u, parameter.low, parameter.high)))
    return max(abs(u - off) for u in ends)


def _moved(
    held: Mapping[str, Estimate], free: Mapping[str, Estimate], own: Iterable[str]
) -> dict[str, Estimate]:
    """Values that an effect held as stated makes others, or surer, than they are with it free."""
    return {
        path: free[path]
        for path, one in held.items()
        if path != GAIN and path not in own and one.stderr and (error := free[path].stderr)
        and (abs(free[path].value - one.value) > one.stderr or error > _LESS_SURE * one.stderr)
    }  # fmt: skip


def _no_surer(told: Mapping[str, Estimate], least: Mapping[str, float]) -> dict[str, Estimate]:
    return {
        path: one.model_copy(update={"stderr": one.stderr and max(one.stderr, least.get(path, 0.0))})
        for path, one in told.items()
    }


def stated_effects(
    scene: Scene,
    judged: Iterable[Judged],
    free: Iterable[str],
    untestable: Untestable,
    estimate: Callable[[Fit, Mapping[str, float]], Mapping[str, Estimate]],
    of_answer: Mapping[str, float],
) -> list[StatedEffect]:
    """Every effect that the scene has: first those that were tested, then what is held as stated.

    Parameters
    ----------
    free : iterable of str
        Paths that the base model fits.
    estimate : callable
        Values of a fit with their errors, which are given the smallest they may be.
    of_answer : mapping
        Errors of the answer by path: with an effect free too none is smaller.
    """
    known = scene.parameters()
    out = []
    for one in judged:
        moved = [p.path for p in one.candidate.parameters if p.path in one.free.paths]
        values = estimate(one.free, one.errors)
        told = {} if one.held is None else _moved(estimate(one.held, one.errors), values, moved)
        out.append(
            StatedEffect(
                effect=one.candidate.name,
                judgement=one.judgement,
                stated={path: float(known[path].value) for path in moved},
                neutral={p: float(off) for p in moved if (off := known[p].neutral) is not None},
                fitted={path: values[path] for path in moved},
                beside=list(one.beside),
                limit=one.limit,
                sigma_from_stated=one.sigma_from_stated,
                sigma_to_remove=one.sigma_to_remove,
                if_free=_no_surer(told, of_answer),
            )
        )
    tested = {path for entry in out for path in entry.stated} | set(free)
    owner = {f.path: e.name for e in effects.table().values() for form in e.forms for f in form.amplitudes}
    for path, parameter in known.items():
        if parameter.neutral is None or parameter.value == parameter.neutral or path in tested:
            continue
        name = owner.get(path)
        why = _NO_EFFECT if name is None else untestable.get(name, _NOT_ASKED)
        out.append(
            StatedEffect(
                effect=name,
                judgement=Judgement.HELD,
                stated={path: float(parameter.value)},
                held_by=list(why),
            )
        )
    return out
