"""The course of a diagnosis: search in the light of a trace, settle what was found in better light, judge it.

Each stage takes what is known and gives what is known then.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lightfield.diagnosis.problem.local_unknowns import left_by_a_ripple, with_unknowns
from lightfield.diagnosis.problem.problem import MANY, Problem
from lightfield.diagnosis.problem.setup import budget_of, problem_of
from lightfield.diagnosis.problem.untestable import Hindrance, Untestable
from lightfield.diagnosis.search.better_light.settled import is_nearly_explained, settled
from lightfield.diagnosis.search.cascade import SearchResult, search
from lightfield.diagnosis.search.many import beyond_two, is_overtaken, leaves, levelled, misses_by_far
from lightfield.diagnosis.search.pool.any_number import Data, Ends, never
from lightfield.diagnosis.search.preparation import Prepared, prepare_problem
from lightfield.diagnosis.search.search_progress import Progress
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
from lightfield.diagnosis.verdict.cautions.noise_and_fit import variance_scale
from lightfield.diagnosis.verdict.parts import DoubtReason
from lightfield.diagnosis.verdict.trust import Trust, says_nothing, trust_of
from lightfield.fitting.diffuse_light import DiffuseSource
from lightfield.fitting.effects import Effect
from lightfield.fitting.retraced import Retraced
from lightfield.readings import Readings
from lightfield.scene import Scene

#: Variance over the stated one from which on more effects are asked whether they explain the scatter, and the
#: part of it that they leave then. Chosen: by chance one set of 60 readings in 300 scatters so much; where
#: errors are stated half as large as they are all is left.
_TOO_SMALL, _MENDS = 1.5, 0.6
#: The part that the first sets of a search have to come down to for it to go on. Chosen: the noise is judged
#: again after them, which takes little more.
_PROMISES = 0.8
#: Where no one or two effects will do, known ones are so many at least. Derived: one and two were tried.
_FEWEST = 3


@dataclass(frozen=True)
class Inquiry:
    """What is asked of readings.

    Parameters
    ----------
    scene : Scene
        What the experimenter believes.
    source, without_diffuse
        What gives scattered and reflected light, or why nothing does.
    effects : sequence of Effect
        That are considered.
    is_settled_after : bool
        Light is traced by the renderer: what is found is settled with light traced for it.
    alpha : float
        Family-wise false-alarm probability of the test of the base model.
    seed : int
        Of the bootstrap, and of the traces that scattered light is settled with.
    asked : sequence of str
        Names of `effects`, where not all that are known were asked for.
    """

    readings: Readings
    scene: Scene
    source: DiffuseSource | None
    without_diffuse: Hindrance | None
    effects: Sequence[Effect]
    is_settled_after: bool
    alpha: float
    seed: int
    asked: Sequence[str] = ()


@dataclass(frozen=True)
class Knowledge:
    """What is known of the readings so far.

    Parameters
    ----------
    problem : Problem
        As the table poses it, with the gain in its range.
    untestable : dict
        Effects that cannot be tested here, with reasons.
    data : Data
        Every usable reading, with every candidate.
    prepared, finding
        Noise and outliers; what was found.
    rng : Generator
        Of the bootstrap, as far as it was used.
    is_settled : bool
        The finding rests on light traced for it.
    """

    problem: Problem
    untestable: Untestable
    data: Data
    prepared: Prepared
    finding: SearchResult
    rng: np.random.Generator
    is_settled: bool = False

    def now(self, prepared: Prepared, finding: SearchResult) -> Knowledge:
        """The same with another finding, and the noise that it was judged beside."""
        return replace(self, prepared=prepared, finding=finding)

    @property
    def data_in_its_light(self) -> Data:
        """Every usable reading, in the light that the finding rests on."""
        forward = self.prepared.problem.forward
        return replace(self.data, problem=replace(self.data.problem, forward=forward))


@dataclass(frozen=True)
class Outcome:
    """What is known in the end.

    Parameters
    ----------
    trust : Trust
        What is set aside, and whether there is a reason to doubt.
    also : WithScattering, optional
        What reflects, with scattering too.
    """

    known: Knowledge
    trust: Trust
    also: WithScattering | None


def course(inquiry: Inquiry, progress: Progress) -> Outcome:
    """Search, settle, judge."""
    # Light that grows beyond all numbers is a model that misses the readings, and no fault.
    with np.errstate(over="ignore", invalid="ignore"):
        return _course(inquiry, progress)


def _course(inquiry: Inquiry, progress: Progress) -> Outcome:
    known = _searched(inquiry, progress)
    progress("rivals of every effect")
    known = known.now(known.prepared, levelled(known.data, known.prepared, known.finding))
    if is_overtaken(known.finding):
        more = _beyond_two(inquiry, known, known.prepared, progress)
        known = more if more.finding.accepted else known
    if inquiry.is_settled_after and not known.is_settled:
        known = _settled_after(inquiry, known, progress)
    return _judged(inquiry, known)


def _searched(inquiry: Inquiry, progress: Progress) -> Knowledge:
    """What a trace shows; traced again where it ends in water too dense for it."""
    readings, seed, alpha = inquiry.readings, inquiry.seed, inquiry.alpha
    budget, quoted = budget_of(readings), np.asarray(readings.stderr, float)
    before: tuple[FittedSet, ...] = ()
    traces = Retraced(inquiry.scene, readings, inquiry.source)
    for forward in traces:
        problem, untestable = problem_of(forward, readings, inquiry.effects, inquiry.without_diffuse)
        rng = np.random.default_rng(seed)
        progress(f"noise and outliers of {problem.layout.size} readings")
        by_shape = calibration.by_shape(problem)
        # Curves come only where no named effect will do.
        data = Data(by_shape.with_curves(), quoted, budget)
        prepared = prepare_problem(by_shape, quoted, budget, rng, alpha, before)
        traces.asked, before = prepared.to_trace_per_m, prepared.known
        if traces.asked is not None and traces.left:
            continue
        finding = search(prepared, budget.tolerance, rng, alpha, progress)
        known = Knowledge(problem, untestable, data, prepared, finding, rng)
        if finding.size is None:
            known = _with_more_effects(inquiry, known, progress)
        elif finding.size > 0 and prepared.errors_stated:
            known = _unless_more_explain(inquiry, known, progress)
        if prepared.errors_stated:
            known = _unless_a_ripple_does(inquiry, known, progress)
        if known.is_settled:
            break
        light = known.prepared.problem.forward.light
        traces.asked = light.to_trace(one.fit.values for one in known.finding.contenders)
    return known


def _with_more_effects(inquiry: Inquiry, known: Knowledge, progress: Progress) -> Knowledge:
    """Where no one or two effects will do: any number, unless one or two nearly do, and do once settled."""
    if inquiry.is_settled_after and is_nearly_explained(known.prepared, known.finding):
        early = _settled(inquiry, known, progress)
        if early.finding.accepted:
            return replace(early, data=early.data_in_its_light, is_settled=True)
    more = _beyond_two(inquiry, known, known.prepared, progress, misses_by_far(known.data.budget.tolerance))
    if more.finding.accepted or more.finding.many is None:
        return more
    beside = _beside_unknowns(inquiry, more, progress)
    if beside is not None and _is_simpler(beside.finding, more.finding):
        return beside  # of more effects than these some imitate anything
    if more.finding.many.at_first_sight:
        more = _beyond_two(inquiry, known, known.prepared, progress)
    return more if more.finding.accepted or beside is None else beside


def _beside_unknowns(inquiry: Inquiry, known: Knowledge, progress: Progress) -> Knowledge | None:
    """What explains the readings beside a local unknown, if something does that may be believed; not of many
    readings, nor of what is no beam."""
    if known.problem.layout.size > MANY or _doubt(inquiry, known) not in (None, DoubtReason.SET_ASIDE):
        return None
    progress("effects beside local unknowns")
    problem, unknown = with_unknowns(known.data_in_its_light.problem, inquiry.readings)
    data = replace(known.data, problem=replace(problem, candidates=(*problem.candidates, *unknown)))
    base = known.finding.level.base
    prepared = replace(known.prepared, problem=data.problem, explanation=(), reference=base)
    ends = misses_by_far(data.budget.tolerance)
    found = _beyond_two(inquiry, replace(known, data=data), prepared, progress, ends)
    names, best = tuple(dict.fromkeys(c.name for c in unknown)), found.finding.best
    if best is None or set(names).isdisjoint(best.names) or _doubt(inquiry, found) is not None:
        return None
    return found.now(found.prepared, replace(found.finding, unknown=names))


def _doubt(inquiry: Inquiry, known: Knowledge) -> DoubtReason | None:
    """What speaks against believing anything of the readings."""
    saturated, rng = np.asarray(inquiry.readings.saturated, bool), np.random.default_rng(inquiry.seed)
    doubt = trust_of(known.prepared, known.finding, saturated, rng).doubt
    return None if doubt is None else doubt.reason


def _is_simpler(finding: SearchResult, other: SearchResult) -> bool:
    """Does an explanation take fewer effects than a set that explains less, or as few as may explain it?"""
    best, more = finding.best, other.closest
    few = max(_FEWEST, len(more.explanation) - 1 if more is not None else 0)
    return best is not None and len(best.explanation) <= few


def _unless_more_explain(inquiry: Inquiry, known: Knowledge, progress: Progress) -> Knowledge:
    """One or two effects that pass because the errors are taken for too small, or more that explain the
    scatter: if not all of it, something is missing, and the two are no answer."""
    scale = variance_scale(known.prepared, known.finding)
    if scale < _TOO_SMALL:
        return known
    more = _beyond_two(inquiry, known, known.prepared, progress, leaves(_PROMISES))
    many = more.finding.many
    if many is None or many.at_first_sight:
        return known
    if variance_scale(more.prepared, more.finding, many.adequacy) >= _MENDS * scale:
        return known
    return more if more.finding.accepted else _beside_unknowns(inquiry, more, progress) or more


def _unless_a_ripple_does(inquiry: Inquiry, known: Knowledge, progress: Progress) -> Knowledge:
    """What passes, or explains the readings beside a ripple of the lamp's power in time.

    It was taken for noise then: one that follows another looks like errors that go together.
    """
    prepared, finding = known.prepared, known.finding
    if finding.size is None or known.problem.layout.size > MANY:
        return known
    scale = variance_scale(prepared, finding)
    if scale < _TOO_SMALL:
        return known
    problem, sigma = prepared.problem, prepared.noise.sigma
    fit = finding.level.base if finding.best is None else finding.best.fit
    off, light = (problem.value - fit.prediction) / sigma, fit.prediction / sigma
    if left_by_a_ripple(problem.layout, off, light, problem.keep) >= _MENDS:
        return known
    beside = _beside_unknowns(inquiry, known, progress)
    if beside is None or variance_scale(beside.prepared, beside.finding) >= _MENDS * scale:
        return known
    return beside


def _beyond_two(
    inquiry: Inquiry, known: Knowledge, prepared: Prepared, progress: Progress, ends: Ends = never
) -> Knowledge:
    alpha, seed = inquiry.alpha, inquiry.seed
    if says_nothing(prepared, known.finding):
        return known.now(prepared, known.finding)
    return known.now(*beyond_two(known.data, prepared, known.finding, alpha, seed, progress, ends))


def _settled(inquiry: Inquiry, known: Knowledge, progress: Progress) -> Knowledge:
    data, prepared, finding, rng = known.data, known.prepared, known.finding, known.rng
    alpha, seed = inquiry.alpha, inquiry.seed
    return known.now(*settled(data, prepared, finding, rng, alpha, progress, seed))


def _settled_after(inquiry: Inquiry, found: Knowledge, progress: Progress) -> Knowledge:
    """What was found, settled; more effects where better light takes one or two back."""
    known = _settled(inquiry, found, progress)
    finding = known.finding
    if finding.cheaper is not None:
        better = _from_there(inquiry, found, finding.cheaper, progress)
        known = known if better is None else better
        finding = known.finding
    if finding.size is None and (finding.many is None or not finding.many.sought):
        known = _beyond_two(inquiry, known, found.prepared, progress)
        known = _settled(inquiry, known, progress)
        finding = known.finding
    if not (finding.is_levelled or finding.beyond_two):  # in better light another set is the best
        finding = replace(finding, many=None)
        finding = levelled(known.data_in_its_light, known.prepared, finding)
    return known.now(known.prepared, finding)


def _from_there(inquiry: Inquiry, found: Knowledge, node: FittedSet, progress: Progress) -> Knowledge | None:
    """What any number of effects explain, from a set and in light traced there, settled; None for nothing."""
    there = replace(found.prepared, explanation=node.explanation, reference=node.fit)
    more = _beyond_two(inquiry, found, there, progress)
    return _settled(inquiry, more, progress) if more.finding.accepted else None


def _judged(inquiry: Inquiry, known: Knowledge) -> Outcome:
    """What may be believed: the calibration, what the scene states, too much noise, the photons' errors."""
    # What the answer rests on is said and drawn in its own light.
    known = replace(known, problem=replace(known.problem, forward=known.prepared.problem.forward))
    prepared, finding = calibration.on_absolute_scale(
        known.prepared, known.problem, without_held_ranges(with_truncation(known.finding))
    )
    finding = refutation.pruned(prepared, finding)
    trust = trust_of(prepared, finding, np.asarray(inquiry.readings.saturated, bool), known.rng)
    if trust.doubt is not None:
        partly = trust.doubt.reason is DoubtReason.SET_ASIDE
        # What has a coordinate may pass for noise; of what is no beam nothing is told.
        no_beam = trust.doubt.reason is not DoubtReason.NOISE
        finding = finding.but_for_some() if partly else finding.without_answer(no_beam)
    also = None
    if inquiry.is_settled_after:
        finding = in_light_of_photons(prepared.problem, finding)
        also = with_scattering(prepared.problem, finding, inquiry.seed)
    if finding.best is not None:
        finding = replace(finding, errors_of_set=finding.best.errors)
    if also is not None:
        finding = replace(finding, accepted=[also.widened(finding.accepted[0]), *finding.accepted[1:]])
    finding = unnamed.in_errors(finding)
    return Outcome(known.now(prepared, finding.open_beside_unknown()), trust, also)
