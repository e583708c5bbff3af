"""From a scene and a reading table to the problem of a diagnosis."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from lightfield.arrays import TINY, Array
from lightfield.diagnosis.problem.assumed import Assumed, Term
from lightfield.diagnosis.problem.candidates import Setting, candidates
from lightfield.diagnosis.problem.layout import BRIGHT, LEAST_RANGE, Layout, layout_of
from lightfield.diagnosis.problem.noise import Budget
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.problem.quoted import ASSUMED_FLOOR, ASSUMED_RELATIVE, errors_stated
from lightfield.diagnosis.problem.repeats import plane_gain_error, repeats_of
from lightfield.diagnosis.problem.untestable import Hinders, Hindrance
from lightfield.errors import FitError
from lightfield.fitting.beam_width import beam_width_deg
from lightfield.fitting.diffuse_light import DiffuseSource, has_diffuse_light
from lightfield.fitting.effects import Effect
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.parameter import FitParameter
from lightfield.fitting.reader import READOUT
from lightfield.formula.readout import ambient
from lightfield.readings import Readings
from lightfield.readings.columns import PLACE_DECIMALS, WAVELENGTH_DECIMALS
from lightfield.readings.load_warning import Remarks
from lightfield.render.diffuse.source import cells_for, response_for
from lightfield.scene import Scene
from lightfield.scene.acts import Acts
from lightfield.scene.all_parameters import only
from lightfield.scene.listed import AT
from lightfield.scene.water.coefficients import absorption_per_m, clearest_in

#: Assumed when the table does not say, in per cent and mm. Chosen: what a tow tank's stage and lamp repeat
#: to, and what nobody asks of a formula; the verdict lists what was assumed.
PLANE_GAIN_PERCENT, _POSITION_MM, _TOLERANCE_PERCENT, OUTLIER_PERCENT = 0.3, 0.0, 0.3, 2.0
#: Chosen: a radiometer calibrated by a standard lamp is good to a few per cent in the laboratory and to 5 to
#: 10 % in water (Mueller et al. 2003, Ocean optics protocols, rev. 4, vol. II); so are most stated lamp
#: powers.
_CALIBRATION_PERCENT = 10.0
#: The gain of absolute readings is looked for within so many errors of the calibration. Derived: the normal
#: law; one of 370 lies beyond.
_GAIN_SIGMAS = 3.0
#: On a relative scale a gain is looked for within this exponent of the first guess. Chosen: a factor of
#: 160,000.
GAIN_ROOM = 12.0
#: Half widths are looked for within this factor of the guess. Chosen: beyond any mistake (`plausibility`).
_WIDTH_FACTOR = 5.0
#: Guesses are kept unless the width is off by this factor, or the light by this exponent. Chosen: a start
#: alone.
_WIDTH_GUESS, _ABSORPTION_GUESS = 2.0, 1.5
#: Half widths are looked for up to this, in degrees. Chosen: nearly a hemisphere.
_WIDEST_DEG = 80.0
#: Absorption is looked for up to so much above the guess, in 1/m. Chosen: light is lost within a metre.
_ABSORPTION_ROOM_PER_M = 3.0
#: Steps of finite differences: of absorption in 1/m and of the logarithm of a width, and of that of a gain,
#: which is exact. Chosen: half of the digits are rounding.
_STEP, _GAIN_STEP = 1e-4, 1e-5
#: Part of the largest reading that a place of most light reads at least: a gain is positive. Chosen.
_LEAST_READING = 1e-3
#: The gain is guessed where there is most light: a tenth of the places, so many at least. Chosen: a start
#: alone.
_FEWEST_BRIGHTEST = 3
#: Wavelengths in nm, closer than this, are one. Derived: as those of a table are.
_SAME_NM = 10.0**-WAVELENGTH_DECIMALS
#: Light below this part of the most is none. Chosen: no instrument sees it.
_NO_LIGHT = 1e-60
#: A fit needs so many readings more than it has parameters. Derived: any curve meets as many.
_FEWEST_TO_SPARE = 1
#: Time and memory of a diagnosis grow with the readings, and with the readings times the distances at each of
#: which the model may be wrong in its own way. Chosen: time and memory alone.
_MOST_READINGS, _MOST_AT_DISTANCES = 20_000, 2_000_000
#: Memory of traced light grows with the cells that are tallied for the places it is wanted at (0.6 to 0.9 GB
#: for so many, benchmarks/diagnosis_size); a place by itself takes up to nine.
_MOST_CELLS, _CELLS_ALONE = 3000, 9
#: Where the scene's own light is scattered and reflected, five classes of it are evaluated, each with errors
#: of its own, for every explanation that is tried: so many readings take a minute and, with their trace, 2 GB
#: (benchmarks/diagnosis_size).
_MOST_MURKY = 4000


def budget_of(readings: Readings) -> Budget:
    """The stated error budget; what is missing is estimated from repeats or assumed, and named."""
    stated = readings.budget
    assumed: list[Assumed] = []
    gain, position, tolerance = stated.plane_gain_percent, stated.position_mm, stated.tolerance_percent
    repeats = repeats_of(readings) if gain is None else None
    if repeats is not None:
        gain = 100 * plane_gain_error(repeats, PLANE_GAIN_PERCENT / 100)
        assumed.append(Assumed(Term.PLANE_GAIN, gain, repeats.visits, repeats.reference))
    elif gain is None:
        assumed.append(Assumed(Term.PLANE_GAIN, PLANE_GAIN_PERCENT))
    if position is None:
        assumed.append(Assumed(Term.POSITION, _POSITION_MM))
    if tolerance is None:
        assumed.append(Assumed(Term.TOLERANCE, _TOLERANCE_PERCENT))
    slips = stated.outlier_percent
    if slips is None:
        slips = OUTLIER_PERCENT
        assumed.append(Assumed(Term.OUTLIERS, slips))
    calibration = calibration_of(readings)
    if calibration is not None and stated.calibration_percent is None:
        assumed.append(Assumed(Term.CALIBRATION, _CALIBRATION_PERCENT))
    if not errors_stated(np.asarray(readings.stderr, float)) or not errors_believed(readings):
        assumed.append(Assumed(Term.STDERR, 100 * ASSUMED_RELATIVE, floor_percent=100 * ASSUMED_FLOOR))
    return Budget(
        (PLANE_GAIN_PERCENT if gain is None else gain) / 100,
        (_POSITION_MM if position is None else position) / 1000,
        (_TOLERANCE_PERCENT if tolerance is None else tolerance) / 100,
        gain is not None,
        tuple(assumed),
        slips / 100,
        calibration,
    )


def errors_believed(readings: Readings) -> bool:
    """Could the standard errors of a table, where it has some, be those of an instrument?"""
    return all(one.code is not Remarks.TINY_ERRORS for one in readings.warnings)


def with_usual_errors(readings: Readings) -> Readings:
    """The same; errors that are not believed are those that are assumed where a table has none.

    Beside errors that are thousands of times too small every grain of noise asks for an effect, and a search
    finds no end. Assumed ones serve readings without noise as well.
    """
    if errors_believed(readings):
        return readings
    size = np.abs(readings.value)
    floor = ASSUMED_FLOOR * size[~readings.saturated].max(initial=0.0)
    return replace(readings, stderr=np.hypot(ASSUMED_RELATIVE * size, floor))


def calibration_of(readings: Readings) -> float | None:
    """Relative standard error of an absolute calibration, stated or assumed; None on a relative scale."""
    if readings.scale != "absolute":
        return None
    stated = readings.budget.calibration_percent
    return (_CALIBRATION_PERCENT if stated is None else float(stated)) / 100


def base_parameters(forward: SceneForward, layout: Layout, value: Array) -> tuple[FitParameter, ...]:
    """Nuisance parameters: gain per channel, half width of the beam, absorption (see `spectral`).

    On an absolute scale the gain is 1 within the error of the calibration, which is its range; its start is
    what the readings show at once, be it in that range or not.

    The scene's values are guesses. Where they are far from what the readings show at once, the fit starts
    from that: in the flank of a wrong beam, or behind a wall of absorption, it would not find its way.

    Parameters
    ----------
    value : array, shape (n,)
    """
    scene, names = forward.scene, forward.gains.names
    # A gain is found from the light: a background would hide it.
    known = scene.parameters()
    start = {path: known[path].neutral or 0.0 for path in READOUT if path in known}
    light = value - ambient(scene, forward.readings.time_s, forward.readings.wavelength_nm)
    free = []
    if layout.angle_rad.max() > LEAST_RANGE and scene.lamp.profile not in ("isotropic", "pencil", "table"):
        hwhm, seen = scene.lamp.hwhm_deg, forward.light.diffuse.width_deg
        begin = hwhm if 1 / _WIDTH_GUESS < hwhm / seen < _WIDTH_GUESS else seen
        low, high = min(hwhm, begin) / _WIDTH_FACTOR, min(max(hwhm, begin) * _WIDTH_FACTOR, _WIDEST_DEG)
        begin = start["lamp.hwhm_deg"] = min(begin, high)
        free.append(FitParameter("lamp.hwhm_deg", np.log(low), np.log(high), np.log(begin), _STEP, "log"))
    if scene.water.absorption_at and scene.water.base == "none":
        free += _spectrum(scene, layout, len(names) == 1)
    elif layout.varies("z_m") and not layout.air.all():
        now, clearest = scene.water.absorption_per_m, -_least_absorption(scene, layout)
        more = _decay_per_m(layout, light) - _decay_per_m(layout, forward.predict(start))
        if abs(more) * float(np.ptp(layout.z_m[~layout.air])) > _ABSORPTION_GUESS:
            start["water.absorption_per_m"] = begin = max(now + more, clearest)
        else:
            begin = now
        low, high = min(clearest, now), max(now, begin) + _ABSORPTION_ROOM_PER_M
        free.append(FitParameter("water.absorption_per_m", low, high, begin, _STEP))
    unit = forward.predict(start)
    least = _LEAST_READING * float(np.abs(value).max())
    gains = []
    for k, name in enumerate(names):
        mine = np.flatnonzero(layout.channel == k) if len(names) > 1 else np.arange(layout.size)
        brightest = mine[np.argsort(unit[mine])[-max(_FEWEST_BRIGHTEST, len(mine) // 10) :]]
        gain = float(np.median(np.maximum(light[brightest], least) / np.maximum(unit[brightest], TINY)))
        if not np.isfinite(gain) or gain <= 0:
            gain = 1.0
        begin, room = float(np.log(gain)), _GAIN_SIGMAS * (calibration_of(forward.readings) or 0.0)
        low, high = (-room, room) if forward.gains.is_absolute else (begin - GAIN_ROOM, begin + GAIN_ROOM)
        gains.append(FitParameter(name, low, high, begin, _GAIN_STEP, "log"))
    return (*gains, *free)


def _decay_per_m(layout: Layout, light: Array) -> float:
    """By how much the logarithm of light times r^2 falls with the distance in water, roughly; 0 if unknown.

    From the brightest place of every distance and channel.
    """
    wet = np.flatnonzero(~layout.air)
    squared = layout.x_m**2 + layout.y_m**2 + layout.z_m**2
    above, below = 0.0, 0.0
    for k in np.unique(layout.channel[wet]):
        mine = wet[layout.channel[wet] == k]
        top = [here[light[here].argmax()] for p in np.unique(layout.plane[mine])
               if (here := mine[layout.plane[mine] == p]).size]  # fmt: skip
        lit = np.array([i for i in top if light[i] > 0], int)
        z = layout.z_m[lit] - layout.z_m[lit].mean() if len(lit) > 1 else np.zeros(len(lit))
        above -= float(z @ np.log(light[lit] * squared[lit]))
        below += float(z @ z)
    return above / below if below > 0 else 0.0


def _spectrum(scene: Scene, layout: Layout, one_gain: bool) -> list[FitParameter]:
    """Absorption at each wavelength, where the readings tell it from the gain."""
    out = []
    for wavelength, now in scene.water.absorption_at:
        z = layout.z_m[~layout.air & (np.abs(layout.wavelength_nm - wavelength) < _SAME_NM)]
        if len(z) and (np.ptp(z) > LEAST_RANGE or (one_gain and layout.varies("z_m"))):
            out.append(FitParameter(f"{AT}{wavelength:g}nm", 0.0, now + _ABSORPTION_ROOM_PER_M, now, _STEP))
    return out


def spectral(scene: Scene, readings: Readings) -> Scene:
    """The scene with an absorption of its own at each wavelength of the readings, if its water is unknown.

    Water is never grey over the visible: one absorption for all wavelengths would make its colour an effect.
    """
    wet = np.asarray(readings.medium) != "air"
    wavelengths = np.unique(np.round(np.asarray(readings.wavelength_nm, float)[wet], WAVELENGTH_DECIMALS))
    if scene.water.base != "none" or len(wavelengths) < 2:
        return scene
    given = scene.water.absorption_at or ((float(wavelengths[0]), 0.0),)
    known, there = np.array(given).T
    now = scene.water.absorption_per_m + np.interp(wavelengths, known, there)
    points = tuple(zip(wavelengths.tolist(), now.tolist(), strict=True))
    return scene.with_values({"water.absorption_per_m": 0.0, "water.absorption_at": points})


def _least_absorption(scene: Scene, layout: Layout) -> float:
    """Least absorption of the base water alone, in 1/m: how much clearer than its base water can be."""
    base, known = only(scene, Acts.BASE).water, np.unique(layout.wavelength_nm)
    least = clearest_in(base, scene.detector.bands_read_nm)[1]
    return min([least, *absorption_per_m(base, known[np.isfinite(known)]).tolist()])


def problem_of(
    forward: SceneForward, readings: Readings, effects: Iterable[Effect], without_diffuse: Hindrance | None
) -> tuple[Problem, dict[str, tuple[Hindrance, ...]]]:
    """The problem, and the effects that cannot be tested with reasons.

    Parameters
    ----------
    without_diffuse : Hindrance, optional
        Why scattered and reflected light cannot be predicted.

    Raises
    ------
    FitError
        Too few readings for the base model, too many for one diagnosis, or none but zeros.
    """
    layout, value = layout_of(readings), np.asarray(readings.value, float)
    _check_size(layout, readings.source)
    keep = np.where(np.asarray(readings.saturated), 0.0, 1.0)
    base = base_parameters(forward, layout, value)
    if keep.sum() < len(base) + _FEWEST_TO_SPARE:
        raise FitError(
            "too few readings to fit even the base model",
            where=readings.source or None,
            found=f"{int(keep.sum())} usable readings",
            rule=f"more than its {len(base)} parameters ({', '.join(p.path for p in base)})",
            remedy="add readings",
        )
    _check_reach(forward, readings, value, keep, base)
    low, high = forward.scene.detector.bands_nm[0]
    signal = float(np.max(np.abs(value[keep > 0])))
    if signal == 0:
        raise FitError(
            "there is no light in these readings",
            where=readings.source or None,
            found="every usable reading is 0",
            rule="at least one reading differs from 0",
            remedy="check the column value",
        )
    curves = forward.scenes.curves
    known = curves.parameters
    told = {field: basis.told for field, basis in curves.bases.items()}
    setting = Setting(
        forward.scene, layout, signal, float(high - low), forward.gains.is_absolute, known, told
    )
    found, untestable = candidates(setting, effects, [p.path for p in base], without_diffuse)
    named = tuple(c for c in found if not c.effect.is_free_form)
    free_form = tuple(c for c in found if c.effect.is_free_form)
    return Problem(forward, layout, value, keep, base, named, free_form), untestable


def _check_size(layout: Layout, source: str) -> None:
    """Refuse what would take hours or all memory."""
    distances = len(np.unique(layout.plane_and_channel))
    if layout.size > _MOST_READINGS or layout.size * distances > _MOST_AT_DISTANCES:
        raise FitError(
            "too many readings for one diagnosis",
            where=source or None,
            found=f"{layout.size} readings at {distances} distances (apart for each medium and wavelength)",
            rule=f"at most {_MOST_READINGS} readings, and {_MOST_AT_DISTANCES} in the product of the two",
            remedy="diagnose every tenth reading, say, average what was read at one place, or round z_m",
        )


def _check_reach(
    forward: SceneForward, readings: Readings, value: Array, keep: Array, base: tuple[FitParameter, ...]
) -> None:
    """Refuse bright readings at places where the lamp's light is less than any number: no fit leads there."""
    light = forward.predict({p.path: p.value(p.start) for p in base})
    bright = (keep > 0) & (value > BRIGHT * value[keep > 0].max())
    beyond = np.flatnonzero(bright & ~(light > _NO_LIGHT * light.max()))
    if len(beyond):
        x, y, z = (float(getattr(readings, k)[beyond[0]]) for k in ("x_m", "y_m", "z_m"))
        tube = readings.quantity == "radiance"
        seen = ", and a lamp within the detector.full_angle_deg of a collimator aimed as the scene says"
        raise FitError(
            "the lamp's light does not reach readings that are bright",
            where=readings.source or None,
            found=f"{len(beyond)} of them, the first at x = {x:g}, y = {y:g}, z = {z:g} m",
            rule="a beam of about the scene's lamp.hwhm_deg along z, positions in metres" + seen * tube,
            remedy="give the positions in metres (not centimetres or inches), or correct the scene's lamp"
            + " or collimator" * tube,
        )


