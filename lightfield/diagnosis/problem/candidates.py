"""The effects that could be missing here: forms with absolute bounds, and those that cannot be tested, with
reasons."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, product

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.problem.layout import LEAST_RANGE, Layout
from lightfield.diagnosis.problem.untestable import Hinders, Hindrance
from lightfield.fitting.curves import field_of
from lightfield.fitting.diffuse_light import has_diffuse_light
from lightfield.fitting.effects import Effect, Form, Free
from lightfield.fitting.parameter import FitParameter
from lightfield.formula.path import attenuation_per_m
from lightfield.readings.motion import motion_of
from lightfield.render.reflected.reflected_light import applies
from lightfield.scene import Scene
from lightfield.scene.parameters import Parameter
from lightfield.scene.water.library import pure_water_absorption

#: Finite differences step by this part of the typical size. Chosen: little physics, much for the single
#: precision in which the response of the diffuse light is kept.
STEP = 1e-2
#: The start of a shape keeps this part of its range from its ends, where fits would stay. Chosen.
_FROM_THE_ENDS = 0.02
#: Readings at one distance, in metres, have a range all the same. Chosen: no place is better known.
_SHORTEST_RANGE_M = 1e-3
#: A curve of one function is no curve: named effects have as much. Chosen.
_FEWEST_FUNCTIONS = 2

#: Attenuation of the clearest water there is, in 1/m, rounded: pure water at 490 nm (Pope & Fry 1997, Appl.
#: Opt. 36, 8710, doi:10.1364/AO.36.008710).
_CLEAREST_PER_M = 0.02

#: What is in water adds so much to the spread of attenuation in a band, in 1/m for each nm of it. Chosen:
#: as CDOM of 0.25 per m at 440 nm (slope 0.014 per nm) has in a band about it. Places in a band.
_COLOURED_PER_M_NM, _IN_BAND = 0.001, 33

#: What stands in the way where a condition of the table is not fulfilled.
UNMET: Mapping[str, Hinders] = {
    "vary_x": Hinders.ONE_X,
    "vary_y": Hinders.ONE_Y,
    "vary_z": Hinders.ONE_DISTANCE,
    "oblique": Hinders.ON_A_CROSS,
    "off_axis": Hinders.ON_AXIS,
    "time": Hinders.NO_TIMES,
    "to_and_fro": Hinders.ONE_WAY,
    "tank": Hinders.NO_TANK,
    "mirror": Hinders.NARROW_VIEW,
    "panes": Hinders.NO_PANES,
    "water": Hinders.NO_WATER,
    "air_and_water": Hinders.NOT_BOTH_MEDIA,
    "two_colours": Hinders.ONE_WAVELENGTH,
    "spectral": Hinders.FEW_WAVELENGTHS,
    "overlap": Hinders.NO_OVERTONE,
    "absolute": Hinders.RELATIVE,
    "relative": Hinders.ABSOLUTE,
    "formula_beam": Hinders.TABLE_BEAM,
    "table_beam": Hinders.FORMULA_BEAM,
    "known_base": Hinders.ABSORPTION_FREE,
}


@dataclass(frozen=True)
class Setting:
    """What turns the relative numbers of the table of effects into absolute ones.

    `curves` are the amplitudes of free-form effects, by path: those of which the readings tell; `told` is how
    many would follow any readings, by the curve's field.
    """

    scene: Scene
    layout: Layout
    signal: float
    band_nm: float
    absolute: bool = False
    curves: Mapping[str, Parameter] = field(default_factory=dict)
    told: Mapping[str, int] = field(default_factory=dict)

    @property
    def hwhm_deg(self) -> float:
        return float(self.scene.get("lamp.hwhm_deg"))

    @property
    def attenuation_per_m(self) -> float:
        """Largest of the scene's water at these wavelengths; no water is clearer than some."""
        known = self.layout.wavelength_nm[np.isfinite(self.layout.wavelength_nm)]
        middle = float(np.mean(self.scene.detector.bands_nm[0]))
        colours = np.unique(known) if known.size else np.array([middle])
        return max(float(np.max(attenuation_per_m(self.scene.water, colours))), _CLEAREST_PER_M)

    @property
    def spread_per_m(self) -> float:
        """Largest plausible standard deviation of the attenuation within the scene's first band, 1/m: that of
        pure water, and what coloured matter in it may add."""
        wavelength, absorption, _ = pure_water_absorption()
        low, high = self.scene.detector.bands_nm[0]
        pure = np.interp(np.linspace(low, high, _IN_BAND), wavelength, absorption)
        return float(np.std(pure)) + _COLOURED_PER_M_NM * self.band_nm

    def met(self, need: str) -> bool:
        """Is a condition of the table fulfilled by these readings and this scene?"""
        layout = self.layout
        if need in ("vary_x", "vary_y", "vary_z"):
            return layout.varies(need[-1] + "_m")
        if need == "to_and_fro":
            motion = motion_of(layout.x_m, layout.y_m, layout.z_m, layout.time_s)
            return motion is not None and motion.to_and_fro
        return {
            "oblique": bool(np.minimum(abs(layout.x_m), abs(layout.y_m)).max() > LEAST_RANGE),
            "off_axis": bool(layout.angle_rad.max() > LEAST_RANGE),
            "time": layout.has_time,
            "absolute": self.absolute,
            "relative": not self.absolute,
            "tank": self.scene.tank is not None,
            "mirror": self.scene.tank is None or applies(self.scene),
            "panes": self.scene.tank is None or self.scene.tank.panes != "none",
            "water": bool((~layout.air).any()),
            "air_and_water": bool(layout.air.any() and (~layout.air).any()),
            "two_colours": int(layout.channel.max()) >= 1,
            "spectral": int(layout.channel.max()) >= 2,
            "overlap": _overlaps(layout.wavelength_nm),
            "formula_beam": self.scene.lamp.profile != "table",
            "table_beam": self.scene.lamp.profile == "table",
            # In fewer than three bands it is the bands that are missing, not the spectrum.
            "known_base": self.scene.get("water.base") != "none" or int(layout.channel.max()) < 2,
        }[need]

    def scale(self, per: str) -> tuple[float, float]:
        """Factor and offset that turn a number of the table into the scene's unit."""
        time = self.layout.time_s
        span_s = float(np.ptp(time)) if self.layout.has_time else 1.0
        near, far = float(self.layout.z_m.min()), float(self.layout.z_m.max())
        low, high = float(min(self.layout.y_m.min(), 0.0)), float(max(self.layout.y_m.max(), 0.0))
        return {
            "one": (1.0, 0.0),
            "power": (float(self.scene.get("lamp.power_w")), 0.0),
            "signal": (self.signal, 0.0),
            "inverse_signal": (1.0 / self.signal, 0.0),
            "hwhm": (self.hwhm_deg, 0.0),
            "hours": (span_s / 3600, 0.0),
            "seconds": (span_s, 0.0),
            "moment": (span_s, float(time.min()) if self.layout.has_time else 0.0),
            "interval": (span_s / max(len(np.unique(time)) - 1, 1), 0.0),
            "inverse_hours": (3600 / span_s, 0.0),
            "range": (max(far - near, _SHORTEST_RANGE_M), near),
            "heights": (max(high - low, _SHORTEST_RANGE_M), low),
            # What is found has to be possible beside the scene's own planes as well.
            "nearest": (min(near, self.scene.detector.distances_m[0]), 0.0),
            "spread": (self.spread_per_m, 0.0),
            "attenuation": (self.attenuation_per_m, 0.0),
        }[per]


