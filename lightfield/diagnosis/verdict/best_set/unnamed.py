"""Effects that are too small to be named, and what they would change: in the stated errors, and a warning.

An effect that the readings ask for a little, less than its price, is not in the best set: a claim would be
wrong too often. But the water and the beam that are fitted without it carry it, and their standard errors,
those of the best set alone, do not know of it: they are made to reach what the values would be with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.search.cascade import SearchResult
from lightfield.diagnosis.search.many import in_pool
from lightfield.diagnosis.search.pool.answer import NAMED_FIRST
from lightfield.diagnosis.search.pool.evidence import FAMILY, Weighing
from lightfield.diagnosis.search.pool.fitted_sets import Pool
from lightfield.diagnosis.search.set_of_effects import FittedSet
from lightfield.diagnosis.verdict.best_set.averaged import averaged, largest, with_an_effect_more, with_others
from lightfield.diagnosis.verdict.best_set.finer_lamp import comparable_errors, finer_lamp, with_finer_lamp
from lightfield.diagnosis.verdict.best_set.scattered_too import WithScattering
from lightfield.diagnosis.verdict.parts import Estimate, Unnamed
from lightfield.fitting.beam_width import WIDTH
from lightfield.fitting.least_squares import Fit
from lightfield.fitting.parameter import is_gain

#: Chance that any absent effect saves so much of chi-square that it is spoken of, were the readings without
#: any. Chosen: a warning in three of ten such verdicts, and only where it also changes something.
_CHANCE_OF_ANY = 0.3
#: A change is spoken of from so many stated errors on. Chosen: within two a value is as it was said to be.
_CHANGED = 2.0
#: So many effects are fitted, of those that promise most, and so many are told. Chosen: time and words alone.
_EFFECTS_FITTED, _EFFECTS_TOLD = 4, 2


def unnamed(
    finding: SearchResult, units: dict[str, str], also: WithScattering | None = None
) -> list[Unnamed]:
    """Named effects that are absent from the best set for their price alone, those first that save most.

    None of many readings, where fits take their time, and none beside an unexplained rest, whose own size is
    told.

    Parameters
    ----------
    units : mapping
        Unit of every parameter.
    also : WithScattering, optional
        The best set with scattering too: told first, and not once more of the light of the search.
    """
    first = [] if also is None else _hardly_told(also, finding, units)
    taken = None if also is None else also.candidate.name
    others = [_told(one, units) for one in _absent(finding) if one.candidate.name != taken]
    return [*first, *others][:_EFFECTS_TOLD]


def in_errors(finding: SearchResult) -> SearchResult:
    """The finding; errors of its best set reach what the values would be with each effect that is too small
    to be named, and are averaged over effects that are smaller still, over other accepted sets, and over
    other forms of its effects."""
    best, level = finding.best, finding.level
    if best is None or best.adequacy is None:
        wider = with_an_effect_more((), level.base, level.adequacy, level.scale)
        return replace(finding, base_errors=largest(finding.base_errors, wider))
    wider = with_an_effect_more(best.explanation, best.fit, best.adequacy, best.scale)
    best = replace(best, errors=largest(best.errors, wider))
    best = averaged(with_others([best, *finding.accepted[1:]]), _in_other_forms(finding, best.fit.values))
    finding = replace(finding, finer_lamp=finer_lamp(finding))
    if (weighing := _weighing(finding)) is not None and finding.finer_lamp is not None:
        best = with_finer_lamp(weighing, best, finding.finer_lamp)
    for one in _absent(finding):
        best = best.reaching({path: one.values[path] for path in one.changed}, one.errors)
    return replace(finding, accepted=[best, *finding.accepted[1:]])


def _in_other_forms(
    finding: SearchResult, values: Mapping[str, float]
) -> list[tuple[float, Mapping[str, float], Mapping[str, float]]]:
    """Sets of the same effects in other forms that cost hardly more: weight over that of the best, and what
    its values and errors would be; moved from set to set, for a pool has the light of its search.

    Parameters
    ----------
    values : mapping
        Of the best set, by path.
    """
    if (weighing := _weighing(finding)) is None:
        return []
    node, phi = weighing.best, weighing.phi
    out: list[tuple[float, Mapping[str, float], Mapping[str, float]]] = []
    for other in weighing.pool.nodes.values():
        above = weighing.above(other)
        if other.names == node.names and other.key != node.key and above <= FAMILY:
            own, theirs = node.fit.values, other.fit.values
            both = values.keys() & theirs.keys() & own.keys()  # of what is left out there are no shapes
            there = {path: values[path] + theirs[path] - own[path] for path in both}
            stderr = {path: error for path, error in other.fit.stderr(phi).items() if path in there}
            out.append((float(np.exp(-0.5 * max(above, 0.0))), there, stderr))
    return out


def _hardly_told(also: WithScattering, finding: SearchResult, units: dict[str, str]) -> list[Unnamed]:
    """Scattering where it widens an error so many times that a change would be spoken of."""
    if (best := finding.best) is None:
        fit, told, scale = finding.level.base, finding.base_errors, finding.level.scale
    else:
        fit, told, scale = best.fit, best.errors, best.scale
    own, values = fit.stderr(scale), also.fit.values
    wide = {path for path in own if told[path] > _CHANGED * own[path] and not is_gain(path)}
    with_it = {
        path: Estimate(value=values[path], stderr=also.errors[path], unit=units.get(path, "reading"))
        for path in also.fit.paths
        if path in wide or path not in own
    }
    name, sigma = also.candidate.name, float(np.sqrt(max(also.saved, 0.0)))
    return [Unnamed(effect=name, sigma=sigma, with_it=with_it, in_errors=True)] if wide else []


@dataclass(frozen=True)
class _Absent:
    """An effect that is not in the best set for its price alone.

    Parameters
    ----------
    sigma : float
        By how much the readings ask for it.
    changed : tuple of str
        Water, beam and effects that would be other ones by more than their stated errors.
    values, errors : mapping
        Of the best set with it, by path.
    """

    candidate: Candidate
    sigma: float
    changed: tuple[str, ...]
    values: Mapping[str, float]
    errors: Mapping[str, float]


def _told(one: _Absent, units: dict[str, str]) -> Unnamed:
    with_it = {
        path: Estimate(
            value=one.values[path],
            stderr=one.errors[path] if np.isfinite(one.errors[path]) else None,
            unit=units.get(path, "reading"),
        )
        for path in one.changed
    }
    name, stated = one.candidate.name, one.candidate.is_stated
    return Unnamed(effect=name, sigma=one.sigma, with_it=with_it, in_errors=True, stated=stated)


def _absent(finding: SearchResult) -> list[_Absent]:
    """Those that change something: detail of the lamp, then what the readings ask for most."""
    if (weighing := _weighing(finding)) is None:
        return []
    pool, node = weighing.pool, weighing.best
    out = []
    for other, candidate in _with_one_more(pool, node, weighing.phi):
        saved = (node.fit.chi2 - other.fit.chi2) / weighing.phi
        if saved > _asked(pool, candidate) and (changed := _changed(node.fit, other.fit, weighing.phi)):
            errors = other.fit.stderr(weighing.phi)
            out.append(_Absent(candidate, float(np.sqrt(saved)), changed, other.fit.values, errors))
    return [*_of_the_lamp(weighing, finding.finer_lamp), *sorted(out, key=lambda one: -one.sigma)]


def _weighing(finding: SearchResult) -> Weighing | None:
    """Of the best set in its pool; None where it is in none."""
    node = in_pool(finding)
    return None if finding.many is None or node is None else Weighing.of(finding.many.pool, node)


def _of_the_lamp(weighing: Weighing, finer: FittedSet | None) -> list[_Absent]:
    """What is changed by detail of the lamp that costs no more than a name is worth."""
    node = weighing.best
    if finer is None or weighing.above(finer) > NAMED_FIRST:
        return []
    (curve,) = (c for c in finer.explanation if c.key not in node.key)
    errors, own = comparable_errors(weighing, finer), {WIDTH, *(p.path for p in curve.parameters)}
    changed = tuple(path for path in _changed(node.fit, finer.fit, weighing.phi) if path not in own)
    saved = (node.fit.chi2 - finer.fit.chi2) / weighing.phi
    return (
        [_Absent(curve, float(np.sqrt(max(saved, 0.0))), changed, finer.fit.values, errors)]
        if changed
        else []
    )


def _asked(pool: Pool, candidate: Candidate) -> float:
    """Chi-square that one effect of all saves by chance with that probability, in units of the noise."""
    ground, d = pool.ground, len(candidate.parameters)
    names = {c.name for c in ground.problem.candidates}
    return d * float(special.fdtri(d, ground.nu, 1 - _CHANCE_OF_ANY / len(names)))


def _with_one_more(pool: Pool, node: FittedSet, phi: float) -> list[tuple[FittedSet, Candidate]]:
    """The best set with a named effect more, of those that promise most one form each."""
    promises = [
        p
        for p in pool.promises(node)
        if not p.candidate.effect.is_free_form and p.starts[0].gain > phi * _asked(pool, p.candidate)
    ]
    chosen: dict[str, tuple[FittedSet, Candidate]] = {}
    for promise in sorted(promises, key=lambda p: p.cost):
        wanted = promise.candidate.name not in chosen and len(chosen) < _EFFECTS_FITTED
        if wanted and pool.affordable((*node.explanation, promise.candidate)):
            chosen[promise.candidate.name] = pool.finished(pool.add(promise)), promise.candidate
    return list(chosen.values())


def _changed(fit: Fit, other: Fit, phi: float) -> tuple[str, ...]:
    """What would be another value by more than its stated errors."""
    stated, before, after = fit.stderr(phi), fit.values, other.values
    return tuple(
        path
        for path in fit.paths
        if path in after and not is_gain(path) and abs(after[path] - before[path]) > _CHANGED * stated[path]
    )
