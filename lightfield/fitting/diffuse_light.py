"""Scattered and reflected light at the places of a table: traced when it is first needed, or followed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array
from lightfield.fitting.beam_width import beam_width_deg
from lightfield.formula.own_formulas import lit
from lightfield.memory import Latest
from lightfield.readings import Readings
from lightfield.readings.columns import WAVELENGTH_DECIMALS
from lightfield.render.diffuse.dense_water import CLEAR_PER_M, dense_water, trace_for
from lightfield.render.diffuse.followed import field_at
from lightfield.scene import Scene
from lightfield.scene.acts import DIFFUSE
from lightfield.scene.all_parameters import neutral
from lightfield.scene.bands import middles_nm, read_nm
from lightfield.scene.water.ageing import ages, at_time, moments
from lightfield.scene.water.coefficients import scattering_per_m

if TYPE_CHECKING:
    from typing_extensions import Self

    from lightfield.formula.scattered.scattered_field import ScatteredField
    from lightfield.scene.water.water import Water

#: Moments at which the scattered light of changing water is asked for: right to 1e-3 of it 8.5 m away in
#: water that goes from b = 0.3 per m to 0.01. Where nothing settles light goes nearly as the straight line
#: takes it, and two are right to 2e-4 where absorption changes by 0.1 per m; reflected light has longer ways:
#: three are right to 6e-4 where they are half as long again (tests/physics/found/test_ageing_water.py).
_MOMENTS, _MOMENTS_OF_REFLECTED, _FEWEST_MOMENTS = 4, 3, 2
#: Traces that an experiment remembers: in clear and in denser water, of a part of the photons and of all, of
#: four tables. Chosen: so that the memory of a long session has an end.
_TRACES = 16


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
    """The source of one experiment, which gives what it was asked for last from memory.

    Its tank, detector and phase function stay; a trace does not depend on the rest of a scene.
    """
    if source is None:
        return None
    made = Latest[tuple[object, ...], TracedDiffuse](_TRACES)

    def once(scene: Scene, *places: Array, **options: float) -> TracedDiffuse:
        key = (*(np.asarray(p, float).tobytes() for p in places), *sorted(options.items()))
        if key not in made:
            made[key] = source(scene, *places, **options)
        return made[key]

    return once


def has_diffuse_light(scene: Scene) -> bool:
    """Does the scene scatter or reflect any light?

    A table of water may say that it scatters none.
    """
    if neutral(scene, DIFFUSE):
        return False
    if scene.water.base != "table" or scene.reflects:
        return True
    return bool(scattering_per_m(scene.water, middles_nm(scene).ravel()).any())


@dataclass(frozen=True, eq=False)
class DiffuseLight:
    """Scattered and reflected light of scenes at the places of a table, for unit on-axis intensity.

    Parameters
    ----------
    scene : Scene
        With its lamp, as wide as `width_deg` says, photons are sent.
    trace : callable, optional
        `response_for(scene, x_m, y_m, z_m, share=1.0, dense_per_m=None)`: traces once the scattered and
        reflected light, with that part of its photons, in clear water or one that scatters so much. None:
        there is no such light.
    width_deg : float
        Half width of the beam as the readings show it. Photons are sent with it, not with the scene's guess:
        every scene fitted to these readings shares one response, and a stored rung gives the same numbers
        again.
    dense_per_m : float, optional, m^-1
        Also trace in this water.
    part_of : (DiffuseLight, array of bool), optional
        Whose readings these are some of, and which: what is traced is traced for all of them.
    followed : Diffuse, optional
        Scattered and reflected light in place of what `trace` makes, at these very readings.
    """

    scene: Scene
    readings: Readings
    trace: DiffuseSource | None
    width_deg: float
    dense_per_m: float | None
    part_of: tuple[DiffuseLight, NDArray[np.bool_]] | None = None
    followed: Diffuse | None = None

    @classmethod
    def of(
        cls, scene: Scene, readings: Readings, trace: DiffuseSource | None, dense_per_m: float | None
    ) -> DiffuseLight:
        """With the width that the readings show, traced in dense water if the scene's own asks for it."""
        out = cls(scene, readings, trace, beam_width_deg(scene, readings), dense_per_m)
        own = out.dense_water(scene) if dense_per_m is None else None
        return replace(out, dense_per_m=trace_for(own)) if own is not None else out

    def at(self, readings: Readings, share: float) -> DiffuseLight:
        """The same at the places of other readings, with a part of the photons."""
        trace = partial(self.trace, share=share) if self.trace and share != 1 else self.trace
        return DiffuseLight(self.scene, readings, trace, self.width_deg, self.dense_per_m)

    def subset(self, rows: NDArray[np.bool_]) -> DiffuseLight:
        """The same at some of the readings, of every channel some."""
        return replace(self, readings=self.readings.subset(rows), part_of=(self, rows), followed=None)

    @cached_property
    def channels(self) -> tuple[Array, NDArray[np.int_]]:
        """Wavelengths in nm, each once, NaN for the band; index of each reading's among them, shape (n,)."""
        wavelength = np.asarray(self.readings.wavelength_nm, float)
        return np.unique(np.round(wavelength, WAVELENGTH_DECIMALS), return_inverse=True)

    @property
    def wavelengths_nm(self) -> Array:
        """Wavelength of each channel, the middle of the band where the table has none."""
        middle = float(np.mean(self.scene.detector.bands_nm[0]))
        return np.where(np.isnan(self.channels[0]), middle, self.channels[0])

    def is_in(self, scene: Scene) -> bool:
        """Does the scene scatter or reflect light, and is it known how much?"""
        return self.trace is not None and has_diffuse_light(scene)

    def light(self, scene: Scene) -> Array:
        """That of a scene, shape (n,)."""
        if not self.is_in(scene):
            return np.zeros(len(self.channels[1]))
        return np.where(self._wet, self._at_its_times(lit(scene)), 0.0)

    def errors(self, scene: Scene) -> tuple[Array, Array]:
        """Monte Carlo errors as independent contributions, shape (n, k); size of an error that varies little
        between neighbours, shape (n,)."""
        n = len(self.channels[1])
        if not self.is_in(scene):
            return np.zeros((n, 0)), np.zeros(n)
        scene = lit(scene)
        modes, smooth = self.solved.errors(scene, self._colours(scene), self.channels[1])
        return modes * self._wet[:, None], smooth * self._wet

    def dense_water(self, scene: Scene) -> float | None:
        """Scattering coefficient of a scene's water if it is too dense for a trace in clear water, m^-1."""
        return dense_water(scattering_per_m(scene.water, self.wavelengths_nm))

    def to_trace(self, found: Iterable[Scene]) -> float | None:
        """The trace that is still missing for the first of what was found in dense water, m^-1; none where
        light was traced at a fit."""
        if self.followed is not None:
            return None
        now = self.dense_per_m or CLEAR_PER_M
        asked = [trace_for(b, now) for scene in found if (b := self.dense_water(scene)) is not None]
        return asked[0] if asked and asked[0] != self.dense_per_m else None

    def factor_to_traced(self, scene: Scene) -> float:
        """Factor by which dense water would have to scatter more to be the traced one; 1 in clear water."""
        b = self.dense_water(scene)
        return self.dense_per_m / b if self.dense_per_m is not None and b is not None else 1.0

    @cached_property
    def solved(self) -> Diffuse:
        """What tells the light: followed, or traced, for these readings or for those they are a part of."""
        if self.followed is not None:
            return self.followed
        if self.part_of is not None:
            whole, rows = self.part_of
            return whole.solved.some(rows)
        return self.traced

    @cached_property
    def traced(self) -> TracedDiffuse:
        """As `trace` makes it, at these very readings."""
        assert self.trace is not None
        r = self.readings
        sent = self.scene.with_values({"lamp.hwhm_deg": self.width_deg}, validate=False)
        response = self.trace(sent, r.x_m, r.y_m, r.z_m)
        if self.dense_per_m is None:
            return response
        return response.with_denser(self.trace(sent, r.x_m, r.y_m, r.z_m, dense_per_m=self.dense_per_m))

    @cached_property
    def field(self) -> ScatteredField:
        """Scattered light at the readings as far as it is known without photons."""
        return field_at((self.readings.x_m, self.readings.y_m, self.readings.z_m))

    def _at_its_times(self, scene: Scene) -> Array:
        """Light, where need be at a few moments of the water and between, shape (n,)."""
        if ages(scene.water):
            at, shares = moments(scene.water, self.readings.time_s, self._straight_m, _moments(scene))
            waters = [at_time(scene.water, float(t)) for t in at]
            now = self._in_waters(scene, waters)
            return np.asarray((shares * np.array(now)).sum(axis=0))
        return self._of_channels(self.solved.light(scene, self._colours(scene)))

    def _in_waters(self, scene: Scene, waters: Sequence[Water]) -> list[Array]:
        """Light in each of some waters, see `ManyWaters`, each of shape (n,)."""
        scenes = [scene.model_copy(update={"water": water}) for water in waters]
        if isinstance(self.solved, ManyWaters):
            every = self.solved.in_waters(scenes[0], waters, self._colours(scene))
            return [self._of_channels(one) for one in every]
        return [self._at_its_times(one) for one in scenes]

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


def _moments(scene: Scene) -> int:
    """Of how many moments light is asked for."""
    if scene.water.settling_per_m:
        return _MOMENTS
    return _MOMENTS_OF_REFLECTED if scene.reflects else _FEWEST_MOMENTS
