"""Fits under the errors that the diffuse light of the fitted scene has itself.

The transport response knows its light to a Monte Carlo error that differs from scene to scene, and is large
where few photons carry it. A fit moves the scene, and with it the errors that it should be judged by.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from lightfield.diagnosis.problem.noise import WHITENED_WHOLE, Noise
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.profile_likelihood import restarted
from lightfield.fitting.least_squares import Fit
from lightfield.render.diffuse.trace_errors import as_few

#: Water that differs by so much, relatively, from the traced one is also looked for at that one. Chosen.
_FAR_FROM_TRACED = 0.2
#: Fits under errors that the fit before has left behind. One that moves by less than this part of its own
#: errors leaves those of the light as they are. Measured: the second of 61 moves was 0.04 of the first
#: (median), and after one of less than 0.5 at most 0.04 of an error.
_ROUNDS, _STAYED = 2, 0.5


def with_response_error(problem: Problem, noise: Noise, fit: Fit) -> Noise:
    """The noise with the errors that diffuse light and the lamp's table have at a fit."""
    modes, smooth = problem.forward.errors(fit.values)
    # Several bands and traces have a hundred times as many contributions as there are readings.
    modes = as_few(modes) if noise.layout.size <= WHITENED_WHOLE else modes
    lamp = problem.forward.lamp_errors(fit.values)
    return replace(noise, photon_modes=modes, response_error=smooth, lamp_modes=lamp if lamp.size else None)


def own_whitener(problem: Problem, whiten: Whitener, fit: Fit) -> Whitener:
    """A whitening with the errors of the diffuse light at a fit; the rest as it is."""
    noise = with_response_error(problem, whiten.noise, fit)
    return Whitener(noise, whiten.rho, whiten.phi, whiten.tolerance)


def under_own_errors(
    problem: Problem, explanation: Explanation, fit: Fit, whiten: Whitener, rounds: int = _ROUNDS
) -> tuple[Whitener, Fit]:
    """A fit under the errors of its own diffuse light, from where it lies; the rest as in a whitening."""
    for _ in range(rounds):
        whiten = own_whitener(problem, whiten, fit)
        before, fit = fit.u, problem.fit(explanation, whiten, [fit.u])
        if fit.away_from(before) < _STAYED:
            break
    return whiten, fit


def from_valleys(
    problem: Problem, explanation: Explanation, fit: Fit, whiten: Whitener
) -> tuple[Whitener, Fit]:
    """The same for a single effect: water between two traced ones may look right only because neither trace
    says much of it, so that dense water is looked for at the traced one as well."""
    found = [under_own_errors(problem, explanation, fit, whiten)]
    more = problem.forward.light.factor_to_traced(found[0][1].values)
    if abs(more - 1) > _FAR_FROM_TRACED:
        (candidate,), u = explanation, fit.u.copy()
        for i, parameter in enumerate(candidate.amplitudes, len(problem.base)):
            u[i] = np.clip(parameter.start + more * (u[i] - parameter.start), parameter.low, parameter.high)
        there = problem.fit(explanation, whiten, [u], max_steps=0)
        found.append(under_own_errors(problem, explanation, there, whiten))
    return min(found, key=objective)


def from_shapes(
    problem: Problem, explanation: Explanation, fit: Fit, whiten: Whitener
) -> tuple[Whitener, Fit]:
    """The same, at every shape: errors that grow with an effect move the valleys of its shapes."""
    best = from_valleys(problem, explanation, fit, whiten)
    other = restarted(problem, explanation, best[1], best[0])
    if other is not best[1]:
        best = min(best, under_own_errors(problem, explanation, other, whiten), key=objective)
    return best


def on_sample(
    problem: Problem, explanation: Explanation, fit: Fit, whiten: Whitener
) -> tuple[Problem, Fit, Whitener]:
    """A fit as a sample of many readings sees it, see `Problem.sample`; of few all is as it was."""
    if problem.sample is None:
        return problem, fit, whiten
    rows, some = problem.sample
    return some, some.fit(explanation, whiten.of(rows), [fit.u], max_steps=0), whiten.of(rows)


def refitted(
    settle: Callable[[Problem, Explanation, Fit, Whitener], tuple[Whitener, Fit]],
    problem: Problem,
    explanation: Explanation,
    fit: Fit,
    whiten: Whitener,
) -> tuple[Whitener, Fit]:
    """What one of these gives; of many readings where a sample leads, and from there to all of them."""
    some, there, own = on_sample(problem, explanation, fit, whiten)
    found = settle(some, explanation, there, own)
    return found if some is problem else under_own_errors(problem, explanation, found[1], whiten, rounds=1)


def objective(found: tuple[Whitener, Fit]) -> float:
    """Twice the negative logarithm of the likelihood, up to a constant."""
    whiten, fit = found
    return fit.chi2 + whiten.log_determinant
