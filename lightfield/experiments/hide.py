"""Readings with an effect hidden in them, made by the full renderer, to test a diagnosis."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array
from lightfield.diagnosis.problem.candidates import Candidate, Setting, candidates
from lightfield.diagnosis.problem.layout import layout_of
from lightfield.errors import UsageError
from lightfield.experiments import unknowns
from lightfield.fitting import effects
from lightfield.fitting.forward import SceneForward
from lightfield.formula.field import direct_field
from lightfield.readings import Readings, write_table
from lightfield.scene import Scene
from lightfield.storage.files import atomic_path

Order = Literal["random", "plane"]
LAYOUTS = ("line", "half", "grid", "fine", "column", "air")

SECONDS_PER_READING = 20.0
#: Samples that a standard error is estimated from.
SAMPLES = 40
#: Read noise over the largest reading.
FLOOR = 0.0008
#: A hidden effect is this many times its typical size, log-uniform.
STRENGTH = (2.0, 20.0)
#: The scene's half width and absorption are wrong by this much.
GUESS = (0.10, 0.25)
#: Radius of the lamp's window in the truth, unless the scene has one; in a small tank this part of the
#: distance to the nearest plane.
WINDOW_M, WINDOW_PART = 0.02, 0.005
#: Photons of the render at most, and its error as a part of the noise: readings shall scatter by their noise.
PHOTONS, ERROR_OF_NOISE = 3e7, 0.25


@dataclass(frozen=True)
class Hidden:
    """A measurement with a secret.

    Parameters
    ----------
    readings : Readings
    believed : Scene
        What the experimenter knows.
    truth : mapping
        What was hidden, with all parameters.
    noise_free : array, shape (n,)
        Readings without noise.
    """

    readings: Any
    believed: Scene
    truth: Mapping[str, Any]
    noise_free: Array

    def save(self, folder: str | Path) -> Path:
        """Write scene.toml and data.csv, and truth.json beside them."""
        target = Path(folder)
        self.believed.save(target / "scene.toml")
        write_table(self.readings, target / "data.csv")
        with atomic_path(target / "truth.json") as temporary:
            temporary.write_text(json.dumps(self.truth, indent=2) + "\n", encoding="utf-8")
        return target


def positions(scene: Scene, kind: str) -> dict[str, Array]:
    """Positions of a layout on the scene's planes.

    Parameters
    ----------
    kind : str
        "line": x on both sides; "half": x from 0; "grid": x and y; "fine": more planes; "column": x and y up
        to the surface; "air": "line" in water and again in air.

    Raises
    ------
    UsageError
        No such layout.
    """
    if kind not in LAYOUTS:
        raise UsageError("unknown layout", found=kind, rule="one of " + ", ".join(LAYOUTS))
    planes: NDArray[Any] = np.array(scene.detector.planes_m)
    reach, (low, high) = 0.5 * scene.plane_size_m[0], (-np.inf, np.inf)
    if scene.tank is not None:
        low, high = scene.tank.box_m[1]
    x: NDArray[Any] = np.linspace(-reach, reach, 21)
    y: NDArray[Any] = np.zeros(1)
    if kind == "half":
        x = np.linspace(0, reach, 11)
    elif kind == "grid":
        x = np.linspace(-0.9 * reach, 0.9 * reach, 7)
        y = np.linspace(max(-0.9 * reach, 0.9 * low), min(0.9 * reach, 0.9 * high), 7)
    elif kind == "fine":
        gaps = np.diff(planes) if len(planes) > 1 else 0.2 * planes
        ends = [planes[:1] - gaps[:1], planes[-1:] + gaps[-1:]]
        planes = np.unique(np.concatenate([planes, 0.5 * (planes[1:] + planes[:-1]), *ends]))
        planes = planes[planes > 0.1 * scene.detector.planes_m[0]]
    elif kind == "column":
        x = min(0.3, 0.9 * reach) * np.array([-1.0, 0.0, 1.0])
        top = high - min(0.1, 0.5 * high)
        y = np.linspace(max(-0.9 * reach, 0.9 * low), min(top, reach), 12)
    media = ("air", "water") if kind == "air" else ("water",)
    gz, gy, gx = (np.tile(a.ravel(), len(media)) for a in np.meshgrid(planes, y, x, indexing="ij"))
    return {"x_m": gx, "y_m": gy, "z_m": gz, "medium": np.repeat(media, gx.size // len(media))}


def scan(scene: Scene, kind: str, order: Order, rng: np.random.Generator) -> Any:
    """A layout with times, and no values yet; all bands of the scene are read at once."""
    places = positions(scene, kind)
    n, bands = len(places["x_m"]), scene.detector.bands_nm
    sequence = rng.permutation(n) if order == "random" else np.arange(n)
    centres = [float(np.mean(band)) for band in bands] if len(bands) > 1 else [np.nan]
    bare = Readings.from_arrays(
        **{name: np.repeat(column, len(centres)) for name, column in places.items()},
        value=np.ones(n * len(centres)),
        stderr=np.full(n * len(centres), np.nan),
        wavelength_nm=np.tile(centres, n),
        time_s=SECONDS_PER_READING * np.repeat(sequence, len(centres)),
        quantity=scene.detector.quantity,
    )
    return bare.check_against(scene)


def _amplitudes(candidate: Candidate, strength: float, rng: np.random.Generator) -> dict[str, float]:
    """Values of one effect: amplitudes of a given strength with random signs, shapes anywhere plausible."""
    out = {}
    for parameter, typical in zip(candidate.amplitudes, candidate.typical, strict=True):
        sign = 1.0 if parameter.start <= parameter.low or rng.random() < 0.5 else -1.0
        room = abs((parameter.high if sign > 0 else parameter.low) - parameter.start)
        out[parameter.path] = parameter.value(parameter.start + sign * min(strength * typical, 0.5 * room))
    for k, parameter in enumerate(candidate.shapes):
        grid = np.array([point[k] for point in candidate.grid])
        low, high = float(grid.min()), float(grid.max())
        out[parameter.path] = parameter.value(rng.uniform(low, high) if high > low else low)
    return out


def draw_effect(
    scene: Scene,
    readings: Any,
    name: str,
    rng: np.random.Generator,
    strength: float | None = None,
) -> dict[str, float]:
    """Parameter values of a hidden effect.

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
    effect, form = effects.get_form(name)
    setting = Setting(scene, layout_of(readings), 1.0, float(np.ptp(scene.detector.bands_nm[0])))
    found, untestable = candidates(setting, [effect], ())
    if effect.name in untestable:
        raise UsageError(
            "this effect cannot act here",
            found=f"{name}: {untestable[effect.name]}",
            remedy="change the layout or scene",
        )
    size = float(np.exp(rng.uniform(*np.log(STRENGTH)))) if strength is None else strength
    chosen = next((c for c in found if c.form.name == form.name), found[0])
    return _amplitudes(chosen, size, rng)


