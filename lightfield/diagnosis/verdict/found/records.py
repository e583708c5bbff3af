"""Every effect of the best set as data: its level, its size, what stands against it, and what water and beam
would be without it."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite

from lightfield.diagnosis.search.cascade import Finding
from lightfield.diagnosis.search.pool.evidence import Evidence
from lightfield.diagnosis.verdict.parts import Estimate, FoundEffect, WaterAndBeam
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.least_squares import Fit
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m


def found_effects(
    forward: SceneForward, finding: Finding, values: Mapping[str, Estimate]
) -> list[FoundEffect]:
    """One record for every effect of the best set, largest first; none where no answer can rest on the
    readings.

    Parameters
    ----------
    values : mapping
        Parameters of the best set by path.
    """
    many, closest = finding.many, finding.closest
    if many is None or closest is None or finding.withheld:
        return []
    there = {c.key for c in closest.explanation}
    records = [
        _record(forward, one, closest.fit, values, finding.identified)
        for one in many.evidence
        if one.candidate.key in there
    ]
    return sorted(records, key=lambda r: -(r.sigma_to_remove or 0.0))


def _record(
    forward: SceneForward, one: Evidence, fit: Fit, values: Mapping[str, Estimate], identified: bool
) -> FoundEffect:
    candidate = one.candidate
    # Where one or two effects were sought, all sets of them were: what they identify is no slot.
    level = "simplest" if identified and one.level == "one of" else one.level
    return FoundEffect(
        effect=candidate.name,
        family=candidate.effect.family,
        form=candidate.form.name,
        level=level,
        parameters={p.path: values[p.path] for p in candidate.parameters if p.path in values},
        sigma_to_remove=_finite(one.sigma_to_remove),
        gap=_finite(one.gap),
        gap_named=_finite(one.gap_named),
        gap_plus=_finite(one.gap_plus),
        rival=sorted(one.rival.names) if one.rival is not None else [],
        alternatives=[list(names) for names in one.alternatives],
        weight=one.weight,
        with_it=_water_and_beam(forward, fit),
        without_it=None if one.without is None else _water_and_beam(forward, one.without.fit),
    )


def _finite(number: float) -> float | None:
    return number if isfinite(number) else None


def _water_and_beam(forward: SceneForward, fit: Fit) -> WaterAndBeam:
    """At the wavelength of the first channel."""
    scene, wavelength = forward.scene_at(fit.values, validate=False), forward.light.wavelengths_nm[:1]
    a, b = (float(of(scene.water, wavelength)[0]) for of in (absorption_per_m, scattering_per_m))
    return WaterAndBeam(
        absorption_per_m=a, scattering_per_m=b, attenuation_per_m=a + b, hwhm_deg=scene.lamp.hwhm_deg
    )
