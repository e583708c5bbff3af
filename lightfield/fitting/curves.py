"""Curves that a fit may lay over a scene: departures from what the base model says of lamp, water and time.

A scene states such a curve by its nodes (`scene/curve.py`); a fit moves amplitudes of smooth functions
(`smooth_functions.py`). What the base model can do by itself costs no roughness and is left out, so that
every curve is a departure from it and nothing else:

    lamp.profile_departure      s(theta), I = I_base exp(s)   int (s'' - s'/theta)^2   without 1, theta^2
    water.absorption_departure  k(z), K = K_base + k          int k'^2                 without 1
    lamp.power_departure        q(t), power = base exp(q)     int q''^2                without 1
    lamp.spectrum_departure     p(l), power = base exp(p)     int p''^2                without 1
    water.colour_departure      k(l), K = K_base + k          int k''^2                without 1
    water.scattering_departure  s(l), b = b_stated exp(s)     int s''^2                without 1
    detector.plane_departure    g(z), gain = exp(g)           none: each plane's own   without 1, z
    detector.background_departure  b(l), background + b       int b''^2                without nothing
    detector.background_course     b(t), background + b       int b''^2                without nothing

An amplitude is the weighted rms of what its function changes in the logarithm of the readings; of
scattering in that of the coefficient; of a background, which is added, the most that it adds, over the
brightest reading.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array
from lightfield.fitting.beam_width import WIDTH, beam_width_deg
from lightfield.fitting.smooth_functions import NODES, Basis, Family, basis_of, bent
from lightfield.formula.path import rays
from lightfield.readings import Readings
from lightfield.readings.columns import LINE_DECIMALS
from lightfield.scene import Scene
from lightfield.scene.curve import LARGEST_OF_BEAM, Nodes, integral_to, sum_of, value_at
from lightfield.scene.lamp.frame import beam_angles
from lightfield.scene.lamp.profile import radial_intensity
from lightfield.scene.lamp.section import effective_angles
from lightfield.scene.parameters import Parameter

PROFILE, ABSORPTION, POWER = ("lamp.profile_departure", "water.absorption_departure", "lamp.power_departure")
SPECTRUM, COLOUR, PLANES = "lamp.spectrum_departure", "water.colour_departure", "detector.plane_departure"
BACKGROUND, AMBIENT, HALO = (
    "detector.background_departure",
    "detector.background_course",
    "water.scattering_departure",
)
FIELDS = (PROFILE, ABSORPTION, POWER, SPECTRUM, COLOUR, HALO, PLANES, BACKGROUND, AMBIENT)
#: Most functions of each: of a lamp's profile 7 left rings and flat tops unexplained that 11 explain, and 11
#: a measured flood with a steep edge and a step (what 7, 11 and 19 miss of 105 readings without noise: 1676,
#: 136, 17 in chi-square; lamps of `benchmarks/many_effects`), and 19 a flat top whose edge falls by a factor
#: of ten within 0.7 degrees (chi-square per reading 6.0, with 31 1.2: `test_lamps`), and 31 the tip of a cone
#: and dark rings, whose rest scattering and an apparent source took (`benchmarks/lamps`). K(z) at five
#: distances has three, and hardly more are told apart at fifteen; six are a lamp's warm-up and a step. Eight
#: follow the colour of a filter or of pigments 50 nm apart. Planes have a gain each, or are not asked. Of
#: the sun between clouds, over 154 readings, six functions leave four times the chi-square of twelve.
_MOST = {
    PROFILE: 51,
    ABSORPTION: 4,
    POWER: 6,
    SPECTRUM: 8,
    COLOUR: 8,
    HALO: 8,
    PLANES: 30,
    BACKGROUND: 8,
    AMBIENT: 24,
}
#: Nodes of a lamp's profile: one in a quarter of a degree where readings reach 25. A flat top with a ring
#: falls by a factor of eight within a degree; with 61 nodes its edge was told to be a ripple over the angle,
#: and chi-square per reading stayed at 4.8 (1.8 with these). Chosen.
_PROFILE_NODES = 121
#: The most that a function of a lamp's profile bends: root of the integral of its squared second derivative
#: over the angle in half widths. Between dim readings far out, where nothing else holds it, a curve else rose
#: to 1e3 times the lamp, and fits ended in valleys beside; flat tops with edges of a fifteenth of their half
#: width need no more than 30, with kinks 100. Chosen, by three flat tops and five other draws of the formulas
#: of `benchmarks/lamps`.
_MOST_BENT = 100.0
#: Power of the width in that: derived.
_BY_WIDTH = 1.5
#: Readings that a plane has, in the mean, where its gain is asked for: fewer are all that a gain
#: is made of. Chosen.
_EACH = 3
#: Angles are tabulated up to so many times the largest read: tilt and offset move the axis. Chosen.
BEYOND = 1.3
#: Unknown errors are 1 % of the reading and 0.1 % of the brightest, as a diagnosis assumes. Readings are
#: taken for this part of the brightest at least: with 0.02 dim angles outweigh the beam, whose width is then
#: hardly told from the curve; with none, functions are stiff where it is dim, and a background that is fitted
#: beside them takes the blame, by one sigma. Chosen between.
_RELATIVE, _FLOOR, _DIM = 0.01, 0.001, 0.005
#: Roughness counts by the area of its ring, and on the axis by this part of the outermost ring's. Chosen.
_ON_AXIS = 0.1
#: So many wavelengths tell a bend from a slope: derived.
_A_BEND = 3
#: Paths of which is remembered whether they are amplitudes. Chosen: memory alone.
_PATHS = 4096
#: So many curves are remembered by their amplitudes. Chosen: memory alone.
_REMEMBERED = 32

#: Values by path as a scene takes them: numbers, and nodes of curves.
Stated = Mapping[str, Any]

_AMPLITUDES = tuple(f"{field}." for field in FIELDS)


@lru_cache(_PATHS)
def is_amplitude(path: str) -> bool:
    """Is it the name of an amplitude?"""
    return path.startswith(_AMPLITUDES)


def field_of(path: str) -> str:
    """The scene's field that a value changes: of an amplitude the curve's."""
    return path.rpartition(".")[0] if is_amplitude(path) else path


class Curves:
    """Curves over one scene, smooth in the sense of one table of readings.

    Parameters
    ----------
    scene : Scene
        What it has of curves stays: those of a fit are added.
    """

    def __init__(self, scene: Scene, readings: Readings) -> None:
        self.scene, self.readings = scene, readings

    @cached_property
    def bases(self) -> dict[str, Basis]:
        """Basis of every curve that the readings can tell of, by the scene's field."""
        found = (self._profile(), self._absorption(), self._power())
        more = (
            self._spectrum(),
            self._colour(),
            self._halo(),
            self._planes(),
            self._daylight(),
            self._ambient(),
        )
        return {basis.field: basis for basis in (*found, *more) if basis is not None}

    @cached_property
    def parameters(self) -> dict[str, Parameter]:
        """Every amplitude by its path."""
        return {
            path: Parameter(path, "1", f"amplitude {k} of {field}", -end, end, 0.0, 0.0)
            for field, basis in self.bases.items()
            for k, (path, end) in enumerate(basis.ends.items(), 1)
        }

    def stated(self, values: Mapping[str, float]) -> Stated:
        """Values as a scene takes them: nodes of curves in place of their amplitudes."""
        amplitudes = {k: v for k, v in values.items() if is_amplitude(k)}
        if not amplitudes:
            return dict(values)
        out: dict[str, Any] = {k: v for k, v in values.items() if k not in amplitudes}
        for field, basis in self.bases.items():
            own = tuple(amplitudes.get(path, 0.0) for path in basis.paths)
            if any(own):
                out[field] = self._nodes(field, own, values.get(WIDTH) if field == PROFILE else None)
        return out

    @cached_property
    def _nodes(self) -> Callable[[str, tuple[float, ...], float | None], Nodes]:
        """Nodes of a curve with these amplitudes, over a beam of this width; most steps of a fit change
        something else."""

        def nodes(field: str, amplitudes: tuple[float, ...], width_deg: float | None) -> Nodes:
            basis = self.bases[field]
            curve = basis.curve(np.array(amplitudes))
            if field == PROFILE:
                curve = self._dim_beyond(basis.place, curve, width_deg)
            return self._with_stated(field, basis.place, curve)

        return lru_cache(_REMEMBERED)(nodes)

    def _dim_beyond(self, place: Array, curve: Array, width_deg: float | None) -> Array:
        """A departure of the lamp's profile with which no lamp is brighter beyond the largest angle that was
        read than there: nothing holds it where it goes on as it ended, up at times. Where a table is dark
        there, all beyond is as dark as a departure can make it."""
        lamp = self.scene.lamp
        if width_deg is not None:
            lamp = lamp.model_copy(update={"hwhm_deg": width_deg})
        light = np.log(np.maximum(radial_intensity(lamp, np.radians(place) ** 2), np.finfo(float).tiny))
        beyond = place > place[-1] / BEYOND
        last = int(np.argmax(beyond)) - 1
        most = np.maximum(curve[last] + light[last] - light, -LARGEST_OF_BEAM)
        return np.where(beyond, np.minimum(curve, most), curve)

    def _with_stated(self, field: str, place: Array, curve: Array) -> Nodes:
        """Nodes of a curve together with what the scene has already."""
        return sum_of(self.scene.get(field), tuple(zip(place.tolist(), curve.tolist(), strict=True)))

    @cached_property
    def _top(self) -> float:
        """The brightest reading."""
        value = np.asarray(self.readings.value, float)[~np.asarray(self.readings.saturated, bool)]
        return float(np.abs(value).max(initial=0.0)) or 1.0

    @cached_property
    def light(self) -> Array:
        """What a reading is taken for, shape (n,)."""
        return np.asarray(np.maximum(np.asarray(self.readings.value, float), _DIM * self._top))

    @cached_property
    def weight(self) -> Array:
        """1 / (relative error of a reading)^2, shape (n,); 0 where it is saturated."""
        value, stderr = np.asarray(self.readings.value, float), np.asarray(self.readings.stderr, float)
        known = np.isfinite(stderr) & (stderr > 0)
        sigma = np.where(known, stderr, _RELATIVE * np.abs(value) + _FLOOR * self._top)
        return np.where(self.readings.saturated, 0.0, (self.light / sigma) ** 2)

    def _profile(self) -> Basis | None:
        lamp, r = self.scene.lamp, self.readings
        if lamp.profile in ("isotropic", "pencil"):
            return None
        ray = rays(lamp, *(np.asarray(v, float) for v in (r.x_m, r.y_m, r.z_m)))
        across, up = beam_angles(lamp, ray.dx, ray.dy, ray.dz)
        theta = np.degrees(np.hypot(*effective_angles(lamp, across, up)))
        place = np.linspace(0.0, BEYOND * float(theta.max()), _PROFILE_NODES)
        if place[-1] <= 0:
            return None
        x = place / place[-1]
        step = x[1]
        rough = np.zeros((len(x), len(x)))
        for i in range(1, len(x) - 1):
            ring = np.sqrt(min(x[i] + _ON_AXIS, 1.0))
            rough[i, i - 1 : i + 2] += ring * np.array([1.0, -2.0, 1.0])
            rough[i, [i - 1, i + 1]] += ring * np.array([0.5, -0.5]) * step / x[i]
        # A table's width is not fitted: there the angle's square is a function like others.
        known = 1 if lamp.profile == "table" else 2
        family = Family(place, rough, [np.ones_like(x), x**2], known)
        found = self._basis(PROFILE, family, theta, value_at)
        # What could contradict it is not other angles alone, but the other places at each.
        where = np.stack([np.asarray(v, float) for v in (r.x_m, r.y_m, r.z_m)])[:, self.weight > 0]
        places = len(np.unique(np.round(where, LINE_DECIMALS), axis=1).T)
        if found is None:
            return None
        # Six half widths off its axis a Gaussian is down by e^25, a lamp with a skirt by e^8: held to what
        # other curves may be, a lamp's would miss readings.
        most, width = LARGEST_OF_BEAM, beam_width_deg(self.scene, r)
        largest = _MOST_BENT / (found.bends * width**_BY_WIDTH)
        return replace(found, told=max(found.told, places - known), most=most, largest=largest)

    def _absorption(self) -> Basis | None:
        r = self.readings
        wet = np.asarray(r.medium) != "air"
        z = np.asarray(r.z_m, float)
        wet &= z > 0
        if not wet.any() or np.ptp(z[wet]) <= 0:
            return None
        place, z = np.linspace(z[wet].min(), z[wet].max(), NODES), np.where(wet, z, z[wet].min())
        lamp = self.scene.lamp
        way = rays(lamp, *(np.asarray(v, float) for v in (r.x_m, r.y_m, r.z_m))).water_m
        steep = np.where(wet, way / np.where(wet, z, 1.0), 0.0)

        def depth(nodes: Nodes, at: Array) -> Array:
            return np.asarray(-integral_to(nodes, at) * steep)

        family = Family(place, np.diff(np.eye(NODES), axis=0), [np.ones(NODES)], 1, beside=1)
        return self._basis(ABSORPTION, family, z, depth, gains=np.zeros(len(z), int))

    def _power(self) -> Basis | None:
        time = np.asarray(self.readings.time_s, float)
        known = np.isfinite(time)
        if not known.all() or np.ptp(time) <= 0:
            return None
        return self._basis(POWER, bent(time), time, value_at)

    @cached_property
    def _colours(self) -> Array | None:
        """Wavelength of every reading, nm, shape (n,); None where one is unknown, or all are one."""
        wave = np.asarray(self.readings.wavelength_nm, float)
        return wave if np.isfinite(wave).all() and np.ptp(wave) > 0 else None

    def _spectrum(self) -> Basis | None:
        # On a relative scale each wavelength has a gain of its own, and the lamp's spectrum is part of it.
        wave = self._colours
        if wave is None or self.readings.scale != "absolute":
            return None
        found = self._basis(SPECTRUM, bent(wave), wave, value_at)
        return found and self._by_its_readings(found, wave)

    def _colour(self) -> Basis | None:
        wave, r = self._colours, self.readings
        wet = np.asarray(r.medium) != "air"
        # In water without a base the absorption is free at every wavelength.
        if wave is None or not wet.any() or self.scene.water.base == "none":
            return None
        ray = rays(self.scene.lamp, *(np.asarray(v, float) for v in (r.x_m, r.y_m, r.z_m)))
        way = np.where(wet, ray.water_m, 0.0)

        def depth(nodes: Nodes, at: Array) -> Array:
            return np.asarray(-value_at(nodes, at) * way)

        every = np.unique(wave, return_inverse=True)[1]
        gains = np.zeros(len(wave), int) if r.scale == "absolute" else every
        found = self._basis(COLOUR, bent(wave), wave, depth, gains)
        return found and self._by_its_readings(found, wave)

    def _halo(self) -> Basis | None:
        wave, r = self._colours, self.readings
        wet = np.asarray(r.medium) != "air"
        # Between two wavelengths every curve is a slope.
        if wave is None or len(np.unique(wave[wet])) < _A_BEND:
            return None
        found = self._basis(HALO, bent(wave), wave, value_at)
        return found and self._by_its_readings(found, wave)

    def _by_its_readings(self, found: Basis, wave: Array) -> Basis:
        """What could contradict a curve over wavelengths is not others, but the other readings of each."""
        used = self.weight > 0
        return replace(found, told=int(used.sum()) - len(np.unique(wave[used])))

    def _daylight(self) -> Basis | None:
        wave = self._colours
        if wave is None:
            return None
        found = self._added(BACKGROUND, wave)
        return found and self._by_its_readings(found, wave)

    def _ambient(self) -> Basis | None:
        time = np.asarray(self.readings.time_s, float)
        return self._added(AMBIENT, time) if np.isfinite(time).all() and np.ptp(time) > 0 else None

    def _added(self, field: str, at: Array) -> Basis | None:
        """Readings without the lamp over a coordinate: amplitudes are the most that is added."""

        def added(nodes: Nodes, at: Array) -> Array:
            return np.asarray(value_at(nodes, at) / self.light)

        found = self._basis(field, replace(bent(at), known=0), at, added)
        if found is None:
            return None
        unit = self._top / np.abs(found.functions).max(axis=0)
        return replace(found, functions=found.functions * unit, size=found.size * unit, most=np.inf)

    def _planes(self) -> Basis | None:
        z = np.asarray(self.readings.z_m, float)
        place = np.unique(np.round(z, LINE_DECIMALS))
        used = int((self.weight > 0).sum())
        if not 2 < len(place) <= _MOST[PLANES] + 2 or used < _EACH * len(place):
            return None
        smooth = [np.ones(len(place)), place - place.mean()]
        found = self._basis(PLANES, Family(place, np.eye(len(place)), smooth, 2), z, value_at)
        # What could contradict them is not other planes, but the other readings of each.
        return found and replace(found, told=used - len(smooth))

    def _basis(
        self,
        field: str,
        family: Family,
        at: Array,
        acts: Callable[[Nodes, Array], Array],
        gains: NDArray[np.int_] | None = None,
    ) -> Basis | None:
        return basis_of(field, family, at, self.weight, acts, _MOST[field], gains)
