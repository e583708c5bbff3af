"""Readings with an effect hidden in them, made by the full renderer, to test a diagnosis."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.problem.candidates import Candidate, Setting, candidates
from lightfield.diagnosis.problem.layout import layout_of
from lightfield.diagnosis.problem.untestable import in_words
from lightfield.errors import OutputError, UsageError
from lightfield.experiments import unknowns
from lightfield.experiments.hidden_curves import draw_curve, field_to_hide
from lightfield.experiments.layouts import LISTED, Order, scan
from lightfield.experiments.measure import Instrument, LightInDoubt, in_doubt, measure, rendered
from lightfield.fitting import effects
from lightfield.readings import Readings, write_table
from lightfield.render.limits import MADE_PHOTONS
from lightfield.scene import Scene, Tank
from lightfield.scene.curve import sum_of
from lightfield.storage.files import write_text

#: A hidden effect is this many times its typical size, log-uniform.
STRENGTH = (2.0, 20.0)
#: The scene's half width and absorption are wrong by this much.
_GUESS = (0.10, 0.25)
#: Radius of the lamp's window in the truth, unless the scene has one; in a small tank this part of the
#: distance to the nearest plane.
_WINDOW_M, WINDOW_PART = 0.02, 0.005
#: What the truth says of places that were given.
TABLE = "table"
#: Files of a riddle; the last tells that the others are one.
WRITTEN = ("scene.toml", "data.csv", "truth.json")
#: What shows only beside walls, or a surface, that reflect.
_WAVES = "tank.surface_slope_deg"
#: Parts of the tank that reflect beside the walls, by the effect that moves them.
_FACES = {"tank.floor_over_walls": "floor_reflection", "tank.end_over_walls": "end_reflection"}
#: Where a scene says that its lamp is that of a table.
_PROFILE, _TABLE = "lamp.profile", "lamp.intensity_table"


@dataclass(frozen=True)
class Secret:
    """What shall be hidden.

    Parameters
    ----------
    names : sequence of str
        Effects of the table, each in its first form or as "effect:form"; or "unknown:ripple" and the like.
    strength : float, optional
        Size of each effect over its typical size; drawn when absent.
    values : mapping
        Values of parameters that shall not be drawn.
    lamp : path-like, optional
        Table of the true lamp's intensity against the angle, which the experimenter takes for the scene's.
    """

    names: Sequence[str] = ()
    strength: float | None = None
    values: Mapping[str, float] = field(default_factory=dict)
    lamp: str | Path | None = None


@dataclass(frozen=True)
class Hidden:
    """A measurement with a secret.

    Parameters
    ----------
    believed : Scene
        What the experimenter knows.
    truth : mapping
        What was hidden, with all parameters.
    in_doubt : LightInDoubt, optional
        Where the render's own error is larger than the noise.
    """

    readings: Readings
    believed: Scene
    truth: Mapping[str, Any]
    in_doubt: LightInDoubt | None = None

    def save(self, folder: str | Path) -> Path:
        """Write scene.toml and data.csv, and truth.json beside them.

        Raises
        ------
        OutputError
            As `replaced_in` says.
        """
        target = Path(folder)
        replaced_in(target)
        # The truth first: a folder without one is not written over, also where the disk was full.
        target.mkdir(parents=True, exist_ok=True)
        write_text(target / "truth.json", json.dumps(self.truth, indent=2) + "\n")
        self.believed.save(target / "scene.toml")
        write_table(self.readings, target / "data.csv")
        return target


def check_request(
    names: Sequence[str],
    strength: float | None,
    noise: float,
    plane_gain_percent: float,
    position_mm: float,
    *,
    spelled: Callable[[str], str] = str,
) -> None:
    """Refuse numbers that no measurement has, and an effect that is named twice.

    Parameters
    ----------
    names, strength
        As `Secret` takes them.
    noise : float
        Relative.
    plane_gain_percent : float
        Error of every stay at a plane, %.
    position_mm : float
        Error of every position, mm.
    spelled : callable, optional
        Makes of a word (effect, strength, noise, plane_gain, position) how the user wrote it.

    Raises
    ------
    UsageError
        What is wrong, and where.
    """
    for name, size, low, high in (
        ("noise", noise, 1e-5, 0.5),
        ("plane_gain", plane_gain_percent, 0, 50),
        ("position", position_mm, 0, 100),
    ):
        if not low <= size <= high:
            raise UsageError(
                "impossible error", where=spelled(name), found=size, rule=f"{low:.5g} to {high:g}"
            )
    if strength is not None and not 0 < strength < np.inf:
        raise UsageError("impossible strength", where=spelled("strength"), found=strength, rule="above 0")
    doubled = sorted({name for name in names if names.count(name) > 1})
    if doubled:
        raise UsageError(
            "an effect is hidden twice", where=spelled("effect"), found=", ".join(doubled), rule="each once"
        )


def replaced_in(folder: Path) -> list[str]:
    """Files that will be written over; they must be those of a riddle, not somebody's own readings.

    Raises
    ------
    OutputError
        Readings are there, and no truth that they were made from.
    """
    there = [str(folder / name) for name in WRITTEN if (folder / name).exists()]
    if there and not (folder / WRITTEN[-1]).exists():
        raise OutputError(
            "files of an experiment are here already",
            where=str(folder),
            found=", ".join(there),
            rule="only a riddle is replaced by another",
            remedy="choose another folder",
        )
    return there


def _amplitudes(candidate: Candidate, strength: float, rng: np.random.Generator) -> dict[str, float]:
    """Values of one effect: amplitudes of a given strength with random signs, shapes anywhere plausible."""
    out = {}
    real = {free.path: free.real for free in candidate.form.amplitudes}
    for parameter, typical in zip(candidate.amplitudes, candidate.typical, strict=True):
        most = real[parameter.path]
        high = parameter.high if most is None else min(parameter.high, most)
        up = parameter.start <= parameter.low or rng.random() < 0.5
        sign = 1.0 if up and parameter.start < high else -1.0
        room = abs((high if sign > 0 else parameter.low) - parameter.start)
        out[parameter.path] = parameter.value(parameter.start + sign * min(strength * typical, 0.5 * room))
    for k, parameter in enumerate(candidate.shapes):
        grid = np.array([point[k] for point in candidate.grid])
        low, high = float(grid.min()), float(grid.max())
        out[parameter.path] = parameter.value(rng.uniform(low, high) if high > low else low)
    return out


def draw_effect(
    scene: Scene, readings: Readings, name: str, rng: np.random.Generator, strength: float | None = None
) -> dict[str, Any]:
    """Parameter values of a hidden effect; nodes of a curve, together with what the scene states of it.

    Parameters
    ----------
    name : str
        Effect of the table, in its first form, or "effect:form".
    strength : float, optional
        Size over the typical size; drawn when absent.

    Raises
    ------
    UsageError
        Unknown effect or form, or it cannot act on these readings.
    """
    effect, form = effects.get_form(name, scene)
    field = field_to_hide(effect) if effect.is_free_form else None
    if effect.is_free_form and field is None:
        raise UsageError(
            "a curve is not hidden by its name",
            found=name,
            remedy="give the true lamp's table, or hide one of " + ", ".join(effect.contains),
        )
    absolute = readings.scale == "absolute"
    setting = Setting(scene, layout_of(readings), 1.0, float(np.ptp(scene.detector.bands_nm[0])), absolute)
    found, untestable = candidates(setting, [effect], ())
    if field is not None and not [need for need in effect.needs if not setting.met(need)]:
        drawn = float(np.exp(rng.uniform(*np.log(STRENGTH)))) if strength is None else strength
        typical = effect.forms[0].amplitudes[0].typical
        return {field: sum_of(scene.get(field), draw_curve(field, drawn * typical, readings, rng))}
    if effect.name in untestable:
        raise UsageError(
            "this effect cannot act here",
            found=f"{name}: {in_words(untestable[effect.name])}",
            remedy="change the layout or scene",
        )
    size = float(np.exp(rng.uniform(*np.log(STRENGTH)))) if strength is None else strength
    chosen = next((c for c in found if c.form.name == form.name), found[0])
    return _amplitudes(chosen, size, rng)


def _only_hidden(scene: Scene, values: Mapping[str, float], names: Sequence[str]) -> None:
    """Refuse values by which an effect would be hidden that the truth does not name."""
    chosen = {effects.get_form(name, scene)[0].name for name in names}
    for effect in effects.all_of(scene).values():
        amplitudes = {free.path for form in effect.forms for free in form.amplitudes}
        other = sorted(amplitudes & set(values))
        if effect.name not in chosen and other:
            raise UsageError(
                "a size of an effect that is not hidden",
                found=", ".join(other),
                rule=f"sizes of what is hidden: {', '.join(sorted(chosen)) or 'nothing'}",
                remedy=f"hide {effect.name} too",
            )


def true_scene(scene: Scene, values: Mapping[str, Any], rng: np.random.Generator) -> Scene:
    """The scene as it is: guesses wrong by 10 to 25 %, a finite window, and the hidden values."""
    wrong = 1 + rng.choice([-1, 1], 2) * rng.uniform(*_GUESS, 2)
    if scene.water.absorption_per_m < 0:  # clearer than the base: clearer still may be less than nothing
        wrong[1] = min(wrong[1], 1 / wrong[1])
    changed: dict[str, Any] = {
        "lamp.hwhm_deg": scene.lamp.hwhm_deg * float(wrong[0]),
        "water.absorption_per_m": scene.water.absorption_per_m * float(wrong[1]),
    }
    if scene.lamp.radius_m == 0:
        changed["lamp.radius_m"] = min(_WINDOW_M, WINDOW_PART * scene.detector.distances_m[0])
    return scene.with_values({**changed, **values})


def _refuse_without_effect(hidden: Collection[str], tank: Tank) -> None:
    """Refuse parameters of faces that reflect nothing."""
    for path, name in _FACES.items():
        if path in hidden and tank.wall_albedo == 0:
            raise UsageError(
                "this effect cannot act here",
                found=f"{name}: the walls are black",
                remedy="hide wall_reflection too, or state tank.wall_albedo",
            )
    if _WAVES in hidden and tank.surface_reflectance == 0:
        raise UsageError(
            "this effect cannot act here",
            found="waves: the tank has no water surface",
            remedy='hide surface_reflection too, or state tank.surface = "flat"',
        )


def hide(
    scene: Scene,
    secret: Secret,
    seed: int,
    instrument: Instrument,
    *,
    layout: str | Readings | None = None,
    order: Order = "random",
    max_photons: float = MADE_PHOTONS,
) -> Hidden:
    """A measurement of the scene with effects hidden in it.

    Parameters
    ----------
    scene : Scene
        What the experimenter believes.
    secret : Secret
    seed : int
    instrument : Instrument
        Its errors of planes and positions are stated in the table's error budget.
    layout : str or Readings, optional
        One of `layouts.LAYOUTS`, or a table with the places to read; else "line", or the positions that the
        scene lists.
    order : str
        As `layouts.scan` takes it.
    max_photons : float
        Budget of the render.

    Raises
    ------
    UsageError
        Unknown effect, unknown layout, an effect that cannot act here, or a size that hides one more.
    """
    rng = np.random.default_rng(seed)
    if layout is None:
        layout = "line" if scene.detector.positions_m is None else LISTED
    table = scan(scene, layout, order, rng)
    hidden: dict[str, Any] = {}
    known = [name for name in secret.names if not name.startswith(unknowns.PREFIX)]
    for name in known:
        hidden |= draw_effect(scene, table, name, rng, secret.strength)
    _only_hidden(scene, secret.values, known)
    hidden |= secret.values
    lamp = {} if secret.lamp is None else {_PROFILE: "table", _TABLE: str(Path(secret.lamp).resolve())}
    truth = true_scene(scene, {**hidden, **lamp}, rng)
    factor: Array | float = 1.0
    drawn: dict[str, Any] = {}
    for name in secret.names:
        if name not in known:
            one, drawn[name] = unknowns.draw(name, layout_of(table), rng)
            factor = factor * one
    if truth.tank is not None:
        _refuse_without_effect(hidden, truth.tank)
    light = rendered(truth, table, instrument.noise, rng, max_photons)
    readings, clean = measure(truth, table, light, instrument, rng, factor)
    doubt = in_doubt(light, instrument, clean, max_photons)
    told = {
        "hidden": list(secret.names),
        "lamp": None if secret.lamp is None else Path(secret.lamp).name,
        "parameters": hidden,
        "unknown": drawn,
        **({} if truth.lamp.profile == "table" else {"lamp.hwhm_deg": truth.lamp.hwhm_deg}),
        "lamp.radius_m": truth.lamp.radius_m,
        "water.absorption_per_m": truth.water.absorption_per_m,
        "layout": layout if isinstance(layout, str) else TABLE,
        "order": order,
        "noise": instrument.noise,
        "plane_gain_percent": 100 * instrument.plane_gain,
        "position_mm": 1000 * instrument.position_m,
        "light_error_percent": 100 * float(np.median(light.relative_error)),
        "light_in_doubt": None if doubt is None else doubt.as_data(),
        "seed": seed,
    }
    return Hidden(instrument.stated(readings), scene, told, doubt)
