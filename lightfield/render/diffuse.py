"""Scattered and reflected light at the places of a measurement, fast enough to fit with.

A few traces (one per node of the asymmetry parameter g) are tallied by history *and* by direction of
emission. From then on any beam, absorption, scattering, wall albedo and surface costs a millisecond, with no
new trace:

    E_diffuse(p) = sum over directions w  I(w)
                   sum over histories h  R_g[h, w, p]  (b/b_0)^n (rho/rho_0)^m s^k e^{-dc (r + e)}

Followed to first order only: an offset of the lamp moves the scattered field with it (the walls stay), and an
apparent source behind the window stretches the beam plane by plane.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.errors import RenderError
from lightfield.render import store
from lightfield.render.backend import use_backend
from lightfield.render.beamnodes import BeamNodes, is_round
from lightfield.render.bounce import SingleBounce, applies
from lightfield.render.grid import Grid, angle_nodes, positions_grid, straight_path
from lightfield.render.rendering import transport_key
from lightfield.render.response import (
    CLASSES,
    FROM_WALLS,
    HERMITE_NODES,
    HERMITE_SHARES,
    NEVER_SCATTERED,
    Array,
    Reference,
    TransportResponse,
    light_classes,
)
from lightfield.render.shift import Shift, smoother
from lightfield.scene import Lamp, Scene
from lightfield.water.iop import absorption_per_m, scattering_per_m

REFERENCE_ABSORPTION, REFERENCE_SCATTERING, REFERENCE_ALBEDO = 0.1, 0.2, 0.5
G_NODES = (0.75, 0.87, 0.924, 0.97)
PHOTONS = 2_000_000
KEPT_BEAMS = 256
BEAM = (
    "profile",
    "hwhm_deg",
    "shape_exponent",
    "skirt_fraction",
    "skirt_hwhm_deg",
    "ellipticity",
    "tilt_x_deg",
    "tilt_y_deg",
    "apparent_distance_m",
)


@dataclass(frozen=True)
class DiffuseResponse:
    """Response of the diffuse light at n positions to beam, water, walls and surface.

    Parameters
    ----------
    tallies : list of arrays, shape (n_emission_nodes, n_rows, n_cells), one per node of g
    relative_stderr : array, shape (n_g, 5, n_cells)
        Monte Carlo error of each class of light (see `light_classes`).
    g_nodes : tuple of float
        Empty when the phase function has no g (one tally then).
    rows : TransportResponse
        Histories of the rows, with an empty tally.
    beam_nodes : BeamNodes
    shift : Shift
        From cells to positions.
    under_surface : DiffuseResponse, optional
        The same tank with a water surface in place of its lid; for light that was reflected.
    bounce : SingleBounce, optional
        Light that was reflected once and not scattered, known better than from a trace.
    """

    tallies: list[Array]
    relative_stderr: Array
    g_nodes: tuple[float, ...]
    rows: TransportResponse
    beam_nodes: BeamNodes
    shift: Shift
    under_surface: DiffuseResponse | None = None
    bounce: SingleBounce | None = None
    _beams: dict[Any, Any] = field(default_factory=dict, repr=False, compare=False)
    _tallies: dict[Any, Any] = field(default_factory=dict, repr=False, compare=False)

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
        """
        water = scene.water
        at = np.array(
            [float(np.mean(scene.detector.bands_nm[0])) if wavelength_nm is None else wavelength_nm]
        )
        a, b = float(absorption_per_m(water, at)[0]), float(scattering_per_m(water, at)[0])
        if self.under_surface is None or scene.tank is None or scene.tank.surface_reflectance == 0:
            value, variance = self._light(scene, a, b, range(CLASSES))
        else:
            # Light that was only scattered is the same under either top, and known for every g here.
            value, variance = self._light(scene, a, b, range(1))
            more, more_variance = self.under_surface._light(scene, a, b, range(1, CLASSES))
            value, variance = value + more, variance + more_variance
        uneven = self._inhomogeneous(scene)
        attenuated = uneven * self._path_change(scene, a + b)
        moved = self.shift.apply(value * attenuated, scene.lamp.offset_x_m, scene.lamp.offset_y_m)
        once = self._single_bounce(scene, a + b) * self.shift.pick(uneven)
        return moved + once, self.shift.pick(np.sqrt(variance) * attenuated)

    def _single_bounce(self, scene: Scene, attenuation: float) -> Array:
        """Light reflected once and never scattered, at the readings, free of Monte Carlo noise."""
        tank, light = scene.tank, np.zeros(len(self.shift.cell))
        if self.bounce is None or tank is None:
            return light
        q = scene.water.hardening_per_m
        for share, cz in zip(HERMITE_SHARES, HERMITE_NODES, strict=True) if q else [(1.0, 0.0)]:
            c = attenuation + q * cz
            if tank.wall_albedo > 0:
                light += share * tank.wall_albedo * self.bounce.walls(scene, c, tank.surface_reflectance == 0)
            if tank.surface_reflectance > 0:
                light += share * tank.surface_reflectance * self.bounce.surface(scene, c)
        return light

    def _light(self, scene: Scene, a: float, b: float, kinds: range) -> tuple[Array, Array]:
        """Light of some classes in every cell, and its variance, in uniform water."""
        tank, q = scene.tank, scene.water.hardening_per_m
        rho, surface = (tank.wall_albedo, tank.surface_reflectance) if tank else (0.0, 0.0)
        spread = a + q * HERMITE_NODES if q else np.array([a])
        history = self.rows.histories
        used = self.counted & np.isin(self.classes, kinds) & ((rho > 0) | (history[:, 1] == 0))
        used &= ((surface > 0) | (history[:, 2] == 0)) & ((b > 0) | (history[:, 0] == 0))
        value, variance = np.zeros(len(self.rows.straight_m)), np.zeros(len(self.rows.straight_m))
        if not used.any():
            return value, variance
        ones, reference = np.ones_like(spread), self.rows.reference
        weights = self.rows.row_weights(spread, b * ones, rho * ones, surface * ones)
        change = spread + b - reference.absorption_per_m - reference.scattering_per_m
        along = np.exp(-change[:, None] * self.rows.straight_m)
        average = HERMITE_SHARES if q else np.ones(1)
        shares = self._g_shares(scene)
        for kind in np.unique(self.classes[used]):
            rows = self.counted & (self.classes == kind)
            # Light that was never scattered knows no g: its tally is the same at every node.
            for share, index in [(1.0, shares[0][1])] if kind in NEVER_SCATTERED else shares:
                beam = self._beam(index, int(kind), scene)
                part = share * (average @ ((weights[:, rows] @ beam) * along))
                value += part
                variance += (part * self.relative_stderr[index, kind]) ** 2
        return value, variance

    @cached_property
    def counted(self) -> NDArray[np.bool_]:
        """Rows that are not known better from the single bounce."""
        n, m, k = self.rows.histories.T
        return (n > 0) | (m + k > 1) if self.bounce is not None else np.ones(len(n), bool)

    @cached_property
    def classes(self) -> NDArray[np.integer[Any]]:
        """Class of every row, see `light_classes`."""
        return light_classes(self.rows.histories)

    def _g_shares(self, scene: Scene) -> list[tuple[float, int]]:
        """Lagrange interpolation in log(1 - g) over the traced nodes."""
        if len(self.g_nodes) < 2:
            return [(1.0, 0)]
        g = float(scene.get("water.phase.g"))
        if not self.g_nodes[0] - 0.1 <= g <= 0.99:
            raise RenderError(
                "g is outside the traced range",
                where="water.phase.g",
                found=g,
                rule=f"{self.g_nodes[0] - 0.1:.2f} to 0.99",
            )
        nodes, at = np.log1p(-np.array(self.g_nodes)), np.log1p(-g)
        shares = [float(np.prod([(at - y) / (x - y) for y in nodes if y != x])) for x in nodes]
        return [(share, i) for i, share in enumerate(shares) if abs(share) > 1e-9]

    def _beam(self, index: int, kind: int, scene: Scene) -> Array:
        """Tally of one g node and class of light, contracted with the scene's beam, (n_rows, n_cells)."""
        lamp = scene.lamp
        key = (index, kind, *(getattr(lamp, name) for name in BEAM))
        if key not in self._beams:
            while len(self._beams) >= KEPT_BEAMS:
                self._beams.pop(next(iter(self._beams)))
            tally = self._tally(index, kind, is_round(lamp))
            contracted = np.empty(tally.shape[1:], np.float32)
            for stretch, cells in self._stretches(lamp.apparent_distance_m):
                values = self.beam_nodes.values(_stretched(lamp, stretch)) / stretch**2
                mine = tally if cells is None else tally[:, :, cells]
                flat = values.astype(np.float32) @ mine.reshape(len(mine), -1)
                contracted[:, slice(None) if cells is None else cells] = flat.reshape(mine.shape[1:])
            self._beams[key] = contracted
        return np.asarray(self._beams[key])

    def _tally(self, index: int, kind: int, rings: bool) -> Array:
        """Rows of one class, shape (n_nodes, n_rows, n_cells); for a round beam its sectors are added up."""
        key = (index, kind, rings)
        if key not in self._tallies:
            tally = self.tallies[index][:, self.counted & (self.classes == kind)]
            if rings:
                nodes = self.beam_nodes.nodes
                tally = tally.reshape(nodes.n_theta, nodes.n_phi, *tally.shape[1:]).sum(axis=1)
            self._tallies[key] = np.ascontiguousarray(tally)
        return np.asarray(self._tallies[key])

    def _stretches(self, apparent_distance_m: float) -> list[tuple[float, NDArray[np.integer[Any]] | None]]:
        """Factor on the beam's angles at each plane, and the cells of that plane.

        Light from a point z0 behind the window starts at z0 theta beside the axis. At plane z it is, to first
        order in the angles, where light of a beam wider by (z + z0) / z would be that starts at the window.
        """
        if apparent_distance_m == 0:
            return [(1.0, None)]
        planes = self.shift.cell_z_m
        return [
            (float((z + apparent_distance_m) / z), np.flatnonzero(planes == z)) for z in np.unique(planes)
        ]

    def _path_change(self, scene: Scene, attenuation: float) -> Array:
        """Less attenuation for light from behind the window, which crosses the water less obliquely."""
        behind = scene.lamp.apparent_distance_m
        z, r = self.shift.cell_z_m, self.rows.straight_m
        radius = np.sqrt(np.maximum(r * r - z * z, 0))
        return np.asarray(np.exp(-attenuation * (np.hypot(radius, z + behind) * z / (z + behind) - r)))

    def _inhomogeneous(self, scene: Scene) -> Array:
        """Attenuation by a gradient or layer along the straight path, which diffuse light nearly follows."""
        water = scene.water
        z, r = self.shift.cell_z_m, self.rows.straight_m
        tau = water.gradient_per_m2 * (0.5 * z - water.gradient_centre_m) * r
        if water.layer_absorption_per_m:
            half = 0.5 * water.layer_width_m
            low, high = water.layer_centre_m - half, water.layer_centre_m + half
            tau = (
                tau
                + water.layer_absorption_per_m * np.clip(np.minimum(z, high) - max(low, 0.0), 0, None) * r / z
            )
        return np.asarray(np.exp(-tau))


