"""Scattered and reflected light at the places of a measurement, fast enough to fit with.

A few traces (one per node of the asymmetry parameter g) are tallied by history *and* by direction of
emission. From then on any beam, absorption, scattering, wall albedo and surface costs a millisecond, with no
new trace:

    E_diffuse(p) = sum over directions w  I(w)
                   sum over histories h  R_g[h, w, p]  (b/b_0)^n (rho/rho_0)^m s^k e^{-dc (r + e)}

A trace answers for waters near its own b_0; far from it few photons carry all the weight. So there are
several, traced when they are first asked for, and one fades into the next.

Followed to first order only: an offset of the lamp moves the scattered field with it (the walls stay), and an
apparent source behind the window stretches the beam plane by plane.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.errors import RenderError
from lightfield.render.beamnodes import BeamNodes, is_round
from lightfield.render.reflected import ReflectedLight
from lightfield.render.response import (
    CLASSES,
    FROM_WALLS,
    HERMITE_NODES,
    HERMITE_SHARES,
    NEVER_SCATTERED,
    Array,
    TransportResponse,
    light_classes,
)
from lightfield.render.shift import Shift
from lightfield.render.straight import from_behind, inhomogeneous
from lightfield.scene import Lamp, Scene
from lightfield.water.iop import absorption_per_m, scattering_per_m

KEPT_BEAMS = 256
#: Waters that scatter less than this are answered by the first trace alone.
CLEAR_TO_PER_M = 0.3
#: Relative errors that are not photon noise: of light that was scattered, and of light that never was.
SCATTERED_ERROR, REFLECTED_ERROR = 0.01, 0.005
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
class Sent:
    """How the photons of a trace were sent out.

    Parameters
    ----------
    density : array, shape (n_rings,), 1/sr
        Part of them per solid angle at each ring.
    lamp : Lamp
        The beam that the stated errors belong to.
    """

    density: Array
    lamp: Lamp


@dataclass(frozen=True)
class DiffuseResponse:
    """Response of the diffuse light at n positions to beam, water, walls and surface.

    Parameters
    ----------
    tallies : list of arrays, shape (n_emission_nodes, n_rows, n_cells), one per node of g
    relative_stderr : array, shape (n_g, 5, n_cells)
        Monte Carlo error of each class of light (see `light_classes`) before any smoothing.
    g_nodes : tuple of float
        Empty when the phase function has no g (one tally then).
    rows : TransportResponse
        Histories of the rows, with an empty tally.
    beam_nodes : BeamNodes
    sent : Sent
    shift : Shift
        From cells to positions.
    images : array of 0 and 1, shape (n_cells, n_sets)
        Which cells are mirror images of each other and share their photons.
    wall_smoother : array, shape (n_cells, n_cells)
        By which the tallies of light from walls were smoothed.
    under_surface : DiffuseResponse, optional
        The same tank with a water surface in place of its lid; for light that was reflected.
    reflected : ReflectedLight, optional
        Light that was reflected and not scattered, known better than from a trace.
    denser : callable, optional
        Gives the response of the same scene traced in water that scatters more.
    takes_over_per_m : (float, float)
        Scattering coefficients between which the denser one takes over.
    """

    tallies: list[Array]
    relative_stderr: Array
    g_nodes: tuple[float, ...]
    rows: TransportResponse
    beam_nodes: BeamNodes
    sent: Sent
    shift: Shift
    images: Array
    wall_smoother: Array
    under_surface: DiffuseResponse | None = None
    reflected: ReflectedLight | None = None
    denser: Callable[[], DiffuseResponse] | None = None
    takes_over_per_m: tuple[float, float] = (np.inf, np.inf)
    _beams: dict[Any, Any] = field(default_factory=dict, repr=False, compare=False)
    _tallies: dict[Any, Any] = field(default_factory=dict, repr=False, compare=False)
    _scatter: dict[Any, Any] = field(default_factory=dict, repr=False, compare=False)

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
        modes, _ = self.errors(scene, wavelength_nm)
        return self.light(scene, [wavelength_nm])[0], np.linalg.norm(modes, axis=1)

    def light(self, scene: Scene, wavelengths_nm: Sequence[float | None]) -> Array:
        """The values of `evaluate` at several wavelengths, without their errors; shape (n_wavelengths, n)."""
        a, b = self._water(scene, wavelengths_nm)
        return self._moved(scene, a, b) + self._unscattered(scene, a + b)

    def errors(self, scene: Scene, wavelength_nm: float | None = None) -> tuple[Array, Array]:
        """Errors of the light.

        Returns
        -------
        modes : array, shape (n, k), m^-2
            Monte Carlo errors as independent contributions: covariance = modes @ modes.T. Mirror images share
            their photons, and light from walls is smoothed over a plane: such readings share contributions.
        smooth : array, shape (n,), m^-2
            Size of an error that varies little between neighbours: interpolation in g, beams of a finite
            basis, patches of the walls.
        """
        a, b = self._water(scene, [wavelength_nm])
        (moved,), (unscattered,) = self._moved(scene, a, b), self._unscattered(scene, a + b)
        smooth = SCATTERED_ERROR * moved + REFLECTED_ERROR * unscattered
        return self._modes(scene, a, b), smooth

    @property
    def clear(self) -> DiffuseResponse:
        """The same without the denser waters: never traces, and is not to be believed in water that is."""
        return replace(self, denser=None)

    def _share_of_denser(self, b: Array) -> Array:
        """How much of each water is left to the denser response; smooth in b, shape (n_waters,)."""
        if self.denser is None:
            return np.zeros(len(b))
        low, high = self.takes_over_per_m
        t = np.clip((b - low) / (high - low), 0, 1)
        return np.asarray(t * t * (3 - 2 * t))

    def _moved(self, scene: Scene, a: Array, b: Array) -> Array:
        """The traced light at the readings, shape (n_waters, n)."""
        share = self._share_of_denser(b)
        if self.denser is None or not share.any():
            return self._traced(scene, a, b)
        beyond = share[:, None] * self.denser()._moved(scene, a, b)
        return beyond if (share == 1).all() else beyond + (1 - share)[:, None] * self._traced(scene, a, b)

    def _modes(self, scene: Scene, a: Array, b: Array) -> Array:
        """Errors of the traced light of one water as independent contributions, shape (n, k)."""
        (share,) = self._share_of_denser(b)
        (traced,) = self._traced(scene, a, b)
        # Kept even where its share is nothing: the same columns are the same photons in every water.
        modes = (1 - share) * traced[:, None] * self._relative_modes(scene, a, b)
        if self.denser is None or share == 0:
            return np.asarray(modes)
        return np.hstack([modes, share * self.denser()._modes(scene, a, b)])

    def _traced(self, scene: Scene, a: Array, b: Array) -> Array:
        """The light of this trace at the readings, shape (n_waters, n)."""
        nothing = np.zeros((len(a), len(self.rows.straight_m)))
        light = sum((v for v, _ in self._light(scene, a, b, errors=False).values()), nothing)
        z, r = self.shift.cell_z_m, self.rows.straight_m
        seen = light * inhomogeneous(scene.water, z, r)
        seen = seen * from_behind(scene.lamp.apparent_distance_m, a + b, z, r)
        return self.shift.apply(seen, scene.lamp.offset_x_m, scene.lamp.offset_y_m)

    @staticmethod
    def _water(scene: Scene, wavelengths_nm: Sequence[float | None]) -> tuple[Array, Array]:
        """Absorption and scattering coefficients, m^-1, each of shape (n_wavelengths,)."""
        middle = float(np.mean(scene.detector.bands_nm[0]))
        at = np.array([middle if w is None else w for w in wavelengths_nm])
        return absorption_per_m(scene.water, at), scattering_per_m(scene.water, at)

    def _light(self, scene: Scene, a: Array, b: Array, errors: bool) -> dict[int, tuple[Array, Array]]:
        """Light of every class in every cell, and its variance, in uniform waters."""
        if self.under_surface is None or scene.tank is None or scene.tank.surface_reflectance == 0:
            return self._classes(scene, a, b, range(CLASSES), errors)
        # Light that was only scattered is the same under either top, and known for every g here.
        scattered = self._classes(scene, a, b, range(1), errors)
        return scattered | self.under_surface._classes(scene, a, b, range(1, CLASSES), errors)

    def _relative_modes(self, scene: Scene, a: Array, b: Array) -> Array:
        """Relative errors of the traced light at the readings as independent contributions, shape (n, k).

        At most 1: beyond the nodes of g the light of a dim cell may come out as nothing.
        """
        parts = {kind: (v[0], e[0]) for kind, (v, e) in self._light(scene, a, b, errors=True).items()}
        if not parts:
            return np.zeros((len(self.shift.cell), 0))
        total = sum((v for v, _ in parts.values()), np.full(len(self.rows.straight_m), 1e-300))
        total = np.maximum(total, np.sqrt(sum(e for _, e in parts.values())))
        open_top = self.under_surface is not None and scene.tank and scene.tank.surface_reflectance > 0
        modes = []
        for kind, (_, variance) in parts.items():
            traced = self.under_surface if open_top and kind > 0 and self.under_surface else self
            error = np.sqrt(variance)[:, None] * traced.images
            if kind in FROM_WALLS:
                error = traced.wall_smoother @ error
            modes.append(self.shift.spread(error / total[:, None]))
        return np.hstack(modes)

    def _unscattered(self, scene: Scene, attenuation: Array) -> Array:
        """Light that was reflected and never scattered, free of Monte Carlo noise, shape (n_waters, n)."""
        light = np.zeros((len(attenuation), len(self.shift.cell)))
        if self.reflected is None:
            return light
        nodes, shares = self._spread(scene)
        for one, c in zip(light, attenuation, strict=True):
            for share, at in zip(shares, nodes, strict=True):
                one += share * self.reflected.evaluate(scene, float(c + at))
        along = inhomogeneous(scene.water, self.shift.cell_z_m, self.rows.straight_m)
        return light * self.shift.pick(along)

    @staticmethod
    def _spread(scene: Scene) -> tuple[Array, Array]:
        """Changes of the attenuation within a band, m^-1, and the share of each."""
        q = scene.water.hardening_per_m
        return (q * HERMITE_NODES, HERMITE_SHARES) if q else (np.zeros(1), np.ones(1))

    def _classes(
        self, scene: Scene, a: Array, b: Array, kinds: range, errors: bool
    ) -> dict[int, tuple[Array, Array]]:
        """Light of some classes in every cell, and its variance before any smoothing, in uniform waters.

        Each of shape (n_waters, n_cells); the variance is zero unless asked for.
        """
        tank = scene.tank
        rho, surface = (tank.wall_albedo, tank.surface_reflectance) if tank else (0.0, 0.0)
        within, average = self._spread(scene)
        spread, b = np.add.outer(a, within).ravel(), np.repeat(b, len(within))
        history = self.rows.histories
        used = np.isin(self.classes, kinds) & ((rho > 0) | (history[:, 1] == 0))
        used &= ((surface > 0) | (history[:, 2] == 0)) & ((b > 0).any() | (history[:, 0] == 0))
        out: dict[int, tuple[Array, Array]] = {}
        if not used.any():
            return out
        ones, reference = np.ones_like(spread), self.rows.reference
        weights = self.rows.row_weights(spread, b, rho * ones, surface * ones)
        change = spread + b - reference.absorption_per_m - reference.scattering_per_m
        along = np.exp(-change[:, None] * self.rows.straight_m)
        shares = self._g_shares(scene)
        for kind in np.unique(self.classes[used]):
            rows = self.classes == kind
            # Light that was never scattered knows no g: its tally is the same at every node.
            value, variance = np.zeros((2, len(a), len(self.rows.straight_m)))
            for share, index in [(1.0, shares[0][1])] if kind in NEVER_SCATTERED else shares:
                beam = self._beam(index, int(kind), scene.lamp)
                found = ((weights[:, rows] @ beam) * along).reshape(len(a), len(within), -1)
                part = share * np.einsum("whc,h->wc", found, average)
                value += part
                if errors:
                    mixed = np.einsum("whr,h->wr", weights[:, rows].reshape(len(a), len(within), -1), average)
                    thinned = self._thinning(index, int(kind), scene, mixed)
                    variance += (part * self.relative_stderr[index, kind]) ** 2 * thinned
            out[int(kind)] = value, variance
        return out

    def _thinning(self, index: int, kind: int, scene: Scene, weights: Array) -> Array:
        """Factor on the variance because other photons count now than in the traced beam and water.

        The effective number of photons of weights w is (sum w)^2 / sum w^2 (Kish 1965, Survey Sampling).

        Parameters
        ----------
        weights : array, shape (n_waters, n_rows)
            Of the rows of one class.
        """
        key = (index, kind)
        if key not in self._scatter:
            once = np.ones((1, (self.classes == kind).sum()))
            self._scatter[key] = self._concentration(index, kind, self.sent.lamp, once)
        now, then = self._concentration(index, kind, scene.lamp, weights), self._scatter[key]
        return np.divide(now, then, out=np.ones_like(now), where=(now > 0) & (then > 0))

    def _concentration(self, index: int, kind: int, lamp: Lamp, weights: Array) -> Array:
        """Sum of squares over the square of the sum of what single photons bring, up to a constant."""
        total = weights @ self._beam(index, kind, lamp)
        squares = weights**2 @ self._beam(index, kind, lamp, squares=True)
        return np.divide(squares, total**2, out=np.zeros_like(total), where=np.abs(total) > 1e-30)

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

    def _beam(self, index: int, kind: int, lamp: Lamp, squares: bool = False) -> Array:
        """Tally of one g node and class of light, contracted with a beam, (n_rows, n_cells).

        With `squares` the sum over photons of squared contributions, up to a constant.
        """
        key = (index, kind, squares, *(getattr(lamp, name) for name in BEAM))
        if key not in self._beams:
            while len(self._beams) >= KEPT_BEAMS:
                self._beams.pop(next(iter(self._beams)))
            tally = self._tally(index, kind, is_round(lamp))
            contracted = np.empty(tally.shape[1:], np.float32)
            for stretch, cells in self._stretches(lamp.apparent_distance_m):
                values = self.beam_nodes.values(_stretched(lamp, stretch)) / stretch**2
                if squares:
                    per_ring = values.reshape(self.beam_nodes.nodes.n_theta, -1)
                    values = (per_ring**2 / self.sent.density[:, None]).ravel()
                mine = tally if cells is None else tally[:, :, cells]
                flat = values.astype(np.float32) @ mine.reshape(len(mine), -1)
                contracted[:, slice(None) if cells is None else cells] = flat.reshape(mine.shape[1:])
            self._beams[key] = contracted
        return np.asarray(self._beams[key])

    def _tally(self, index: int, kind: int, rings: bool) -> Array:
        """Rows of one class, shape (n_nodes, n_rows, n_cells); for a round beam its sectors are added up."""
        key = (index, kind, rings)
        if key not in self._tallies:
            tally = self.tallies[index][:, self.classes == kind]
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


def _stretched(lamp: Lamp, factor: float) -> Lamp:
    """The beam with all its angles multiplied."""
    if factor == 1:
        return lamp
    names = ("hwhm_deg", "skirt_hwhm_deg", "tilt_x_deg", "tilt_y_deg")
    return lamp.model_copy(update={name: factor * getattr(lamp, name) for name in names})
