"""Scattered and reflected light at the places of a measurement, fast enough to fit with.

A few traces (one per node of the asymmetry parameter g) are tallied by history *and* by direction of
emission. From then on any beam, absorption, scattering, wall albedo and surface costs a millisecond, with no
new trace:

    E_diffuse(p) = sum over directions w  I(w)
                   sum over histories h  R_g[h, w, p]  (b/b_0)^n (rho/rho_0)^m s^k e^{-dc (r + e)}

A trace answers for waters near its own b_0; far from it few photons carry all the weight. Clear waters share
one; water that scatters much is answered by a trace of its own, into which the first one fades.

Followed to first order only: an offset of the lamp moves the scattered field with it (the walls stay), and an
apparent source behind the window stretches the beam plane by plane.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

from lightfield.arrays import Array
from lightfield.errors import RenderError
from lightfield.render.diffuse.dense_water import CLEAR_TO_PER_M
from lightfield.render.diffuse.errors import MANY, Noise, by_plane
from lightfield.render.diffuse.shift import Shift
from lightfield.render.diffuse.straight import from_behind
from lightfield.render.reflected.light import ReflectedLight, lagrange
from lightfield.render.response.beam_tallies import BeamTallies, roots
from lightfield.render.response.response import (
    CLASSES,
    FROM_SURFACE,
    FROM_WALLS,
    HERMITE_NODES,
    HERMITE_SHARES,
    NEVER_SCATTERED,
    Reference,
    TransportResponse,
)
from lightfield.scene import Scene
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m
from lightfield.scene.water.layers import is_layered, layers_depth

#: From where a trace is worth as much as another to where it is relied on, as a factor in b.
FADE = 1.2
#: Relative errors that are not photon noise: of light that was scattered, and of light that never was.
SCATTERED_ERROR, REFLECTED_ERROR = 0.01, 0.005
#: Cells darker than this part of the brightest have no relative error of their own.
DARK = 1e-9


class Traced(NamedTuple):
    """What a trace tells.

    Parameters
    ----------
    beams : BeamTallies
        One per node of g.
    relative_stderr : array, shape (n_g, 5, n_cells)
        Monte Carlo error of each class of light (see `light_classes`) before any smoothing.
    rows : TransportResponse
        Histories of the rows, with an empty tally.
    part : array, shape (n_g,)
        Of the photons that each node was traced with.
    """

    beams: BeamTallies
    relative_stderr: Array
    rows: TransportResponse
    part: Array


@dataclass(frozen=True)
class DiffuseResponse:
    """Response of the diffuse light at n positions to beam, water, walls and surface.

    Parameters
    ----------
    trace : callable
        Gives what the trace tells; asked only when light is wanted that it must tell of.
    kinds : tuple of int
        The classes of light that it tells of, see `light_classes`.
    reference : Reference
        Water and walls that it is made with.
    straight_m : array, shape (n_cells,), m
        Straight line from the lamp to each cell, in water.
    g_nodes : tuple of float
        Empty when the phase function has no g (one tally then).
    shift : Shift
        From cells to positions.
    images : array of 0 and 1, shape (n_cells, n_sets)
        Which cells are mirror images of each other and share their photons.
    wall_smoother : sparse array, shape (n_cells, n_cells)
        By which the tallies of light from walls were smoothed.
    ratio_smoother : sparse array, shape (n_cells, n_cells)
        For ratios of the light at one g and another.
    under_surface : DiffuseResponse, optional
        The same tank with a water surface in place of its lid; for light that was reflected.
    reflected : ReflectedLight, optional
        Light that was reflected and not scattered, known better than from a trace.
    denser : DiffuseResponse, optional
        The same scene traced in water that scatters more, see `with_denser`.
    """

    trace: Callable[[], Traced]
    kinds: tuple[int, ...]
    reference: Reference
    straight_m: Array
    g_nodes: tuple[float, ...]
    shift: Shift
    images: Array
    wall_smoother: csr_array
    ratio_smoother: csr_array
    under_surface: DiffuseResponse | None = None
    reflected: ReflectedLight | None = None
    denser: DiffuseResponse | None = None

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
        a, b = self._water(scene, wavelengths_nm)
        return self._moved(scene, a, b) + self._unscattered(scene, a + b)

    def errors(
        self, scene: Scene, wavelengths_nm: Sequence[float | None], channel: NDArray[np.integer[Any]]
    ) -> tuple[Array, Array]:
        """Errors of the light at readings that have one wavelength each.

        Parameters
        ----------
        channel : array of int, shape (n,)
            Which of the wavelengths.

        Returns
        -------
        modes : array, shape (n, k), m^-2
            Monte Carlo errors as independent contributions: covariance = modes @ modes.T. Mirror images share
            their photons, light from walls is smoothed over a plane, and all wavelengths are of one trace:
            such readings share contributions, the less the more their waters differ.
        smooth : array, shape (n,), m^-2
            Size of an error that varies little between neighbours: interpolation in g, beams of a finite
            basis, patches of the walls.
        """
        a, b = self._water(scene, wavelengths_nm)
        smooth = SCATTERED_ERROR * self._moved(scene, a, b) + REFLECTED_ERROR * self._unscattered(
            scene, a + b
        )
        return self._modes(scene, a, b, channel), smooth[channel, np.arange(len(channel))]

    def with_denser(self, other: DiffuseResponse) -> DiffuseResponse:
        """The same, with what a trace in denser water says of waters like that one."""
        return replace(self, denser=other)

    def some(self, rows: NDArray[np.bool_]) -> DiffuseResponse:
        """At some of the readings, from the same traces."""
        return replace(
            self,
            shift=self.shift.some(rows),
            reflected=self.reflected and self.reflected.some(rows),
            denser=self.denser and self.denser.some(rows),
        )

    def _share_of_denser(self, b: Array) -> Array:
        """How much of each water is left to the denser response; smooth in b, shape (n_waters,).

        Far from the water of a trace the variance grows as exp((b - b_0)^2 L / b_0): two traces are worth
        the same at the geometric mean of their waters.
        """
        if self.denser is None:
            return np.zeros(len(b))
        one, other = (r.reference.scattering_per_m for r in (self, self.denser))
        low = max(CLEAR_TO_PER_M, np.sqrt(one * other) / FADE)
        t = np.clip((b - low) / (low * FADE**2 - low), 0, 1)
        return np.asarray(t * t * (3 - 2 * t))

    def _moved(self, scene: Scene, a: Array, b: Array) -> Array:
        """The traced light at the readings, shape (n_waters, n)."""
        share = self._share_of_denser(b)
        if self.denser is None or not share.any():
            return self._traced(scene, a, b)
        beyond = share[:, None] * self.denser._moved(scene, a, b)
        return beyond if (share == 1).all() else beyond + (1 - share)[:, None] * self._traced(scene, a, b)

    def _modes(self, scene: Scene, a: Array, b: Array, channel: NDArray[np.integer[Any]]) -> Array:
        """Errors of the traced light as independent contributions, shape (n, k); see `errors`."""
        share = self._share_of_denser(b)
        traced = ((1 - share)[:, None] * self._traced(scene, a, b))[channel, np.arange(len(channel))]
        # Kept even where its share is nothing: the same columns are the same photons in every water.
        modes = traced[:, None] * self._relative_modes(scene, a, b, channel)
        if self.denser is None or not share.any():
            return np.asarray(modes)
        return np.hstack([modes, share[channel, None] * self.denser._modes(scene, a, b, channel)])

    def _traced(self, scene: Scene, a: Array, b: Array) -> Array:
        """The light of this trace at the readings, shape (n_waters, n)."""
        nothing = np.zeros((len(a), len(self.straight_m)))
        light = sum((v for v, _ in self._light(scene, a, b, errors=False).values()), nothing)
        z, r = self.shift.cell_z_m, self.straight_m
        seen = light * np.exp(-layers_depth(scene.water, z, r))
        seen = seen * from_behind(scene.lamp.apparent_distance_m, a + b, z, r)
        return self.shift.apply(seen, scene.lamp.offset_x_m, scene.lamp.offset_y_m)

    @staticmethod
    def _water(scene: Scene, wavelengths_nm: Sequence[float | None]) -> tuple[Array, Array]:
        """Absorption and scattering coefficients, m^-1, each of shape (n_wavelengths,)."""
        middle = 0.5 * sum(scene.detector.bands_nm[0])
        at = np.array([middle if w is None else w for w in wavelengths_nm])
        return absorption_per_m(scene.water, at), scattering_per_m(scene.water, at)

    def _light(self, scene: Scene, a: Array, b: Array, errors: bool) -> dict[int, tuple[Array, list[Noise]]]:
        """Light of every class in every cell, and its errors, in uniform waters; see `_classes`."""
        if self.under_surface is None or not scene.surface_reflects:
            return self._classes(scene, a, b, range(CLASSES), errors)
        # Light that was only scattered is the same under either top, and known for every g here.
        scattered = self._classes(scene, a, b, range(1), errors)
        return scattered | self.under_surface._classes(scene, a, b, range(1, CLASSES), errors)

    def _relative_modes(self, scene: Scene, a: Array, b: Array, channel: NDArray[np.integer[Any]]) -> Array:
        """Relative errors of the traced light at the readings as independent contributions, shape (n, k).

        At most 1: beyond the nodes of g the light of a dim cell may come out as nothing.
        """
        parts = self._light(scene, a, b, errors=True)
        if not parts:
            return np.zeros((len(channel), 0))
        total = sum((v for v, _ in parts.values()), np.zeros((len(a), len(self.straight_m))))
        per_light = 1 / np.maximum(total, DARK * total.max(axis=1, keepdims=True, initial=1e-290))
        open_top = self.under_surface is not None and scene.surface_reflects
        walls = (self.under_surface if open_top and self.under_surface else self).wall_smoother
        if self.shift.asked > MANY:
            every = by_plane(self.shift, parts, per_light, walls, channel)
            return every / np.maximum(np.linalg.norm(every, axis=1, keepdims=True), 1)
        modes = []
        for kind, (_, noises) in parts.items():
            for noise in noises:
                found = np.zeros((len(channel), noise.roots.shape[1] * noise.images.shape[1]))
                for water in np.unique(channel):
                    mine = channel == water
                    spread = self.shift.shares[mine] @ diags_array(per_light[water])
                    if kind in FROM_WALLS:
                        spread = spread @ walls
                    passed_on = (spread @ noise.passed_on[water]).tocsr()
                    each = [passed_on @ (root[:, None] * noise.images) for root in noise.roots[water]]
                    found[mine] = np.hstack(each)
                modes.append(found)
        every = np.hstack(modes)
        return every / np.maximum(np.linalg.norm(every, axis=1, keepdims=True), 1)

    def _unscattered(self, scene: Scene, attenuation: Array) -> Array:
        """Light that was reflected and never scattered, free of Monte Carlo noise, shape (n_waters, n)."""
        light = np.zeros((len(attenuation), len(self.shift.cell)))
        if self.reflected is None or not any(scene.reflectances):
            return light
        nodes, shares = self._spread(scene)
        for one, c in zip(light, attenuation, strict=True):
            for share, at in zip(shares, nodes, strict=True):
                one += share * self.reflected.evaluate(scene, float(c + at))
        if is_layered(scene.water):
            along = np.exp(-layers_depth(scene.water, self.shift.cell_z_m, self.straight_m))
            light *= self.shift.pick(along)
        return light

    @staticmethod
    def _spread(scene: Scene) -> tuple[Array, Array]:
        """Changes of the attenuation within a band, m^-1, and the share of each."""
        q = scene.water.hardening_per_m
        return (q * HERMITE_NODES, HERMITE_SHARES) if q else (np.zeros(1), np.ones(1))

    def _classes(
        self, scene: Scene, a: Array, b: Array, kinds: range, errors: bool
    ) -> dict[int, tuple[Array, list[Noise]]]:
        """Light of some classes in every cell, and its errors before any smoothing, in uniform waters.

        The light of shape (n_waters, n_cells); a noise for every node of g, if asked for.
        """
        rho, surface = scene.reflectances
        within, average = self._spread(scene)
        spread, b = np.add.outer(a, within).ravel(), np.repeat(b, len(within))
        out: dict[int, tuple[Array, list[Noise]]] = {}
        lit = [
            kind
            for kind in self.kinds
            if kind in kinds
            and (rho > 0 or kind not in FROM_WALLS)
            and (surface > 0 or kind not in FROM_SURFACE)
            and (kind in NEVER_SCATTERED or (b > 0).any())
        ]
        if not lit:
            return out
        beams, relative_stderr, rows, part = self.trace()
        ones, reference = np.ones_like(spread), self.reference
        change = spread + b - reference.absorption_per_m - reference.scattering_per_m
        along = np.exp(-change[:, None] * self.straight_m)
        shares = self._g_shares(scene)
        for kind in lit:
            if kind not in beams.rows_of:
                continue
            weights = rows.row_weights(spread, b, rho * ones, surface * ones, beams.rows_of[kind])
            light = weights @ beams.contracted(kind, scene.lamp) * along
            found = average @ light.reshape(len(light), len(a), len(within), -1)
            value, passed_on = self._at_g(found, shares, part, errors)
            noises = []
            for i in range(len(found)) if errors else ():
                mixed = np.einsum("whr,h->wr", weights.reshape(len(a), len(within), -1), average)
                own = relative_stderr[i, kind] * roots(beams.thinning(i, kind, scene.lamp, mixed))
                noises.append(Noise(passed_on[i], own, self.images))
            out[kind] = value, noises
        return out

    def _at_g(self, found: Array, shares: Array, part: Array, errors: bool) -> tuple[Array, list[list[Any]]]:
        """Light at one g from that at the nodes.

        The nodes are traced apart, and a fit would take the difference of their noise for that of g. But the
        light at one g over that at another varies slowly from cell to cell: smoothed ratios, times the mean
        of all nodes, have a noise that hardly depends on g, and less of it.

        Parameters
        ----------
        found : array, shape (n_nodes, n_waters, n_cells)

        Returns
        -------
        value : array, shape (n_waters, n_cells)
        passed_on : list of n_nodes lists of n_waters sparse arrays, shape (n_cells, n_cells)
            Change of the value in one cell with the relative error of a node's light in another; empty unless
            asked for.
        """
        if len(found) < 2:
            return found[0], [[diags_array(light) for light in found[0]]] if errors else []
        flat = found.reshape(len(found), -1)
        mean, wanted = ((w @ flat).reshape(found.shape[1:]) for w in (part, shares))
        lit = mean > 0
        ratio = np.divide(wanted, mean, out=np.ones_like(mean), where=lit)
        value = mean * (ratio @ self.ratio_smoother.T)
        if not errors:
            return value, []
        ratios = np.divide(found, mean, out=np.ones_like(found), where=lit)
        common = part[:, None, None] * ratios
        apart = shares[:, None, None] * ratios - common * ratio
        passed_on = [
            [diags_array(m) @ self.ratio_smoother @ diags_array(n) + diags_array(c) for m, n, c in each]
            for each in (zip(mean, apart[i], common[i] * value, strict=True) for i in range(len(found)))
        ]
        return value, passed_on

    def _g_shares(self, scene: Scene) -> Array:
        """Lagrange interpolation in log(1 - g) over the traced nodes, shape (n_nodes,)."""
        if len(self.g_nodes) < 2:
            return np.ones(1)
        g = float(scene.get("water.phase.g"))
        if not self.g_nodes[0] - 0.1 <= g <= 0.99:
            raise RenderError(
                "g is outside the traced range",
                where="water.phase.g",
                found=g,
                rule=f"{self.g_nodes[0] - 0.1:.2f} to 0.99",
            )
        return _interpolation(self.g_nodes, g)


@lru_cache(maxsize=64)
def _interpolation(g_nodes: tuple[float, ...], g: float) -> Array:
    return lagrange(np.log1p(-np.array(g_nodes)).tolist(), float(np.log1p(-g)))