def _overlaps(wavelength_nm: Array) -> bool:
    """Does half of some wavelength lie among the others?"""
    known = wavelength_nm[np.isfinite(wavelength_nm)]
    return bool(known.size and known.max() >= 2 * known.min())


@dataclass(frozen=True)
class Candidate:
    """One form of one effect, ready to be tested.

    Parameters
    ----------
    amplitudes, shapes : tuple of FitParameter
        `start` of an amplitude is the scene's value: its neutral coordinate, unless the scene has the effect.
    typical : tuple of float
        Size of each amplitude worth asking about, in its coordinate.
    grid : tuple of tuple of float
        Start points of the shapes, every combination.
    neutral : tuple of float
        Coordinate of each amplitude that switches it off.
    one_sided : bool
        A single amplitude whose neutral value is its lower bound.
    spare : int, optional
        Of a curve: by how many coordinates the readings could contradict it.
    """

    effect: Effect
    form: Form
    amplitudes: tuple[FitParameter, ...]
    typical: tuple[float, ...]
    shapes: tuple[FitParameter, ...]
    grid: tuple[tuple[float, ...], ...]
    neutral: tuple[float, ...] = ()
    spare: int | None = None

    @property
    def is_hardly_tested(self) -> bool:
        """Is it a curve that follows nearly any readings, of more functions than could contradict it?"""
        return self.spare is not None and self.spare < len(self.amplitudes)

    @property
    def is_stated(self) -> bool:
        """Does the scene have this effect already?"""
        return any(p.start != off for p, off in zip(self.amplitudes, self.neutral, strict=False))

    @property
    def name(self) -> str:
        return self.effect.name

    @property
    def key(self) -> tuple[str, str]:
        return (self.effect.name, self.form.name)

    @property
    def parameters(self) -> tuple[FitParameter, ...]:
        return self.amplitudes + self.shapes

    @property
    def one_sided(self) -> bool:
        return len(self.amplitudes) == 1 and self.amplitudes[0].start <= self.amplitudes[0].low


def go_together(candidates: Sequence[Candidate]) -> bool:
    """Can all of them be in one explanation?"""
    pairs = combinations(candidates, 2)
    return all(one.effect.combines_with(other.effect) for one, other in pairs)


