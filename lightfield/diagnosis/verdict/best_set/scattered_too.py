"""What is found between walls, with scattering too.

Every water scatters, and between walls that reflect, light that was turned a little and light from the walls
look nearly alike. A set without scattering then passes, and absorption, width and albedo carry what is
scattered, by many errors that do not know of it. So the set is fitted with scattering too, in light that is
traced there and under the errors which that light has: beside them the readings may hardly tell.

Where the set scatters already its light, too, is that of photons, and its errors have to know it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.cascade import SearchResult
from lightfield.diagnosis.search.followed import can_follow, following, scatters
from lightfield.diagnosis.search.own_errors import objective, under_own_errors
from lightfield.diagnosis.search.set_of_effects import ScoredSet
from lightfield.diagnosis.search.told_apart import DETECTABLE_SIGMA, Limit
from lightfield.diagnosis.verdict.best_set.averaged import largest
from lightfield.diagnosis.verdict.best_set.uncertain_light import in_uncertain_light
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
    """The best set with scattering too, of the scene's phase function: with another one free any b would do.

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

    def widened(self, best: ScoredSet) -> ScoredSet:
        """The set as it stands, with errors that reach what its values would be with scattering."""
        return best.reaching(self.fit.values, self.errors)


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
    wider = best.reaching(found.fit.values, found.stderr(best.adequacy.phi))
    return replace(finding, accepted=[wider, *finding.accepted[1:]])


def with_scattering(problem: Problem, finding: SearchResult, seed: int) -> WithScattering | None:
    """The best set with scattering too, where it reflects and does not scatter; else None.

    None of so many readings that a sample leads: fits take their time there.
    """
    best = finding.best
    if best is None or best.test is None or best.adequacy is None or problem.sample is not None:
        return None
    found = next((c for c in problem.candidates if _scatters(c) and _joins(c, best)), None)
    if found is None or not can_follow(problem) or not _is_between_walls(problem, best.fit):
        return None
    if scatters(problem, best.fit):
        return None
    (free,) = found.amplitudes
    candidate = replace(found, amplitudes=(replace(free, low=_LEAST_PER_M),), shapes=(), grid=((),))
    explanation, main = (*best.explanation, candidate), best.test.whiten
    assert isinstance(main, Whitener)
    start = problem.model(explanation).at(best.fit.by_path | {_PATH: _TRACED_PER_M})
    traced = problem.fit(explanation, main, [start], max_steps=0)
    if not scatters(problem, traced):
        return None
    there = following(problem, traced, seed, _PHOTONS)
    found_there = in_uncertain_light(there, explanation, main, start)
    fit, phi = found_there.fit, best.adequacy.phi
    errors = found_there.stderr(phi)
    alone = under_own_errors(there, best.explanation, best.fit, main)
    i = fit.paths.index(_PATH)
    if fit.u[i] < _TRACED_PER_M:
        some = fit.u.copy()
        some[i] = _TRACED_PER_M
        errors = largest(errors, in_uncertain_light(there, explanation, main, some, rounds=0).stderr(phi))
    saved = (objective(alone) - objective((found_there.whiten, fit))) / phi
    return WithScattering(candidate, fit, errors, saved)


def _scatters(candidate: Candidate) -> bool:
    return any(p.path == _PATH for p in candidate.amplitudes) and not candidate.is_stated


def _joins(candidate: Candidate, best: ScoredSet) -> bool:
    moved = {p.path for c in best.explanation for p in c.parameters}
    new = moved.isdisjoint(p.path for p in candidate.parameters)
    return new and all(candidate.effect.combines_with(c.effect) for c in best.explanation)


def _is_between_walls(problem: Problem, fit: Fit) -> bool:
    """Do walls reflect, as fitted?"""
    scene = problem.forward.light.scenes.at(fit.values, validate=False)
    return scene.tank is not None and scene.tank.wall_albedo > 0