def _only_hidden(values: Mapping[str, float], names: Sequence[str]) -> None:
    """Refuse values by which an effect would be hidden that the truth does not name."""
    chosen = {effects.get_form(name)[0].name for name in names}
    for effect in effects.table().values():
        amplitudes = {free.path for form in effect.forms for free in form.amplitudes}
        other = sorted(amplitudes & set(values))
        if effect.name not in chosen and other:
            raise UsageError(
                "a size of an effect that is not hidden",
                where="--size",
                found=", ".join(other),
                rule=f"sizes of what --effect names: {', '.join(sorted(chosen)) or 'nothing'}",
                remedy=f"add --effect {effect.name}",
            )


def true_scene(scene: Scene, values: Mapping[str, Any], rng: np.random.Generator) -> Scene:
    """The scene as it is: guesses wrong by 10 to 25 %, a finite window, and the hidden values."""
    wrong = 1 + rng.choice([-1, 1], 2) * rng.uniform(*GUESS, 2)
    if scene.water.absorption_per_m < 0:  # clearer than the base: clearer still may be less than nothing
        wrong[1] = min(wrong[1], 1 / wrong[1])
    changed: dict[str, Any] = {
        "lamp.hwhm_deg": scene.lamp.hwhm_deg * float(wrong[0]),
        "water.absorption_per_m": scene.water.absorption_per_m * float(wrong[1]),
    }
    if scene.lamp.radius_m == 0:
        nearest = min(scene.detector.planes_m)
        changed["lamp.radius_m"] = min(WINDOW_M, WINDOW_PART * nearest)
    return scene.with_values({**changed, **values})


