"""What a fitted nuisance parameter far from the scene's means: a mistake in the table, more often than not.

Width, absorption and gain are refitted because the scene's are guesses. So they also take up what is not
physics: positions in another unit, air labelled water, values in another unit.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from lightfield.diagnosis.adequacy.amplifying import cost_of_amplifying, lowest_attenuation_per_m
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.search.cascade import SearchResult
from lightfield.diagnosis.verdict.cautions.caution import Caution, Warns
from lightfield.diagnosis.verdict.ladder import bright
from lightfield.fitting.curves import field_of
from lightfield.fitting.diffuse_light import has_diffuse_light
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.gains import LAMP_POWER
from lightfield.fitting.least_squares import Fit
from lightfield.fitting.light_source import beyond_table
from lightfield.fitting.parameter import GAIN
from lightfield.formula.closed_form import table_angle
from lightfield.readings import Readings
from lightfield.readings.unchecked import bands_of
from lightfield.scene import Scene
from lightfield.scene.acts import Acts
from lightfield.scene.all_parameters import acts_on
from lightfield.scene.bands import over_bands, read_nm
from lightfield.scene.lamp.frame import has_round_section
from lightfield.scene.lamp.profile import table_of
from lightfield.scene.lamp.spectrum import axial_intensity
from lightfield.scene.lamp.width import lobe_width_deg
from lightfield.scene.water.coefficients import absorption_per_m

#: Factors from which on a fitted value is spoken of. Measured: guesses of the width were off by up to 18 %,
#: those of the absorption by up to 35 %, where the model was right (52 rendered sets); mistakes are larger:
#: radius for diameter or half for full width 2, decadic for natural logarithms 2.3, feet for metres 3.3.
_WIDTH_FACTOR, _ABSORPTION_FACTOR = 1.5, 2.0
#: Absorption, and that of one wavelength.
_ABSORPTION, _AT_A_WAVELENGTH = "water.absorption", "water.absorption_at."
#: An absorption that takes less of the light than this optical depth is not spoken of. Chosen: a tenth.
_FELT = 0.1
#: Of its own errors an absorption lies so many from the scene's. Chosen: two are chance.
_SURE = 3.0
#: Errors of the calibration beyond which a gain is spoken of. Chosen: one right calibration of 370 is.
_GAIN_SIGMA = 3.0
#: Factors that are spoken of as an irradiance collector's. Chosen: about water's index of refraction; each
#: design has one of its own.
_IMMERSED = (1.1, 1.6)
#: Chi-square from which on water that amplifies is spoken of. Chosen: two standard errors.
_AMPLIFIES = 4.0
#: By how much two smooth beams through a coarse table differ, in bright readings, from which on it is spoken
#: of. Chosen: twice the least error that a lamp's table is measured with.
_COARSE = 0.01
#: Exchanged columns leave this part of the misfit at most. Chosen: in chi-square, half of every reading's.
_EXCHANGED = 0.25


def hints(
    forward: SceneForward,
    problem: Problem,
    fit: Fit,
    calibration: float | None = None,
    nearly_fits: bool = True,
) -> list[Caution]:
    """Cautions about fitted values that no guess is so far off.

    Parameters
    ----------
    fit : Fit
        Of the best model.
    calibration : float, optional
        Relative standard error of the calibration; None on a relative scale.
    nearly_fits : bool
        Of a model that misses the readings by far, width and absorption stand in for what it lacks, and say
        nothing of the table.
    """
    scene, values = forward.scene, fit.values
    gain = _gain(scene, values, calibration)
    found = [
        _width(forward, forward.scenes.at(values, validate=False)) if nearly_fits else None,
        _absorption(forward, problem, fit) if nearly_fits else None,
        gain, _immersed(forward, gain), _of_band(forward, gain, calibration), _amplifying(fit),
        _coarse_table(forward, problem), _beyond_table(scene, forward.readings),
    ]  # fmt: skip
    if has_diffuse_light(scene) and forward.light.diffuse.trace is None:
        found.append(Caution(warns=Warns.LEFT_OUT))
    return [caution for caution in found if caution is not None]


def exchanged(forward: SceneForward, problem: Problem, finding: SearchResult) -> list[Caution]:
    """A caution where the scene, which x and y are not alike for, meets the readings with the two exchanged.

    Of direct light only: for scattered and reflected light another trace would be needed.
    """
    scene, readings = forward.scene, forward.readings
    lamp, turned = scene.lamp, scene.detector.tilt_x_deg != 0
    centred = lamp.offset_x_m == lamp.offset_y_m and lamp.tilt_x_deg == lamp.tilt_y_deg
    alike = centred and has_round_section(lamp)
    if finding.size == 0 or (alike and not turned) or has_diffuse_light(scene):
        return []
    other = SceneForward(scene, replace(readings, x_m=readings.y_m, y_m=readings.x_m))
    base, whiten = finding.level.base, finding.level.bench.whiten
    swapped = replace(problem, forward=other).fit((), whiten, [base.u, problem.model().start])
    if swapped.chi2 > _EXCHANGED * base.chi2:
        return []
    both = {"exchanged": swapped.chi2 / finding.n, "as_given": base.chi2 / finding.n}
    return [Caution(warns=Warns.EXCHANGED, values=both)]


def _width(forward: SceneForward, fitted: Scene) -> Caution | None:
    width, guess = (_seen_width_deg(scene, forward.readings) for scene in (fitted, forward.scene))
    ratio = width / guess
    if 1 / _WIDTH_FACTOR < ratio < _WIDTH_FACTOR:
        return None
    told = {"ratio": ratio, "fitted": width, "stated": guess}
    return Caution(warns=Warns.WIDTH, about="lamp.hwhm_deg", values=told)


def _seen_width_deg(scene: Scene, r: Readings) -> float:
    """Half width of the beam as a receiver that faces the lamp sees it, by its acceptance too, degrees."""
    width = lobe_width_deg(scene.lamp, table_angle(scene.lamp, r.x_m, r.y_m, r.z_m, r.medium))
    acceptance = scene.detector.acceptance_hwhm_deg
    return float(1 / np.hypot(1 / width, 1 / acceptance)) if acceptance else width


def _absorption(forward: SceneForward, problem: Problem, fit: Fit) -> Caution | None:
    layout, wet, values = problem.layout, ~problem.layout.air, fit.values
    if not wet.any() or not any(path.startswith("water.absorption") for path in values):
        return None
    # What is found to be in the water, and has a colour, is no other coefficient.
    told = {p: v for p, v in values.items() if p.startswith(_ABSORPTION) or not _has_colour(p)}
    band = np.mean(forward.scene.detector.bands_nm[0])
    at = np.where(np.isnan(layout.wavelength_nm), band, layout.wavelength_nm)[wet]
    stated = absorption_per_m(forward.scene.water, at)
    if np.ptp(stated) == 0 and any(path.startswith(_AT_A_WAVELENGTH) for path in values):
        return None  # one number for all colours is no statement about each
    guess = float(np.mean(stated))
    fitted = float(np.mean(absorption_per_m(forward.scenes.at(told, validate=False).water, at)))
    felt = abs(fitted - guess) * float(np.ptp(layout.z_m[wet]))
    if guess <= 0 or felt < _FELT or 1 / _ABSORPTION_FACTOR < fitted / guess < _ABSORPTION_FACTOR:
        return None
    error = fit.stderr().get("water.absorption_per_m", np.nan)
    if abs(fitted - guess) < _SURE * error:
        return None
    said = {"ratio": fitted / guess, "fitted": fitted, "stated": guess}
    warns = Warns.LESS_ABSORPTION if fitted < guess else Warns.MORE_ABSORPTION
    return Caution(warns=warns, about="water.absorption_per_m", values=said)


def _has_colour(path: str) -> bool:
    return bool(acts_on(field_of(path)) & Acts.COLOUR)


def _amplifying(fit: Fit) -> Caution | None:
    if cost_of_amplifying(fit) < _AMPLIFIES:
        return None
    return Caution(
        warns=Warns.AMPLIFIES, about="water", values={"least_per_m": lowest_attenuation_per_m(fit)}
    )


def _beyond_table(scene: Scene, readings: Readings) -> Caution | None:
    beyond = beyond_table(scene, readings)
    if not beyond.any():
        return None
    r = readings.subset(beyond)
    at = np.degrees(table_angle(scene.lamp, r.x_m, r.y_m, r.z_m, r.medium))
    told = {"beyond": float(beyond.sum()), "readings": float(len(readings)), "from_deg": float(at.min())}
    return Caution(warns=Warns.BEYOND_TABLE, about="lamp.intensity_table", values=told)


def _coarse_table(forward: SceneForward, problem: Problem) -> Caution | None:
    table, r = table_of(forward.scene.lamp), forward.readings
    if table is None:
        return None
    angle = table_angle(forward.scene.lamp, r.x_m, r.y_m, r.z_m, r.medium)
    untold, stated = np.abs(table.untold(angle)) * bright(problem), np.degrees(table.stated_rad)
    k = int(np.argmax(untold))
    if untold[k] < _COARSE:
        return None
    step = np.diff(stated)[np.clip(np.searchsorted(table.stated_rad, angle[k]) - 1, 0, len(stated) - 2)]
    told = {"step_deg": float(step), "percent": 100 * float(untold[k])}
    return Caution(warns=Warns.COARSE_TABLE, about="lamp.intensity_table", values=told)


def _gain(scene: Scene, values: Mapping[str, float], calibration: float | None) -> Caution | None:
    power = float(scene.lamp.power_w)
    ratio = values.get(GAIN, 1.0) * values.get(LAMP_POWER, power) / power
    if calibration is None or abs(np.log(ratio)) < _GAIN_SIGMA * calibration:
        return None
    told = {"ratio": ratio, "power_w": power, "calibration_percent": 100 * calibration}
    return Caution(warns=Warns.GAIN, about=LAMP_POWER, values=told)


def _immersed(forward: SceneForward, gain: Caution | None) -> Caution | None:
    """Are the readings too dark by what a collector for air loses in water?"""
    if gain is None or forward.scene.detector.immersion_factor != 1.0:
        return None
    factor = 1 / float(gain.values["ratio"])
    wet = (np.asarray(forward.readings.medium) == "water").all()
    if not (wet and forward.scene.detector.quantity != "radiance" and _IMMERSED[0] < factor < _IMMERSED[1]):
        return None
    return Caution(warns=Warns.IMMERSED, about="detector.immersion_factor", values={"factor": factor})


def _of_band(forward: SceneForward, gain: Caution | None, calibration: float | None) -> Caution | None:
    """Is the lamp so much too bright or too dark because means over the band were given a wavelength?"""
    scene, readings = forward.scene, forward.readings
    if gain is None or calibration is None or readings.of_band or len(scene.detector.bands_nm) > 1:
        return None
    wavelength = np.asarray(readings.wavelength_nm, float)
    if any(bands_of(readings, np.unique(wavelength))):
        return None
    mean = over_bands(scene).intensity.mean()
    at = axial_intensity(scene.lamp, read_nm(scene, wavelength)).mean()
    if at <= 0 or abs(np.log(gain.values["ratio"] * at / mean)) > _GAIN_SIGMA * calibration:
        return None
    return Caution(warns=Warns.OF_BAND, about="wavelength_nm", values={"ratio": float(mean / at)})
