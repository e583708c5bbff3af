"""Readings predicted from parameter values: the bridge from a scene and a reading table to a fit."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cache, cached_property, lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array
from lightfield.fitting.curves import field_of
from lightfield.fitting.diffuse_light import Diffuse, DiffuseSource, remembered
from lightfield.fitting.light_source import LightSource
from lightfield.fitting.parameter import GAIN
from lightfield.formula import field as analytic
from lightfield.formula import own
from lightfield.readings import Readings, units
from lightfield.scene import Scene
from lightfield.scene.acts import Acts
from lightfield.scene.all_parameters import paths_on
from lightfield.scene.bands import over_band, read_nm
from lightfield.scene.lamp.spectrum import axial_intensity
from lightfield.scene.listed import OWN
from lightfield.scene.own.effect import OwnEffect
from lightfield.scene.water.coefficients import absorption_per_m

#: Parameters that act on the reading after the light has arrived; everything else makes the light field anew.
READOUT = paths_on(Acts.READOUT)
_READOUT, _TIME = frozenset(READOUT), frozenset(paths_on(Acts.TIME))
#: Where the light comes from and which way it shines, of which formulas may speak.
_POSE = frozenset(paths_on(Acts.SOURCE | Acts.BEAM))
#: What makes the intensity on the axis: power, the beam that it is spread over, and the wavelengths read.
_LIT = frozenset(paths_on(Acts.POWER | Acts.BEAM | Acts.PLACES))
POWER = "lamp.power_w"
#: So many scenes and powers in time are remembered: most steps of a fit change something else.
_REMEMBERED = 16

Chosen = tuple[tuple[str, float], ...]
#: The diffuse light is traced in the water that a fit asks for, until it asks for no other: at most so often.
TRACES = 3


class SceneForward:
    """Predicts the readings of a table from values of scene parameters and one gain per channel.

    Parameters
    ----------
    scene : Scene
        Values that are not given to `predict` are the scene's.
    readings : Readings
    diffuse : callable, optional
        Traces the scattered and reflected light, see `DiffuseLight`.
    full : float, optional
        Reading that saturation is relative to; default: the largest.
    dense_per_m : float, optional, m^-1
        Also trace in this water; default: if the scene's own asks for it.
    light : LightSource, optional
        Instead of a new one.
    """

    def __init__(
        self,
        scene: Scene,
        readings: Readings,
        diffuse: DiffuseSource | None = None,
        full: float | None = None,
        dense_per_m: float | None = None,
        light: LightSource | None = None,
    ) -> None:
        self.scene, self.readings = scene, readings
        self.light = light or LightSource.of(scene, readings, diffuse, dense_per_m)
        self._time = np.nan_to_num(np.asarray(readings.time_s, float))
        air = np.asarray(readings.medium) == "air"
        spectrum = analytic.spectra(readings.x_m, readings.y_m, readings.z_m, air, self._time)
        overlap = analytic.halves(spectrum, readings.wavelength_nm)
        z_m = np.asarray(readings.z_m, float)
        self._taken = analytic.Taken(analytic.air_mask(air), spectrum, self._time, overlap, z_m)
        self._full = float(np.max(np.abs(readings.value))) if full is None else full

    @property
    def size(self) -> int:
        return len(self._channel)

    @property
    def _channel(self) -> NDArray[np.int_]:
        return self.light.diffuse.channels[1]

    @property
    def is_absolute(self) -> bool:
        """Are the readings in a unit of light, which the lamp's power gives?"""
        return bool(self.readings.scale == "absolute")

    @property
    def gain_names(self) -> tuple[str, ...]:
        """One gain per channel on a relative scale; on an absolute one, one for all, next to 1."""
        wavelengths = self.light.diffuse.channels[0]
        if len(wavelengths) == 1 or self.is_absolute:
            return (GAIN,)
        return tuple(f"{GAIN}.{w:g}nm" for w in wavelengths)

    def at(self, share: float = 1.0, **places: NDArray[Any]) -> SceneForward:
        """The same scene at other places.

        Parameters
        ----------
        share : float
            Part of the photons that a trace there is worth.
        places : arrays of one length
            Columns of readings: positions, medium and time.
        """
        columns: dict[str, Any] = {**places}
        n = len(next(iter(places.values())))
        there = replace(self.readings.subset(np.zeros(n, int)), **columns)
        return SceneForward(self.scene, there, full=self._full, light=self.light.at(there, share))

    def subset(self, rows: NDArray[np.bool_]) -> SceneForward:
        """The same at some of the readings, of every channel some."""
        light = self.light.subset(rows)
        return SceneForward(self.scene, light.readings, full=self._full, light=light)

    def holding(self, values: Mapping[str, float]) -> SceneForward:
        """The same near some values, for slopes: scattered and reflected light does not follow the lamp."""
        return SceneForward(self.scene, self.readings, full=self._full, light=self.light.holding(values))

    def corrected(self, light: Array, stderr: Array, values: Mapping[str, float]) -> SceneForward:
        """A copy whose light is scaled, reading by reading, so that at `values` it equals a full render.

        Parameters
        ----------
        light, stderr : array, shape (n,)
            The render, for unit on-axis intensity.
        """
        scaled = self.light.corrected(light, stderr, values)
        return SceneForward(self.scene, self.readings, full=self._full, light=scaled)

    def following(self, diffuse: Diffuse) -> SceneForward:
        """A copy with other scattered and reflected light at the readings."""
        light = self.light.following(diffuse)
        return SceneForward(self.scene, self.readings, full=self._full, light=light)

    def with_effects(self, more: Iterable[OwnEffect]) -> SceneForward:
        """A copy whose scene has effects of the user's own more; scattered light does not follow them."""
        scene = self.scene.model_copy(update={"effect": (*self.scene.effect, *more)})
        light = self.light.of_scene(scene)
        return SceneForward(scene, self.readings, full=self._full, light=light)

    def scene_at(self, values: Mapping[str, float], validate: bool = True) -> Scene:
        """The scene with these values; gains are not part of a scene."""
        return self.light.scene_at(values, validate)

    def predict(self, values: Mapping[str, float]) -> Array:
        """Readings, shape (n,)."""
        return self.read(self.light.light(values), values)

    def errors(self, values: Mapping[str, float]) -> tuple[Array, Array]:
        """Errors of the predicted readings by their light's, before saturation, see `LightSource.errors`."""
        modes, smooth = self.light.errors(values)
        factor = self._gain(values) * self.power(values) * self._shown(values) * self._own(values)
        modes *= factor[:, None]
        return modes, factor * smooth

    def lamp_errors(self, values: Mapping[str, float]) -> Array:
        """Errors of the predicted readings by those of the lamp's table, see `LightSource.lamp_errors`."""
        modes = self.light.lamp_errors(values)
        if not modes.size:
            return modes
        factor = self._gain(values) * self.power(values) * self._shown(values) * self._own(values)
        return np.asarray(modes * factor[:, None])

    def position_slope(self, values: Mapping[str, float]) -> Array:
        """|gradient| of the readings with respect to position, per metre, shape (n,).

        Scattered and reflected light moves aside with the lamp, as in `DiffuseResponse`, and falls with the
        square of the distance and by absorption: right to 10 % in water that scatters 0.4 per metre, to a
        third where it scatters 2 (tests/unit/fitting/test_forward.py).
        """
        scene, step_m = self.scene_at(values, validate=False), 1e-3
        r, square = self.readings, np.zeros(self.size)
        here, rest = self.light.direct(scene, r), self.light.rest(values)
        absorption = absorption_per_m(scene.water, self.light.diffuse.wavelengths_nm)[self._channel]
        falling = rest * (2 / np.maximum(np.abs(r.z_m), step_m) + absorption)
        for axis, offset in (("x_m", "lamp.offset_x_m"), ("y_m", "lamp.offset_y_m"), ("z_m", None)):
            moved: dict[str, Any] = {axis: getattr(r, axis) + step_m}
            change = self.light.direct(scene, replace(r, **moved)) - here
            if offset is None:
                change -= step_m * falling
            elif rest.any():
                aside = float(scene.get(offset)) - step_m
                change += self.light.rest({**values, offset: aside}) - rest
            square += (change / step_m) ** 2
        return np.asarray(np.sqrt(square) * self._gain(values) * self._shown(values))

    def _gain(self, values: Mapping[str, float]) -> Array:
        """Reading per unit of light from an on-axis intensity of one, shape (n,)."""
        gains = np.array([values.get(name, 1.0) for name in self.gain_names])
        gain = gains[self._channel] if len(gains) > 1 else np.full(self.size, gains[0])
        return np.asarray(gain * self._intensity(values) if self.is_absolute else gain)

    def _intensity(self, values: Mapping[str, float]) -> Array:
        """Radiant intensity on the axis, in the unit of absolute readings times m^2, shape (n,)."""
        scene = self._with(values, _LIT)
        lamp, shift = own.lit(scene).lamp, scene.detector.wavelength_shift_nm
        unit = units.to_si(self.readings.units, self.scene.detector.quantity)
        intensity = axial_intensity(lamp, read_nm(scene, self.light.diffuse.wavelengths_nm))
        whole = np.isnan(self.light.diffuse.channels[0]) | self.readings.of_band
        if whole.any():
            low, high = scene.detector.bands_nm[0]
            intensity[whole] = over_band(lamp, low + shift, high + shift, scene.detector).intensity.mean()
        return np.asarray(intensity / unit)[self._channel]

    def power(self, values: Mapping[str, float]) -> Array:
        """Lamp power over its value at time zero, shape (n,)."""
        return self._power(_chosen(values, _TIME))

    def _shown(self, values: Mapping[str, float]) -> Array | float:
        """Factors of the readout on all light: of the plane, and of readings in water."""
        scene = self._with(values, _READOUT)
        gain = analytic.plane_gain(scene, self._taken.z_m)
        return gain * analytic.immersed(scene, self._taken.in_air)

    def read(self, field: Array, values: Mapping[str, float]) -> Array:
        """Readings from light for unit on-axis intensity: gain, lamp power, then what the instrument does."""
        signal = self._gain(values) * field * self.power(values) * self._own(values)
        reading = analytic.readout(self._with(values, _READOUT), signal, self._full, self._taken)
        if not self.scene.effect:
            return reading
        return own.shown(self._with(values, _POSE), reading, self._full, *self._where)

    def _own(self, values: Mapping[str, float]) -> Array | float:
        """What the user's own effects at source and receiver make of all light, shape (n,)."""
        if not self.scene.effect:
            return 1.0
        return own.factor(self._with(values, _POSE), ("source", "receiver"), *self._where)

    @property
    def _where(self) -> tuple[Array, ...]:
        r = self.readings
        return r.x_m, r.y_m, r.z_m, r.wavelength_nm, r.time_s

    def _with(self, values: Mapping[str, float], paths: frozenset[str]) -> Scene:
        """The scene with those of the values that lie at some paths."""
        return self._scene(_chosen(values, paths))

    @cached_property
    def _scene(self) -> Callable[[Chosen], Scene]:
        """The scene with these values."""
        return lru_cache(_REMEMBERED)(
            lambda chosen: self.light.with_values(dict(chosen)) if chosen else self.scene
        )

    @cached_property
    def _power(self) -> Callable[[Chosen], Array]:
        """Lamp power over its value at time zero, shape (n,), for these values; read alone."""

        def power(chosen: Chosen) -> Array:
            factor = np.array(analytic.time_factor(self._scene(chosen), self._time))
            factor.setflags(write=False)
            return factor

        return lru_cache(_REMEMBERED)(power)


