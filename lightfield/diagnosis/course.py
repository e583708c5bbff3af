"""The course of a diagnosis: search in the light of a trace, settle what was found in better light, judge it.

Each stage takes what is known and gives what is known then.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lightfield.diagnosis.adequacy.score_tests import Adequacy
from lightfield.diagnosis.knowledge import Inquiry, Knowledge
from lightfield.diagnosis.problem.candidates import go_together
from lightfield.diagnosis.problem.local_unknowns import left_by_an_unknown, with_unknowns
from lightfield.diagnosis.problem.problem import MANY, Problem
from lightfield.diagnosis.problem.setup import budget_of, problem_of
from lightfield.diagnosis.problem.whitening import unwhitened
from lightfield.diagnosis.search.better_light.settled import is_nearly_explained
from lightfield.diagnosis.search.cascade import SearchResult, search
from lightfield.diagnosis.search.followed import can_follow, following, scatters
from lightfield.diagnosis.search.many import is_overtaken, leaves, misses_by_far
from lightfield.diagnosis.search.pool.any_number import Data
from lightfield.diagnosis.search.preparation import Prepared, prepare_problem
from lightfield.diagnosis.search.set_of_effects import FittedSet
from lightfield.diagnosis.search.truncation import with_truncation
from lightfield.diagnosis.verdict import calibration, refutation
from lightfield.diagnosis.verdict.best_set import unnamed
from lightfield.diagnosis.verdict.best_set.held_by_ranges import without_held_ranges
from lightfield.diagnosis.verdict.best_set.scattered_too import (
    WithScattering,
    in_light_of_photons,
    with_scattering,
)
from lightfield.diagnosis.verdict.parts import Doubt, DoubtReason
from lightfield.diagnosis.verdict.trust import Trust
from lightfield.fitting.retraced import Retraced

#: Variance over the stated one from which on more effects are asked whether they explain the scatter, and the
#: part of it that they leave then. Chosen: by chance one set of 60 readings in 300 scatters so much; where
#: errors are stated half as large as they are all is left.
_TOO_SMALL, _MENDS = 1.5, 0.6
#: The part that the first sets of a search have to come down to for it to go on. Chosen: the noise is judged
#: again after them, which takes little more.
_PROMISES = 0.8
#: What a local unknown has to be worth at first sight, in chi-square of the noise. Chosen: the best of some
#: hundred shapes takes half as much from readings without one.
_SHOWS = 30.0
#: What is left beside an unknown, over the stated variance, where it does not mend as much. Chosen: of a
#: hundred readings one table in twenty scatters more.
_AS_STATED = 1.25
#: Where no one or two effects will do, known ones are so many at least. Derived: one and two were tried.
_FEWEST = 3
#: Seed of the trace of a scene that scatters. Chosen: no other trace has it.
_SEED = 9000


class Outcome(NamedTuple):
    """What is known in the end, how far it is trusted, and what reflects, with scattering too."""

    known: Knowledge
    trust: Trust
    also: WithScattering | None


def course(inquiry: Inquiry) -> Outcome:
    """Search, settle, judge."""
    # Light that grows beyond all numbers is a model that misses the readings, and no fault.
    with np.errstate(over="ignore", invalid="ignore"):
        known = _searched(inquiry)
        inquiry.progress("rivals of every effect")
        known = _unless_overtaken(known.levelled())
        if inquiry.is_settled_after and not known.is_settled:
            known = _settled_after(known)
        return _judged(known)


def _searched(inquiry: Inquiry) -> Knowledge:
    """What a trace shows; traced again where it ends in water too dense for it."""
    readings, alpha, progress = inquiry.readings, inquiry.alpha, inquiry.progress
    budget, quoted = budget_of(readings), np.asarray(readings.stderr, float)
    before: tuple[FittedSet, ...] = ()
    traces = Retraced(inquiry.scene, readings, inquiry.source)
    for forward in traces:
        problem, untestable = problem_of(forward, readings, inquiry.effects, inquiry.without_diffuse)
        rng = np.random.default_rng(inquiry.seed)
        progress(f"noise and outliers of {problem.layout.size} readings")
        by_shape = calibration.by_shape(problem)
        if inquiry.is_settled_after:
            by_shape = _in_light_of_the_scene(by_shape, _SEED + inquiry.seed)
        # Curves come only where no named effect will do.
        data = Data(by_shape.with_curves(), quoted, budget)
        prepared = prepare_problem(by_shape, quoted, budget, rng, alpha, before)
        traces.asked, before = prepared.to_trace_per_m, prepared.known
        if traces.asked is not None and traces.left:
            continue
        finding = search(prepared, budget.tolerance, rng, alpha, progress)
        known = _explained(Knowledge(inquiry, problem, untestable, data, prepared, finding, rng))
        if known.is_settled:
            break
        light = known.prepared.problem.forward.light
        traces.asked = light.to_trace(one.fit.values for one in known.finding.contenders)
    return known


def _in_light_of_the_scene(problem: Problem, seed: int) -> Problem:
    """The problem in light that is followed where its base model lies, if that scatters.

    A trace of other water has errors that sets of effects describe. Of eight campaigns in stated water of b =
    0.4 per m, with a skirt and a background, the right set came first in six, and the background was certain
    in five; four and four without it.
    """
    if not can_follow(problem):
        return problem
    base = problem.fit((), unwhitened, [problem.model().start])
    return following(problem, base, seed) if scatters(problem, base) else problem


def _explained(known: Knowledge) -> Knowledge:
    """What one or two effects explain, or more, or effects beside a local unknown."""
    stated = known.prepared.errors_stated
    if known.finding.size is None:
        known = _settled_early(known) or _in_larger_errors(known) or _of_any_number(known)
    elif known.finding.size > 0 and stated:
        known = _unless_more_explain(known)
    return _unless_an_unknown_does(known) if stated else known


def _settled_early(known: Knowledge) -> Knowledge | None:
    """One or two effects that nearly explain the readings, and do once settled; None if there are none."""
    if known.inquiry.is_settled_after and is_nearly_explained(known.prepared, known.finding):
        early = known.in_traced_light()
        if early.finding.accepted:
            return replace(early.in_its_light(), is_settled=True)
    return None


def _in_larger_errors(known: Knowledge) -> Knowledge | None:
    """What explains the readings in errors as large as their scatter; None where more is missing beside the
    best sets than larger errors, or a local unknown shows.

    In the stated errors all sets miss the readings then, and would be tried for nothing.
    """
    asked, data, alone = known.inquiry, known.data, known.finding.scatter
    if alone is None or data.budget.times_stated > 1 or not known.prepared.errors_stated:
        return None
    times = float(np.sqrt(_unexplained_variance(known.prepared, known.finding, alone)))
    data = replace(data, quoted=times * data.quoted, budget=replace(data.budget, times_stated=times))
    rng, begun = np.random.default_rng(asked.seed), data.problem.without_curves()
    prepared = prepare_problem(begun, data.quoted, data.budget, rng, asked.alpha)
    finding = search(prepared, data.budget.tolerance, rng, asked.alpha, asked.progress)
    there = _explained(replace(known, data=data, prepared=prepared, finding=finding, rng=rng))
    return None if there.finding.size is None or _an_unknown_shows(there) else there


def _of_any_number(known: Knowledge) -> Knowledge:
    """What any number of effects explain, or a few beside a local unknown."""
    more = known.with_more_effects(misses_by_far(known.data.budget.tolerance))
    if more.finding.accepted or more.finding.many is None:
        return more
    if larger := _in_larger_errors(more):
        return larger
    beside = _beside_unknowns(more)
    if beside is not None and _is_simpler(beside.finding, more.finding):
        return beside  # of more effects than these some imitate anything
    if more.finding.many.at_first_sight:
        more = known.with_more_effects()
    return more if more.finding.accepted else beside or more


def _beside_unknowns(known: Knowledge) -> Knowledge | None:
    """What explains the readings beside a local unknown, or without the one that led there, if something does
    that may be believed; not of many readings, nor of what is no beam."""
    if known.problem.layout.size > MANY or _doubt(known) not in (None, DoubtReason.SET_ASIDE):
        return None
    known.inquiry.progress("effects beside local unknowns")
    problem, unknown = with_unknowns(known.in_its_light().data.problem, known.inquiry.readings)
    data = replace(known.data, problem=replace(problem, candidates=(*problem.candidates, *unknown)))
    base = known.finding.level.base
    prepared = replace(known.prepared, problem=data.problem, explanation=(), reference=base)
    ends = misses_by_far(data.budget.tolerance)
    found = replace(known, data=data, prepared=prepared).with_more_effects(ends)
    names, best = tuple(dict.fromkeys(c.name for c in unknown)), found.finding.best
    if best is None or _doubt(found) is not None:
        return None
    if set(names).isdisjoint(best.names):  # an unknown led to what does without it
        there = replace(known.prepared, explanation=best.explanation, reference=best.fit)
        more = replace(known, prepared=there).with_more_effects()
        return more if more.finding.accepted else None
    return found.now(found.prepared, replace(found.finding, unknown=names))


def _doubt(known: Knowledge) -> DoubtReason | None:
    """What speaks against believing anything of the readings."""
    doubt = known.trust(np.random.default_rng(known.inquiry.seed)).doubt
    return None if doubt is None else doubt.reason


def _is_simpler(finding: SearchResult, other: SearchResult) -> bool:
    """Does an explanation take fewer effects than a set that explains less, or as few as may explain it?"""
    best, more = finding.best, other.closest
    few = max(_FEWEST, len(more.explanation) - 1 if more is not None else 0)
    return best is not None and len(best.explanation) <= few


def _unless_more_explain(known: Knowledge) -> Knowledge:
    """One or two effects that pass because the errors are taken for too small, or more that explain the
    scatter: if not all of it, something is missing, and the two are no answer."""
    scale = _unexplained_variance(known.prepared, known.finding)
    if scale < _TOO_SMALL:
        return known
    more = known.with_more_effects(leaves(_PROMISES))
    many = more.finding.many
    if many is None or many.at_first_sight:
        return known
    if _unexplained_variance(more.prepared, more.finding, many.adequacy) >= _MENDS * scale:
        return known
    return more if more.finding.accepted else _beside_unknowns(more) or more


def _unexplained_variance(prepared: Prepared, finding: SearchResult, about: Adequacy | None = None) -> float:
    """Variance over the quoted one that all effects together leave, beside what was found or another set."""
    judged = about or finding.adequacy_of(finding.explaining)
    return prepared.excess * finding.level.bench.phi * judged.phi


def _unless_an_unknown_does(known: Knowledge) -> Knowledge:
    """What passes, or explains the readings beside a local unknown, where it leaves more than their errors.

    It was taken for noise then: a lamp that swings looks like errors that go together, a step that a curve of
    its power follows halfway like larger ones.
    """
    prepared, finding = known.prepared, known.finding
    if finding.size is None or known.problem.layout.size > MANY:
        return known
    scale = _variance_left(prepared, finding)
    if scale < _TOO_SMALL or not _an_unknown_shows(known):
        return known
    beside = _beside_unknowns(known)
    if beside is None or _variance_left(beside.prepared, beside.finding) >= max(_MENDS * scale, _AS_STATED):
        return known
    return beside


def _an_unknown_shows(known: Knowledge) -> bool:
    """Does a local unknown take so much of what is left beside what was found that one is to be sought?"""
    prepared, finding = known.prepared, known.finding
    problem, sigma = prepared.problem, prepared.noise.sigma
    explanation = () if finding.best is None else finding.best.explanation
    fit = finding.level.base if finding.best is None else finding.best.fit
    # What the scene states may have another size, which an unknown shows beside alone.
    stated = tuple(c for c in problem.candidates if c.is_stated and c not in explanation)
    model = problem.model((*explanation, *stated)) if go_together((*explanation, *stated)) else fit.model
    off, light = (problem.value - fit.prediction) / sigma, fit.prediction / sigma
    moves = model.jacobian(model.at(fit.by_path), fit.prediction) / sigma[:, None]
    left = left_by_an_unknown(problem.layout, off, light, problem.keep, moves, fit.prediction)
    return left < _MENDS and float(problem.keep.sum()) * np.log(1 / left) >= _SHOWS


def _variance_left(prepared: Prepared, finding: SearchResult) -> float:
    """Variance over the quoted one that what was found leaves, be it of noise or not."""
    fit = finding.level.base if finding.explaining is None else finding.explaining.fit
    left = fit.chi2 / max(finding.n - len(fit.u), 1)
    return prepared.excess * finding.level.bench.phi * left


def _unless_overtaken(known: Knowledge) -> Knowledge:
    """One or two effects, or any number where a set among their rivals costs less by more than a name is
    worth."""
    more = known.with_more_effects() if is_overtaken(known.finding) else known
    return more if more.finding.accepted else known


def _settled_after(found: Knowledge) -> Knowledge:
    """What was found, settled; more effects where better light takes one or two back."""
    known = found.in_traced_light()
    if (node := known.finding.cheaper) is not None:  # the search goes on from there, in light traced there
        there = replace(found.prepared, explanation=node.explanation, reference=node.fit)
        more = replace(found, prepared=there).with_more_effects()
        known = more.in_traced_light() if more.finding.accepted else known
    if known.finding.size is None and not known.finding.beyond_two:
        known = known.now(found.prepared, known.finding).with_more_effects().in_traced_light()
    finding = known.finding
    if finding.is_levelled or finding.beyond_two:
        return known
    # In better light another set is the best.
    return known.in_its_light().now(known.prepared, replace(finding, many=None)).levelled()


def _judged(known: Knowledge) -> Outcome:
    """What may be believed: the calibration, what the scene states, too much noise, the photons' errors."""
    # What the answer rests on is said and drawn in its own light.
    known = replace(known, problem=replace(known.problem, forward=known.prepared.problem.forward))
    prepared, finding = calibration.on_absolute_scale(
        known.prepared, known.problem, without_held_ranges(with_truncation(known.finding))
    )
    finding = refutation.pruned(prepared, finding)
    trust = known.now(prepared, finding).trust(known.rng)
    if trust.doubt is None and known.data.budget.times_stated > 1:
        trust = replace(trust, doubt=Doubt(reason=DoubtReason.SCATTER, times=known.data.budget.times_stated))
    if trust.doubt is not None:
        partly = trust.doubt.leaves_names
        # What has a coordinate may pass for noise; of what is no beam nothing is told.
        no_beam = trust.doubt.reason is not DoubtReason.NOISE
        finding = finding.but_for_some() if partly else finding.without_answer(no_beam)
    also = None
    if known.inquiry.is_settled_after:
        finding = in_light_of_photons(prepared.problem, finding)
        also = with_scattering(prepared.problem, finding, known.inquiry.seed)
    if finding.best is not None:
        finding = replace(finding, errors_of_set=finding.best.errors)
    if also is not None:
        finding = also.widened(finding)
    finding = unnamed.in_errors(finding)
    variance = _unexplained_variance(prepared, finding) if prepared.errors_stated else 1.0
    return Outcome(known.now(prepared, finding.open_beside_unknown(variance)), trust, also)
