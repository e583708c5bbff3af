"""Scattered light at many places in unbounded water: exact single and small-angle multiple scattering.

About a round beam the light is a function of the distance along the axis and of the angle to it. It is worked
out at a few of both, and interpolated: without inverse square and Beer-Lambert it varies little.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple, TypeVar

import numpy as np
from scipy.interpolate import CubicSpline

from lightfield.arrays import TINY, Array, Mask
from lightfield.formula.scattered.multiple import Spread, closure, largest_kz, multiple
from lightfield.formula.scattered.quadrature import EmissionTable, mean_cosine, near, shares_at
from lightfield.formula.scattered.single import (
    LitPaths,
    Resolution,
    TabledPaths,
    seen_narrow,
    single_paths,
    times_about,
)
from lightfield.memory import kept_within
from lightfield.scene import Scene
from lightfield.scene.bands import molecular_share
from lightfield.scene.lamp.colour import colour_by_colour
from lightfield.scene.lamp.frame import (
    Direction,
    Point,
    beam_axes,
    beyond_window,
    has_round_section,
    is_tilted,
    source_point,
)
from lightfield.scene.lamp.lamp import Lamp
from lightfield.scene.lamp.width import half_width_rad
from lightfield.scene.receiver import is_cosine
from lightfield.scene.water.coefficients import coefficients_in
from lightfield.scene.water.hardening import within_band
from lightfield.scene.water.layers import layers_depth
from lightfield.scene.water.phase.of_scene import with_molecules
from lightfield.scene.water.phase.spec import TracedPhase
from lightfield.storage.tables import kept_by_tables

#: Angles to the axis at which light is worked out, at least and for every factor of e beyond a wide one
#: (tangent), and the power in which they grow.
_ANGLES, _PER_ANGLE, _WIDE, _GROW = 5, 5, 0.1, 1.4
#: Beams that take so many times a Gaussian's nodes about their paths have twice as many angles: light that is
#: scattered by little follows an edge. Single scattering beside a super-Gaussian of exponent 8 is right to
#: 0.3 % then (to 3 % at the edge of one of exponent 12 with as many as a Gaussian has).
_STEEP = 3
#: Distances, at least and for every factor of e from the nearest to the farthest; part of the range that is
#: added at its ends for tilts.
_DISTANCES, _PER_E, _MORE = 3, 1.5, 0.05
#: Cosine of the angle to a tilted beam at which places farther beside it, or behind the lamp, are taken: what
#: is scattered there by so much more is no small angle's.
_ASIDE = 0.3
#: A place at a node is so far from it, logarithmically.
_AT_NODE = 1e-15
_REMEMBERED, _STEPS = 64, 8
#: Spreads, of half a megabyte each for another phase function, and paths, for another width too, of which as
#: many are remembered as there is room for: 4 MB take those of a Gaussian, 20 those that come from behind
#: the window. A search goes to and fro between dozens. Measured where a search with scattered light takes
#: longest: 5 and 10 spreads take a seventh more time, 15 and 60 none less.
_SPREADS, _PATH_BYTES, _FEWEST_PATHS = 40, 80e6, 3
#: Places to which paths are worked out at once: there are up to 40,000 to each. Chosen: memory alone.
_AT_ONCE = 16
#: What beams send along these, which is remembered likewise: of one whose width has a colour a dozen are
#: asked for by turns, one for each band. Chosen: memory alone.
_BEAM_BYTES, _FEWEST_BEAMS = 60e6, 3
#: Beams whose half widths differ by less than this factor share their nodes, which follow the beam.
_WIDTH_STEP = 1.25
#: Water that scatters less has light in proportion.
_CLEAREST_PER_M = 1e-6


_Paths = TypeVar("_Paths", TabledPaths, LitPaths)


def describes(scene: Scene) -> bool:
    """Is the scene's scattered light of the kind that is followed here?

    A round beam of finite width, and plain cosine receivers of irradiance that face along the axis.
    """
    lamp = scene.lamp
    round_beam = lamp.profile not in ("isotropic", "pencil") and has_round_section(lamp)
    return is_cosine(scene.detector) and round_beam


class _Seen(NamedTuple):
    """Places as a lamp sees them: what interpolates between the nodes, and what is left of the light.

    Parameters
    ----------
    most : float
        Tangent of the largest angle of the nodes.
    by_z, by_angle : arrays, shape (n, n_distances) and (n, n_angles)
    table_path : array, shape (n,), m
        Straight line through the water, as the table takes it.
    nearer : array, shape (n,), m^-2
        Inverse square, and the receiver's turn from the beam.
    path, from_y : arrays, shape (n,), m
        Straight from the window, and where it begins.
    """

    most: float
    by_z: Array
    by_angle: Array
    table_path: Array
    nearer: Array
    path: Array
    from_y: Array


class _Tables:
    """Light at the nodes of distance and angle, for fields of different places that share them.

    Parameters
    ----------
    x_m, y_m, z_m : arrays, shape (n,), m
        The nodes enclose these places.
    """

    def __init__(self, x_m: Array, y_m: Array, z_m: Array) -> None:
        self.span_m = low, high = float(z_m.min()) * (1 - _MORE), float(z_m.max()) * (1 + _MORE)
        count = _DISTANCES + math.ceil(_PER_E * math.log(high / low))
        middle, half = 0.5 * math.log(low * high), 0.5 * math.log(high / low)
        self.log_z = middle - half * np.cos(math.pi * (np.arange(count) + 0.5) / count)
        # Barycentric weights of Chebyshev's points of the first kind.
        self.signs = (-1.0) ** np.arange(count) * np.sin(math.pi * (np.arange(count) + 0.5) / count)
        self.most = 1.2 * float((np.hypot(x_m, y_m) / z_m).max()) + 0.05
        #: Of a lamp on the axis of the tank.
        self.light = lru_cache(_REMEMBERED)(self._light)
        # What does not change with the water, or with the lamp, in the steps of a fit.
        self._paths = kept_within(_PATH_BYTES, _FEWEST_PATHS, _size)(self._paths_to)
        self._sent = kept_within(_BEAM_BYTES, _FEWEST_BEAMS, _size)(self._sent_along)
        self._spreads = lru_cache(_SPREADS)(self._spread)

    def _light(
        self, lamp: Lamp, phase: TracedPhase, most: float, a: tuple[float, ...], b: tuple[float, ...]
    ) -> Array:
        """ln(E R^2 exp(c R)), shape (n_waters, n_distances, n_angles)."""
        angles = _angles(most, _times(lamp))
        behind_m, width = lamp.apparent_distance_m, half_width_rad(lamp)
        z = np.exp(self.log_z)[:, None]
        behind, known = z + behind_m, near(phase)
        absorption, scattering = np.array(a), np.array(b)
        spread = self._spreads(known, _stepped(largest_kz(lamp))).of(phase, behind_m)
        light = np.maximum(multiple(lamp, spread, angles, absorption, scattering), 0.0)
        loss = 1 - mean_cosine(phase)
        light *= closure(scattering[:, None, None], loss, angles * (behind / z), width, z, behind_m)
        for rows, paths in self._sent(lamp, known, most):
            once = paths.light(absorption, scattering, shares_at(phase, known, len(paths.share)))
            light[..., rows] += once.reshape(len(a), len(z), -1)
        slant = np.sqrt(1 + angles**2)
        # Of dense water nothing may be left.
        return np.log(np.maximum(light * (behind * slant) ** 2, TINY)) + np.multiply.outer(
            absorption + scattering, z * slant
        )

    def _paths_to(
        self, phase: TracedPhase, width: float, behind_m: float, most: float, times: int
    ) -> list[tuple[slice, TabledPaths]]:
        """Paths of light that is scattered once, at every distance to the angles of every resolution."""
        angles, table, z = _angles(most, times), EmissionTable.of(width), np.exp(self.log_z)
        aside = int(np.searchsorted(angles, seen_narrow(width)))

        def to(tangent: Array) -> TabledPaths:
            radius, far = np.outer(z + behind_m, tangent).ravel(), np.repeat(z, len(tangent))
            fine = Resolution.for_beam(width, float(tangent[-1]), times)
            some = [slice(i, i + _AT_ONCE) for i in range(0, len(far), _AT_ONCE)]
            each = (single_paths(phase, width, radius[at], far[at], behind_m, fine) for at in some)
            return TabledPaths.joined([TabledPaths.of(table, paths) for paths in each])

        parts = [rows for rows in (slice(aside), slice(aside, len(angles))) if len(angles[rows])]
        return [(rows, to(angles[rows])) for rows in parts]

    def _sent_along(self, lamp: Lamp, phase: TracedPhase, most: float) -> list[tuple[slice, LitPaths]]:
        """The same paths with the light of a lamp on them."""
        width, behind_m = _stepped(half_width_rad(lamp)), lamp.apparent_distance_m
        light = EmissionTable.of(width).intensity(lamp)
        each = self._paths(phase, width, behind_m, most, _times(lamp))
        return [(rows, paths.lit(light)) for rows, paths in each]

    def _spread(self, phase: TracedPhase, top: float) -> Spread:
        """Where light that was scattered more often arrives, at every distance."""
        return Spread.on_planes(phase, np.exp(self.log_z), top)


class ScatteredField:
    """Irradiance of scattered light at n places, for any lamp and water that `describes` allows.

    Parameters
    ----------
    x_m, y_m, z_m : arrays, shape (n,), m
        z > 0.
    tables : optional
        Of a field at these places and others: what was worked out for it is known.
    """

    def __init__(self, x_m: Array, y_m: Array, z_m: Array, tables: _Tables | None = None) -> None:
        self.x_m, self.y_m, self.z_m = (np.asarray(v, float) for v in (x_m, y_m, z_m))
        self._tables = tables or _Tables(self.x_m, self.y_m, self.z_m)
        self._seen = lru_cache(_STEPS)(self._seen_from)

    def some(self, rows: Mask) -> ScatteredField:
        """At some of the places, from the same nodes."""
        return ScatteredField(self.x_m[rows], self.y_m[rows], self.z_m[rows], self._tables)

    def light(self, scene: Scene, wavelengths_nm: Sequence[float | None]) -> Array:
        """Scattered light for unit intensity on the axis, shape (n_wavelengths, n), m^-2.

        Parameters
        ----------
        scene : Scene
            Lamp and water; of the water's layers and hardening, what they take along the straight line.
        wavelengths_nm : sequence of float
            None: the middle of the first band.
        """
        if scene.lamp.width_slope:
            return colour_by_colour(scene, wavelengths_nm, self.light)
        return self.at(scene, *_coefficients(scene, wavelengths_nm))

    def in_waters(self, scenes: Sequence[Scene], wavelengths_nm: Sequence[float | None]) -> Array:
        """The same of scenes that differ by what absorbs and scatters alone, (n_scenes, n_wavelengths, n)."""
        # And where molecules scatter by the phase function, too.
        if scenes[0].lamp.width_slope or len(set(map(molecular_share, scenes))) > 1:
            return np.stack([self.light(scene, wavelengths_nm) for scene in scenes])
        each = [_coefficients(scene, wavelengths_nm) for scene in scenes]
        a, b = (np.concatenate(v) for v in zip(*each, strict=True))
        return self.at(scenes[0], a, b).reshape(len(scenes), len(wavelengths_nm), -1)

    def at(self, scene: Scene, a: Array, b: Array) -> Array:
        """The same for given coefficients of absorption and scattering, shape (n_waters,), m^-1.

        As `coefficients_in` gives them for the scene's `molecular_share`.
        """
        lamp, water = scene.lamp, scene.water
        axis = beam_axes(lamp)[2] if is_tilted(lamp) else None
        seen = self._seen(source_point(lamp), axis, _times(lamp))
        scatters = np.maximum(b, _CLEAREST_PER_M)
        phase = with_molecules(water.phase, molecular_share(scene))
        waters = tuple(a.tolist()), tuple(scatters.tolist())
        table = self._tables.light(_on_the_axis(lamp), phase, seen.most, *waters)
        power = (seen.by_z.T * (table @ seen.by_angle.T)).sum(axis=1)
        light = np.exp(power - (a + scatters)[:, None] * seen.table_path) * seen.nearer
        light *= (b / scatters)[:, None]
        if water.hardening_per_m:
            changes, shares = within_band(water.hardening_per_m)
            light *= np.exp(-np.multiply.outer(seen.path, changes)) @ shares
        return np.asarray(light * np.exp(-layers_depth(water, self.z_m, seen.path, self.y_m, seen.from_y)))

    def _seen_from(self, source: Point, axis: Direction | None, times: int) -> _Seen:
        """The places as a lamp sees them whose light comes from there; `axis` of a tilted one."""
        dx, dy, dz = self.x_m - source[0], self.y_m - source[1], self.z_m - source[2]
        length = np.sqrt(dx * dx + dy * dy + dz * dz)
        along, turned = dz, np.ones_like(dz)
        if axis is not None:
            least = min(_ASIDE, 1 / math.hypot(1.0, self._tables.most))
            along = np.maximum(axis[0] * dx + axis[1] * dy + axis[2] * dz, least * length)
            # Scattered light arrives from about where the lamp is.
            turned = dz / along
        tangent = np.sqrt(np.maximum(length**2 - along**2, 0.0)) / along
        most = max(self._tables.most, 1.02 * float(tangent.max()))
        # Beyond what the nodes span, which a large tilt may reach, as at its end.
        far = np.clip(along + source[2], *self._tables.span_m)
        near = np.log(far)[:, None] - self._tables.log_z
        by_z = self._tables.signs / np.where(near == 0, _AT_NODE, near)
        by_z /= by_z.sum(axis=1, keepdims=True)
        table_path = far * np.sqrt(1 + tangent**2)
        by_angle = _spline(_angles(most, times))(tangent)
        path = beyond_window(length, self.z_m, -source[2])
        from_y = self.y_m - dy * (path / length)
        return _Seen(most, by_z, by_angle, table_path, turned / length**2, path, from_y)


def _size(parts: Sequence[tuple[slice, _Paths]]) -> int:
    """Bytes that paths, or what is sent along them, take."""
    return sum(paths.nbytes for _, paths in parts)


def _coefficients(scene: Scene, wavelengths_nm: Sequence[float | None]) -> tuple[Array, Array]:
    """Absorption and scattering, m^-1, each of shape (n_wavelengths,)."""
    middle = 0.5 * sum(scene.detector.bands_nm[0])
    at = np.array([middle if w is None else w for w in wavelengths_nm])
    return coefficients_in(scene.water, at, molecular_share(scene))


@kept_by_tables(256)
def _on_the_axis(lamp: Lamp) -> Lamp:
    """The same beam where its axis is that of the tank: about it its light is the same."""
    return lamp.model_copy(
        update=dict.fromkeys(("offset_x_m", "offset_y_m", "tilt_x_deg", "tilt_y_deg"), 0.0)
    )


def _stepped(scale: float) -> float:
    """A scale in whole steps: not every step of a fit makes new nodes."""
    return float(_WIDTH_STEP ** round(math.log(scale) / math.log(_WIDTH_STEP)))


@kept_by_tables(256)
def _times(lamp: Lamp) -> int:
    """How many times a Gaussian's nodes about its paths a beam takes."""
    width = _stepped(half_width_rad(lamp))
    return times_about(width, EmissionTable.of(width).intensity(lamp))


def _angles(most: float, times: int) -> Array:
    """Tangents of angles from the axis to the largest, for light that follows an edge so steep."""
    count = _ANGLES + math.ceil(_PER_ANGLE * math.asinh(most / _WIDE))
    return np.asarray(most * np.linspace(0, 1, 1 + (count - 1) * (2 if times >= _STEEP else 1)) ** _GROW)


def _spline(angles: Array) -> CubicSpline:
    """Cubic splines through one at each angle and nothing at the others, even about the axis."""
    n = len(angles)
    return CubicSpline(angles, np.eye(n), bc_type=((1, np.zeros(n)), (2, np.zeros(n))))