def _parameter(
    free: Free, setting: Setting, known: Mapping[str, Parameter], shape: bool
) -> tuple[FitParameter, float, Array]:
    factor, offset = setting.scale(free.per)
    factor = factor**2 if free.square else factor
    now = known[free.path].value
    coordinate = "inverse-square" if free.inverse_square else "square" if free.square else "linear"
    low, high = offset + factor * free.low, offset + factor * free.high
    limits = _limits(known[free.path], coordinate)
    if coordinate == "linear":
        low, high = max(low, limits[0]), min(high, limits[1])
    grid = offset + factor * np.array(free.grid)
    step = STEP * factor * free.typical
    parameter = FitParameter(free.path, low, high, now, step, coordinate, limits, free.lowest)
    start = parameter.coordinate_of(now)
    if not shape:
        low, high = min(low, start), max(high, start)  # what the scene has is plausible
    else:
        edge = _FROM_THE_ENDS * (high - low)
        grid = np.clip(grid, low + edge, high - edge)
        start = float(grid[0])
    return replace(parameter, low=low, high=high, start=start), factor * free.typical, grid


def _limits(declared: Parameter, coordinate: str) -> tuple[float, float]:
    """What a scene can have of a parameter, in the coordinate of the fit."""
    if coordinate == "inverse-square":
        return 0.0, np.inf
    low, high = declared.low, declared.high
    return (max(low, 0.0) ** 2, high**2) if coordinate == "square" else (low, high)


def _resolve(
    effect: Effect, form: Form, setting: Setting, known: Mapping[str, Parameter]
) -> Candidate | None:
    usable = [f for f in form.amplitudes if f.path in known and all(setting.met(n) for n in f.needs)]
    if not usable:
        return None
    amplitudes = [_parameter(free, setting, known, shape=False) for free in usable]
    shapes = [_parameter(free, setting, known, shape=True) for free in form.shapes if free.path in known]
    parameters = tuple(p for p, _, _ in amplitudes)
    off = [known[p.path].neutral for p in parameters]
    found = Candidate(
        effect,
        form,
        parameters,
        tuple(t for _, t, _ in amplitudes),
        tuple(p for p, _, _ in shapes),
        tuple(tuple(map(float, point)) for point in product(*(g for _, _, g in shapes))),
        tuple(p.start if n is None else p.coordinate_of(n) for p, n in zip(parameters, off, strict=True)),
    )
    if not (found.is_stated and found.shapes):
        return found
    own = tuple(float(np.clip(setting.scene.get(p.path), p.low, p.high)) for p in found.shapes)
    return replace(found, grid=(own, *(point for point in found.grid if point != own)))


def _different_curves(forms: Iterable[Candidate], told: Mapping[str, int]) -> list[Candidate]:
    """Forms of a free-form effect with different numbers of functions, called after them."""
    sizes: dict[int, Candidate] = {}
    for form in forms:
        if len(form.amplitudes) >= _FEWEST_FUNCTIONS:
            sizes.setdefault(len(form.amplitudes), form)
    return [
        replace(
            one, form=replace(one.form, name=f"{n} functions"),
            spare=told[field_of(one.amplitudes[0].path)] - n,
        )
        for n, one in sizes.items()
    ]  # fmt: skip


def _shaped(forms: list[Candidate]) -> list[Candidate]:
    """Without forms whose shapes the scene does not know: those of other phase functions; but one of them."""
    lacking = [f for f in forms if f.form.shapes and not f.shapes]
    rest = [f for f in forms if f.shapes or not f.form.shapes]
    return rest or lacking[:1]


def candidates(
    setting: Setting, effects: Iterable[Effect], base: Iterable[str], without_diffuse: Hindrance | None = None
) -> tuple[tuple[Candidate, ...], dict[str, tuple[Hindrance, ...]]]:
    """Testable forms of the effects, and what stands in the way of each effect that cannot be tested.

    Parameters
    ----------
    base : iterable of str
        Paths that the base model frees already.
    without_diffuse : Hindrance, optional
        Why scattered and reflected light cannot be predicted, when it cannot.
    """
    known = {**setting.scene.parameters(), **setting.curves}
    taken = set(base)
    found: list[Candidate] = []
    untestable: dict[str, tuple[Hindrance, ...]] = {}
    for effect in effects:
        missing = [Hindrance(UNMET[need]) for need in effect.needs if not setting.met(need)]
        if effect.diffuse and without_diffuse is not None:
            missing.append(without_diffuse)
        if effect.direct_only and has_diffuse_light(setting.scene):
            missing.append(Hindrance(Hinders.DIFFUSE))
        if missing:
            untestable[effect.name] = tuple(missing)
            continue
        forms = [
            f for f in (_resolve(effect, form, setting, known) for form in effect.forms) if f is not None
        ]
        forms = _shaped([f for f in forms if not taken & {p.path for p in f.amplitudes}])
        if effect.is_free_form:
            forms = _different_curves(forms, setting.told)
        if not forms:
            none = Hinders.FEW_PLACES if effect.is_free_form else Hinders.FREE_ALREADY
            untestable[effect.name] = (Hindrance(none),)
        found.extend(forms)
    return tuple(found), untestable
