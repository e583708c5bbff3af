"""What is explored: a scene, readings or the render in their place, and a model whose effects are all off."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array
from lightfield.diagnosis.problem.assumed import Assumed
from lightfield.diagnosis.problem.candidates import Candidate, Setting, candidates
from lightfield.diagnosis.problem.layout import Layout, layout_of
from lightfield.diagnosis.problem.noise import Budget, Noise
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.problem.setup import budget_of, problem_of, source_of, spectral
from lightfield.diagnosis.problem.untestable import Hindrance, Untestable, in_words
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.preparation import bench, prepare_problem
from lightfield.diagnosis.verdict.calibration import by_shape
from lightfield.errors import FitError
from lightfield.explorer.places import SIDE, MapPlaces, spread
from lightfield.fitting import effects
from lightfield.fitting.diffuse_light import DiffuseSource, remembered
from lightfield.fitting.effects.registry import effect_name
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.parameter import FitParameter
from lightfield.fitting.retraced import Retraced
from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
from lightfield.scene import Scene
from lightfield.scene.parameters import Parameter

#: Without readings the model is asked for the render at every so many places of a map, to so many per cent of
#: the light and of the plane's brightest. Chosen: what a careful measurement tells.
_EVERY, PERCENT, _FLOOR_PERCENT = 5, 1.0, 0.1
#: And in so many bands at most, of more of them spread evenly. Chosen: they are readings by the thousand.
MOST_BANDS = 9
#: Part of the photons of a fit that a trace for the maps is worth: they are looked at, not fitted to.
_MAP_SHARE = 0.35


@dataclass(frozen=True, eq=False)
class Experiment:
    """A model, what it is held against, and the places where it is shown.

    Parameters
    ----------
    scene : Scene
        As it was given.
    readings : Readings
        What the model is held against: data, or the render of the scene at some places of the maps.
    problem : Problem
        Its scene has every effect off that can be switched; what these readings do not tell of one that the
        scene has is held as stated, and switched with it.
    phi : float
        Variance of the noise over that of `whiten`.
    sigma : array, shape (n,)
        Standard error of every reading.
    untestable : mapping
        Effects that cannot be switched here, with reasons.
    stated : mapping
        Values of the effects that the scene itself has, by path.
    maps : tuple of SceneForward
        The same model at the places of the maps, at each wavelength that was read.
    gain : float, optional
        Of the render that takes the place of readings.
    assumed : tuple of Assumed
        Terms of the error budget that were not given.
    """

    scene: Scene
    readings: Readings
    has_data: bool
    problem: Problem
    whiten: Whitener
    phi: float
    sigma: Array
    untestable: Untestable
    stated: Mapping[str, float]
    maps: tuple[SceneForward, ...]
    places: MapPlaces
    gain: float | None = None
    assumed: tuple[Assumed, ...] = ()

    @property
    def forward(self) -> SceneForward:
        """Predicts the readings."""
        return self.problem.forward

    @property
    def layout(self) -> Layout:
        """Where and when was read."""
        return self.problem.layout

    @cached_property
    def candidates(self) -> Mapping[str, Candidate]:
        """Every form of every effect that can be switched here, by "effect:form", in the table's order."""
        every = (*self.problem.candidates, *self.problem.curves)
        return {":".join(candidate.key): candidate for candidate in every}

    @cached_property
    def parameters(self) -> Mapping[str, Parameter]:
        """Every parameter of scene and curves by path."""
        return self.forward.scene.parameters() | dict(self.forward.scenes.curves.parameters)

    @cached_property
    def switched_on(self) -> tuple[str, ...]:
        """The effects that the scene itself has, by "effect:form"."""
        return tuple(":".join(one.key) for one in _stated_forms(self.candidates.values(), self.stated))

    def beside_own(self, keys: Iterable[str]) -> tuple[str, ...]:
        """Effects that a diagnosis found, after the scene's own, which it took for granted."""
        found = tuple(keys)
        names = {effect_name(key) for key in found}
        return (*(key for key in self.switched_on if effect_name(key) not in names), *found)

    def held(self, keys: Iterable[str]) -> dict[str, float]:
        """Values of what comes with some effects and no fit moves, by path."""
        parameters = (p for key in keys for p in self.candidates[key].parameters)
        return {p.path: p.value(p.start) for p in parameters if p.is_held}


