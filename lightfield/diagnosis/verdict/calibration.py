"""On an absolute scale the gain is known to the error of the calibration: what is fitted says whether the
lamp has the power that the scene states.

A factor on all readings hides nothing that the readings show by their shape. So the search looks for that
first, with the gain free as on a relative scale; then the gain of what it found is compared with 1. One that
is more than three errors off calls for a lamp of another power, or readings in another unit.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import special

from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.problem.setup import GAIN_ROOM
from lightfield.diagnosis.search.cascade import Level, SearchResult
from lightfield.diagnosis.search.preparation import Prepared
from lightfield.diagnosis.search.set_of_effects import ScoredSet, scale_of_errors
from lightfield.diagnosis.search.told_apart import MISSED, Limit
from lightfield.diagnosis.verdict.refutation import Judged
from lightfield.errors import MeasurementError
from lightfield.fitting.gains import LAMP_POWER
from lightfield.fitting.least_squares import Fit
from lightfield.fitting.parameter import GAIN

#: A gain this many standard errors from 1 is not the calibration's. Chosen: one right one of 370 is that far;
#: with half of it more are (test_calibration.py).
_AGREES_SIGMA = 3.0
EFFECT = "lamp_power"
#: Factor on a lamp's power, to either side, that is looked at once it is known. Chosen: far beyond its error.
_AROUND = 100.0


def by_shape(problem: Problem) -> Problem:
    """The problem with the gain free and the lamp's power held, as readings on a relative scale pose it."""
    if _power(problem) is None:
        return problem
    base = tuple(
        replace(p, low=p.start - GAIN_ROOM, high=p.start + GAIN_ROOM) if p.path == GAIN else p
        for p in problem.base
    )
    return replace(problem, base=base, candidates=tuple(c for c in problem.candidates if c.name != EFFECT))


def _power(problem: Problem) -> Candidate | None:
    return next((c for c in problem.candidates if c.name == EFFECT), None)


def sigmas_from_one(fit: Fit, scale: float, calibration: float) -> float:
    """How many standard errors, of calibration and fit together, the logarithm of a gain lies from 0.

    Parameters
    ----------
    scale : float
        Pure-error variance in units of the whitening.
    calibration : float
        Relative standard error.
    """
    i = fit.paths.index(GAIN)
    variance = float(fit.covariance(scale)[i, i])
    return float(fit.u[i] / np.hypot(calibration, np.sqrt(variance))) if np.isfinite(variance) else 0.0


def power_limits(problem: Problem, base: Fit, calibration: float | None) -> dict[str, Limit]:
    """Smallest excess of the lamp's power that would be seen with 95 % probability; none on a relative scale.

    Parameters
    ----------
    problem : Problem
        With the lamp's power among its candidates.
    base : Fit
        Of readings in units of their noise.
    calibration : float, optional
        Relative standard error.
    """
    power = _power(problem)
    if power is None or calibration is None:
        return {}
    (allowed,) = power.amplitudes
    error = float(np.hypot(calibration, np.sqrt(base.covariance(1.0)[(base.paths.index(GAIN),) * 2])))
    factor = float(np.exp((_AGREES_SIGMA - special.ndtri(MISSED)) * error))
    reachable = allowed.start * factor < allowed.high
    return {EFFECT: Limit(EFFECT, allowed.path, allowed.start * (factor - 1), reachable)}


def on_absolute_scale(
    prepared: Prepared, problem: Problem, finding: SearchResult
) -> tuple[Prepared, SearchResult]:
    """What was found by shape, with another lamp power beside it where its gain cannot be the calibration's.

    Parameters
    ----------
    problem : Problem
        With the gain in its range and the lamp's power among the candidates.
    """
    power, calibration = _power(problem), prepared.noise.budget.calibration
    if power is None or calibration is None or finding.size is None:
        return prepared, finding
    phi = finding.level.phi
    explanations = finding.accepted or [ScoredSet((), finding.level.base, finding.level.base.chi2 / phi)]
    far = [sigmas_from_one(t.fit, t.scale if t.adequacy else phi, calibration) for t in explanations]
    agreeing = [k for k, z in enumerate(far) if abs(z) <= _AGREES_SIGMA]
    if agreeing:
        if len(agreeing) == len(far):
            return prepared, finding
        weights = np.array([finding.weights[k] for k in agreeing])
        share = list(map(float, weights / (weights.sum() + 1 - sum(finding.weights))))
        return prepared, replace(finding, accepted=[explanations[k] for k in agreeing], weights=share)
    known = replace(prepared, problem=replace(problem, keep=prepared.problem.keep))

    def more(tried: ScoredSet) -> ScoredSet:
        return with_power(known, finding, tried, power)

    off = min(map(abs, far))
    levels = [_contradicted(known, level, off) for level in finding.levels]
    level = levels[finding.levels.index(finding.level)]
    weights = np.array(finding.weights) if finding.accepted else np.ones(1)
    return known, replace(
        finding, size=(finding.size or 0) + 1, level=level, levels=levels,
        accepted=[more(t) for t in explanations], weights=list(map(float, weights / weights.sum())),
        tried=[more(t) for t in finding.tried],
    )  # fmt: skip