def measure(
    believed: Scene,
    truth: Scene,
    table: Any,
    rng: np.random.Generator,
    *,
    noise: float = 0.01,
    light: Array | None = None,
    light_stderr: Array | None = None,
    factor: Array | float = 1.0,
    serial: float = 0.0,
    outliers: float = 0.0,
    plane_gain: float = 0.0,
    position_m: float = 0.0,
    photons: float | None = None,
) -> tuple[Any, Array, Array]:
    """Take the readings of a scene.

    What the render does not know of the light is an error of the readings, and stated with theirs. (Places
    that are mirror images of each other share it; so it is kept small beside the noise.)

    Parameters
    ----------
    table : Readings
        Positions and times.
    noise : float
        Relative noise of a bright reading.
    light, light_stderr : array, shape (n,), optional
        Light from an earlier render of the same scene, and its error; absent: rendered now.
    factor : array, shape (n,)
        Unknown influences on the light.
    serial : float
        Correlation of successive errors.
    outliers : float
        Part of the readings that are grossly wrong.
    plane_gain : float
        Relative error of each visit to a plane.
    position_m : float, m
        Error of each coordinate of each position.

    Returns
    -------
    readings : Readings
    noise_free : array, shape (n,)
    light_error : array, shape (n,)
        Relative error of the rendered light.
    """
    if light is None:
        from lightfield.render.at_readings import rendered_light  # loads the renderer

        light, light_stderr = rendered_light(
            truth,
            table,
            seed=int(rng.integers(1, 1_000_000)),
            rel_error=ERROR_OF_NOISE * noise,
            max_photons=PHOTONS if photons is None else photons,
            symmetry=True,
        )
    unsure = np.zeros(len(light)) if light_stderr is None else light_stderr
    light_error = np.divide(unsure, light, out=np.zeros(len(light)), where=light > 0)
    bright = light * factor
    forward = SceneForward(truth, table, full=1.0)
    gains = dict.fromkeys(forward.gain_names, 1.0 / float((bright * forward.power({})).max()))
    # Saturation is stated relative to the largest reading, which itself is saturated.
    full = 1.0
    for _ in range(60):
        clean = SceneForward(truth, table, full=full).read(bright, gains)
        full = float(clean.max())
    layout = layout_of(table)
    shown = clean * (1 + plane_gain * rng.standard_normal(int(layout.visit.max()) + 1)[layout.visit])
    if position_m > 0:
        shown = shown * _displaced(truth, table, position_m, rng)
    sigma = np.hypot(noise * shown, FLOOR)
    error = rng.standard_normal(len(clean))
    for previous, now in zip(layout.order[:-1], layout.order[1:], strict=True):
        error[now] = serial * error[previous] + np.sqrt(1 - serial**2) * error[now]
    gross = rng.random(len(clean)) < outliers
    error = error + gross * rng.choice([-1, 1], len(clean)) * rng.uniform(6, 30, len(clean))
    quoted = sigma * np.sqrt(rng.chisquare(SAMPLES - 1, len(clean)) / (SAMPLES - 1))
    stderr = np.hypot(quoted, light_error * shown)
    return replace(table, value=shown + sigma * error, stderr=stderr), clean, light_error


def _displaced(truth: Scene, table: Any, position_m: float, rng: np.random.Generator) -> Array:
    """Light a few millimetres off over light at the stated place; the direct light's gradient is enough."""
    here = [table.x_m, table.y_m, table.z_m]
    _, first, moment = np.unique(table.time_s, return_index=True, return_inverse=True)
    place = np.argsort(np.argsort(first))[moment]  # all wavelengths of one moment share it
    there = [c + position_m * rng.standard_normal(len(first))[place] for c in here]
    one, other = (
        direct_field(truth, x, y, z, table.wavelength_nm, table.medium) for x, y, z in (here, there)
    )
    return np.divide(other, one, out=np.ones_like(one), where=one > 0)  # where nothing is read, nothing moves


def hide(
    scene: Scene,
    names: Sequence[str],
    seed: int,
    *,
    layout: str = "line",
    order: Order = "random",
    noise: float = 0.01,
    plane_gain: float = 0.0,
    position_m: float = 0.0,
    strength: float | None = None,
    values: Mapping[str, float] | None = None,
    photons: float | None = None,
) -> Hidden:
    """A measurement of the scene with effects hidden in it.

    Parameters
    ----------
    scene : Scene
        What the experimenter believes.
    names : sequence of str
        Effects of the table, each in its first form or as "effect:form"; or "unknown:ripple" and the like.
    seed : int
    plane_gain, position_m : float
        Errors as `measure` takes them; stated in the table's error budget when they are not zero.
    strength : float, optional
        Size of each effect over its typical size.
    values : mapping, optional
        Values of parameters that shall not be drawn.

    Raises
    ------
    UsageError
        Unknown effect, unknown layout, an effect that cannot act here, or a size that hides one more.
    """
    rng = np.random.default_rng(seed)
    table = scan(scene, layout, order, rng)
    hidden: dict[str, float] = {}
    known = [name for name in names if not name.startswith(unknowns.PREFIX)]
    for name in known:
        hidden |= draw_effect(scene, table, name, rng, strength)
    _only_hidden(values or {}, known)
    hidden |= dict(values or {})
    truth = true_scene(scene, hidden, rng)
    factor: Array | float = 1.0
    drawn: dict[str, Any] = {}
    for name in names:
        if name not in known:
            one, drawn[name] = unknowns.draw(name, layout_of(table), rng)
            factor = factor * one
    readings, clean, light_error = measure(
        scene, truth, table, rng, noise=noise, factor=factor,
        plane_gain=plane_gain, position_m=position_m, photons=photons,
    )  # fmt: skip
    if plane_gain > 0:
        readings = replace(readings, budget=replace(readings.budget, plane_gain_percent=100 * plane_gain))
    if position_m > 0:
        readings = replace(readings, budget=replace(readings.budget, position_mm=1000 * position_m))
    secret = {
        "hidden": list(names),
        "parameters": hidden,
        "unknown": drawn,
        "lamp.hwhm_deg": truth.lamp.hwhm_deg,
        "lamp.radius_m": truth.lamp.radius_m,
        "water.absorption_per_m": truth.water.absorption_per_m,
        "layout": layout,
        "order": order,
        "noise": noise,
        "plane_gain_percent": 100 * plane_gain,
        "position_mm": 1000 * position_m,
        "light_error_percent": 100 * float(np.median(light_error)),
        "seed": seed,
    }
    return Hidden(readings, scene, secret, clean)
