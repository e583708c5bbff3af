"""Light at the places of a table, for values of scene parameters: direct, scattered and reflected."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache, partial
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array
from lightfield.fitting.curves import Curves, Stated
from lightfield.fitting.parameter import is_gain
from lightfield.formula import field as analytic
from lightfield.formula.own import lit
from lightfield.readings import Readings
from lightfield.render.diffuse.dense_water import CLEAR_PER_M, dense_water, trace_for
from lightfield.render.diffuse.followed import field_at
from lightfield.scene import Scene
from lightfield.scene.acts import AFTERWARDS, DIFFUSE, Acts
from lightfield.scene.all_parameters import acts_on, neutral, paths_on
from lightfield.scene.bands import read_nm
from lightfield.scene.water.ageing import ages, at_time, moments
from lightfield.scene.water.coefficients import scattering_per_m

if TYPE_CHECKING:
    from typing_extensions import Self

    from lightfield.formula.scattered.field import ScatteredField
    from lightfield.scene.water.water import Water

_AFTERWARDS = frozenset(paths_on(AFTERWARDS))
_REMEMBERED = 120
#: Moments at which the scattered light of changing water is asked for: right to 1e-3 of it 8.5 m away in
#: water that goes from b = 0.3 per m to 0.01 (tests/physics/test_tank_effects.py).
MOMENTS = 4


class Diffuse(Protocol):
    """Scattered and reflected light at the readings' places."""

    def light(self, scene: Scene, wavelengths_nm: Sequence[float | None]) -> Array: ...

    def errors(
        self, scene: Scene, wavelengths_nm: Sequence[float | None], channel: NDArray[np.int_]
    ) -> tuple[Array, Array]: ...

    def some(self, rows: NDArray[np.bool_]) -> Diffuse: ...


@runtime_checkable
class ManyWaters(Protocol):
    """Diffuse light that tells of several waters faster than of one after the other."""

    def in_waters(
        self, scene: Scene, waters: Sequence[Water], wavelengths_nm: Sequence[float | None]
    ) -> Array:
        """That of a scene in waters which differ by what absorbs and scatters alone.

        Shape (n_waters, n_wavelengths, n).
        """


class TracedDiffuse(Diffuse, Protocol):
    """The same, from traces in clear water and perhaps in one that scatters more."""

    def with_denser(self, other: Self) -> Self: ...


DiffuseSource = Callable[..., TracedDiffuse]


def remembered(source: DiffuseSource | None) -> DiffuseSource | None:
    """The source, which gives what it has been asked for before from memory."""
    if source is None:
        return None
    made: dict[tuple[object, ...], TracedDiffuse] = {}

    def once(scene: Scene, *places: Array, **options: float) -> TracedDiffuse:
        key = (*(np.asarray(p, float).tobytes() for p in places), *sorted(options.items()))
        if key not in made:
            made[key] = source(scene, *places, **options)
        return made[key]

    return once


def has_diffuse_light(scene: Scene) -> bool:
    """Does the scene scatter or reflect any light?"""
    return not neutral(scene, DIFFUSE)


def beam_width_deg(scene: Scene, readings: Readings) -> float:
    """Half width of the beam, roughly, from the readings alone; the scene's value where they do not show it.

    Regression of ln(value r^2) on theta^2 over the brighter half of every plane, a level per plane, medium
    and wavelength.
    """
    x, y, z = (np.asarray(getattr(readings, k), float) for k in ("x_m", "y_m", "z_m"))
    value = np.asarray(readings.value, float)
    theta2 = np.arctan2(np.hypot(x, y), z) ** 2
    wavelength = np.nan_to_num(np.asarray(readings.wavelength_nm, float))
    kinds = np.stack([np.round(z, 3), np.asarray(readings.medium) == "air", np.round(wavelength, 3)], axis=1)
    _, group = np.unique(kinds, axis=0, return_inverse=True)
    group = group.ravel()
    top = np.full(int(group.max()) + 1, -np.inf)
    np.maximum.at(top, group, value)
    lit = (value > 0.4 * top[group]) & (value > 0)
    left, right = 0.0, 0.0
    for k in np.unique(group[lit]):
        mine = lit & (group == k)
        t = theta2[mine] - theta2[mine].mean()
        left += float(t @ t)
        right -= float(t @ np.log(value[mine] * (x[mine] ** 2 + y[mine] ** 2 + z[mine] ** 2)))
    if left <= 0 or right <= 0:
        return float(scene.lamp.hwhm_deg)
    return float(np.clip(np.degrees(np.sqrt(np.log(2) * left / right)), 0.5, 60.0))


