"""Readings predicted from parameter values: the bridge from a scene and a reading table to a fit."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Protocol

import numpy as np

from lightfield.arrays import Array
from lightfield.formula import field as analytic
from lightfield.render.diffuse.dense_water import CLEAR_PER_M, dense_water, trace_for
from lightfield.scene import Scene
from lightfield.scene.acts import AFTERWARDS, DIFFUSE, Acts
from lightfield.scene.all_parameters import neutral, paths_on
from lightfield.scene.water.coefficients import scattering_per_m

GAIN = "gain"
#: Parameters that act on the reading after the light has arrived; everything else makes the light field anew.
READOUT = paths_on(Acts.READOUT)
_TIME = paths_on(Acts.TIME)
_AFTERWARDS = frozenset(paths_on(AFTERWARDS))
_REMEMBERED = 120


class Diffuse(Protocol):
    """Scattered and reflected light at the readings' places."""

    def light(self, scene: Scene, wavelengths_nm: Sequence[float | None]) -> Any: ...

    def errors(
        self, scene: Scene, wavelengths_nm: Sequence[float | None], channel: Any
    ) -> tuple[Any, Any]: ...

    def with_denser(self, other: Any) -> Diffuse: ...


DiffuseSource = Callable[..., Diffuse]


def has_diffuse_light(scene: Scene) -> bool:
    """Does the scene scatter or reflect any light?"""
    return not neutral(scene, DIFFUSE)


def _optical(values: Mapping[str, float]) -> dict[str, float]:
    """The values that make the light field, without those that act on the readings afterwards."""
    return {k: v for k, v in values.items() if not k.startswith(GAIN) and k not in _AFTERWARDS}


def beam_width_deg(scene: Scene, readings: Any) -> float:
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
    top = np.array([value[group == k].max() for k in group])
    lit = (value > 0.4 * top) & (value > 0)
    left, right = 0.0, 0.0
    for k in np.unique(group[lit]):
        mine = lit & (group == k)
        t = theta2[mine] - theta2[mine].mean()
        left += float(t @ t)
        right -= float(t @ np.log(value[mine] * (x[mine] ** 2 + y[mine] ** 2 + z[mine] ** 2)))
    if left <= 0 or right <= 0:
        return float(scene.lamp.hwhm_deg)
    return float(np.clip(np.degrees(np.sqrt(np.log(2) * left / right)), 0.5, 60.0))


