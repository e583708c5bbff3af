"""Puts a finding together as the verdict: numbers, limits, rival, advice, words."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.adequacy.families import Coordinate, coordinates
from lightfield.diagnosis.problem.noise import Whitener
from lightfield.diagnosis.search.cascade import Finding
from lightfield.diagnosis.search.preparation import Prepared
from lightfield.diagnosis.search.rivals import SAME_CLASS_SIGMA, detection_limits, nearest_rival
from lightfield.diagnosis.search.search import Tried
from lightfield.diagnosis.verdict import aside_words, stated, words
from lightfield.diagnosis.verdict.advice import ROUGH, possible_places, where_next
from lightfield.diagnosis.verdict.cautions import cautions, variance_scale
from lightfield.diagnosis.verdict.ladder import Step, bright, held_out, percent
from lightfield.diagnosis.verdict.plausibility import exchanged, hints
from lightfield.diagnosis.verdict.refutation import Judged, entries, judged
from lightfield.diagnosis.verdict.trust import Trust, error_scale, standard_errors
from lightfield.diagnosis.verdict.verdict import (
    DetectionLimit,
    Estimate,
    Explanation,
    Kind,
    NearestRival,
    NextMeasurement,
    Reason,
    Rung,
    Spot,
    Verdict,
)
from lightfield.fitting.least_squares import Fit

#: A family of unknown factors is named when it takes away this part of the misfit.
_NAMED = 0.35


def estimates(
    fit: Fit, scale: float, units: dict[str, str], least: Mapping[str, float] | None = None
) -> dict[str, Estimate]:
    """Fitted values with errors, or the reason why there is none.

    Parameters
    ----------
    scale : float
        Pure-error variance in units of the whitening.
    least : mapping, optional
        Smallest errors by path, from a profile.
    """
    errors, bound = fit.stderr(scale), fit.at_bound()
    out = {}
    for i, path in enumerate(fit.paths):
        value, error = fit.values[path], np.fmax(errors[path], (least or {}).get(path, 0.0))
        reason: Reason | None = None
        if fit.model.parameters[i].is_held:
            reason = Reason.HELD
        elif bound[i]:
            reason = Reason.AT_BOUNDARY
        elif np.linalg.norm(fit.jacobian[:, i]) == 0:
            reason = Reason.DID_NOT_MOVE
        elif not np.isfinite(error):
            reason = Reason.UNDETERMINED
        elif error > fit.model.parameters[i].width(fit.u[i]):
            reason = Reason.TOO_WIDE
        out[path] = Estimate(
            value=value, stderr=None if reason else error, unit=units.get(path, "reading"), reason=reason
        )
    return out


def units_of(scene: Any) -> dict[str, str]:
    """Unit of every scene parameter."""
    return {path: parameter.unit for path, parameter in scene.parameters().items()}


def _rungs(
    steps: list[Step], forward: Any, scale: float, units: dict[str, str], best: Tried | None
) -> list[Rung]:
    def values(step: Step) -> dict[str, Estimate]:
        # The last rung is the best explanation: its errors are stated once, not in two ways.
        if best is None or {c.key for c in step.explanation} != {c.key for c in best.explanation}:
            return estimates(step.fit, scale, units)
        assert best.adequacy is not None
        return estimates(step.fit, best.adequacy.phi, units, best.errors)

    return [
        Rung(
            label=s.label,
            effects=[c.name for c in s.explanation],
            error_percent=s.error_percent,
            chi2_per_dof=s.chi2_per_dof,
            held_out_percent=None if np.isnan(s.held_out_percent) else s.held_out_percent,
            parameters=values(s),
            scene=forward.scene_at(s.fit.values).to_toml(),
        )
        for s in steps
    ]


def _explanations(
    finding: Finding, prepared: Prepared, steps: list[Step], units: dict[str, str], hold_out: bool
) -> list[Explanation]:
    problem, level = prepared.problem, finding.level
    counted, n = bright(problem), int(problem.keep.sum())
    out = []
    for k, (tried, weight) in enumerate(zip(finding.accepted, finding.weights, strict=True)):
        assert tried.adequacy is not None
        if k == 0:
            left_out = steps[-1].held_out_percent
        elif hold_out:
            left_out = held_out(
                problem, tried.explanation, tried.fit, tried.test.whiten if tried.test else finding.whiten
            )
        else:
            left_out = float("nan")
        out.append(
            Explanation(
                effects=[c.name for c in tried.explanation],
                families=[c.effect.family for c in tried.explanation],
                forms=[c.form.name for c in tried.explanation],
                weight=weight,
                parameters=estimates(tried.fit, tried.adequacy.phi, units, tried.errors),
                chi2_per_dof=tried.fit.chi2 * level.bench.phi / max(n - len(tried.fit.u), 1),
                error_percent=percent(problem, tried.fit.prediction, counted),
                held_out_percent=None if np.isnan(left_out) else left_out,
                adequacy_p=tried.adequacy.p,
            )
        )
    return out


def _limits(finding: Finding, best: Tried | None, units: dict[str, str]) -> dict[str, DetectionLimit]:
    adequacy = best.adequacy if best is not None and best.adequacy is not None else finding.level.adequacy
    named = {c.name for c in best.explanation} if best else set()
    return {
        name: DetectionLimit(
            parameter=limit.path,
            value=limit.value,
            unit=units.get(limit.path, "1"),
            within_range=limit.reachable,
        )
        for name, limit in detection_limits(adequacy, adequacy.phi).items()
        if name not in named
    }


def sigma_curve(prepared: Prepared, scale: float) -> Callable[[Array], Array]:
    """Standard error of a reading from its prediction, interpolated over the readings at hand."""
    order = np.argsort(prepared.noise.prediction)
    level, sigma = prepared.noise.prediction[order], prepared.noise.sigma[order]

    def curve(prediction: Array) -> Array:
        quoted = np.interp(prediction, level, sigma)
        # Beyond the brightest reading the error is taken to grow in proportion.
        beyond = np.maximum(prediction / level[-1], 1.0)
        return np.asarray(np.sqrt(scale) * quoted * beyond)

    return curve


def _advice(forward: Any, prepared: Prepared, finding: Finding, one: Tried, two: Tried) -> NextMeasurement:
    problem, level = prepared.problem, finding.level
    places = possible_places(problem, forward.scene.tank)
    last = float(np.nanmax(problem.layout.time_s)) if problem.layout.has_time else np.nan
    n = len(places.x_m)
    there = forward.at(
        ROUGH,
        x_m=places.x_m,
        y_m=places.y_m,
        z_m=places.z_m,
        medium=np.where(places.air > 0, "air", "water"),
        time_s=np.full(n, last),
    )
    curve = sigma_curve(prepared, level.bench.phi * level.phi)
    found = where_next(problem, finding.whiten, one, two, level.phi, places, there, curve)
    readings = [
        Spot(x_m=float(x), y_m=float(y), z_m=float(z), medium="air" if a else "water", repeats=found.repeats)
        for x, y, z, a in zip(
            found.places.x_m, found.places.y_m, found.places.z_m, found.places.air, strict=True
        )
    ]
    advice = NextMeasurement(
        sentence="",
        between=[list(one.names), list(two.names)],
        readings=readings,
        separation_now_sigma=found.now_sigma,
        separation_predicted_sigma=found.predicted_sigma,
    )
    if found.predicted_sigma < SAME_CLASS_SIGMA:
        return advice.model_copy(update={"sentence": words.other_kind(one.names, two.names), "readings": []})
    return advice.model_copy(update={"sentence": words.next_reading(one.names, two.names, advice)})


def _where(best: Coordinate) -> str:
    if best.period_deg is not None:
        return f"with a period of {best.period_deg:.2g} degrees"
    unit = {"x": "m", "y": "m", "plane": "m", "angle": "degrees", "time": "minutes", "wavelength": "nm"}.get(
        best.name, ""
    )
    return f"most near {best.worst_at:.3g} {unit}".rstrip()


def _unexplained(prepared: Prepared, finding: Finding) -> tuple[str | None, str, NextMeasurement]:
    problem, noise = prepared.problem, prepared.noise
    # A misfit without any smoothness was taken for noise: what is noise is then for the quoted errors to say.
    scale = error_scale(prepared, finding)
    plain = Whitener(noise, 0.0, 1.0, 0.0)
    base = problem.fit((), plain, [finding.level.base.u])
    ranked = coordinates(problem, plain, base, scale)
    best = ranked[0] if ranked and ranked[0].explained > _NAMED else None
    z = np.abs(problem.keep * (problem.value - base.prediction) / noise.sigma)
    worst = int(z.argmax())
    lay = problem.layout
    spot = Spot(
        x_m=float(lay.x_m[worst]), y_m=float(lay.y_m[worst]), z_m=float(lay.z_m[worst]),
        medium="air" if lay.air[worst] else "water", repeats=3,
    )  # fmt: skip
    about = f" where the misfit is largest (x = {spot.x_m:.2f}, y = {spot.y_m:.2f}, z = {spot.z_m:.2f} m)"
    if best is not None and best.name == "time":
        sentence = (
            "Repeat one reference position every few minutes: the misfit follows the time, not the place."
        )
    else:
        sentence = (
            f"Repeat readings{about} at another time: what repeats is a structure, what does not is noise."
        )
    advice = NextMeasurement(sentence=sentence, readings=[spot])
    return (best.name if best else None), (_where(best) if best else ""), advice


def verdict_of(
    forward: Any,
    readings: Any,
    prepared: Prepared,
    finding: Finding,
    steps: list[Step],
    untestable: dict[str, str],
    trust: Trust,
    seed: int,
    alpha: float,
    advise: bool,
    lamp: Sequence[Judged] = (),
) -> Verdict:
    """The verdict as plain data.

    Parameters
    ----------
    lamp : sequence of Judged
        What absolute readings say of the lamp's power.
    """
    problem, level, units = prepared.problem, finding.level, units_of(forward.scene)
    best = finding.accepted[0] if finding.accepted else None
    absorbed = {
        s.template.candidate.name: "absorbed by gain, beam width and absorption with these readings"
        for s in finding.levels[0].adequacy.scores
        if not s.testable
    }
    testable = {s.template.candidate.name for s in finding.levels[0].adequacy.scores if s.testable}
    untestable = untestable | {k: v for k, v in absorbed.items() if k not in testable}
    kind: Kind = "none" if finding.size == 0 else "unexplained"
    if best is not None:
        kind = "identified" if finding.identified else "ambiguous"
    rival = None
    advice: NextMeasurement | None = None
    coordinate, where = None, ""
    if best is not None:
        near = nearest_rival(problem, finding.whiten, best, finding.tried, level.phi)
        if near is not None:
            rival = NearestRival(effects=list(near.explanation.names), separation_sigma=near.separation_sigma)
        other = finding.accepted[1] if len(finding.accepted) > 1 else (near.explanation if near else None)
        if kind == "ambiguous" and other is not None and advise:
            advice = _advice(forward, prepared, finding, best, other)
    elif kind == "unexplained" and not finding.withheld:
        coordinate, where, advice = _unexplained(prepared, finding)
    aside = aside_words.entries(readings, trust)
    # A misfit that has a coordinate says more than any doubt.
    doubt = trust.doubt if coordinate is None else None
    if doubt is not None and trust.structure is not None:
        coordinate, advice = trust.structure.coordinate, aside_words.advice(aside)
    tolerance = prepared.noise.budget.tolerance
    within_tolerance = level.tolerance > 0
    within = f" within {100 * tolerance:g} %" if within_tolerance else ""
    if finding.levels[0].adequacy.scale_taken:
        within += " with the errors taken on trust"
    explanations = _explanations(finding, prepared, steps, units, advise)
    limits = _limits(finding, best, units)
    counted = bright(problem)
    sigma = standard_errors(prepared, finding)
    floor = (
        float(100 * np.sqrt(np.mean((sigma[counted] / prepared.noise.prediction[counted]) ** 2)))
        if counted.any()
        else 0.0
    )
    scale = variance_scale(prepared, finding)
    noise = words.at_noise(trust.noise_percent, prepared.errors_stated, scale)
    phi = best.adequacy.phi if best is not None and best.adequacy is not None else level.phi
    own_effects = entries(
        forward.scene,
        # What cannot be trusted contradicts no scene either.
        [] if doubt is not None else [*lamp, *judged(prepared, finding, untestable)],
        (p.path for p in problem.base),
        untestable,
        lambda fit, least: estimates(fit, phi, units, least),
    )

    def say(told: Sequence[Explanation], next_one: NearestRival | None) -> words.Said:
        new = {k: v for k, v in limits.items() if all(k != entry.effect for entry in own_effects)}
        return words.said(kind, told, next_one, new, coordinate, where, within, finding.determined, noise)

    said = stated.said(kind, explanations, rival, own_effects, say)
    if doubt is not None:
        said = words.Said.of(f"Unexplained: {doubt}.")
    waves = int(problem.layout.channel.max()) > 0
    return Verdict(
        verdict=kind,
        **said.then(aside_words.sentence(aside, problem.layout.size, waves)).fields,
        effects=[c.name for c in best.explanation] if best else [],
        explanations=explanations,
        nearest_rival=rival,
        detection_limits=limits,
        untestable=untestable,
        unexplained_coordinate=coordinate,
        doubt=doubt,
        ladder=_rungs(steps, forward, level.phi, units, best),
        noise_floor_percent=floor,
        noise_percent=trust.noise_percent,
        next_measurement=advice,
        stated=own_effects,
        assumed=list(prepared.noise.budget.assumed),
        warnings=[
            *hints(forward, problem, steps[-1].fit, prepared.noise.budget.calibration),
            *exchanged(forward, problem, finding),
            *cautions(readings, prepared, finding, explanations),
        ],
        base_p=finding.levels[0].adequacy.p,
        within_tolerance=within_tolerance,
        variance_scale=scale,
        serial_correlation=prepared.serial.rho,
        outliers=[int(i) for i in np.flatnonzero(trust.aside)],
        saturated=[int(i) for i in np.flatnonzero(np.asarray(readings.saturated))],
        set_aside=aside,
        readings=problem.layout.size,
        seed=seed,
    )


def taken_back(verdict: Verdict, contradiction: str) -> dict[str, Any]:
    """What changes in a verdict that something found later contradicts."""
    named = words.join(verdict.effects) if verdict.effects else "the base model"
    doubt = f"{named} would explain the readings, but {contradiction}"
    waves = len({one.wavelength_nm for one in verdict.set_aside}) > 1
    aside = aside_words.sentence(verdict.set_aside, verdict.readings, waves)
    said = words.Said.of(f"Unexplained: {doubt}.").then(aside)
    return {"verdict": "unexplained", "effects": [], "doubt": doubt, **said.fields}