def with_power(prepared: Prepared, finding: SearchResult, tried: ScoredSet, power: Candidate) -> ScoredSet:
    """An explanation with its gain put down to the lamp; the same prediction."""
    known = tried.fit.by_path
    known[LAMP_POWER] = value = power.amplitudes[0].start * np.exp(known[GAIN])
    _check_power(value, power)
    explanation = (*tried.explanation, _near(power, value))
    start = prepared.problem.model(explanation).at(known)
    adequacy = finding.adequacy_of(tried)
    test = tried.test or finding.level.bench.test
    fit = prepared.problem.fit(explanation, test.whiten, [start])
    # The gain's, whose logarithm is far from any bound: to powers of a hundredth the range has no digits.
    i, calibration = tried.fit.paths.index(GAIN), prepared.noise.budget.calibration or 0.0
    error = np.sqrt(tried.fit.covariance(scale_of_errors(tried.fit, adequacy, test))[i, i])
    errors = {**tried.errors, LAMP_POWER: float(fit.values[LAMP_POWER] * np.hypot(calibration, error))}
    bic = tried.bic + float(np.log(finding.n))
    return replace(
        tried, explanation=explanation, fit=fit, bic=bic, adequacy=adequacy, test=test, errors=errors
    )


def _near(power: Candidate, value: float) -> Candidate:
    """The same with a range about a value: of eight powers of ten all small ones lie at the lower end."""
    (allowed,) = power.amplitudes
    low, high = max(allowed.low, value / _AROUND), min(allowed.high, value * _AROUND)
    return replace(power, amplitudes=(replace(allowed, low=low, high=high),))


def _check_power(power_w: float, power: Candidate) -> None:
    """Refuse readings that no lamp makes."""
    (allowed,) = power.amplitudes
    if not allowed.low < power_w < allowed.high:
        raise MeasurementError(
            f"the readings are {power_w / allowed.start:.2g} times what the scene's lamp gives",
            found=f"light of a lamp of {power_w:.2g} W",
            rule=f"the scene's {allowed.start:g} W, or {allowed.high / allowed.start:g} times more or less",
            remedy='check the units in the head of the readings, or write scale = "relative"',
        )


def _contradicted(known: Prepared, level: Level, sigma: float) -> Level:
    """A level whose base model has a gain that the calibration allows, and fails by that.

    Width and absorption stay as the shape of the readings has them: refitted they would bend to make light.
    """
    base = known.problem.fit((), level.bench.whiten, [level.base.u], max_steps=0)
    p = min(level.adequacy.p, 2 * float(special.ndtr(-sigma)))
    return replace(level, base=base, adequacy=replace(level.adequacy, p=p))


def judged_power(prepared: Prepared, problem: Problem, finding: SearchResult) -> list[Judged]:
    """What the readings say of the lamp's power: one entry on an absolute scale, none on a relative one."""
    power, calibration = _power(problem), prepared.noise.budget.calibration
    if power is None or calibration is None:
        return []
    best = finding.best or ScoredSet((), finding.level.base, 0.0)
    found = any(c.name == EFFECT for c in best.explanation)
    phi = finding.adequacy_of(best).phi
    if found:
        value = best.fit.values[LAMP_POWER]
        far = float(np.log(value / power.amplitudes[0].start)) * value / best.errors[LAMP_POWER]
    else:
        far = sigmas_from_one(best.fit, phi, calibration)
        known = replace(prepared, problem=replace(problem, keep=prepared.problem.keep))
        best = with_power(known, finding, best, power)
    return [Judged(power, best.fit, abs(far), None, None, found, best.errors)]