def explored(
    scene: Scene,
    readings: Readings | None,
    diffuse: DiffuseSource | str | None = "trace",
    dense_per_m: float | None = None,
    progress: Callable[[str], None] = lambda stage: None,
) -> Experiment:
    """The experiment of a scene, with or without readings.

    Parameters
    ----------
    diffuse : "trace", None or callable
        As `lightfield.diagnosis.diagnose.diagnose` takes it.
    dense_per_m : float, optional, m^-1
        Also trace in water that scatters so much.
    progress : callable
        Told what begins.

    Raises
    ------
    LightfieldError
        Scene and readings do not belong together, or cannot be modelled.
    """
    readings = readings.check_against(scene) if readings is not None else None
    places, stated = MapPlaces.of(scene, readings), _stated(scene)
    if readings is None:
        return _against_render(scene, stated, places, diffuse, dense_per_m, progress)
    source, reason = source_of(_switched_off(scene, stated), diffuse, readings)
    source, plain = remembered(source), _plain(scene, stated, readings, reason)
    plain, quoted, budget = spectral(plain, readings), np.asarray(readings.stderr, float), budget_of(readings)
    every = [*effects.all_of(scene).values(), *effects.curves().values()]
    traces = Retraced(plain, readings, source)
    traces.asked = dense_per_m
    for forward in traces:
        problem, untestable = problem_of(forward, readings, every, reason)
        problem = by_shape(_with_stated(problem, stated))
        progress(f"judging the noise of {len(readings)} readings")
        rng = np.random.default_rng(0)
        prepared = prepare_problem(problem, quoted, budget, rng)
        traces.asked = None if dense_per_m is not None else prepared.to_trace_per_m
    made = bench(prepared, 0.0, rng)
    sigma = np.sqrt(prepared.noise.variance(1.0, 0.0))
    maps = _at_maps(forward, places)
    return Experiment(
        scene, readings, True, prepared.problem, made.whiten, made.phi, sigma, untestable, stated, maps,
        places, None, budget.assumed,
    )  # fmt: skip