def response_for(
    scene: Scene,
    x_m: Array,
    y_m: Array,
    z_m: Array,
    *,
    photons: int = PHOTONS,
    g_nodes: Sequence[float] = G_NODES,
    seed: int = 0,
    cache: bool = True,
) -> DiffuseResponse:
    """Trace, or fetch from the cache, the diffuse light of a scene at the places of a measurement.

    Parameters
    ----------
    scene : Scene
        Tank, detector, phase function, apparent source; the beam's width only decides where photons are sent.
    x_m, y_m, z_m : arrays, shape (n,), m
    photons : int
        Per node of g.
    g_nodes : sequence of float
        Ascending; used when the phase function is Henyey-Greenstein.
    seed : int
    cache : bool

    Returns
    -------
    DiffuseResponse
    """
    places = (np.asarray(x_m, float), np.asarray(y_m, float), np.asarray(z_m, float))
    has_g = scene.water.phase.type == "henyey-greenstein"
    nodes = tuple(sorted(g_nodes)) if has_g else ()
    open_top = bool(scene.tank and scene.tank.surface_reflectance > 0)
    bounce = SingleBounce(scene, *places) if applies(scene) else None
    main = replace(_response(scene, places, nodes, open_top, photons, seed, cache), bounce=bounce)
    if scene.tank is None or open_top:
        return main
    middle = nodes[len(nodes) // 2 : len(nodes) // 2 + 1]
    below = replace(_response(scene, places, middle, True, photons, seed, cache), bounce=bounce)
    return replace(main, under_surface=below)


def _response(
    scene: Scene,
    places: tuple[Array, Array, Array],
    nodes: tuple[float, ...],
    surface: bool,
    photons: int,
    seed: int,
    cache: bool,
) -> DiffuseResponse:
    """Response with or without a water surface on top of the tank."""
    grid = positions_grid(*places)
    width = _bucket(scene.lamp.hwhm_deg)
    traced = _traced_scene(scene, width, surface)
    albedo = REFERENCE_ALBEDO if scene.tank else 0.0
    reference = Reference(REFERENCE_ABSORPTION, REFERENCE_SCATTERING, albedo)
    beam_nodes = BeamNodes(angle_nodes(width), width)
    key = {
        "kind": "diffuse",
        **transport_key(traced, grid, reference),
        "g": nodes,
        "photons": photons,
        "seed": seed,
        "nodes": asdict(beam_nodes.nodes),
    }
    stored = store.load(key) if cache else None
    if stored is None:
        stored = _trace(traced, grid, reference, beam_nodes, nodes, photons, seed)
        if cache:
            store.save(key, stored)
    histories = np.asarray(stored["histories"], int)
    straight = straight_path(traced, grid)
    rows = TransportResponse(np.zeros((1, 0, 0)), histories, stored["excess_m"], straight, reference, photons)
    tallies, errors = stored["tallies"], stored["relative_stderr"]
    from_walls = np.isin(light_classes(histories), FROM_WALLS)
    if from_walls.any():
        smooth = smoother(grid)
        tallies[:, :, from_walls] = tallies[:, :, from_walls] @ smooth.T.astype(np.float32)
        # Cells and their mirror images share photons, so only half of the neighbours are independent.
        errors[:, list(FROM_WALLS)] *= np.minimum(np.sqrt(2) * np.linalg.norm(smooth, axis=1), 1)
    return DiffuseResponse(list(tallies), errors, nodes, rows, beam_nodes, Shift(grid, *places))


def _stretched(lamp: Lamp, factor: float) -> Lamp:
    """The beam with all its angles multiplied."""
    if factor == 1:
        return lamp
    names = ("hwhm_deg", "skirt_hwhm_deg", "tilt_x_deg", "tilt_y_deg")
    return lamp.model_copy(update={name: factor * getattr(lamp, name) for name in names})


def _bucket(hwhm_deg: float) -> float:
    """Beam width rounded to steps of a factor 1.5, so that guesses that differ a little share a response."""
    return float(4.0 * 1.5 ** np.round(np.log(hwhm_deg / 4.0) / np.log(1.5)))


def _traced_scene(scene: Scene, width_deg: float, surface: bool) -> Scene:
    """The scene with everything neutral that is reweighed afterwards."""
    lamp = type(scene.lamp)(hwhm_deg=width_deg)
    values: dict[str, Any] = {"water.gradient_per_m2": 0.0, "water.layer_absorption_per_m": 0.0}
    if scene.tank:
        values |= {"tank.surface_reflectance": float(surface)}
    if scene.water.phase.type == "henyey-greenstein":
        values["water.phase.g"] = 0.924
    return scene.model_copy(update={"lamp": lamp}).with_values(values, validate=False)


def _trace(
    scene: Scene,
    grid: Grid,
    reference: Reference,
    beam_nodes: BeamNodes,
    g_nodes: tuple[float, ...],
    photons: int,
    seed: int,
) -> dict[str, Array]:
    use_backend()
    from lightfield.render.accumulate import trace_by_direction

    tallies, errors = [], []
    for g in g_nodes or (None,):
        one = scene if g is None else scene.with_values({"water.phase.g": g}, validate=False)
        tally, stderr, histories, excess = trace_by_direction(one, grid, reference, beam_nodes, photons, seed)
        tallies.append(tally)
        errors.append(stderr)
    stacked, relative = np.array(tallies, np.float32), np.array(errors)
    once = histories[:, 0] == 0
    stacked[:, :, once] = stacked[:, :, once].mean(axis=0)
    kinds = list(NEVER_SCATTERED)
    relative[:, kinds] = np.sqrt((relative[:, kinds] ** 2).mean(axis=0) / len(relative))
    used = stacked.any(axis=(0, 1, 3))
    return {
        "tallies": stacked[:, :, used],
        "relative_stderr": relative,
        "histories": histories[used],
        "excess_m": excess[used],
    }
