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

from lightfield.errors import RenderError
from lightfield.render.beam_tallies import BeamTallies
from lightfield.render.reflected import ReflectedLight, lagrange
from lightfield.render.response import (
    CLASSES,
    FROM_SURFACE,
    FROM_WALLS,
    HERMITE_NODES,
    HERMITE_SHARES,
    NEVER_SCATTERED,
    Array,
    Reference,
    TransportResponse,
)
from lightfield.render.shift import Shift
from lightfield.render.straight import from_behind, inhomogeneous
from lightfield.scene import Scene
from lightfield.water.iop import absorption_per_m, scattering_per_m

#: Scattering of the water of the first trace. Waters that scatter less than the second number are answered by
#: it alone; denser ones by a trace in water that scatters as much as the third, or a power of the step more.
CLEAR_PER_M, CLEAR_TO_PER_M, DENSE_FROM_PER_M, DENSE_STEP = 0.2, 0.3, 0.43, 1.7
#: How far a trace reaches into denser water, as a factor in b; and the power of such a factor by which fits
#: fall short at least (0.06 to 0.1 where the farthest reading is 5 m away, 0.2 to 0.4 at 8.5 m).
REACH, FALLS_SHORT = 1.05, 0.12
#: From where a trace is worth as much as another to where it is relied on, as a factor in b.
FADE = 1.2
#: Relative errors that are not photon noise: of light that was scattered, and of light that never was.
SCATTERED_ERROR, REFLECTED_ERROR = 0.01, 0.005


def dense_water(scattering_per_m: Array) -> float | None:
    """The largest of several scattering coefficients, m^-1; None where the first trace will do.

    Parameters
    ----------
    scattering_per_m : array, shape (n_wavelengths,)
    """
    most = float(scattering_per_m.max())
    return most if most > CLEAR_TO_PER_M else None


