"""What a fitted curve leaves out: errors of all that was fitted beside it.

A curve has as many functions as pay for themselves. Finer ones are there all the same, and what they do to
the readings is taken by other parameters, that then look surer than they are: beside a beam of four functions
the g of scattering water had an error four times too small (scenes/dive_lamp). So the best set is fitted once
more with the next longer form of its curves, over a range of every shape, where valleys are bent; an error
covers the values that fit as well.

Gains of planes leave out their level and their slope over the distance, which a gain and the absorption are:
those that are as large as the others by chance go into the errors of what is fitted in their place.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.special import stdtrit

from lightfield.diagnosis.adequacy.subspace import by_others
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.diagnosis.search.cascade import SearchResult
from lightfield.diagnosis.search.pool.quick import Begin, finished_fit
from lightfield.diagnosis.search.profile_likelihood import ONE_SIGMA, TWO_SIGMA
from lightfield.diagnosis.search.set_of_effects import ScoredSet
from lightfield.fitting.curves import PLANES, field_of
from lightfield.fitting.least_squares import Fit
from lightfield.fitting.parameter import FitParameter

#: Standard errors from its best value at which a shape is held, each way from the nearest on. Chosen.
_HELD = (2.0, 4.0)
#: Steps of a fit at most, and what it may leave of chi-square. Chosen, as in the pool (`fitted_sets._STEPS`).
_STEPS, _LEFT = 20, 0.05
#: Part of a normal distribution below one standard error (derived); what is not told, as in `Fit`.
_HOLDS, _SINGULAR = 0.8413, 1e-6


def with_truncation(finding: SearchResult) -> SearchResult:
    """The finding whose best set has errors that know what its curves leave out."""
    return finding.with_closest(_widened)


def _widened(tried: ScoredSet) -> ScoredSet:
    if tried.test is None:
        return tried
    problem = tried.test.problem
    longer = tuple(_longer(problem, c) for c in tried.explanation)
    errors, phi = dict(tried.errors), tried.scale
    if longer != tried.explanation:
        for path, error in truncation_errors(tried, problem, longer, phi).items():
            errors[path] = max(error, errors.get(path, 0.0))
    own = tried.fit.stderr(phi)
    for path, error in slope_errors(tried, problem).items():
        errors[path] = float(np.hypot(np.fmax(errors.get(path, 0.0), own[path]), error))
    return tried if errors == tried.errors else replace(tried, errors=errors)


def slope_errors(tried: ScoredSet, problem: Problem) -> Mapping[str, float]:
    """What level and slope of the gains of planes may do to each value, by path; empty without such gains.

    Gains of m planes that were independent leave m - 2 numbers beside their line over z: by these they
    scatter by s, and the line's own two are as large, within the quantile of t that holds 68 %.
    """
    curves = problem.forward.scenes.curves
    if tried.test is None or curves is None or not any(field_of(path) == PLANES for path in tried.fit.paths):
        return {}
    basis, fit = curves.bases[PLANES], tried.fit
    gain, z_m = basis.curve(basis.amplitudes(fit.values)), problem.layout.z_m
    line = np.linalg.qr(np.stack([np.ones_like(basis.place), basis.place - basis.place.mean()], axis=1))[0]
    rest = gain - line @ (line.T @ gain)
    spare = len(gain) - line.shape[1]
    size = np.sqrt(float(rest @ rest) / spare) * float(stdtrit(spare, _HOLDS))
    nearest = np.argmin(np.abs(z_m[:, None] - basis.place), axis=1)
    moved = tried.test.whiten(problem.keep[:, None] * fit.prediction[:, None] * line[nearest])
    free = ~fit.at_bound() & (np.linalg.norm(fit.jacobian, axis=0) > 0)
    change = size * np.linalg.norm(by_others(fit.jacobian[:, free], moved, _SINGULAR), axis=1)
    return {
        p.path: float(c * abs(p.slope(u)))
        for p, u, c in zip(np.array(fit.model.parameters, object)[free], fit.u[free], change, strict=True)
        if field_of(p.path) != PLANES
    }


def _longer(problem: Problem, candidate: Candidate) -> Candidate:
    """The next longer form of a curve; of all else the effect itself."""
    if not candidate.effect.is_free_form:
        return candidate
    forms = (c for c in problem.candidates if c.name == candidate.name)
    more = (c for c in forms if len(c.parameters) > len(candidate.parameters))
    return min(more, key=lambda c: len(c.parameters), default=candidate)


def truncation_errors(
    tried: ScoredSet, problem: Problem, longer: Explanation, phi: float
) -> Mapping[str, float]:
    """Standard errors by path, in the scene's unit, of all that is fitted but the curves themselves.

    Of fits with longer curves those within 1 of the lowest chi-square lie within one of them from the value
    that is stated, those within 4 within two; and so does the best of them, with its own error.

    Parameters
    ----------
    tried : ScoredSet
        With its test.
    longer : tuple of Candidate
        Its explanation with longer curves.
    phi : float
        Pure-error variance in units of the whitening.
    """
    assert tried.test is not None
    whiten, stated = tried.test.whiten, tried.fit.values

    def fitted(explanation: Explanation, begin: Mapping[str, float]) -> Fit:
        return finished_fit(problem, explanation, whiten, Begin(begin), _STEPS, _LEFT)

    first = fitted(longer, tried.fit.by_path)
    found = [first]
    for path, sigma in _shapes(tried).items():
        middle = tried.fit.by_path[path]
        for side in (-1.0, 1.0):
            begin = first.by_path
            for step in _HELD:
                held, u = _holding(longer, path, middle + side * step * sigma)
                there = fitted(held, {**begin, path: u})
                begin = there.by_path
                found.append(there)
    best = fitted(longer, min(found, key=lambda f: f.chi2).by_path)
    found.append(best)
    curved = {p.path for c in tried.explanation if c.effect.is_free_form for p in c.parameters}
    own, out = best.stderr(phi), {}
    for path, value in stated.items():
        if path in curved:
            continue
        far = [float(np.hypot(np.nan_to_num(own[path]), best.values[path] - value))]
        for fit in found:
            worse = (fit.chi2 - best.chi2) / phi
            if worse <= TWO_SIGMA:
                far.append(abs(fit.values[path] - value) / (1.0 if worse <= ONE_SIGMA else 2.0))
        out[path] = max(far)
    return out


def _shapes(tried: ScoredSet) -> dict[str, float]:
    """Coordinates of the shapes that are fitted, and their errors; none at a bound."""
    sigma = np.sqrt(np.diag(tried.fit.covariance()))
    errors = dict(zip(tried.fit.paths, sigma.tolist(), strict=True))
    paths = [p.path for c in tried.explanation for p in c.shapes]
    return {path: errors[path] for path in paths if np.isfinite(errors[path])}


def _holding(explanation: Explanation, path: str, u: float) -> tuple[Explanation, float]:
    """An explanation with a shape held, and where: within its range."""

    def held(parameter: FitParameter) -> FitParameter:
        if parameter.path != path:
            return parameter
        return parameter.held(float(np.clip(u, parameter.low, parameter.high)))

    out = tuple(replace(c, shapes=tuple(map(held, c.shapes))) for c in explanation)
    return out, next(p.low for c in out for p in c.shapes if p.path == path)
