"""What a single trace tells of any beam, water and walls: light of the classes in every cell, and its errors.

It is tallied by history *and* by direction of emission, once per node of the asymmetry parameter g:

    E(cell) = sum over directions w  I(w)
              sum over histories h  R_g[h, w, cell]  (b/b_0)^n (rho/rho_0)^m s^k e^{-dc (r + e)}
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lightfield.arrays import Array
from lightfield.render.diffuse.between_g import BetweenG
from lightfield.render.diffuse.trace_errors import ClassLight, TraceErrors
from lightfield.render.reflected.reflected_light import bareness
from lightfield.render.response.beam_tallies import BeamTallies, roots
from lightfield.render.response.light_classes import CLASSES, FROM_MIRRORS, FROM_WALLS, NEVER_SCATTERED
from lightfield.render.response.response import Reference, TransportResponse, Waters
from lightfield.scene import Scene
from lightfield.scene.water.hardening import within_band


class Traced(NamedTuple):
    """What a trace tells.

    Parameters
    ----------
    beams : BeamTallies
        One per node of g.
    relative_stderr : array, shape (n_g, 5, n_cells)
        Monte Carlo error of each class of light (see `light_classes`) before any smoothing.
    rows, rows_of_kept : TransportResponse
        Histories of the rows, with an empty tally, over all cells, and over those that the tallies keep.
    """

    beams: BeamTallies
    relative_stderr: Array
    rows: TransportResponse
    rows_of_kept: TransportResponse

    def over(self, tallies: Array) -> TransportResponse:
        """The histories over the cells of contracted tallies, see `BeamTallies.contracted`."""
        return self.rows if tallies.shape[2] == self.rows.straight_m.size else self.rows_of_kept


@dataclass(frozen=True)
class TracedLight:
    """Light of one trace.

    Parameters
    ----------
    trace : callable
        Gives what the trace tells; asked only when light is wanted that it must tell of.
    kinds : tuple of int
        The classes of light that it tells of, see `light_classes`.
    reference : Reference
        Water and walls that it is made with.
    """

    trace: Callable[[], Traced]
    kinds: tuple[int, ...]
    reference: Reference
    between_g: BetweenG

    def classes(self, scene: Scene, a: Array, b: Array, kinds: range, errors: bool) -> dict[int, ClassLight]:
        """Light of some classes in every cell, and its errors before any smoothing, in uniform waters.

        Parameters
        ----------
        a, b : arrays, shape (n_waters,), m^-1
            Absorption and scattering coefficients.
        errors : bool
            Without, no noises come with the light.
        """
        (rho, surface), panes = scene.reflectances, scene.pane_reflectance
        lit = [
            kind
            for kind in self.kinds
            if kind in kinds
            and (rho > 0 or kind not in FROM_WALLS)
            and (surface > 0 or panes > 0 or kind not in FROM_MIRRORS)
            and (kind in NEVER_SCATTERED or (b > 0).any())
        ]
        if not lit:
            return {}
        traced = self.trace()
        beams, rows = traced.beams, traced.rows
        within, average = within_band(scene.water.hardening_per_m)
        absorption, scattering = np.add.outer(a, within).ravel(), np.repeat(b, len(within))
        ones, reference = np.ones_like(absorption), self.reference
        change = absorption + scattering - reference.absorption_per_m - reference.scattering_per_m
        shares = self.between_g.shares(scene)
        out = {}
        for kind in (k for k in lit if k in beams.rows_of):
            mine = beams.rows_of[kind]
            mirrored, part = self._panes(kind, panes)
            water = Waters(absorption, scattering, rho * ones, surface * ones, mirrored)
            tallies = beams.contracted(kind, scene.lamp)
            lit_by = traced.over(tallies)
            along = np.exp(-change[:, None] * lit_by.straight_m)

            def at_nodes(light: Array, along: Array = along, part: float = part) -> Array:
                each = (light * along).reshape(len(light), len(a), len(within), -1)
                return np.asarray(beams.at_cells(part * (average @ each)))

            found = at_nodes(lit_by.weighed(tallies, water, mine))
            value, passed_on = self.between_g.light(found, shares, errors)
            uncertain: Array = np.zeros_like(value)
            if errors:
                found = at_nodes(lit_by.uncertain(tallies, water, mine))
                uncertain, _ = self.between_g.light(found, shares, False)
            noises = []
            weights = rows.row_weights(water, mine) if errors else np.zeros((0, 0))
            for i, passed in enumerate(passed_on):
                mixed = np.einsum("whr,h->wr", weights.reshape(len(a), len(within), -1), average)
                own = traced.relative_stderr[i, kind] * roots(beams.thinning(i, kind, scene.lamp, mixed))
                noises.append(TraceErrors(passed, own, beams.images.orbits))
            out[kind] = ClassLight(value, noises, uncertain)
        return out

    def _panes(self, kind: int, panes: float) -> tuple[float | None, float]:
        """What the panes mirror in light of a class, None: as in the trace; and the part of it that counts.

        What walls alone sent is known between panes as they are traced, and between covered ones without any
        trace, see `ReflectedLight`; it changes from the one to the other as they do.
        """
        if kind == FROM_WALLS[0] and self.reference.pane_reflectance and NEVER_SCATTERED[1] not in self.kinds:
            return None, bareness(panes, self.reference.pane_reflectance)
        return panes, 1.0


@dataclass(frozen=True)
class TracedWater:
    """Light of one traced water, in the same tank under its own top and under a water surface.

    Parameters
    ----------
    under_surface : TracedLight, optional
        Of a tank that has a lid; for light that was reflected.
    """

    own_top: TracedLight
    under_surface: TracedLight | None = None

    @property
    def scattering_per_m(self) -> float:
        """Scattering coefficient of the water, m^-1."""
        return self.own_top.reference.scattering_per_m

    def classes(
        self, scene: Scene, a: Array, b: Array, errors: bool, kinds: range = range(CLASSES)
    ) -> dict[int, ClassLight]:
        """Light of every class, or of some, in every cell, and its errors; see `TracedLight.classes`."""
        if self.under_surface is None or not scene.surface_reflects:
            return self.own_top.classes(scene, a, b, kinds, errors)
        # Light that was only scattered is the same under either top, and known for every g here.
        first, last = kinds.start, kinds.stop
        scattered = self.own_top.classes(scene, a, b, range(first, min(last, 1)), errors)
        return scattered | self.under_surface.classes(scene, a, b, range(max(first, 1), last), errors)
