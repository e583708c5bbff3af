"""Curves that a fit may lay over a scene: departures from what the base model says of lamp, water and time.

A scene states such a curve by its nodes (`scene/curve.py`); a fit moves amplitudes of smooth functions. They
are those of Demmler and Reinsch (1975, Numer. Math. 24, 375-382): of all curves, those that
are least rough for what they change in the readings, the smoothest first. What the base model can do by
itself costs no roughness and is left out, so that every curve is a departure from it and nothing else:

    lamp.profile_departure      s(theta), I = I_base exp(s)   int (s'' - s'/theta)^2   without 1, theta^2
    water.absorption_departure  k(z), K = K_base + k          int k'^2                 without 1
    lamp.power_departure        q(t), power = base exp(q)     int q''^2                without 1
    lamp.spectrum_departure     p(l), power = base exp(p)     int p''^2                without 1
    water.colour_departure      k(l), K = K_base + k          int k''^2                without 1
    detector.plane_departure    g(z), gain = exp(g)           none: each plane's own   without 1, z

An amplitude is the weighted rms of what its function changes in the logarithm of the readings.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from lightfield.arrays import Array
from lightfield.formula.path import rays
from lightfield.readings import Readings
from lightfield.scene import Scene
from lightfield.scene.curve import Nodes, integral_to, value_at
from lightfield.scene.lamp.frame import beam_angles
from lightfield.scene.lamp.profile import effective_angles
from lightfield.scene.parameters import Parameter

PROFILE, ABSORPTION, POWER = (
    "lamp.profile_departure",
    "water.absorption_departure",
    "lamp.power_departure",
)
SPECTRUM, COLOUR, PLANES = "lamp.spectrum_departure", "water.colour_departure", "detector.plane_departure"
FIELDS = (PROFILE, ABSORPTION, POWER, SPECTRUM, COLOUR, PLANES)
#: Most functions of each: of a lamp's profile 7 left rings and flat tops unexplained that 11 explain, and 11
#: a measured flood with a steep edge and a step (what 7, 11 and 19 miss of 105 readings without noise: 1676,
#: 136, 17 in chi-square; lamps of `benchmarks/many_effects`); K(z) at five distances has three, and hardly
#: more are told apart at fifteen; six are a lamp's warm-up and a step. Eight follow the colour of a filter or
#: of pigments 50 nm apart. Planes have a gain each, or are not asked.
MOST = {PROFILE: 19, ABSORPTION: 4, POWER: 6, SPECTRUM: 8, COLOUR: 8, PLANES: 30}
#: Readings that a plane has, in the mean, where its gain is asked for: fewer are all that a gain
#: is made of. Chosen.
_EACH = 3
#: Decimals in metres to which distances are one plane.
_PLANE_DECIMALS = 3
#: Nodes of a curve: three for each bend of the finest function. Chosen.
NODES = 61
#: Angles are tabulated up to so many times the largest read: tilt and offset move the axis. Chosen.
BEYOND = 1.3
#: A curve that a fit tries is clipped here, a factor of 1100: no lamp has more, and no number overflows.
LARGEST = 7.0
#: Unknown errors are 1 % of the reading and 0.1 % of the brightest, as a diagnosis assumes. Readings are
#: taken for this part of the brightest at least: with 0.02 dim angles outweigh the beam, whose width is then
#: hardly told from the curve; with none, functions are stiff where it is dim, and a background that is fitted
#: beside them takes the blame, by one sigma. Chosen between.
_RELATIVE, _FLOOR, _DIM = 0.01, 0.001, 0.005
#: Roughness counts by the area of its ring, and on the axis by this part of the outermost ring's. Chosen.
_ON_AXIS = 0.1
#: What differs by less is one: coordinates, as a part of their range; curves, of their largest value.
_SAME_PART = 1e-6
#: What rounding leaves of the largest eigenvalue.
_ROUNDING = 1e-10
#: So many curves are remembered by their amplitudes.
_REMEMBERED = 32
#: All that has no second differences: of lamps and waters over time and wavelength.
_LINES: list[Array] = [np.ones(NODES), np.linspace(-1, 1, NODES)]

#: Values by path as a scene takes them: numbers, and nodes of curves.
Stated = Mapping[str, Any]


@dataclass(frozen=True)
class Basis:
    """Functions of a curve, on its nodes.

    Parameters
    ----------
    field : str
        Dotted path of the scene's curve.
    place : array, shape (n_nodes,)
        deg, m, s or nm.
    functions : array, shape (n_nodes, n_functions)
        ln of a factor, or m^-1.
    told : int
        So many functions would follow any readings at all along this coordinate.
    """

    field: str
    place: Array
    functions: Array
    told: int

    @cached_property
    def paths(self) -> tuple[str, ...]:
        """One per amplitude."""
        return tuple(path_of(self.field, k) for k in range(1, self.functions.shape[1] + 1))

    def curve(self, amplitudes: Array) -> Array:
        """The curve at its nodes, shape (n_nodes,)."""
        return np.asarray(np.clip(self.functions[:, : len(amplitudes)] @ amplitudes, -LARGEST, LARGEST))

    def amplitudes(self, values: Mapping[str, float]) -> Array:
        """Amplitudes of all functions among the values of a fit; 0 where it has none."""
        return np.array([values.get(path, 0.0) for path in self.paths])


@dataclass(frozen=True, eq=False)
class _Family:
    """Curves on nodes, and which of them are rough.

    Parameters
    ----------
    place : array, shape (n_nodes,)
    rough : array, shape (k, n_nodes)
        Square root of the roughness of a curve by its nodes.
    smooth : list of array, shape (n_nodes,)
        All that is not rough.
    known : int
        So many of them the base model has; the others are functions too.
    """

    place: Array
    rough: Array
    smooth: list[Array]
    known: int


def _bent(at: Array) -> _Family:
    """Curves over a coordinate that are rough where they bend; the base model has their level."""
    place = np.linspace(at.min(), at.max(), NODES)
    return _Family(place, np.diff(np.eye(NODES), 2, axis=0), _LINES, 1)


def path_of(field: str, k: int) -> str:
    """Name of the k-th amplitude of a curve, k = 1, 2..."""
    return f"{field}.{k}"


_AMPLITUDES = tuple(f"{field}." for field in FIELDS)


@cache
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
        more = (self._spectrum(), self._colour(), self._planes())
        return {basis.field: basis for basis in (*found, *more) if basis is not None}

    @cached_property
    def parameters(self) -> dict[str, Parameter]:
        """Every amplitude by its path."""
        return {
            path: Parameter(path, "1", f"amplitude {k} of {field}", -LARGEST, LARGEST, 0.0, 0.0)
            for field, basis in self.bases.items()
            for k, path in enumerate(basis.paths, 1)
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
                out[field] = self._nodes(field, own)
        return out

    @cached_property
    def _nodes(self) -> Callable[[str, tuple[float, ...]], Nodes]:
        """Nodes of a curve with these amplitudes; most steps of a fit change something else."""

        def nodes(field: str, amplitudes: tuple[float, ...]) -> Nodes:
            basis = self.bases[field]
            return self._added(field, basis.place, basis.curve(np.array(amplitudes)))

        return lru_cache(_REMEMBERED)(nodes)

    def _added(self, field: str, place: Array, curve: Array) -> Nodes:
        """Nodes of a curve together with what the scene has already."""
        own: Nodes = self.scene.get(field)
        if own:
            every = np.union1d(place, [at for at, _ in own])
            place, curve = every, np.interp(every, place, curve) + value_at(own, every)
        return tuple(zip(place.tolist(), curve.tolist(), strict=True))

    @cached_property
    def _weight(self) -> Array:
        """1 / (relative error of a reading)^2, shape (n,); 0 where it is saturated."""
        value, stderr = np.asarray(self.readings.value, float), np.asarray(self.readings.stderr, float)
        used = ~np.asarray(self.readings.saturated, bool)
        top = float(np.abs(value[used]).max(initial=0.0)) or 1.0
        light = np.maximum(value, _DIM * top)
        known = np.isfinite(stderr) & (stderr > 0)
        sigma = np.where(known, stderr, _RELATIVE * np.abs(value) + _FLOOR * top)
        return np.where(used, (light / sigma) ** 2, 0.0)

    def _profile(self) -> Basis | None:
        lamp, r = self.scene.lamp, self.readings
        if lamp.profile in ("isotropic", "pencil"):
            return None
        ray = rays(lamp, *(np.asarray(v, float) for v in (r.x_m, r.y_m, r.z_m)))
        across, up = beam_angles(lamp, ray.dx, ray.dy, ray.dz)
        theta = np.degrees(np.hypot(*effective_angles(lamp, across, up)))
        place = np.linspace(0.0, BEYOND * float(theta.max()), NODES)
        if place[-1] <= 0:
            return None
        x = place / place[-1]
        step = x[1]
        rough = np.zeros((NODES, NODES))
        for i in range(1, NODES - 1):
            ring = np.sqrt(min(x[i] + _ON_AXIS, 1.0))
            rough[i, i - 1 : i + 2] += ring * np.array([1.0, -2.0, 1.0])
            rough[i, [i - 1, i + 1]] += ring * np.array([0.5, -0.5]) * step / x[i]
        # A table's width is not fitted: there the angle's square is a function like others.
        known = 1 if lamp.profile == "table" else 2
        family = _Family(place, rough, [np.ones(NODES), x**2], known)
        found = self._basis(PROFILE, family, theta, value_at)
        # What could contradict it is not other angles alone, but the other places at each.
        where = np.stack([np.asarray(v, float) for v in (r.x_m, r.y_m, r.z_m)])[:, self._weight > 0]
        places = len(np.unique(np.round(where, _PLANE_DECIMALS), axis=1).T)
        return found and replace(found, told=max(found.told, places - known))

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

        family = _Family(place, np.diff(np.eye(NODES), axis=0), [np.ones(NODES)], 1)
        return self._basis(ABSORPTION, family, z, depth, gains=np.zeros(len(z), int))

    def _power(self) -> Basis | None:
        time = np.asarray(self.readings.time_s, float)
        known = np.isfinite(time)
        if not known.all() or np.ptp(time) <= 0:
            return None
        return self._basis(POWER, _bent(time), time, value_at)

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
        found = self._basis(SPECTRUM, _bent(wave), wave, value_at)
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
        found = self._basis(COLOUR, _bent(wave), wave, depth, gains)
        return found and self._by_its_readings(found, wave)

    def _by_its_readings(self, found: Basis, wave: Array) -> Basis:
        """What could contradict a curve over wavelengths is not others, but the other readings of each."""
        used = self._weight > 0
        return replace(found, told=int(used.sum()) - len(np.unique(wave[used])))

    def _planes(self) -> Basis | None:
        z = np.asarray(self.readings.z_m, float)
        place = np.unique(np.round(z, _PLANE_DECIMALS))
        used = int((self._weight > 0).sum())
        if not 2 < len(place) <= MOST[PLANES] + 2 or used < _EACH * len(place):
            return None
        smooth = [np.ones(len(place)), place - place.mean()]
        found = self._basis(PLANES, _Family(place, np.eye(len(place)), smooth, 2), z, value_at)
        # What could contradict them is not other planes, but the other readings of each.
        return found and replace(found, told=used - len(smooth))

    def _basis(
        self,
        field: str,
        family: _Family,
        at: Array,
        acts: Callable[[Nodes, Array], Array],
        gains: NDArray[np.int_] | None = None,
    ) -> Basis | None:
        """Functions of Demmler and Reinsch on nodes.

        Parameters
        ----------
        at : array, shape (n,)
            Coordinate of every reading.
        acts : callable
            What nodes change in the logarithm of the readings: `acts(nodes, at)`, linear in their values.
        gains : array of int, shape (n,), optional
            Readings that share a gain, which the base model has as well: no curve is one.
        """
        weight, place = self._weight, family.place
        count = len(place)
        design = np.empty((len(at), count))
        for j in range(count):
            unit = np.zeros(count)
            unit[j] = 1.0
            design[:, j] = acts(tuple(zip(place.tolist(), unit.tolist(), strict=True)), at)
        if gains is not None:
            total = np.maximum(np.bincount(gains, weight), np.finfo(float).tiny)
            mean = np.stack([np.bincount(gains, weight * column) / total for column in design.T], axis=1)
            design = design - mean[gains]
        metric = design.T @ (weight[:, None] * design) / weight.sum()
        functions: list[Array] = []
        taken: list[Array] = []
        for k, one in enumerate(family.smooth):
            rest = one - sum((t * (t @ metric @ one) for t in taken), np.zeros(count))
            size = float(np.sqrt(max(rest @ metric @ rest, 0.0)))
            if size <= _SAME_PART * float(np.abs(design @ one).max()):
                return None
            taken.append(rest / size)
            if k >= family.known:
                functions.append(rest / size)
        # All that is orthogonal to what is not rough; there the roughness is a metric too.
        others = linalg.null_space(np.array(taken) @ metric)
        change, roughness = others.T @ metric @ others, (r := family.rough @ others).T @ r
        share, vectors = linalg.eigh(change, roughness)
        share, vectors = share[::-1], vectors[:, ::-1]
        told = _levels(at[weight > 0]) - family.known - int(field == ABSORPTION)
        most = min(told, MOST[field]) - len(functions)
        more = min(most, int((share > _ROUNDING * share[0]).sum()))
        functions += [others @ vectors[:, k] / np.sqrt(share[k]) for k in range(max(more, 0))]
        if not functions:
            return None
        # A function and its negative are one: it ends above where it begins.
        signed = [f if f[-1] >= f[0] else -f for f in functions]
        return Basis(field, place, np.stack(signed, axis=1), told)


def _levels(at: Array) -> int:
    """How many different coordinates there are."""
    return int(1 + (np.diff(np.sort(at)) > _SAME_PART * max(float(np.ptp(at)), _SAME_PART)).sum())
