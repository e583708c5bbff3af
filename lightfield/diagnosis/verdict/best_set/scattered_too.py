"""What is found between walls, with scattering too.

Every water scatters, and between walls that reflect, light that was turned a little and light from the walls
look nearly alike. A set without scattering then passes, and absorption, width and albedo carry what is
scattered, by many errors that do not know of it. So the set is fitted with scattering too, in light that is
traced there and under the errors which that light has: beside them the readings may hardly tell.

Where the set scatters already its light, too, is that of photons, and its errors have to know it. So has a
fit that was asked for by hand: by the photons' word it found b too small by five of its errors, in one of six
readings none, with an absorption twelve of its errors off.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.cascade import SearchResult
from lightfield.diagnosis.search.followed import can_follow, following, scatters
from lightfield.diagnosis.search.own_errors import objective, under_own_errors
from lightfield.diagnosis.search.set_of_effects import errors_reaching
from lightfield.diagnosis.search.told_apart import DETECTABLE_SIGMA, Limit
from lightfield.diagnosis.verdict.best_set.averaged import largest
from lightfield.diagnosis.verdict.best_set.uncertain_light import FoundInLight, in_uncertain_light
from lightfield.fitting.least_squares import Fit

_PATH = "water.scattering_per_m"
#: Scattering that is traced, in 1/m. Chosen: between that of clear ocean and of coastal water (0.04 and 0.22
#: at 514 nm, Petzold 1972, SIO Ref. 72-78).
_TRACED_PER_M = 0.1
#: Photons of that trace. Measured: of a tenth of them the noise hides how much scatters.
_PHOTONS = 1e7
#: Least scattering of the fit, in 1/m: without any, its light would have no error. Chosen: clear water.
_LEAST_PER_M = 1e-4


@dataclass(frozen=True)
class WithScattering:
    """What is found with scattering too, of the scene's phase function: with another one free any b would do.

    Parameters
    ----------
    errors : mapping
        Standard errors by path; where it is less than what was traced, no less than those beside that.
    saved : float
        Chi-square that it saves beyond what the photons' errors take up, in units of the noise.
    """

    candidate: Candidate
    fit: Fit
    errors: Mapping[str, float]
    saved: float

    @property
    def limit(self) -> Limit:
        """Smallest scattering that would have been seen, as rough as the tests that share the level."""
        (parameter,) = self.candidate.amplitudes
        size, room = DETECTABLE_SIGMA * self.errors[_PATH], parameter.high - parameter.low
        return Limit(self.candidate.name, _PATH, min(size, room), bool(size <= room))

    def widened(self, finding: SearchResult) -> SearchResult:
        """The finding as it stands, with errors that reach what the values would be with scattering."""
        best, values, errors = finding.best, self.fit.values, self.errors
        if best is not None:
            return replace(finding, accepted=[best.reaching(values, errors), *finding.accepted[1:]])
        wider = errors_reaching(finding.base_errors, finding.level.base, values, errors)
        return replace(finding, base_errors=wider)


def in_light_of_photons(problem: Problem, finding: SearchResult) -> SearchResult:
    """The finding; where its best set reflects and scatters, with errors that reach its values in that light.

    In open water they change nothing: there scattered light is a bright and smooth part of the readings.
    """
    best = finding.best
    if best is None or best.test is None or best.adequacy is None or problem.sample is not None:
        return finding
    if not can_follow(problem) or not _is_between_walls(problem, best.fit) or not scatters(problem, best.fit):
        return finding
    assert isinstance(best.test.whiten, Whitener)
    found = in_uncertain_light(problem, best.explanation, best.test.whiten, best.fit.u)
    wider = best.reaching(found.fit.values, found.stderr(best.scale))
    return replace(finding, accepted=[wider, *finding.accepted[1:]])


def with_scattering(problem: Problem, finding: SearchResult, seed: int) -> WithScattering | None:
    """The best set, or the base model that nothing is missing in, with scattering too, where it reflects and
    does not scatter; else None.

    None of so many readings that a sample leads: fits take their time there.
    """
    if problem.sample is not None or (set_ := _standing(finding)) is None:
        return None
    explanation, fit, main, phi = set_
    found = next((c for c in problem.candidates if _scatters(c) and _joins(c, explanation)), None)
    if found is None or not can_follow(problem) or not _is_between_walls(problem, fit):
        return None
    if scatters(problem, fit):
        return None
    candidate = replace(_at_least_a_little(found), shapes=(), grid=((),))
    more = (*explanation, candidate)
    start = problem.model(more).at(fit.by_path | {_PATH: _TRACED_PER_M})
    there = _traced_at(problem, more, start, main, seed)
    if there is None:
        return None
    told = _told_there(there, more, start, main)
    errors = {path: float(np.sqrt(phi) * sigma) for path, sigma in told.errors.items()}
    alone = under_own_errors(there, explanation, fit, main)
    saved = (objective(alone) - objective((told.found.whiten, told.found.fit))) / phi
    return WithScattering(candidate, told.found.fit, errors, saved)


def _standing(finding: SearchResult) -> tuple[Explanation, Fit, Whitener, float] | None:
    """What nothing is missing in, as it was fitted, and the scale of the noise beside it."""
    best, level = finding.best, finding.level
    if best is None and finding.size == 0:
        assert isinstance(level.bench.whiten, Whitener)
        return (), level.base, level.bench.whiten, level.scale
    if best is None or best.test is None or best.adequacy is None:
        return None
    assert isinstance(best.test.whiten, Whitener)
    return best.explanation, best.fit, best.test.whiten, best.scale


class ByHand(NamedTuple):
    """A fit between walls in the light that it found.

    Parameters
    ----------
    errors : mapping
        Standard errors by path, for noise as it is whitened.
    """

    problem: Problem
    fit: Fit
    whiten: Whitener
    errors: Mapping[str, float]


def by_hand(problem: Problem, explanation: Explanation, fit: Fit, whiten: Whitener) -> ByHand | None:
    """A fit of given effects where walls reflect and scattering is one of them; else None.

    What the scene states to scatter is no question to the photons: of three readings of one tank, values and
    errors were the same to a tenth of an error.
    """
    if problem.sample is not None or not can_follow(problem) or not _is_between_walls(problem, fit):
        return None
    if not any(map(_scatters, explanation)):
        return None
    effects = tuple(_at_least_a_little(c) if _scatters(c) else c for c in explanation)
    # Its phase function begins as the scene has it: that of the fit was led by the photons' word.
    begun = {p.path for c in effects if _scatters(c) for p in c.shapes}
    known = {path: u for path, u in fit.by_path.items() if path not in begun}
    start = problem.model(effects).at(known | {_PATH: max(_TRACED_PER_M, fit.values[_PATH])})
    there = _traced_at(problem, effects, start, whiten, 0)
    if there is None:
        return None
    found, errors = _told_there(there, effects, start, whiten)
    as_found = there.fit(effects, found.whiten, [found.fit.u], max_steps=0)
    return ByHand(there, replace(as_found, converged=found.fit.converged), found.whiten, errors)


class _ToldThere(NamedTuple):
    """What was found in the light of a trace, and its errors."""

    found: FoundInLight
    errors: Mapping[str, float]


def _traced_at(
    problem: Problem, explanation: Explanation, start: Array, whiten: Whitener, seed: int
) -> Problem | None:
    """The problem in light that is traced at the start; None if that is of a kind that is not followed."""
    traced = problem.fit(explanation, whiten, [start], max_steps=0)
    return following(problem, traced, seed, _PHOTONS) if scatters(problem, traced) else None


def _told_there(there: Problem, explanation: Explanation, start: Array, whiten: Whitener) -> _ToldThere:
    """A fit of what scatters; where that is less than what was traced, no surer than beside that."""
    found = in_uncertain_light(there, explanation, whiten, start)
    fit, errors = found.fit, found.stderr()
    if _PATH in fit.paths and fit.u[i := fit.paths.index(_PATH)] < _TRACED_PER_M:
        some = fit.u.copy()
        some[i] = _TRACED_PER_M
        errors = largest(errors, in_uncertain_light(there, explanation, whiten, some, rounds=0).stderr())
    return _ToldThere(found, errors)


def _at_least_a_little(candidate: Candidate) -> Candidate:
    """Scattering that is never none: its light would have no error."""
    free = (replace(p, low=_LEAST_PER_M) if p.path == _PATH else p for p in candidate.amplitudes)
    return replace(candidate, amplitudes=tuple(free))


def _scatters(candidate: Candidate) -> bool:
    return any(p.path == _PATH for p in candidate.amplitudes) and not candidate.is_stated


def _joins(candidate: Candidate, explanation: Explanation) -> bool:
    moved = {p.path for c in explanation for p in c.parameters}
    new = moved.isdisjoint(p.path for p in candidate.parameters)
    return new and all(candidate.effect.combines_with(c.effect) for c in explanation)


def _is_between_walls(problem: Problem, fit: Fit) -> bool:
    """Do walls reflect, as fitted?"""
    scene = problem.forward.light.scenes.at(fit.values, validate=False)
    return scene.tank is not None and scene.tank.wall_albedo > 0
