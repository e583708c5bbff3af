"""Light at the places of a table, for values of scene parameters: direct, scattered and reflected."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import TINY, Array, Mask
from lightfield.fitting.curves import Curves, field_of
from lightfield.fitting.diffuse_light import Diffuse, DiffuseLight, DiffuseSource
from lightfield.fitting.parameter import is_gain
from lightfield.fitting.scene_of_values import SceneOfValues
from lightfield.formula.closed_form import direct_field, table_angle
from lightfield.readings import Readings
from lightfield.readings.motion import Motion, motion_of
from lightfield.scene import Scene
from lightfield.scene.acts import AFTERWARDS, DIFFUSE, Acts
from lightfield.scene.all_parameters import acts_on, paths_on
from lightfield.scene.bands import read_nm
from lightfield.scene.lamp.profile import table_of
from lightfield.scene.listed import OWN
from lightfield.scene.own.own_effect import OwnEffect
from lightfield.scene.water.coefficients import absorption_per_m

_AFTERWARDS = frozenset(paths_on(AFTERWARDS))
#: So much light is remembered by the values it is of. Chosen: memory alone.
_REMEMBERED = 120
#: And so much with its slopes, which take three times as long. Chosen: memory alone.
_FEW = 8
#: Paths, and groups of them, of which is remembered whether they make light. Chosen: memory alone.
_PATHS, _GROUPS = 4096, 1024
#: The lamp is moved so far aside for a slope, m. Chosen: next to nothing beside a cell.
_ASIDE_M = 1e-3
#: A lamp's table does not know its light where it may be off by more than this part (chosen: a fifth, far
#: more than is left of a beam that was measured); one that so knows less than this part of the readings is
#: taken as it is (chosen).
_UNKNOWN, _MOST_UNKNOWN = 0.2, 0.5
#: A table whose last intensity is more than this part of its largest ends before the beam does (chosen).
_DARK = 1e-3
#: How far places that are read lag behind.
_LAG = "detector.lag_m"


@dataclass(frozen=True, eq=False)
class LightSource:
    """Light at the places of a table for unit on-axis intensity.

    Parameters
    ----------
    diffuse : DiffuseLight
        Scattered and reflected light; values that are not given are its scene's.
    scenes : SceneOfValues
        Which scene values stand for.
    correction, stderr : array, shape (n,)
        Factor on the light, and error of what comes of it beside the trace's own.
    motion : Motion, optional
        Of the detector; absent, it stands.
    held : (LightSource, array, mapping), optional
        Whose scattered and reflected light, shape (n,), stays as it is while the parameters that make it
        have these values.
    """

    diffuse: DiffuseLight
    scenes: SceneOfValues
    correction: Array | float = 1.0
    stderr: Array | float = 0.0
    motion: Motion | None = None
    held: tuple[LightSource, Array, Mapping[str, float]] | None = None

    @classmethod
    def of(
        cls, scene: Scene, readings: Readings, trace: DiffuseSource | None, dense_per_m: float | None
    ) -> LightSource:
        """Of a scene at the places of a table, see `DiffuseLight`."""
        scenes, r = SceneOfValues(scene, Curves(scene, readings)), readings
        motion = motion_of(r.x_m, r.y_m, r.z_m, r.time_s)
        return cls(DiffuseLight.of(scene, readings, trace, dense_per_m), scenes, motion=motion)

    @property
    def readings(self) -> Readings:
        return self.diffuse.readings

    def at(self, readings: Readings, share: float) -> LightSource:
        """The same at the places of other readings, with a part of the photons."""
        return LightSource(self.diffuse.at(readings, share), self.scenes)

    def subset(self, rows: NDArray[np.bool_]) -> LightSource:
        """The same at some of the readings, of every channel some."""
        correction, stderr = (
            v if np.ndim(v) == 0 else np.asarray(v)[rows] for v in (self.correction, self.stderr)
        )
        motion = None if self.motion is None else self.motion.some(rows)
        return replace(
            self, diffuse=self.diffuse.subset(rows), correction=correction, stderr=stderr, motion=motion
        )

    def corrected(self, light: Array, stderr: Array, values: Mapping[str, float]) -> LightSource:
        """The same, scaled reading by reading, so that at `values` it equals a full render.

        Parameters
        ----------
        light, stderr : array, shape (n,)
            The render, for unit on-axis intensity.
        """
        plain = replace(self, correction=1.0)
        return replace(self, correction=light / np.maximum(plain.light(values), TINY), stderr=stderr)

    def holding(self, values: Mapping[str, float]) -> LightSource:
        """The same, whose scattered and reflected light does not follow the lamp's small changes."""
        return replace(self, held=(self, self.rest(values), _diffuse(values)))

    def read_as(self, readings: Readings) -> LightSource:
        """The same with curves as another table of the same places lays them out."""
        return replace(self, scenes=replace(self.scenes, curves=Curves(self.scenes.scene, readings)))

    def following(self, diffuse: Diffuse) -> LightSource:
        """The same with other scattered and reflected light at the readings."""
        return replace(self, diffuse=replace(self.diffuse, followed=diffuse))

    def with_effects(self, more: Iterable[OwnEffect]) -> LightSource:
        """The same of a scene with effects of the user's own more; scattered light does not follow them."""
        scene = self.scenes.scene.model_copy(update={"effect": (*self.scenes.scene.effect, *more)})
        scenes, diffuse = replace(self.scenes, scene=scene), replace(self.diffuse, scene=scene)
        return replace(self, scenes=scenes, diffuse=diffuse)

    def light(self, values: Mapping[str, float]) -> Array:
        """Light for unit on-axis intensity, shape (n,); parameters that act on it afterwards do not count."""
        return self._remembered(tuple([(path, values[path]) for path in self._optical_paths(tuple(values))]))

    def rest(self, values: Mapping[str, float]) -> Array:
        """Scattered and reflected light for unit on-axis intensity, shape (n,)."""
        scene = self.scenes.with_values(self._optical(values))
        if not self.diffuse.is_in(scene):
            return np.zeros(len(self.diffuse.channels[1]))
        return np.asarray(self.light(values) - self.direct(scene, self.readings) * self.correction)

    def direct(self, scene: Scene, readings: Readings) -> Array:
        """Direct light of a scene alone at the places of some readings, shape (n,), or behind them."""
        r = readings
        x, y, z = r.x_m, r.y_m, r.z_m
        if scene.detector.lag_m and self.motion is not None:
            x, y, z = self.motion.behind(scene.detector.lag_m, x, y, z)
        wavelength = r.wavelength_nm
        if scene.detector.wavelength_shift_nm:
            middle = float(np.mean(scene.detector.bands_nm[0]))
            wavelength = read_nm(scene, np.where(np.isnan(wavelength), middle, wavelength))
        return direct_field(scene, x, y, z, wavelength, r.medium, r.time_s)

    def slopes_of_rest(self, values: Mapping[str, float]) -> Array:
        """How scattered and reflected light changes along x, y and z, per metre, shape (3, n).

        It moves aside with the lamp, as in `DiffuseResponse`, and falls with the square of the distance and
        by absorption.
        """
        optical = self._optical_paths(tuple(values))
        return np.asarray(
            self._about(tuple((p, values[p]) for p in optical if p != _LAG))[1:] * self.correction
        )

    def errors(self, values: Mapping[str, float]) -> tuple[Array, Array]:
        """Errors of the light by its scattered and reflected part.

        Returns
        -------
        modes : array, shape (n, k)
            Monte Carlo errors as independent contributions: covariance = modes @ modes.T; k = 0 without
            scattered and reflected light.
        smooth : array, shape (n,)
            Size of an error that varies little between neighbours.
        """
        modes, smooth = self.diffuse.errors(self.scenes.with_values(self._optical(values)))
        factor = np.broadcast_to(self.correction, smooth.shape)
        modes, smooth = modes * factor[:, None], smooth * factor
        if np.any(self.stderr):
            modes = np.hstack([modes, np.diag(self.stderr * np.ones(len(smooth)))])
        return np.asarray(modes), np.asarray(smooth)

    def lamp_errors(self, values: Mapping[str, float]) -> Array:
        """Errors of the direct light by those of the lamp's table, shape (n, k).

        Independent contributions: covariance = modes @ modes.T; k = 0 where there are none. What they make
        of scattered and reflected light, which comes from all angles at once, is less, and left out.
        """
        scene, r = self.scenes.with_values(self._optical(values)), self.readings
        stated = table_of(scene.lamp)
        if stated is None:
            return np.zeros((len(r.x_m), 0))
        relative = stated.relative_errors(table_angle(scene.lamp, r.x_m, r.y_m, r.z_m, r.medium))
        return np.asarray((self.direct(scene, r) * self.correction)[:, None] * relative.T)

    def to_trace(self, found: Iterable[Mapping[str, float]]) -> float | None:
        """The trace that is still missing for what was found, see `DiffuseLight.to_trace`, m^-1."""
        return self.diffuse.to_trace(self.scenes.at(values, validate=False) for values in found)

    def factor_to_traced(self, values: Mapping[str, float]) -> float:
        """How much more dense water would have to scatter, see `DiffuseLight.factor_to_traced`."""
        return self.diffuse.factor_to_traced(self.scenes.at(values, validate=False))

    def _optical(self, values: Mapping[str, float]) -> dict[str, float]:
        """The values that make the light field, without those that act on the readings afterwards."""
        return {path: values[path] for path in self._optical_paths(tuple(values))}

    @cached_property
    def _optical_paths(self) -> Callable[[tuple[str, ...]], tuple[str, ...]]:
        """Those of some paths that make the light field, in one order."""
        effects = self.scenes.scene.effect

        def acts_afterwards(path: str) -> bool:
            if is_gain(path) or field_of(path) in _AFTERWARDS:
                return True
            return path.startswith(OWN) and not acts_on(path, effects) & ~AFTERWARDS

        def of(paths: tuple[str, ...]) -> tuple[str, ...]:
            return tuple(sorted(path for path in paths if not acts_afterwards(path)))

        return lru_cache(_GROUPS)(of)

    @cached_property
    def _remembered(self) -> Callable[[tuple[tuple[str, float], ...]], Array]:
        return lru_cache(_REMEMBERED)(self._made)

    def _made(self, optical: tuple[tuple[str, float], ...]) -> Array:
        values = self.scenes.stated(dict(optical))
        if self.held is not None and self.held[2] != _diffuse(values):
            return self.held[0].light(dict(optical))
        scene = self.scenes.scene.with_values(values, validate=False)
        light: Array = self.direct(scene, self.readings)
        if self.held is not None:
            return np.asarray(light * self.correction + self.held[1])
        if self.diffuse.is_in(scene):
            light = light + self._behind(scene, optical)
        return np.asarray(light * self.correction)

    def _behind(self, scene: Scene, optical: tuple[tuple[str, float], ...]) -> Array:
        """Scattered and reflected light, shape (n,), where the places that are read lag behind."""
        if self.motion is None or not scene.detector.lag_m:
            return self.diffuse.light(scene)
        rest, *slopes = self._about(tuple(one for one in optical if one[0] != _LAG))
        return np.asarray(rest - scene.detector.lag_m * (self.motion.way * slopes).sum(axis=0))

    @cached_property
    def _about(self) -> Callable[[tuple[tuple[str, float], ...]], Array]:
        return lru_cache(_FEW)(self._with_slopes)

    def _with_slopes(self, optical: tuple[tuple[str, float], ...]) -> Array:
        """Scattered and reflected light, and how it changes with the place, shape (4, n)."""
        scene = self.scenes.with_values(dict(optical))
        if not self.diffuse.is_in(scene):
            return np.zeros((1 + 3, len(self.diffuse.channels[1])))
        rest, sides = self.diffuse.light(scene), []
        for offset in ("lamp.offset_x_m", "lamp.offset_y_m"):
            aside = scene.with_values({offset: float(scene.get(offset)) - _ASIDE_M}, validate=False)
            sides.append((self.diffuse.light(aside) - rest) / _ASIDE_M)
        water = absorption_per_m(scene.water, self.diffuse.wavelengths_nm)[self.diffuse.channels[1]]
        falling = 2 / np.maximum(np.abs(self.readings.z_m), _ASIDE_M) + water
        return np.stack([rest, *sides, -falling * rest])