def _chosen(values: Mapping[str, float], paths: frozenset[str]) -> Chosen:
    """Those of the values that lie at some paths, or in effects of the user's own, in one order."""
    return tuple(sorted(v for v in values.items() if _field_of(v[0]) in paths or v[0].startswith(OWN)))


_field_of = cache(field_of)


class Retraced:
    """Forward models of readings, the next traced in the water that the fit with the one before has found.

    `for forward in retraced:` a fit, which sets `asked` where it ends in water that is too dense for the
    trace. Without that, or with no trace left, it was the last.

    Parameters
    ----------
    scene, readings, diffuse
        As `SceneForward` takes them.

    Attributes
    ----------
    asked : float, optional, m^-1
        Scattering coefficient to trace next, see `DiffuseLight.to_trace`.
    left : int
        Traces that may still be asked for.
    """

    def __init__(self, scene: Scene, readings: Readings, diffuse: DiffuseSource | None) -> None:
        self._forward = partial(SceneForward, scene, readings, remembered(diffuse))
        self.asked: float | None = None
        self.left = TRACES

    def __iter__(self) -> Iterator[SceneForward]:
        for self.left in reversed(range(TRACES)):
            dense, self.asked = self.asked, None
            yield self._forward(dense_per_m=dense)
            if self.asked is None:
                return
