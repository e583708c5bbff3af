"""Scattered and reflected light at the places of a measurement, fast enough to fit with.

A few traces tell of the light in cells (see `traced`). From then on any beam, absorption, scattering, wall
albedo and surface costs a millisecond, with no new trace.

A trace answers for waters near its own b_0; far from it few photons carry all the weight. Clear waters share
one; water that scatters much is answered by a trace of its own, into which the first one fades.

Followed to first order only: an offset of the lamp moves the scattered field with it (the walls stay), and an
apparent source behind the window stretches the beam plane by plane.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lightfield.arrays import Array, Mask
from lightfield.render.diffuse.dense_water import CLEAR_TO_PER_M
from lightfield.render.diffuse.shift import Shift
from lightfield.render.diffuse.trace_errors import ClassLight, relative_modes
from lightfield.render.diffuse.traced import TracedWater
from lightfield.render.reflected.reflected_light import ReflectedLight
from lightfield.render.response.light_classes import CLASSES, FROM_WALLS
from lightfield.scene import Scene
from lightfield.scene.lamp.colour import colour_by_colour
from lightfield.scene.lamp.frame import beyond_window
from lightfield.scene.water.coefficients import coefficients_in
from lightfield.scene.water.hardening import within_band
from lightfield.scene.water.layers import is_layered, layers_depth, mean_to_per_m
from lightfield.scene.water.water import Water

#: Classes of light: all, light that was only scattered, and all that was reflected.
_EVERY_CLASS, SCATTERED, REFLECTED = range(CLASSES), range(1), range(1, CLASSES)
#: From where a trace is worth as much as another to where it is relied on, as a factor in b.
_FADE = 1.2
#: Relative errors that are not photon noise: of light that was scattered, and of light that never was.
SCATTERED_ERROR, _REFLECTED_ERROR = 0.01, 0.005
#: The same of what is taken to do to light from walls what it does to other light: of how much a floor that
#: is no wall changes scattered light, and layers all of it; and what other panes do on average. Measured: 0.1
#: to 0.5 of it between walls of 0.7 and 0.8 (test_floor.py has two of these tanks).
_GUESSED_ERROR = 0.3
#: Where on a line it is asked what layers did so far. Chosen: a gradient is furthest in the middle.
_ON_THE_WAY = (0.25, 0.5, 0.75, 1.0)


@dataclass(frozen=True)
class DiffuseResponse:
    """Response of the diffuse light at n positions to beam, water, walls and surface.

    Parameters
    ----------
    shift : Shift
        From cells to positions.
    straight_m : array, shape (n_cells,), m
        Straight line from the lamp to each cell, in water.
    wall_smoother : sparse array, shape (n_cells, n_cells)
        By which the tallies of light from walls were smoothed.
    clear : TracedWater
        What a trace tells of clear water, or of the only traced one.
    reflected : ReflectedLight, optional
        Light that was reflected and not scattered, known better than from a trace.
    denser : TracedWater, optional
        What a trace tells of water that scatters more, in the same cells.
    """

    shift: Shift
    straight_m: Array
    wall_smoother: csr_array
    clear: TracedWater
    reflected: ReflectedLight | None = None
    denser: TracedWater | None = None

    def evaluate(self, scene: Scene, wavelength_nm: float | None = None) -> tuple[Array, Array]:
        """Scattered and reflected part for unit on-axis intensity.

        Parameters
        ----------
        scene : Scene
            Any beam of the Gaussian family, water and walls; geometry and detector as in the traced scene.
        wavelength_nm : float, optional
            Default: the middle of the scene's first band.

        Returns
        -------
        value, stderr : arrays, shape (n,), m^-2 (m^-2 sr^-1 for radiance)
            The Monte Carlo error alone, see `errors`.
        """
        modes, _ = self.errors(scene, [wavelength_nm], np.zeros(len(self.shift.cell), int))
        return self.light(scene, [wavelength_nm])[0], np.linalg.norm(modes, axis=1)

    def light(self, scene: Scene, wavelengths_nm: Sequence[float | None]) -> Array:
        """The values of `evaluate` at several wavelengths, without their errors; shape (n_wavelengths, n)."""
        return self.in_waters(scene, [scene.water], wavelengths_nm)[0]

    def in_waters(
        self,
        scene: Scene,
        waters: Sequence[Water],
        wavelengths_nm: Sequence[float | None],
        kinds: range = _EVERY_CLASS,
    ) -> Array:
        """The same in waters that differ by what absorbs and scatters, (n_waters, n_wavelengths, n).

        Parameters
        ----------
        kinds : range
            Classes of light, see `light_classes`.
        """
        if scene.lamp.width_slope:
            return colour_by_colour(
                scene, wavelengths_nm, lambda one, at: self.in_waters(one, waters, at, kinds)
            )
        each = [self._coefficients(water, scene, wavelengths_nm) for water in waters]
        a, b = (np.concatenate(v) for v in zip(*each, strict=True))
        return self._light(scene, a, b, kinds).reshape(len(waters), len(wavelengths_nm), -1)

    def _light(self, scene: Scene, a: Array, b: Array, kinds: range) -> Array:
        """Light of some classes in waters of these coefficients, shape (n_waters, n)."""
        light = np.zeros((len(a), len(self.shift.cell)))
        for share, water in self._traced(b):
            if share.any():
                parts = water.classes(scene, a, b, False, kinds)
                if parts:
                    in_cells = self._in_cells(parts, len(a))
                    light += share[:, None] * self._at_readings(scene, a + b, in_cells)
                    light += share[:, None] * self._by_faces(scene, a + b, parts)
        return light + self._unscattered(scene, a + b) if REFLECTED[0] in kinds else light

    def errors(
        self,
        scene: Scene,
        wavelengths_nm: Sequence[float | None],
        channel: NDArray[np.integer[Any]],
        kinds: range = _EVERY_CLASS,
    ) -> tuple[Array, Array]:
        """Errors of the light at readings that have one wavelength each.

        Parameters
        ----------
        channel : array of int, shape (n,)
            Which of the wavelengths.
        kinds : range
            Classes of light.

        Returns
        -------
        modes : array, shape (n, k), m^-2
            Monte Carlo errors as independent contributions: covariance = modes @ modes.T. Mirror images share
            their photons, light from walls is smoothed over a plane, and all wavelengths are of one trace:
            such readings share contributions, the less the more their waters differ.
        smooth : array, shape (n,), m^-2
            Size of an error that varies little between neighbours: interpolation in g, beams of a finite
            basis, patches of the walls, light that was scattered more often than the tally tells apart.
        """
        a, b = self._coefficients(scene.water, scene, wavelengths_nm)
        mine = channel, np.arange(len(channel))
        light, often, guessed = np.zeros((3, len(channel)))
        dimmed = self.shift.pick(self._changed_by_layers(scene)) if is_layered(scene.water) else 0.0
        changed = dimmed + self._changed_by_panes(scene)
        modes = [np.zeros((len(channel), 0), np.float32)]
        shift = self.shift.seen_from(scene.lamp.offset_x_m, scene.lamp.offset_y_m)
        # Also of a trace whose share is nothing: the same columns are the same photons in every water.
        for share, water in self._traced(b):
            parts = water.classes(scene, a, b, True, kinds)
            if not parts:
                continue
            in_cells = self._in_cells(parts, len(a))
            own = (share[:, None] * self._at_readings(scene, a + b, in_cells))[mine]
            relative = relative_modes(shift, parts, in_cells, self.wall_smoother, channel)
            relative *= own[:, None]
            modes.append(relative)
            light += own
            uncertain = sum((part.uncertain for part in parts.values()), np.zeros_like(in_cells))
            often += (share[:, None] * self._at_readings(scene, a + b, uncertain))[mine]
            by_faces = share[:, None] * self._by_faces(scene, a + b, parts)
            from_walls = {kind: part for kind, part in parts.items() if kind in FROM_WALLS}
            seen = self._at_readings(scene, a + b, self._in_cells(from_walls, len(a)))
            guessed += (np.abs(by_faces) + share[:, None] * seen * changed)[mine]
        smooth = SCATTERED_ERROR * light + often
        if REFLECTED[0] in kinds:
            straight = self._unscattered(scene, a + b)
            guessed += (straight * dimmed)[mine]
            smooth += _REFLECTED_ERROR * straight[mine]
            if self.reflected is not None and scene.tank is not None and scene.tank.slope > 0:
                smooth += self.reflected.uncertain(scene, a + b)[mine]
        smooth += _GUESSED_ERROR * guessed
        return np.hstack(modes) if len(modes) > 2 else modes[-1], smooth

    def with_denser(self, other: DiffuseResponse) -> DiffuseResponse:
        """The same, with what a trace in denser water says of waters like that one at the same places."""
        assert np.array_equal(other.straight_m, self.straight_m)
        return replace(self, denser=other.clear)

    def some(self, rows: Mask) -> DiffuseResponse:
        """At some of the readings, from the same traces."""
        reflected = self.reflected and self.reflected.some(rows)
        return replace(self, shift=self.shift.some(rows), reflected=reflected)

    def _coefficients(
        self, water: Water, scene: Scene, wavelengths_nm: Sequence[float | None]
    ) -> tuple[Array, Array]:
        """Absorption and scattering, m^-1, each of shape (n_wavelengths,), see `coefficients_in`."""
        middle = 0.5 * sum(scene.detector.bands_nm[0])
        at = np.array([middle if w is None else w for w in wavelengths_nm])
        return coefficients_in(water, at, self.clear.own_top.reference.molecular_share)

    def _traced(self, b: Array) -> list[tuple[Array, TracedWater]]:
        """How much of each water is left to a trace, shape (n_waters,), smooth in b; and the trace.

        Far from the water of a trace the variance grows as exp((b - b_0)^2 L / b_0): two traces are worth
        the same at the geometric mean of their waters.
        """
        if self.denser is None:
            return [(np.ones(len(b)), self.clear)]
        middle = np.sqrt(self.clear.scattering_per_m * self.denser.scattering_per_m)
        low = max(CLEAR_TO_PER_M, middle / _FADE)
        t = np.clip((b - low) / (low * _FADE**2 - low), 0, 1)
        share = np.asarray(t * t * (3 - 2 * t))
        return [(1 - share, self.clear)] + ([(share, self.denser)] if share.any() else [])

    def _in_cells(self, parts: dict[int, ClassLight], waters: int) -> Array:
        """Light of all classes together, shape (n_waters, n_cells)."""
        return sum((part.value for part in parts.values()), np.zeros((waters, len(self.straight_m))))

    def _at_readings(self, scene: Scene, attenuation: Array, light: Array) -> Array:
        """Light at the readings from that in the cells, as layers and lamp let it; shape (n_waters, n)."""
        z, r = self.shift.cell_z_m, self.straight_m
        seen = light * self._through_layers(scene)
        seen = seen * _from_behind(scene.lamp.apparent_distance_m, attenuation, z, r)
        return self.shift.apply(seen, scene.lamp.offset_x_m, scene.lamp.offset_y_m)

    def _by_faces(self, scene: Scene, attenuation: Array, parts: dict[int, ClassLight]) -> Array | float:
        """What another floor or far end than the traced ones adds to light of walls that was scattered too.

        As it adds to light that was not scattered. Shape (n_waters, n).
        """
        walls = {kind: part for kind, part in parts.items() if kind in FROM_WALLS}
        if self.reflected is None or not walls:
            return 0.0
        more = self.reflected.by_faces(scene, attenuation) - 1.0
        return more * self._at_readings(scene, attenuation, self._in_cells(walls, len(attenuation)))

    def _through_layers(self, scene: Scene, part: float = 1.0) -> Array:
        """What layers let through on the straight lines to the cells, or a part of them, shape (n_cells,)."""
        y, z = self.shift.cell_y_m, self.shift.cell_z_m
        return np.exp(-layers_depth(scene.water, part * z, part * self.straight_m, part * y))

    def _changed_by_layers(self, scene: Scene) -> Array:
        """The largest part of the light that they take, or spare, up to anywhere on these lines, (n_cells,).

        To a cell they may take nothing, and yet something to the walls: as much before its middle as they
        spare behind it.
        """
        return np.max([np.abs(1 - self._through_layers(scene, part)) for part in _ON_THE_WAY], axis=0)

    def _changed_by_panes(self, scene: Scene) -> float:
        """The part of light from walls that other panes than the traced ones change."""
        traced, panes = self.clear.own_top.reference, scene.pane_reflectance
        return abs(1 - (1 - traced.by_panes * panes) / (1 - traced.by_panes * traced.pane_reflectance))

    def _unscattered(self, scene: Scene, attenuation: Array) -> Array:
        """Light that was reflected and never scattered, free of Monte Carlo noise, shape (n_waters, n)."""
        if self.reflected is None or not scene.reflects:
            return np.zeros((len(attenuation), len(self.shift.cell)))
        nodes, shares = within_band(scene.water.hardening_per_m)
        layered, more = is_layered(scene.water), self.mean_of_layers_per_m(scene)
        each = self.reflected.evaluate(scene, np.add.outer(attenuation + more, nodes).ravel())
        light = shares @ each.reshape(len(attenuation), len(nodes), -1)
        if layered:
            # What they take on average they take on the whole way, the rest as on the straight one.
            light *= self.shift.pick(self._through_layers(scene) * np.exp(more * self.straight_m))
        return np.asarray(light)

    def mean_of_layers_per_m(self, scene: Scene) -> float:
        """Absorption that layers add on average from the window to where walls send light back from, 1/m."""
        tank = scene.tank
        if tank is None or not is_layered(scene.water):
            return 0.0
        (_, _), (floor, top), (_, end) = tank.box_m
        far = min(end, float(self.shift.cell_z_m.max()) + 2 * max(tank.width_m, tank.depth_m))
        return mean_to_per_m(scene.water, far, (floor, top))


def _from_behind(
    apparent_distance_m: float, attenuation_per_m: Array, z_m: Array, straight_m: Array
) -> Array:
    """Less attenuation for light from behind the window, which crosses the water less obliquely.

    Parameters
    ----------
    attenuation_per_m : array, shape (n_waters,)
    z_m, straight_m : array, shape (n,)
        Distance of each cell along the axis, and straight from the window.

    Returns
    -------
    factor : array, shape (n_waters, n)
    """
    if apparent_distance_m == 0:
        return np.ones((len(attenuation_per_m), len(z_m)))
    behind = z_m + apparent_distance_m
    radius = np.sqrt(np.maximum(straight_m**2 - z_m**2, 0))
    in_water = beyond_window(np.hypot(radius, behind), z_m, apparent_distance_m)
    return np.asarray(np.exp(-attenuation_per_m[:, None] * (in_water - straight_m)))
