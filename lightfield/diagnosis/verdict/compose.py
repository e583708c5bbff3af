"""Puts a finding together as the verdict: numbers, limits, rival, advice, words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lightfield.arrays import finite
from lightfield.diagnosis.problem.setup import errors_believed
from lightfield.diagnosis.problem.untestable import Hinders, Hindrance, Untestable
from lightfield.diagnosis.search.cascade import SearchResult
from lightfield.diagnosis.search.pool.any_number import FAR
from lightfield.diagnosis.search.preparation import Prepared
from lightfield.diagnosis.search.told_apart import detection_limits, nearest_rival, unseen_effects
from lightfield.diagnosis.verdict import verdict_data
from lightfield.diagnosis.verdict.advice import where_next
from lightfield.diagnosis.verdict.best_set import unnamed
from lightfield.diagnosis.verdict.best_set.found_effects import found_effects
from lightfield.diagnosis.verdict.best_set.scattered_too import WithScattering
from lightfield.diagnosis.verdict.cautions.caution import Caution
from lightfield.diagnosis.verdict.cautions.glass import of_glass
from lightfield.diagnosis.verdict.cautions.noise_and_fit import cautions, variance_scale
from lightfield.diagnosis.verdict.cautions.plausibility import exchanged, hints
from lightfield.diagnosis.verdict.estimates import estimates, units_in
from lightfield.diagnosis.verdict.ladder import Step, bright, held_out, percent, removed, rms_over
from lightfield.diagnosis.verdict.next_measurement import NextMeasurement, look
from lightfield.diagnosis.verdict.parts import (
    AcceptedExplanation,
    DetectionLimit,
    DoubtReason,
    Estimate,
    Kind,
    LeftOver,
    Misfit,
    NearestRival,
    Rung,
    StatedEffect,
)
from lightfield.diagnosis.verdict.refutation import Judged, judged_effects, stated_effects
from lightfield.diagnosis.verdict.rest.left_over import left_over
from lightfield.diagnosis.verdict.rest.misfit import along, beyond_errors, unexplained
from lightfield.diagnosis.verdict.trust import (
    Trust,
    error_scale,
    left_by_fit,
    noise_floor,
    pure_error,
    set_aside,
)
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.light_source import beyond_table
from lightfield.readings import Readings
from lightfield.version import __version__


@dataclass(frozen=True)
class VerdictBasis:
    """All that a verdict is made of.

    Parameters
    ----------
    steps : list of Step
        The ladder with its fits.
    untestable : dict
        Effects that cannot be tested here, with reasons.
    lamp : sequence of Judged
        What absolute readings say of the lamp's power.
    seed : int
        Of the bootstrap.
    also : WithScattering, optional
        What reflects, with scattering too.
    lamp_instead : Caution, optional
        That another lamp than the scene's is spoken of.
    """

    forward: SceneForward
    readings: Readings
    prepared: Prepared
    finding: SearchResult
    steps: list[Step]
    untestable: Untestable
    trust: Trust
    lamp: Sequence[Judged] = ()
    seed: int = 0
    also: WithScattering | None = None
    lamp_instead: Caution | None = None


def _rungs(basis: VerdictBasis, units: dict[str, str]) -> list[Rung]:
    finding = basis.finding
    best, scale = finding.best, finding.level.phi

    def values(step: Step) -> dict[str, Estimate]:
        # The last rung is the best explanation: its errors are stated once, not in two ways.
        if best is None and not step.explanation:
            return estimates(step.fit, finding.level.scale, units, finding.base_errors, {})
        if best is None or {c.key for c in step.explanation} != {c.key for c in best.explanation}:
            return estimates(step.fit, scale, units)
        return estimates(step.fit, best.scale, units, best.errors, finding.errors_of_set)

    return [
        Rung(
            label=s.label,
            effects=[c.name for c in s.explanation],
            error_percent=finite(s.error_percent),
            chi2_per_dof=s.chi2_per_dof,
            held_out_percent=finite(s.held_out_percent),
            parameters=values(s),
            scene=basis.forward.scenes.at(s.fit.values).to_toml(),
            removed_percent=part,
        )
        for s, part in zip(basis.steps, removed(basis.steps, pure_error(finding)), strict=True)
    ]


def _explanations(basis: VerdictBasis, units: dict[str, str], hold_out: bool) -> list[AcceptedExplanation]:
    finding, problem, level = basis.finding, basis.prepared.problem, basis.finding.level
    counted, n = bright(problem), int(problem.keep.sum())
    quoted = level.bench.phi * basis.prepared.excess
    out = []
    for k, (tried, weight) in enumerate(zip(finding.accepted, finding.weights, strict=True)):
        assert tried.adequacy is not None
        of_set = finding.errors_of_set if k == 0 else None
        if k == 0:
            left_out = basis.steps[-1].held_out_percent
        elif hold_out and not finding.beyond_two:
            left_out = held_out(
                problem, tried.explanation, tried.fit, tried.test.whiten if tried.test else finding.whiten
            )
        else:
            left_out = float("nan")
        out.append(
            AcceptedExplanation(
                effects=[c.name for c in tried.explanation],
                families=[c.effect.family for c in tried.explanation],
                forms=[c.form.name for c in tried.explanation],
                weight=weight,
                parameters=estimates(tried.fit, tried.scale, units, tried.errors, of_set),
                chi2_per_dof=tried.fit.chi2 * quoted / max(n - len(tried.fit.u), 1),
                error_percent=finite(percent(problem, tried.fit.prediction, counted)),
                held_out_percent=finite(left_out),
                adequacy_p=tried.adequacy.p,
            )
        )
    return out


def _limits(
    finding: SearchResult, units: dict[str, str], also: WithScattering | None
) -> dict[str, DetectionLimit]:
    best, adequacy = finding.best, finding.adequacy_of(finding.best)
    named = {*(best.names if best else ()), *finding.unknown}
    limits = detection_limits(adequacy, finding.level.scale if best is None else best.scale)
    if also is not None:
        limits[also.candidate.name] = also.limit
    return {
        name: DetectionLimit(
            parameter=limit.path,
            value=limit.value,
            unit=units.get(limit.path, "1"),
            within_range=limit.reachable,
        )
        for name, limit in limits.items()
        if name not in named
    }


def _untestable(basis: VerdictBasis) -> dict[str, tuple[Hindrance, ...]]:
    """What these readings cannot show, with reasons.

    What shows beside the best set was tested there, and what one of its curves contains is in it.
    """
    finding = basis.finding
    of_base = finding.levels[0].adequacy.scores
    scores = (*of_base, *finding.adequacy_of(finding.best).scores)
    held = {name for c in finding.best.explanation for name in c.effect.contains} if finding.best else set()
    unseen = unseen_effects(of_base, scores, Hinders.ABSORBED)
    return {**basis.untestable, **{name: why for name, why in unseen.items() if name not in held}}


def _of_best(finding: SearchResult, units: dict[str, str]) -> dict[str, Estimate]:
    """Parameters of the best set; errors that an unexplained misfit widens."""
    closest, best = finding.closest, finding.best
    if closest is None:
        return {}
    if best is None:
        phi = max(finding.level.phi, closest.fit.chi2 / max(finding.n - len(closest.fit.u), 1))
        return estimates(closest.fit, phi, units, closest.errors)
    return estimates(closest.fit, best.scale, units, closest.errors, finding.errors_of_set)


def kind_of(finding: SearchResult) -> Kind:
    """The kind of verdict that a finding is."""
    if finding.best is not None:
        return Kind.IDENTIFIED if finding.identified else Kind.AMBIGUOUS
    return Kind.NONE if finding.size == 0 else Kind.UNEXPLAINED


class _Undecided(NamedTuple):
    """What a verdict leaves open."""

    rival: NearestRival | None = None
    advice: NextMeasurement | None = None
    misfit: Misfit | None = None
    left: Sequence[LeftOver] = ()


def _left_open(basis: VerdictBasis, kind: Kind, advise: bool) -> _Undecided:
    """Of an answer its nearest rival and what tells them apart; else what the unexplained rest is like."""
    prepared, finding = basis.prepared, basis.finding
    best = finding.best
    if best is None:
        # What scatters more than stated may do so along a coordinate, as a lamp that flickers.
        scatters = basis.trust.doubt is not None and basis.trust.doubt.reason is DoubtReason.SCATTER
        if kind != Kind.UNEXPLAINED or ((finding.withheld or finding.in_part) and not scatters):
            return _Undecided()
        local = left_over(prepared, finding, basis.readings) if advise or finding.unknown else []
        misfit, advice = unexplained(prepared, finding, local)
        return _Undecided(None, advice, misfit, along(misfit, [one.record for one in local]))
    rival, near = None, None
    if not finding.beyond_two:  # of more the gap to the best set without each says more, and takes no fits
        near = nearest_rival(prepared.problem, finding.whiten, best, finding.tried, finding.level.phi)
    if near is not None:
        rival = NearestRival(effects=list(near.explanation.names), separation_sigma=near.separation_sigma)
    second = finding.accepted[1] if len(finding.accepted) > 1 else (near.explanation if near else None)
    other = finding.in_doubt or second
    if kind != Kind.AMBIGUOUS or other is None or not advise:
        return _Undecided(rival)
    return _Undecided(rival, where_next(prepared, finding, basis.forward, best, other))


def _how_judged(basis: VerdictBasis) -> verdict_data.HowJudged:
    prepared, finding = basis.prepared, basis.finding
    first = finding.levels[0].adequacy
    return verdict_data.HowJudged(
        base_p=first.p,
        within_tolerance=finding.level.tolerance > 0,
        tolerance_percent=100 * prepared.noise.budget.tolerance,
        errors_stated=prepared.errors_stated and errors_believed(basis.readings),
        errors_on_trust=first.scale_taken,
        determined=finding.determined,
        variance_scale=variance_scale(prepared, finding),
        serial_correlation=prepared.serial.rho,
    )


def _readings_used(basis: VerdictBasis) -> verdict_data.ReadingsUsed:
    layout = basis.prepared.problem.layout
    beyond = beyond_table(basis.forward.scene, basis.readings)
    return verdict_data.ReadingsUsed(
        outliers=[int(i) for i in np.flatnonzero(basis.trust.aside)],
        saturated=[int(i) for i in np.flatnonzero(basis.readings.saturated & ~beyond)],
        beyond_table=[int(i) for i in np.flatnonzero(beyond)],
        set_aside=set_aside(basis.readings, basis.trust, beyond),
        readings=layout.size,
        several_wavelengths=bool(layout.channel.max() > 0),
    )


def _reached(basis: VerdictBasis, units: dict[str, str]) -> verdict_data.Reached:
    """Over the explained model, as the error of the last rung is."""
    counted, fit = bright(basis.prepared.problem), basis.steps[-1].fit
    errors = noise_floor(basis.prepared, basis.finding)
    floor = rms_over(errors[counted], fit.prediction[counted])
    left, chance = left_by_fit(errors, fit, counted)
    return verdict_data.Reached(
        ladder=_rungs(basis, units),
        noise_floor_percent=finite(floor),
        left_by_fit_percent=finite(left),
        left_by_fit_stderr_percent=finite(chance),
        noise_percent=basis.trust.noise_percent,
    )


def _stated(
    basis: VerdictBasis, units: dict[str, str], untestable: Untestable, doubted: bool
) -> list[StatedEffect]:
    prepared, finding, best = basis.prepared, basis.finding, basis.finding.best
    phi = finding.level.scale if best is None else best.scale
    return stated_effects(
        basis.forward.scene,
        # What cannot be trusted contradicts no scene either.
        [] if doubted else [*basis.lamp, *judged_effects(prepared, finding, untestable)],
        (p.path for p in prepared.problem.base),
        untestable,
        lambda fit, least: estimates(fit, phi, units, least),
        best.errors if best is not None else finding.base_errors,
    )


def _nearly_fits(basis: VerdictBasis, kind: Kind) -> bool:
    """Do the readings come near to the last rung, or is most of them unexplained?"""
    noise = error_scale(basis.prepared, basis.finding)
    return kind != Kind.UNEXPLAINED or basis.steps[-1].chi2_per_dof <= FAR * noise


def verdict_of(basis: VerdictBasis, advise: bool = True) -> Verdict:
    """The verdict as plain data.

    Parameters
    ----------
    advise : bool
        Work out held-out errors and the next measurement.
    """
    finding, problem, units = basis.finding, basis.prepared.problem, units_in(basis.forward)
    best, kind, untestable = finding.best, kind_of(finding), _untestable(basis)
    rival, advice, misfit, left = _left_open(basis, kind, advise)
    # A misfit that has a coordinate says more than any doubt.
    doubt, coordinate = (basis.trust.doubt, None) if misfit is None else (None, misfit.coordinate)
    used = _readings_used(basis)
    if doubt is not None and doubt.structure is not None:
        coordinate, advice = doubt.structure.coordinate, look(used.set_aside)
    if doubt is not None and doubt.reason is DoubtReason.SCATTER:
        advice = beyond_errors(problem)
    explanations, of_best = _explanations(basis, units, advise), _of_best(finding, units)
    # Too much noise names nothing; readings set aside, or more scatter than stated, leave others as they are.
    nameless = doubt is not None and not doubt.leaves_names
    told = [] if nameless else found_effects(basis.forward, finding, of_best)
    # By name: of an effect with several forms one may be in the best set, and another not testable.
    named, budget = {one.effect for one in told}, basis.prepared.noise.budget
    parts = (
        verdict_data.Explained(
            verdict=kind,
            effects=[c.name for c in best.explanation] if best else [],
            explanations=explanations,
            found=told,
        ),
        verdict_data.LeftOpen(
            nearest_rival=rival,
            detection_limits=_limits(finding, units, basis.also),
            hindrances={name: list(why) for name, why in untestable.items() if name not in named},
            unexplained_coordinate=coordinate,
            misfit=misfit,
            left_over=list(left),
            unnamed=unnamed.unnamed(finding, units, basis.also) if advise else [],
            reason_to_doubt=doubt,
        ),
        _reached(basis, units),
        verdict_data.Advised(
            next_measurement=advice,
            stated=_stated(basis, units, untestable, doubt is not None),
            assumptions=list(budget.assumed),
            cautions=[
                *([basis.lamp_instead] if basis.lamp_instead else []),
                *hints(
                    basis.forward, problem, basis.steps[-1].fit, budget.calibration, _nearly_fits(basis, kind)
                ),
                *exchanged(basis.forward, problem, finding),
                *of_glass(basis.forward, problem, finding),
                *cautions(basis.readings, basis.prepared, finding, explanations),
            ],
        ),
        _how_judged(basis),
        used,
        verdict_data.ThisRun(seed=basis.seed, lightfield_version=__version__),
    )
    return Verdict(**{name: value for part in parts for name, value in part})