class SceneForward:
    """Predicts the readings of a table from values of scene parameters and one gain per channel.

    Parameters
    ----------
    scene : Scene
        Values that are not given to `predict` are the scene's.
    readings : Readings
    diffuse : callable, optional
        `response_for(scene, x_m, y_m, z_m, share=1.0, dense_per_m=None)`: traces once the scattered and
        reflected light, with that part of its photons, in clear water or one that scatters so much; called
        only when needed.
    dense_per_m : float, optional, m^-1
        Also trace in this water; default: if the scene's own asks for it.
    """

    def __init__(
        self,
        scene: Scene,
        readings: Any,
        diffuse: DiffuseSource | None = None,
        full: float | None = None,
        width_deg: float | None = None,
        dense_per_m: float | None = None,
    ) -> None:
        self.scene, self.readings, self._source = scene, readings, diffuse
        self._response: Diffuse | None = None
        self._correction: Array | float = 1.0
        self._more_error: Array | float = 0.0
        self._air = np.asarray(readings.medium) == "air"
        self._time = np.nan_to_num(np.asarray(readings.time_s, float))
        self._full = float(np.max(np.abs(readings.value))) if full is None else full
        self._width = beam_width_deg(scene, readings) if width_deg is None else width_deg
        wavelength = np.asarray(readings.wavelength_nm, float)
        self._wavelengths, self._channel = np.unique(np.round(wavelength, 3), return_inverse=True)
        self._fields: OrderedDict[tuple[tuple[str, float], ...], Array] = OrderedDict()
        own = self.dense_water({}) if dense_per_m is None else None
        self._dense = trace_for(own) if own is not None else dense_per_m

    @property
    def size(self) -> int:
        return len(self._channel)

    @property
    def width_seen_deg(self) -> float:
        """Half width of the beam as the readings show it, see `beam_width_deg`."""
        return self._width

    @property
    def _colours(self) -> list[float | None]:
        return [None if np.isnan(w) else float(w) for w in self._wavelengths]

    @property
    def gain_names(self) -> tuple[str, ...]:
        """One gain per channel on a relative scale, one for all on an absolute one."""
        if len(self._wavelengths) == 1 or self.readings.scale == "absolute":
            return (GAIN,)
        return tuple(f"{GAIN}.{w:g}nm" for w in self._wavelengths)

    @property
    def has_diffuse(self) -> bool:
        """Can scattered and reflected light be predicted?"""
        return self._source is not None

    def at(self, share: float = 1.0, **places: Array) -> SceneForward:
        """The same scene at other places.

        Parameters
        ----------
        share : float
            Part of the photons that a trace there is worth.
        places : arrays of one length
            Positions, medium and time.
        """
        n = len(next(iter(places.values())))
        there = replace(self.readings.subset(np.zeros(n, int)), **places)
        source = partial(self._source, share=share) if self._source and share != 1 else self._source
        return SceneForward(self.scene, there, source, self._full, self._width, self._dense)

    def corrected(self, light: Array, stderr: Array, values: Mapping[str, float]) -> SceneForward:
        """A copy whose light is scaled, reading by reading, so that at `values` it equals a full render.

        Parameters
        ----------
        light, stderr : array, shape (n,)
            The render, for unit on-axis intensity.
        """
        out = SceneForward(self.scene, self.readings, self._source, self._full, self._width, self._dense)
        out._response = self._response
        field = out._field(values)
        out._fields.clear()
        out._correction, out._more_error = light / np.maximum(field, 1e-300), stderr
        return out

    def scene_at(self, values: Mapping[str, float], validate: bool = True) -> Scene:
        """The scene with these values; gains are not part of a scene."""
        return self.scene.with_values(
            {k: v for k, v in values.items() if not k.startswith(GAIN)}, validate=validate
        )

    def dense_water(self, values: Mapping[str, float]) -> float | None:
        """Scattering coefficient of the water if it is too dense for a trace in clear water, m^-1."""
        water = self.scene_at(values, validate=False).water
        middle = float(np.mean(self.scene.detector.bands_nm[0]))
        at = np.where(np.isnan(self._wavelengths), middle, self._wavelengths)
        return dense_water(scattering_per_m(water, at))

    def to_trace(self, found: Iterable[Mapping[str, float]]) -> float | None:
        """The trace that is still missing for the first of what was found in dense water, m^-1."""
        now = self._dense or CLEAR_PER_M
        asked = [trace_for(b, now) for values in found if (b := self.dense_water(values)) is not None]
        return asked[0] if asked and asked[0] != self._dense else None

    def factor_to_traced(self, values: Mapping[str, float]) -> float:
        """Factor by which dense water would have to scatter more to be the traced one; 1 in clear water."""
        b = self.dense_water(values)
        return self._dense / b if self._dense is not None and b is not None else 1.0

    def predict(self, values: Mapping[str, float]) -> Array:
        """Readings, shape (n,)."""
        return self.read(self._field(values), values)

    def errors(self, values: Mapping[str, float]) -> tuple[Array, Array]:
        """Errors of the predicted readings by their scattered and reflected light, before saturation.

        Returns
        -------
        modes : array, shape (n, k)
            Monte Carlo errors as independent contributions: covariance = modes @ modes.T; k = 0 without
            scattered and reflected light.
        smooth : array, shape (n,)
            Size of an error that varies little between neighbours.
        """
        scene = self.scene.with_values(_optical(values), validate=False)
        modes: Array = np.zeros((self.size, 0))
        smooth: Array = np.zeros(self.size)
        if has_diffuse_light(scene) and self._source is not None:
            modes, smooth = self._traced().errors(scene, self._colours, self._channel)
        factor = self._gain(values) * self.power(values)
        in_water = np.where(self._air, 0.0, factor * self._correction)
        modes, smooth = in_water[:, None] * modes, in_water * smooth
        if np.any(self._more_error):
            modes = np.hstack([modes, np.diag(factor * self._more_error)])
        return np.asarray(modes), np.asarray(smooth)

    def position_slope(self, values: Mapping[str, float]) -> Array:
        """|gradient| of the direct light's readings with respect to position, per metre, shape (n,)."""
        scene, step_m = self.scene_at(values, validate=False), 1e-3
        r, square = self.readings, np.zeros(self.size)
        for axis in ("x_m", "y_m", "z_m"):
            there = replace(r, **{axis: np.asarray(getattr(r, axis)) + step_m})
            square += ((self._direct(scene, there) - self._direct(scene, r)) / step_m) ** 2
        return np.asarray(np.sqrt(square) * self._gain(values))

    # -- inside ------------------------------------------------------------------------------------

    def _field(self, values: Mapping[str, float]) -> Array:
        """Light for unit on-axis intensity."""
        optical = _optical(values)
        key = tuple(sorted(optical.items()))
        if key in self._fields:
            self._fields.move_to_end(key)
            return self._fields[key]
        scene = self.scene.with_values(optical, validate=False)
        light: Array = self._direct(scene, self.readings)
        if has_diffuse_light(scene):
            light = light + self._diffuse(scene)
        self._fields[key] = np.asarray(light * self._correction)
        if len(self._fields) > _REMEMBERED:
            self._fields.popitem(last=False)
        return self._fields[key]

    def _traced(self) -> Diffuse:
        """The response of the diffuse light, traced when it is first needed."""
        assert self._source is not None
        if self._response is None:
            r = self.readings
            # The width that photons are sent with comes from the readings, not from the scene's guess: every
            # scene fitted to these readings then shares one response, and a stored rung gives the same
            # numbers again.
            traced = self.scene.with_values({"lamp.hwhm_deg": self._width}, validate=False)
            response = self._source(traced, r.x_m, r.y_m, r.z_m)
            if self._dense is not None:
                denser = self._source(traced, r.x_m, r.y_m, r.z_m, dense_per_m=self._dense)
                response = response.with_denser(denser)
            self._response = response
        return self._response

    def _diffuse(self, scene: Scene) -> Array:
        if self._source is None:
            return np.zeros(self.size)
        light = self._traced().light(scene, self._colours)
        return np.where(self._air, 0.0, light[self._channel, np.arange(self.size)])

    def _direct(self, scene: Scene, readings: Any) -> Array:
        return analytic.direct_field(
            scene,
            readings.x_m,
            readings.y_m,
            readings.z_m,
            wavelength_nm=readings.wavelength_nm,
            medium=readings.medium,
        )

    def _gain(self, values: Mapping[str, float]) -> Array:
        gains = np.array([values.get(name, 1.0) for name in self.gain_names])
        return np.asarray(gains[self._channel] if len(gains) > 1 else np.full(self.size, gains[0]))

    def power(self, values: Mapping[str, float]) -> Array:
        """Lamp power over its value at time zero, shape (n,)."""
        return analytic.time_factor(self._with(values, _TIME), self._time)

    def read(self, field: Array, values: Mapping[str, float]) -> Array:
        """Readings from light for unit on-axis intensity: gain, lamp power, background, saturation."""
        signal = self._gain(values) * field * self.power(values)
        return analytic.readout(self._with(values, READOUT), signal, self._full)

    def _with(self, values: Mapping[str, float], paths: Sequence[str]) -> Scene:
        """The scene with those of the values that lie at some paths."""
        chosen = {k: v for k, v in values.items() if k in paths}
        return self.scene.with_values(chosen, validate=False) if chosen else self.scene