def _against_render(
    scene: Scene,
    stated: Mapping[str, float],
    places: MapPlaces,
    diffuse: DiffuseSource | str | None,
    dense_per_m: float | None,
    progress: Callable[[str], None],
) -> Experiment:
    """Without readings: the traced light of the scene as it stands takes their place."""
    columns, off = _in_bands(scene, places), _switched_off(scene, stated)
    direct = direct_field(off, columns["x_m"], columns["y_m"], columns["z_m"], columns.get("wavelength_nm"))
    every = Readings.from_arrays(value=direct, **columns).check_against(scene)
    source, reason = source_of(off, diffuse, every)
    plain = _plain(scene, stated, every, reason)
    progress("tracing the scene")
    whole = SceneForward(plain, every, remembered(source), full=1.0, dense_per_m=dense_per_m)
    light = whole.predict(stated)
    band = whole.light.diffuse.channels[1]
    maps = tuple(whole.subset(band == k) for k in range(band.max() + 1))
    some = places.some(np.arange(SIDE) % _EVERY == (SIDE // 2) % _EVERY)
    rows = np.tile(some, len(maps))
    scale = 1.0 / float(light.max())
    # Band by band: what their errors share does not count here, and would be worked out for minutes.
    own = scale * np.concatenate([error_by_light(m.subset(some), stated) for m in maps])
    value = scale * light[rows]
    by_plane = value.reshape(len(maps) * len(places.z_m), -1)
    top = np.repeat(by_plane.max(axis=1), by_plane.shape[1])
    sigma = np.sqrt(own**2 + (PERCENT / 100 * value) ** 2 + (_FLOOR_PERCENT / 100 * top) ** 2)
    columns = {name: column[rows] for name, column in columns.items()}
    seen = Readings.from_arrays(value=value, stderr=sigma, **columns).check_against(scene)
    light_source = whole.light.subset(rows)
    light_source = replace(light_source, diffuse=replace(light_source.diffuse, readings=seen))
    forward = SceneForward(plain, seen, full=float(value.max()), light=light_source)
    table = [*effects.all_of(scene).values(), *effects.curves().values()]
    problem, untestable = problem_of(forward, seen, table, reason)
    problem = _with_stated(problem, stated)
    layout, zero = layout_of(seen), np.zeros(len(seen))
    whiten = Whitener(Noise(layout, sigma, value, Budget(0.0, 0.0, 0.0), zero))
    return Experiment(
        scene, seen, False, problem, whiten, 1.0, sigma, untestable, stated, maps, places,
        scale,
    )  # fmt: skip


def error_by_light(forward: SceneForward, values: Mapping[str, float]) -> Array:
    """Standard error of predicted readings, shape (n,): photons, and what varies slowly."""
    modes, smooth = forward.errors(values)
    return np.hypot(np.linalg.norm(modes, axis=1), smooth)


def _in_bands(scene: Scene, places: MapPlaces) -> dict[str, NDArray[np.generic]]:
    """Columns of readings at all places of the maps, band by band."""
    columns, bands = dict(places.columns), scene.detector.bands_nm
    if len(bands) == 1:  # without wavelengths readings are means over it
        return columns
    middles = spread(np.unique(np.mean(bands, axis=1)), MOST_BANDS)
    by_band = {name: np.tile(column, len(middles)) for name, column in columns.items()}
    return by_band | {"wavelength_nm": np.repeat(middles, len(columns["z_m"]))}


def _at_maps(forward: SceneForward, places: MapPlaces) -> tuple[SceneForward, ...]:
    n = len(places.columns["z_m"])
    return tuple(
        forward.at(_MAP_SHARE, **places.columns, wavelength_nm=np.full(n, w))
        for w in forward.light.diffuse.channels[0]
    )


def _stated(scene: Scene) -> dict[str, float]:
    """Values of the effects that a scene has, by path, with the shapes that belong to them."""
    known, out = scene.parameters(), dict[str, float]()
    for effect in effects.all_of(scene).values():
        for form in effect.forms:
            amplitudes, shapes = (
                [known[f.path] for f in some if f.path in known] for some in (form.amplitudes, form.shapes)
            )
            if any(map(_is_on, amplitudes)):
                own = [p for p in (*amplitudes, *shapes) if p.neutral is None or _is_on(p)]
                out |= {p.path: p.value for p in own}
    return out


def _is_on(parameter: Parameter) -> bool:
    return parameter.neutral is not None and parameter.value != parameter.neutral


def _switched_off(scene: Scene, paths: Iterable[str]) -> Scene:
    known = scene.parameters()
    off = {path: known[path].neutral for path in paths if _is_on(known[path])}
    return scene.with_values(off) if off else scene


def _plain(
    scene: Scene, stated: Mapping[str, float], readings: Readings, without_diffuse: Hindrance | None
) -> Scene:
    """The scene without its effects, but for those that cannot be switched here: they stay as stated."""
    low, high = scene.detector.bands_nm[0]
    layout, absolute = layout_of(readings), readings.scale == "absolute"
    own = [effect for effect in effects.all_of(scene).values() if stated.keys() & {*effect.paths}]
    while True:
        plain = _switched_off(scene, stated.keys() & {path for effect in own for path in effect.paths})
        # The size of the readings and what the base model frees do not matter: only what can be told does.
        setting = Setting(plain, layout, 1.0, float(high - low), absolute)
        _, untestable = candidates(setting, own, (), without_diffuse)
        if not untestable:
            return plain
        own = [effect for effect in own if effect.name not in untestable]


def _stated_forms(every: Iterable[Candidate], stated: Mapping[str, float]) -> tuple[Candidate, ...]:
    """Of each effect that the scene has the form with most of what is stated, of equal ones the usual one."""
    found: dict[str, Candidate] = {}
    for one in every:
        if stated.keys() & {*one.effect.paths}:
            of_those = found.setdefault(one.name, one), one
            found[one.name] = max(of_those, key=lambda c: len(stated.keys() & {p.path for p in c.parameters}))
    return tuple(found.values())


def _with_stated(problem: Problem, stated: Mapping[str, float]) -> Problem:
    """Its effects bring all that the scene states of them: what their form does not move is held."""
    rest = {}
    for one in _stated_forms(problem.candidates, stated):
        moved = {p.path for p in one.parameters}
        rest[one.name] = {p: stated[p] for p in one.effect.paths if p in stated and p not in moved}
    return replace(problem, candidates=tuple(_holding(c, rest.get(c.name, {})) for c in problem.candidates))


def _holding(candidate: Candidate, values: Mapping[str, float]) -> Candidate:
    """A candidate that brings values which no fit moves."""
    moved = {p.path for p in candidate.parameters}
    held = [
        FitParameter(path, value, value, value, 0.0) for path, value in values.items() if path not in moved
    ]
    more = [p.start for p in held]
    grid = tuple((*point, *more) for point in candidate.grid)
    return replace(candidate, shapes=(*candidate.shapes, *held), grid=grid)


def candidate_of(experiment: Experiment, key: str) -> Candidate:
    """The form of an effect that a key "effect:form" names.

    Raises
    ------
    FitError
        There is none, or it cannot be switched here.
    """
    if key not in experiment.candidates:
        name = effect_name(key)
        raise FitError(
            "this effect cannot be switched here",
            where=name[:60],
            found=in_words(experiment.untestable.get(name, ())) or "no effect of that name",
            remedy="choose one of the list",
        )
    return experiment.candidates[key]


def all_lit(experiment: Experiment) -> dict[str, float]:
    """Values of all effects that make diffuse light, a little on."""
    return {
        p.path: p.value(p.start + typical)
        for candidate in experiment.candidates.values()
        if candidate.effect.diffuse
        for p, typical in zip(candidate.amplitudes, candidate.typical, strict=True)
    }