@dataclass(frozen=True, eq=False)
class LightSource:
    """Light at the places of a table for unit on-axis intensity, traced when it is first needed.

    Parameters
    ----------
    scene : Scene
        Values that are not given are the scene's.
    readings : Readings
    trace : callable, optional
        `response_for(scene, x_m, y_m, z_m, share=1.0, dense_per_m=None)`: traces once the scattered and
        reflected light, with that part of its photons, in clear water or one that scatters so much.
    width_deg : float
        Half width of the beam as the readings show it. Photons are sent with it, not with the scene's guess:
        every scene fitted to these readings shares one response, and a stored rung gives the same numbers
        again.
    dense_per_m : float, optional, m^-1
        Also trace in this water.
    curves : Curves, optional
        What amplitudes of curves among the values stand for.
    correction, stderr : array, shape (n,)
        Factor on the light, and error of what comes of it beside the trace's own.
    part_of : (LightSource, array of bool), optional
        Whose readings these are some of, and which: what is traced is traced for all of them.
    held : (LightSource, array, mapping), optional
        Whose scattered and reflected light, shape (n,), stays as it is while the parameters that make it
        have these values.
    followed : Diffuse, optional
        Scattered and reflected light in place of what `trace` makes, at these very readings.
    """

    scene: Scene
    readings: Readings
    trace: DiffuseSource | None
    width_deg: float
    dense_per_m: float | None
    curves: Curves | None = None
    correction: Array | float = 1.0
    stderr: Array | float = 0.0
    part_of: tuple[LightSource, NDArray[np.bool_]] | None = None
    held: tuple[LightSource, Array, Mapping[str, float]] | None = None
    followed: Diffuse | None = None

    @classmethod
    def of(
        cls, scene: Scene, readings: Readings, trace: DiffuseSource | None, dense_per_m: float | None
    ) -> LightSource:
        """With the width that the readings show, traced in dense water if the scene's own asks for it."""
        width, curves = beam_width_deg(scene, readings), Curves(scene, readings)
        out = cls(scene, readings, trace, width, dense_per_m, curves=curves)
        own = out.dense_water({}) if dense_per_m is None else None
        return replace(out, dense_per_m=trace_for(own)) if own is not None else out

    def at(self, readings: Readings, share: float) -> LightSource:
        """The same at the places of other readings, with a part of the photons."""
        trace = partial(self.trace, share=share) if self.trace and share != 1 else self.trace
        return LightSource(self.scene, readings, trace, self.width_deg, self.dense_per_m, curves=self.curves)

    def subset(self, rows: NDArray[np.bool_]) -> LightSource:
        """The same at some of the readings, of every channel some."""
        correction, stderr = (
            v if np.ndim(v) == 0 else np.asarray(v)[rows] for v in (self.correction, self.stderr)
        )
        some = self.readings.subset(rows)
        part = self, rows
        return replace(self, readings=some, correction=correction, stderr=stderr, part_of=part, followed=None)

    def corrected(self, light: Array, stderr: Array, values: Mapping[str, float]) -> LightSource:
        """The same, scaled reading by reading, so that at `values` it is as given with an error."""
        plain = replace(self, correction=1.0)
        return replace(self, correction=light / np.maximum(plain.light(values), 1e-300), stderr=stderr)

    def holding(self, values: Mapping[str, float]) -> LightSource:
        """The same, whose scattered and reflected light does not follow the lamp's small changes."""
        return replace(self, held=(self, self.rest(values), _diffuse(values)))

    @cached_property
    def channels(self) -> tuple[Array, NDArray[np.int_]]:
        """Wavelengths in nm, each once, NaN for the band; index of each reading's among them, shape (n,)."""
        wavelength = np.asarray(self.readings.wavelength_nm, float)
        return np.unique(np.round(wavelength, 3), return_inverse=True)

    @property
    def wavelengths_nm(self) -> Array:
        """Wavelength of each channel, the middle of the band where the table has none."""
        middle = float(np.mean(self.scene.detector.bands_nm[0]))
        return np.where(np.isnan(self.channels[0]), middle, self.channels[0])

    def scene_at(self, values: Mapping[str, float], validate: bool = True) -> Scene:
        """The scene with these values; gains are not part of a scene."""
        return self.with_values({k: v for k, v in values.items() if not is_gain(k)}, validate)

    def with_values(self, values: Mapping[str, float], validate: bool = False) -> Scene:
        """The scene with values of its parameters, and of amplitudes of curves."""
        return self.scene.with_values(self._stated(values), validate=validate)

    def _stated(self, values: Mapping[str, float]) -> Stated:
        """Values as a scene takes them: nodes of curves in place of amplitudes."""
        return self.curves.stated(values) if self.curves else values

    def light(self, values: Mapping[str, float]) -> Array:
        """Light for unit on-axis intensity, shape (n,); parameters that act on it afterwards do not count."""
        return self._remembered(tuple(sorted(_optical(self._stated(values)).items())))

    def rest(self, values: Mapping[str, float]) -> Array:
        """Scattered and reflected light for unit on-axis intensity, shape (n,)."""
        scene = self.with_values(_optical(values))
        if self.trace is None or not has_diffuse_light(scene):
            return np.zeros(len(self.channels[1]))
        return np.asarray(self.light(values) - self.direct(scene, self.readings) * self.correction)

    def direct(self, scene: Scene, readings: Readings) -> Array:
        """Direct light of a scene alone at the places of some readings, shape (n,)."""
        r = readings
        wavelength = r.wavelength_nm
        if scene.detector.wavelength_shift_nm:
            middle = float(np.mean(scene.detector.bands_nm[0]))
            wavelength = read_nm(scene, np.where(np.isnan(wavelength), middle, wavelength))
        return analytic.direct_field(scene, r.x_m, r.y_m, r.z_m, wavelength, r.medium, r.time_s)

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
        scene, n = lit(self.with_values(_optical(values))), len(self.channels[1])
        modes: Array = np.zeros((n, 0))
        smooth: Array = np.zeros(n)
        if self.trace is not None and has_diffuse_light(scene):
            modes, smooth = self.diffuse.errors(scene, self._colours(scene), self.channels[1])
        factor = np.where(self._wet, self.correction, 0.0)
        modes *= factor[:, None]
        smooth *= factor
        if np.any(self.stderr):
            modes = np.hstack([modes, np.diag(self.stderr * np.ones(n))])
        return np.asarray(modes), np.asarray(smooth)

    def dense_water(self, values: Mapping[str, float]) -> float | None:
        """Scattering coefficient of the water if it is too dense for a trace in clear water, m^-1."""
        return dense_water(scattering_per_m(self.scene_at(values, validate=False).water, self.wavelengths_nm))

    def to_trace(self, found: Iterable[Mapping[str, float]]) -> float | None:
        """The trace that is still missing for the first of what was found in dense water, m^-1; none where
        light was traced at a fit."""
        if self.followed is not None:
            return None
        now = self.dense_per_m or CLEAR_PER_M
        asked = [trace_for(b, now) for values in found if (b := self.dense_water(values)) is not None]
        return asked[0] if asked and asked[0] != self.dense_per_m else None

    def factor_to_traced(self, values: Mapping[str, float]) -> float:
        """Factor by which dense water would have to scatter more to be the traced one; 1 in clear water."""
        b = self.dense_water(values)
        return self.dense_per_m / b if self.dense_per_m is not None and b is not None else 1.0

    @cached_property
    def _remembered(self) -> Callable[[tuple[tuple[str, float], ...]], Array]:
        return lru_cache(_REMEMBERED)(self._made)

    def _made(self, optical: tuple[tuple[str, float], ...]) -> Array:
        if self.held is not None and self.held[2] != _diffuse(dict(optical)):
            return self.held[0].light(dict(optical))
        scene = self.scene.with_values(dict(optical), validate=False)
        light: Array = self.direct(scene, self.readings)
        if self.held is not None:
            return np.asarray(light * self.correction + self.held[1])
        if self.trace is not None and has_diffuse_light(scene):
            light = light + np.where(self._wet, self._diffuse(lit(scene)), 0.0)
        return np.asarray(light * self.correction)

    def _diffuse(self, scene: Scene) -> Array:
        """Scattered and reflected light, where need be at a few moments of the water and between, (n,)."""
        if ages(scene.water):
            at, shares = moments(scene.water, self.readings.time_s, self._straight_m, MOMENTS)
            waters = [at_time(scene.water, float(t)) for t in at]
            now = self._in_waters(scene, waters)
            return np.asarray((shares * np.array(now)).sum(axis=0))
        return self._of_channels(self.diffuse.light(scene, self._colours(scene)))

    def _in_waters(self, scene: Scene, waters: Sequence[Water]) -> list[Array]:
        """Scattered and reflected light in each of some waters, see `ManyWaters`, each of shape (n,)."""
        scenes = [scene.model_copy(update={"water": water}) for water in waters]
        if isinstance(self.diffuse, ManyWaters):
            every = self.diffuse.in_waters(scenes[0], waters, self._colours(scene))
            return [self._of_channels(one) for one in every]
        return [self._diffuse(one) for one in scenes]

    def _of_channels(self, every: Array) -> Array:
        """Of light at all wavelengths that of each reading's channel, shape (n,)."""
        channel = self.channels[1]
        return np.asarray(every[channel, np.arange(len(channel))])

    @cached_property
    def _straight_m(self) -> Array:
        """From the lamp's window to each reading, roughly, shape (n,)."""
        r = self.readings
        return np.asarray(np.sqrt(r.x_m**2 + r.y_m**2 + r.z_m**2))

    @cached_property
    def _wet(self) -> NDArray[np.bool_]:
        """Which readings are in water: nothing is scattered in air."""
        return np.asarray(self.readings.medium) != "air"

    def _colours(self, scene: Scene) -> list[float | None]:
        """Wavelength of each channel as it is read, nm; None: the middle of the band."""
        if scene.detector.wavelength_shift_nm:
            return list(read_nm(scene, self.wavelengths_nm).tolist())
        return [None if np.isnan(w) else float(w) for w in self.channels[0]]

    @cached_property
    def diffuse(self) -> Diffuse:
        """Scattered and reflected light at the readings."""
        if self.followed is not None:
            return self.followed
        if self.part_of is not None:
            whole, rows = self.part_of
            return whole.diffuse.some(rows)
        return self.traced

    @cached_property
    def field(self) -> ScatteredField:
        """Scattered light at the readings as far as it is known without photons."""
        return field_at((self.readings.x_m, self.readings.y_m, self.readings.z_m))

    @cached_property
    def traced(self) -> TracedDiffuse:
        """Diffuse light as `trace` makes it, at these very readings."""
        assert self.trace is not None
        r = self.readings
        sent = self.scene.with_values({"lamp.hwhm_deg": self.width_deg}, validate=False)
        response = self.trace(sent, r.x_m, r.y_m, r.z_m)
        if self.dense_per_m is None:
            return response
        return response.with_denser(self.trace(sent, r.x_m, r.y_m, r.z_m, dense_per_m=self.dense_per_m))


def _optical(values: Mapping[str, float]) -> dict[str, float]:
    """The values that make the light field, without those that act on the readings afterwards."""
    return {k: v for k, v in values.items() if not is_gain(k) and k not in _AFTERWARDS}


def _diffuse(values: Mapping[str, float]) -> dict[str, float]:
    """The values that make scattered and reflected light what it is."""
    return {k: v for k, v in values.items() if _makes_diffuse(k)}


@cache
def _makes_diffuse(path: str) -> bool:
    return bool(acts_on(path) & (DIFFUSE | Acts.FLOOR | Acts.WAVES))
