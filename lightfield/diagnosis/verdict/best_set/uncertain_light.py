"""Fits of an effect whose light is itself uncertain.

What an effect adds to the light is told by photons. A fit that takes their word finds the effect too small,
for their noise fits nothing: by S / (S + n), where S is chi-square by which the readings tell the effect, and
n the number of errors of photons that stand out of the readings' own (attenuation; Fuller 1987, Measurement
Error Models, Wiley, eq. 1.1.7). Scattering between walls has S of 3, and light of 1e6 photons n of 10. So the
errors of the photons are fitted too, each next to none by its own error.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from lightfield.arrays import Array
from lightfield.decompositions import eigen
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.own_errors import own_whitener
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.least_squares import LOOSE, Fit, least_squares

#: Steps of a fit and rounds of fits, at most; part of an error by which the last one may still move.
#: Measured: of 32 fits beside walls all but one ended within 5 rounds.
_STEPS, _ROUNDS, _STAYED = 40, 8, 0.05
#: Part of the apparent information that is left after the photons' noise is taken off, at least: an error is
#: the apparent one over it at most, where noise alone tells. Chosen.
_LEAST_TOLD = 0.3


class FoundInLight(NamedTuple):
    """A fit in light that was found with it.

    Parameters
    ----------
    fit : Fit
        Its derivatives are those of the light that was found.
    whiten : Whitener
        The noise with the errors of the light there.
    covariance : array, shape (n_parameters, n_parameters)
        Of the coordinates, for noise as it is whitened; NaN rows at a bound.
    """

    fit: Fit
    whiten: Whitener
    covariance: Array

    def stderr(self, scale: float = 1.0) -> dict[str, float]:
        """Standard error of every value; NaN at a bound."""
        sigma = np.sqrt(scale * np.diag(self.covariance))
        each = zip(self.fit.model.parameters, self.fit.u, sigma, strict=True)
        return {p.path: float(s * abs(p.slope(x))) for p, x, s in each}


@dataclass(frozen=True)
class _Told:
    """Readings by light in which the photons are so many of their standard errors off, shape (k,)."""

    forward: SceneForward
    off: Array

    def predict(self, values: Mapping[str, float]) -> Array:
        # Where nothing reflects the contributions of its photons, which are the last, are not there.
        modes = self.forward.errors(values)[0]
        both = min(modes.shape[1], len(self.off))
        return np.asarray(self.forward.predict(values) + modes[:, :both] @ self.off[:both])


def in_uncertain_light(
    problem: Problem, explanation: Explanation, whiten: Whitener, start: Array, rounds: int = _ROUNDS
) -> FoundInLight:
    """The values, and the errors of the photons, that are most likely together.

    Least of |y - m(v) - M(v) e|^2 + |e|^2 over values v and the photons' errors e, M their contributions. At
    given v that is |y - m(v)|^2 in the metric of C, of the noise and M M^T, where e = M^T C^-1 (y - m(v)).

    Parameters
    ----------
    explanation : tuple of Candidate
        Bounds within which the light has errors.
    whiten : Whitener
        Of it the noise of the readings; the errors of the light are those of every round.
    start : array, shape (n_parameters,)
    rounds : int
        None of them: the start, with its errors.
    """
    model, u = problem.model(explanation), start
    while True:
        here = problem.fit(explanation, whiten, [u], max_steps=0)
        modes, _ = problem.forward.errors(here.values)
        own = own_whitener(problem, whiten, here)
        off = own(problem.keep[:, None] * modes).T @ own(problem.keep * (problem.value - here.prediction))
        told = replace(model, forward=_Told(problem.forward, off))
        fit = least_squares(told, problem.value + modes @ off, own, u, problem.keep, _STEPS if rounds else 0)
        moved, u, rounds = fit.away_from(u), fit.u, rounds - 1
        if moved < _STAYED or rounds <= 0:
            return FoundInLight(fit, own, _covariance(problem, own, fit))


def _covariance(problem: Problem, own: Whitener, fit: Fit) -> Array:
    """Errors of a fit in the light that it found.

    That light's derivatives J keep a noise, with the covariance of the photons' errors given the readings,
    I - M^T C^-1 M. By it the information J^T C^-1 J is B = A + N where the true one is A, and the covariance
    A^-1 B A^-1 (Fuller 1987, section 1.3.1, for one variable).
    """
    weight, parameters = problem.keep[:, None], fit.model.parameters
    modes = problem.forward.errors(fit.values)[0]
    white = own(weight * modes)
    free = ~fit.at_bound() & (np.linalg.norm(fit.jacobian, axis=0) > 0)
    slopes, told = [], []
    for i in np.flatnonzero(free).tolist():
        u, parameter = fit.u.copy(), parameters[i]
        step = parameter.step_from(u[i])
        u[i] += step
        change = (problem.forward.errors(fit.model.values(u))[0] - modes) / step
        slopes.append(own(weight * change))
        told.append(slopes[-1] @ white.T)
    jacobian = fit.jacobian[:, free]
    size = np.linalg.norm(jacobian, axis=0)
    by_noise = np.array([[np.vdot(a, b) for b in slopes] for a in slopes])
    by_noise -= np.array([[np.vdot(a, b) for b in told] for a in told])
    # In coordinates in which the apparent information is one; what it does not tell is left out, as in `Fit`.
    known, directions = eigen((jacobian / size).T @ (jacobian / size))
    seen = known > LOOSE * known.max(initial=0.0)
    inverse = directions[:, seen] / np.sqrt(known[seen])
    share, axes = eigen(inverse.T @ (by_noise / np.outer(size, size)) @ inverse)
    left = np.maximum(1 - share, _LEAST_TOLD)
    to = (inverse @ axes) / left / size[:, None]
    out = np.full((len(parameters), len(parameters)), np.nan)
    out[np.ix_(free, free)] = to @ to.T
    return out
