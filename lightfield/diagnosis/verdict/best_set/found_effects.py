"""Every effect of the best set as data: its level, its size, what stands against it, and what water and beam
would be without it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lightfield.arrays import finite
from lightfield.diagnosis.certainty import Certainty
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.search.cascade import SearchResult
from lightfield.diagnosis.search.pool.evidence import Evidence
from lightfield.diagnosis.verdict.calibration import EFFECT as POWER
from lightfield.diagnosis.verdict.ladder import adds
from lightfield.diagnosis.verdict.parts import Estimate, FoundEffect, Reason, WaterAndBeam
from lightfield.fitting.curves import field_of
from lightfield.fitting.fitted_curves import changed_rms
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.least_squares import Fit
from lightfield.formula.closed_form import table_angle
from lightfield.scene import Scene
from lightfield.scene.lamp.section import oval_widths
from lightfield.scene.lamp.width import lobe_width_deg
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m

#: By so much a value without an error is moved, to see whether K moves with it, and part of K that is
#: rounding. Chosen: any step does.
_STEP, _ROUNDING = 1e-3, 1e-9


def found_effects(
    forward: SceneForward, finding: SearchResult, values: Mapping[str, Estimate]
) -> list[FoundEffect]:
    """One record for every effect of the best set, largest first; none where no answer can rest on the
    readings.

    Parameters
    ----------
    values : mapping
        Parameters of the best set by path.
    """
    closest = finding.closest
    if closest is None or finding.withheld:
        return []
    light = _water_and_beam(forward, closest.fit)
    stderr = _stderr_of_attenuation(forward, closest.fit, values, light)
    light = light.model_copy(update={"attenuation_stderr_per_m": stderr})
    known = {e.candidate.key: e for e in (finding.many.evidence if finding.many else ())}
    records = [
        _record(forward, c, known.get(c.key), values, finding, light)
        for c in closest.explanation
        if c.name not in finding.unknown
    ]
    return sorted(records, key=lambda r: -(r.sigma_to_remove or 0.0))


def _record(
    forward: SceneForward,
    candidate: Candidate,
    one: Evidence | None,
    values: Mapping[str, Estimate],
    finding: SearchResult,
    light: WaterAndBeam,
) -> FoundEffect:
    assert finding.closest is not None
    known = FoundEffect(
        effect=candidate.name,
        family=candidate.effect.family,
        form=candidate.form.name,
        # What was not sought by its shape, the lamp's power, rests on the calibration alone.
        level=Certainty.SIMPLEST if finding.identified or candidate.name == POWER else Certainty.ONE_OF,
        parameters={p.path: values[p.path] for p in candidate.parameters if p.path in values},
        rms_percent=_rms_percent(forward, candidate, finding.closest.fit),
        hardly_tested=candidate.is_hardly_tested,
        of_scene=not adds(candidate),
        with_it=light,
    )
    if one is None:
        return known
    # Where one or two effects were sought, all sets of them were: what they identify is no slot.
    level = Certainty.SIMPLEST if finding.identified and one.level == Certainty.ONE_OF else one.level
    return known.model_copy(
        update={
            "level": level,
            "sigma_to_remove": finite(one.sigma_to_remove),
            "gap": finite(one.gap),
            "gap_named": finite(one.gap_named),
            "gap_plus": finite(one.gap_plus),
            "rival": sorted(one.rival.names) if one.rival is not None else [],
            "alternatives": [list(names) for names in one.alternatives],
            "beyond": list(one.beyond),
            "other_lamp": one.other_lamp and candidate.effect.of_direction,
            "lamp_detail": one.other_lamp and not candidate.effect.of_direction,
            "weight": one.weight,
            "without_it": None if one.without is None else _water_and_beam(forward, one.without.fit),
        }
    )


def _rms_percent(forward: SceneForward, candidate: Candidate, fit: Fit) -> float | None:
    """What a curve changes in the readings."""
    if not candidate.effect.is_free_form:
        return None
    return 100 * changed_rms(forward, fit.values, field_of(candidate.amplitudes[0].path))


def _water_and_beam(forward: SceneForward, fit: Fit) -> WaterAndBeam:
    """At the wavelength of the first channel, which is the shortest."""
    scene = forward.scenes.at(fit.values, validate=False)
    wavelength = float(forward.light.diffuse.wavelengths_nm[0])
    a, b = _coefficients(scene, wavelength)
    lamp, r = scene.lamp, forward.readings
    width_deg = lobe_width_deg(lamp, table_angle(lamp, r.x_m, r.y_m, r.z_m, r.medium))
    narrow, wide = oval_widths(lamp)
    return WaterAndBeam(
        wavelength_nm=wavelength, absorption_per_m=a, scattering_per_m=b, attenuation_per_m=a + b,
        hwhm_deg=width_deg,
        oval_hwhm_deg=(narrow * width_deg, wide * width_deg) if narrow < wide else None,
    )  # fmt: skip


def _coefficients(scene: Scene, wavelength_nm: float) -> tuple[float, float]:
    """Absorption and scattering, 1/m."""
    there = np.array([wavelength_nm])
    return float(absorption_per_m(scene.water, there)[0]), float(scattering_per_m(scene.water, there)[0])


def _stderr_of_attenuation(
    forward: SceneForward, fit: Fit, values: Mapping[str, Estimate], light: WaterAndBeam
) -> float | None:
    """Standard error of K, 1/m, where one value of the best set alone moves it; None where that has none.

    What several values do to it together their errors do not tell: a and b make up for each other.
    """
    moved: list[float | None] = []
    for path in fit.paths:
        if values[path].reason is Reason.HELD:
            continue
        stderr = values[path].stderr
        there = fit.values | {path: fit.values[path] + (stderr or _STEP)}
        a, b = _coefficients(forward.scenes.at(there, validate=False), light.wavelength_nm)
        change = abs(a + b - light.attenuation_per_m)
        if change > _ROUNDING * light.attenuation_per_m:
            moved.append(change if stderr else None)
    return moved[0] if len(moved) == 1 else None