def source_of(
    scene: Scene, diffuse: DiffuseSource | str | None, readings: Readings
) -> tuple[DiffuseSource | None, Hindrance | None]:
    """What gives scattered and reflected light, or why nothing does.

    Parameters
    ----------
    diffuse : "trace", None or callable
        As `lightfield.diagnosis.diagnose.diagnose` takes it.
    readings : Readings
        Where light would be traced in too many cells, it is done without if the scene has none.

    Raises
    ------
    FitError
        Light of the scene itself would have to be traced in too many cells.
    """
    if diffuse is None:
        return None, Hindrance(Hinders.NOT_TRACED)
    if scene.water.scattering_per_m > 0 and scene.reflects and len(readings) > _MOST_MURKY:
        raise FitError(
            "too many readings where the scene both scatters and reflects",
            where=readings.source or None,
            found=f"{len(readings)} readings",
            rule=f"at most {_MOST_MURKY}",
            remedy="diagnose every third reading, say, or average what was read at neighbouring places",
        )
    if scene.lamp.profile in ("isotropic", "pencil") and not has_diffuse_light(scene):
        return None, Hindrance(Hinders.LAMP, profile=scene.lamp.profile)
    if (cells := _cells(scene, readings)) > _MOST_CELLS:
        if has_diffuse_light(scene):
            raise FitError(
                "the scene's scattered and reflected light is wanted at too many places",
                where=readings.source or None,
                found=f"{cells} cells to trace it in, around {len(readings)} readings",
                rule=f"at most {_MOST_CELLS}",
                remedy="diagnose a part of the readings, or round z_m: every distance has cells of its own",
            )
        return None, Hindrance(Hinders.MANY_CELLS, cells=cells, most=_MOST_CELLS)
    if callable(diffuse):
        return diffuse, None
    return response_for, None


def _cells(scene: Scene, readings: Readings) -> int:
    """Cells that light would be traced in; 0 where they cannot be too many."""
    places = np.stack([readings.x_m, readings.y_m, readings.z_m], axis=1)
    if _CELLS_ALONE * len(np.unique(np.round(places, PLACE_DECIMALS), axis=0)) <= _MOST_CELLS:
        return 0
    seen = scene.with_values({"lamp.hwhm_deg": beam_width_deg(scene, readings)}, validate=False)
    return cells_for(seen, *places.T)
