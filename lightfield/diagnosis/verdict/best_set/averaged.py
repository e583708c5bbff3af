"""Standard errors that know of what is not in the best set: averages over models.

A fit's errors are those of its own set, as if it were known to be the true one. Two kinds of other sets are
as good as it, and say other values of water and beam: those that cost hardly more, and the set itself with an
effect more that is too small to be named. Values of several models have the variance (Hoeting et al. 1999,
doi:10.1214/ss/1009212519)

    sum_k w_k (sigma_k^2 + (x_k - x)^2) / sum_k w_k

about the stated value x. A set weighs what its share of the evidence is. An effect more weighs as much as
the readings favour it over none, where its amplitudes have a normal distribution of some typical sizes and
the model is linear in them: what cannot be large can change little, and what would be seen is not there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array
from lightfield.diagnosis.adequacy.score_tests import LEAST_SCALE, Adequacy, Score
from lightfield.diagnosis.adequacy.subspace import by_others
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.problem import Explanation
from lightfield.diagnosis.search.set_of_effects import ScoredSet
from lightfield.diagnosis.search.told_apart import of_what_is_stated
from lightfield.diagnosis.search.truncation import slope_errors
from lightfield.fitting.effects.free_form import BEAM_PROFILE
from lightfield.fitting.least_squares import Fit
from lightfield.fitting.parameter import is_gain
from lightfield.scene.acts import Acts
from lightfield.scene.all_parameters import acts_on

#: How much an effect that is not named weighs before the readings are looked at, and the spread of its sizes
#: in typical ones. Chosen: in 260 campaigns by other formulas, each with nought to six of nine effects, 95 %
#: of the attenuations are within two errors with them, and 86 % without.
_ODDS, _SPREAD = 0.2, 3.0
#: The same of scattering, of which every water has some. Chosen: seven sets of readings, in water of b = 0.06
#: per m beside a background, from whose best sets it was missing but for one: the absorption was 2.0 of its
#: errors off, rms, and is 1.5.
_EVEN_ODDS, _SCATTERING = 1.0, "water.scattering_per_m"
#: Of an effect of which the others leave no more than this part the readings say nothing: it has its typical
#: size. One of the receiver is one of them by another name: a beam's width is that which a receiver with an
#: acceptance sees. Chosen: two drifts leave a tenth of each other.
_ABSORBED = 0.05
#: Beside these curves a parameter is that of what they change: a half width of no light, absorption of no
#: water.
_CHANGED = {BEAM_PROFILE: "lamp.hwhm_deg", "attenuation_spectrum": "water.absorption_per_m"}
#: Exponents are cut here: what weighs more is all. Derived: e^50 loses no digit of what it is added to.
_MOST = 50.0


def with_an_effect_more(
    explanation: Explanation, fit: Fit, adequacy: Adequacy, scale: float
) -> dict[str, float]:
    """Standard errors of a set by path: of each the largest that one named effect more makes of it.

    Parameters
    ----------
    adequacy : Adequacy
        Of the fit.
    scale : float
        Variance of the noise, in units of the whitening.
    """
    phi, held = max(scale, LEAST_SCALE), fit.at_bound()
    own, free = fit.stderr(phi), np.flatnonzero(~held)
    slope = np.array([abs(p.slope(u)) for p, u in zip(fit.model.parameters, fit.u, strict=True)])[free]
    paths = [fit.paths[i] for i in free]
    square = np.array([own[path] ** 2 for path in paths])
    widest, moves = square.copy(), _all_that_moves(fit, free, adequacy)
    for score in _extras(explanation, fit, adequacy):
        weight, shift, spread = _moved(fit, phi, moves, score)
        shift, spread = shift[: len(free)], spread[: len(free)]
        other = square + slope**2 * (spread + shift**2)
        widest = np.fmax(widest, (square + weight * other) / (1 + weight))
    return {
        path: float(np.sqrt(x))
        for path, x in zip(paths, widest, strict=True)
        if np.isfinite(x) and not is_gain(path)
    }


def _extras(explanation: Explanation, fit: Fit, adequacy: Adequacy) -> list[Score]:
    """Named effects that a set lacks, each form at the shape that promises most."""
    best: dict[tuple[str, str], tuple[float, Score]] = {}
    for score in adequacy.scores:
        candidate = score.template.candidate
        joins = all(candidate.effect.combines_with(c.effect) for c in explanation)
        # What the scene states is believed, and what it would be else is told beside it.
        believed = candidate.is_stated or candidate.effect.is_free_form
        if believed or not joins or not (score.testable or _ages(candidate)):
            continue
        gain = float(np.linalg.norm(score.direction.T @ fit.residual) ** 2)
        if candidate.key not in best or gain > best[candidate.key][0]:
            best[candidate.key] = gain, score
    return [score for _, score in best.values()]


def _ages(candidate: Candidate) -> bool:
    """Does it grow with time? In a scan plane by plane the water absorbs what it does."""
    return all(acts_on(p.path) & (Acts.TIME | Acts.AGEING) for p in candidate.amplitudes)


def _all_that_moves(fit: Fit, free: NDArray[np.intp], adequacy: Adequacy) -> Array:
    """Columns of what a fit has free, and of what the scene states, (n, p + k).

    With an effect more that would be another one, too: it may be the size that was found without.
    """
    stated = [s.template.columns for s in of_what_is_stated(adequacy.scores) if s.testable]
    return np.hstack([fit.jacobian[:, free], *stated])


def _moved(fit: Fit, phi: float, moves: Array, score: Score) -> tuple[float, Array, Array]:
    """Weight of a set with an effect more; how far it moves the others, what it adds to their variances."""
    columns, candidate = score.template.columns, score.template.candidate
    # What of the others goes with its amplitudes, and what is left of their columns beside the others.
    along = by_others(moves, columns)
    left = columns - moves @ along
    absorbed = np.linalg.norm(left) < _ABSORBED * np.linalg.norm(columns)
    if absorbed and candidate.effect.direct_only:
        return 0.0, np.zeros(len(along)), np.zeros(len(along))
    information, towards = left.T @ left / phi, left.T @ fit.residual / phi
    typical = ((1.0 if absorbed else _SPREAD) * np.array(candidate.typical)) ** 2
    covariance = np.linalg.inv(np.diag(1 / typical) + information)
    amplitude = covariance @ towards
    favour = 0.5 * float(towards @ amplitude)
    if candidate.one_sided and amplitude[0] <= 0:
        amplitude, favour = np.zeros(len(amplitude)), 0.0
    volume = 0.5 * float(np.linalg.slogdet(np.eye(len(typical)) + information * typical)[1])
    scatters = any(p.path == _SCATTERING for p in candidate.amplitudes)
    odds = _EVEN_ODDS if scatters else _ODDS
    weight = odds * float(np.exp(min(favour - volume, _MOST)))
    return weight, -along @ amplitude, np.einsum("ij,jk,ik->i", along, covariance, along)


def with_others(accepted: Sequence[ScoredSet]) -> ScoredSet:
    """The best of accepted sets, its errors averaged over all of them.

    Parameters
    ----------
    accepted : sequence of ScoredSet
        Best first; each weighs exp(-BIC/2), or of any number of effects by their price.
    """
    best, others = accepted[0], []
    for other in accepted[1:]:
        weight = float(np.exp(-0.5 * max(other.bic - best.bic, 0.0)))
        theirs = other.fit.stderr(other.scale)
        if other.test is not None:
            for path, error in slope_errors(other, other.test.problem).items():
                theirs[path] = float(np.hypot(theirs[path], error))
        same = theirs.keys() - _of_another_meaning(best, other)
        others.append((weight, other.fit.values, {path: theirs[path] for path in same}))
    return averaged(best, others)


def _of_another_meaning(one: ScoredSet, other: ScoredSet) -> set[str]:
    """Paths of what a curve, which one of two sets has, makes of a parameter: no value of the other's."""
    return {path for curve, path in _CHANGED.items() if (curve in one.names) != (curve in other.names)}


def averaged(
    best: ScoredSet, others: Sequence[tuple[float, Mapping[str, float], Mapping[str, float]]]
) -> ScoredSet:
    """A set, its errors averaged over it and others: weight over its own, values and errors of each."""
    values, errors = best.fit.values, dict(best.errors)
    squares, total = {path: error**2 for path, error in errors.items()}, dict.fromkeys(errors, 1.0)
    for weight, theirs, stderr in others:
        for path, error in stderr.items():
            if path in squares and np.isfinite(error) and not is_gain(path):
                squares[path] += weight * (error**2 + (theirs[path] - values[path]) ** 2)
                total[path] += weight
    return replace(
        best, errors=largest(errors, {path: float(np.sqrt(squares[path] / total[path])) for path in errors})
    )


def largest(one: Mapping[str, float], other: Mapping[str, float]) -> dict[str, float]:
    """Of two errors of a value the larger one."""
    return {path: float(np.fmax(one.get(path, 0.0), other.get(path, 0.0))) for path in {**one, **other}}