def trace_for(scattering_per_m: float, traced_per_m: float | None = None) -> float:
    """Scattering coefficient of the trace that dense water asks for, m^-1.

    Rather that of denser water than of clearer: photons that scattered too often weigh little there, while
    here they would be missing.

    Parameters
    ----------
    scattering_per_m : float
        Of the water.
    traced_per_m : float, optional
        Set when the water was found by a fit with the trace of another one. In denser water the rare photons
        that should carry the light are mostly missed, and a fit stops short of the truth.
    """
    b = scattering_per_m
    if traced_per_m is not None:
        b *= max(b / traced_per_m, 1.0) ** FALLS_SHORT
    steps = np.ceil(np.log(b / (REACH * DENSE_FROM_PER_M)) / np.log(DENSE_STEP))
    return float(DENSE_FROM_PER_M * DENSE_STEP ** max(steps, 0))


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
    """

    beams: BeamTallies
    relative_stderr: Array
    rows: TransportResponse


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
    wall_smoother : array, shape (n_cells, n_cells)
        By which the tallies of light from walls were smoothed.
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
    wall_smoother: Array
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
        seen = light * inhomogeneous(scene.water, z, r)
        seen = seen * from_behind(scene.lamp.apparent_distance_m, a + b, z, r)
        return self.shift.apply(seen, scene.lamp.offset_x_m, scene.lamp.offset_y_m)

    @staticmethod
    def _water(scene: Scene, wavelengths_nm: Sequence[float | None]) -> tuple[Array, Array]:
        """Absorption and scattering coefficients, m^-1, each of shape (n_wavelengths,)."""
        middle = 0.5 * sum(scene.detector.bands_nm[0])
        at = np.array([middle if w is None else w for w in wavelengths_nm])
        return absorption_per_m(scene.water, at), scattering_per_m(scene.water, at)

    def _light(self, scene: Scene, a: Array, b: Array, errors: bool) -> dict[int, tuple[Array, Array]]:
        """Light of every class in every cell, and its covariance, in uniform waters."""
        if self.under_surface is None or scene.tank is None or scene.tank.surface_reflectance == 0:
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
        total = sum((v for v, _ in parts.values()), np.full((len(a), len(self.straight_m)), 1e-300))
        variance = sum(np.einsum("wwh->wh", covariance) for _, covariance in parts.values())
        total = np.maximum(total, np.sqrt(variance))
        open_top = self.under_surface is not None and scene.tank and scene.tank.surface_reflectance > 0
        modes = []
        for kind, (_, covariance) in parts.items():
            traced = self.under_surface if open_top and kind > 0 and self.under_surface else self
            roots = _roots(covariance) / total[:, None]
            found = np.zeros((len(channel), len(a), traced.images.shape[1]))
            for water in np.unique(channel):
                error = roots[water][..., None] * traced.images  # (n_waters, n_cells, n_sets)
                if kind in FROM_WALLS:
                    error = traced.wall_smoother @ (error * total[water][:, None]) / total[water][:, None]
                mine = channel == water
                found[mine] = np.moveaxis(self.shift.spread(error), 0, 1)[mine]
            modes.append(found.reshape(len(channel), -1))
        return np.hstack(modes)

    def _unscattered(self, scene: Scene, attenuation: Array) -> Array:
        """Light that was reflected and never scattered, free of Monte Carlo noise, shape (n_waters, n)."""
        light, tank = np.zeros((len(attenuation), len(self.shift.cell))), scene.tank
        if self.reflected is None or tank is None or tank.wall_albedo == tank.surface_reflectance == 0:
            return light
        nodes, shares = self._spread(scene)
        for one, c in zip(light, attenuation, strict=True):
            for share, at in zip(shares, nodes, strict=True):
                one += share * self.reflected.evaluate(scene, float(c + at))
        along = inhomogeneous(scene.water, self.shift.cell_z_m, self.straight_m)
        return light * self.shift.pick(along)

    @staticmethod
    def _spread(scene: Scene) -> tuple[Array, Array]:
        """Changes of the attenuation within a band, m^-1, and the share of each."""
        q = scene.water.hardening_per_m
        return (q * HERMITE_NODES, HERMITE_SHARES) if q else (np.zeros(1), np.ones(1))

    def _classes(
        self, scene: Scene, a: Array, b: Array, kinds: range, errors: bool
    ) -> dict[int, tuple[Array, Array]]:
        """Light of some classes in every cell, and its covariance before any smoothing, in uniform waters.

        Of shapes (n_waters, n_cells) and (n_waters, n_waters, n_cells); no covariance unless asked for.
        """
        tank = scene.tank
        rho, surface = (tank.wall_albedo, tank.surface_reflectance) if tank else (0.0, 0.0)
        within, average = self._spread(scene)
        spread, b = np.add.outer(a, within).ravel(), np.repeat(b, len(within))
        out: dict[int, tuple[Array, Array]] = {}
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
        beams, relative_stderr, rows = self.trace()
        ones, reference = np.ones_like(spread), self.reference
        change = spread + b - reference.absorption_per_m - reference.scattering_per_m
        along = np.exp(-change[:, None] * self.straight_m)
        shares = self._g_shares(scene)
        for kind in lit:
            if kind not in beams.rows_of:
                continue
            weights = rows.row_weights(spread, b, rho * ones, surface * ones, beams.rows_of[kind])
            # Light that was never scattered knows no g: its tally is the same at every node.
            value = np.zeros((len(a), len(self.straight_m)))
            covariance = np.zeros((len(a), *(value.shape if errors else (0, 0))))
            for share, index in [(1.0, shares[0][1])] if kind in NEVER_SCATTERED else shares:
                beam = beams.contracted(index, kind, scene.lamp)
                found = ((weights @ beam) * along).reshape(len(a), len(within), -1)
                part = share * np.einsum("whc,h->wc", found, average)
                value += part
                if errors:
                    mixed = np.einsum("whr,h->wr", weights.reshape(len(a), len(within), -1), average)
                    error = part * relative_stderr[index, kind]
                    covariance += error[:, None] * error * beams.thinning(index, kind, scene.lamp, mixed)
            out[kind] = value, covariance
        return out

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
        return _shares(self.g_nodes, g)


@lru_cache(maxsize=64)
def _shares(g_nodes: tuple[float, ...], g: float) -> list[tuple[float, int]]:
    """Shares of the nodes that take part, and their numbers."""
    shares = lagrange(np.log1p(-np.array(g_nodes)).tolist(), float(np.log1p(-g))).tolist()
    return [(share, i) for i, share in enumerate(shares) if abs(share) > 1e-9]


def _roots(covariance: Array) -> Array:
    """Lower triangular roots of the covariances of cells, shape (k, k, n_cells) as given."""
    size = np.sqrt(np.einsum("wwh->wh", covariance))
    lengths = np.where(size > 1e-150, size, np.inf)
    few = 1e-5 * np.eye(len(size))  # sums in single precision are positive definite only up to that
    correlation = np.moveaxis(covariance / (lengths[:, None] * lengths), 2, 0)
    correlation += np.eye(len(size)) * np.isinf(lengths.T)[:, :, None]
    roots = np.linalg.cholesky((correlation + few) / (1 + 1e-5))
    return np.asarray(size[:, None] * np.moveaxis(roots, 0, 2))