def _diffuse(values: Mapping[str, float]) -> dict[str, float]:
    """The values that make scattered and reflected light what it is."""
    return {k: v for k, v in values.items() if _makes_diffuse(k)}


@lru_cache(_PATHS)
def _makes_diffuse(path: str) -> bool:
    return bool(acts_on(path) & (DIFFUSE | Acts.FACES | Acts.WAVES))


def beyond_table(scene: Scene, readings: Readings) -> Mask:
    """Readings, shape (n,), whose light the lamp's table does not know: what they show is the lamp alone.

    A lamp that was fitted to readings near its axis says so of what lies beyond, with one error for all of
    that, which cannot hold what a real lamp does there; and a table may end where the beam does not.
    """
    stated, none = table_of(scene.lamp), np.zeros(len(readings), bool)
    if stated is None:
        return none
    at = table_angle(scene.lamp, readings.x_m, readings.y_m, readings.z_m, readings.medium)
    found: Mask = at > (stated.angle_rad[-1] if stated.mean[-1] > _DARK * stated.mean.max() else np.inf)
    if len(stated.errors):
        modes = stated.relative_errors(at)[: len(stated.errors)]
        # What all share is a gain.
        beside = modes - np.median(modes, axis=1, keepdims=True)
        found |= np.sqrt((beside**2).sum(axis=0)) > _UNKNOWN
    return found if found.mean() <= _MOST_UNKNOWN else none


def without_unknown(readings: Readings, scene: Scene) -> Readings:
    """The readings, of which those of `beyond_table` take no part, as saturated ones do."""
    beyond = beyond_table(scene, readings)
    return replace(readings, saturated=readings.saturated | beyond) if beyond.any() else readings
