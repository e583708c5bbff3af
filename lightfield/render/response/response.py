"""The transport response: one trace, every water.

    E(a, b, rho, s) = sum over histories  R[n, m, k, j, e]  (b / b_0)^n  (rho / rho_0)^m  s^k  (w / w_0)^j
                      exp(-(c - c_0) (r + e)),      c = a + b

R is the tally of a trace in the reference water (a_0, b_0) with wall albedo rho_0; n, m, k count
scatterings, wall hits and surface reflections, j those by panes, where there are any (of reflectance w); e is
the path in excess of the straight line r to the cell.
No NumPy array here depends on Mitsuba, so a response read from disk is evaluated without it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import gammainc

from lightfield.arrays import TINY, Array, Mask
from lightfield.errors import RenderError
from lightfield.memory import Latest
from lightfield.render.response.open_ended import OPEN_ENDED_ERROR, Lengths
from lightfield.scene.water.hardening import within_band

Rows = NDArray[np.integer[Any]] | slice
#: Factors of rows in cells that are worked out at a time, one water at least.
_AT_ONCE = 1_000_000
#: Choices of rows whose factors are kept: a fit asks for a few, again and again.
_ROWS_KEPT = 16


@dataclass(frozen=True)
class Reference:
    """Water, walls, surface and panes of a trace: m^-1, m^-1, albedo, factors on the Fresnel reflectance, and
    the part of the scattering that is molecular."""

    absorption_per_m: float
    scattering_per_m: float
    wall_albedo: float
    surface_reflectance: float = 1.0
    #: Not in the text that seeds come from: those of other scenes stay.
    molecular_share: float = field(default=0.0, repr=False)
    pane_reflectance: float = field(default=0.0, repr=False)
    #: The part of what is diffuse in the tank that bare panes would mirror where it meets a wall.
    by_panes: float = field(default=0.0, repr=False)


class Waters(NamedTuple):
    """Waters that a response is asked for, each with its walls and surface; arrays of shape (n_waters,).

    Parameters
    ----------
    a, b : array, m^-1
        Absorption and scattering coefficients.
    rho, surface : array
        Wall albedo; multiplier of the surface's Fresnel reflectance.
    panes : float, optional
        The same of panes, of all waters; default: as traced.
    """

    a: Array
    b: Array
    rho: Array
    surface: Array
    panes: float | None = None


@dataclass(frozen=True)
class TransportResponse:
    """Tally of a trace, split by history and by independent batch.

    Parameters
    ----------
    tally : array, shape (n_batches, n_rows, n_cells), m^-2 (m^-2 sr^-1 for radiance)
        For unit on-axis radiant intensity (for a pencil beam: unit power).
    histories : array of int, shape (n_rows, 3 or 4)
        Scatterings, wall hits and surface reflections of each row; reflections by panes where there are any.
    excess_m : array, shape (n_rows,), m
        Path in excess of the straight line.
    straight_m : array, shape (n_planes, n_y, n_x), m
        Straight line from the lamp to each cell, in water.
    photons : int
        Photons traced, all batches together.
    merged : array of int, shape of `straight_m`, optional
        Cell of the tally that each cell of the maps is read from; mirror images share one and its error.
    """

    tally: Array
    histories: NDArray[np.integer[Any]]
    excess_m: Array
    straight_m: Array
    reference: Reference
    photons: int
    merged: NDArray[np.integer[Any]] | None = None
    #: Factors of the rows that depend on the histories alone, as last asked for: a fit changes them rarely.
    _last: Latest[bytes, tuple[Any, Array]] = field(
        default_factory=lambda: Latest(_ROWS_KEPT), init=False, repr=False, compare=False
    )

    def packed(self) -> dict[str, NDArray[Any]]:
        """Plain arrays to store, all but the reference."""
        names = ("tally", "histories", "excess_m", "straight_m")
        arrays = {name: getattr(self, name) for name in names} | {"photons": np.array(self.photons)}
        # Empty for none: were it left out, a damaged name of the array would read as none.
        return arrays | {"merged": np.empty(0, int) if self.merged is None else self.merged}

    @classmethod
    def unpacked(cls, stored: Mapping[str, NDArray[Any]], reference: Reference) -> TransportResponse:
        """The response that was `packed`."""
        return cls(
            stored["tally"],
            stored["histories"],
            stored["excess_m"],
            stored["straight_m"],
            reference,
            int(stored["photons"]),
            stored["merged"] if stored["merged"].size else None,
        )

    @property
    def shape(self) -> tuple[int, ...]:
        """(n_planes, n_y, n_x)."""
        return self.straight_m.shape

    @property
    def is_direct(self) -> Mask:
        """Rows that light has reached without scattering or reflection, shape (n_rows,)."""
        return np.asarray(~self.histories.any(axis=1))

    def evaluate(
        self,
        a: ArrayLike,
        b: ArrayLike,
        rho: ArrayLike = 0.0,
        surface: ArrayLike = 0.0,
        *,
        hardening: float = 0.0,
        part: str = "all",
    ) -> tuple[Array, Array]:
        """Maps for other waters, walls and surfaces.

        Parameters
        ----------
        a, b : array_like, shape (n,) or scalar, m^-1
            Absorption and scattering coefficients.
        rho, surface : array_like, shape (n,) or scalar
            Wall albedo; multiplier of the surface's Fresnel reflectance.
        hardening : float, m^-1
            Standard deviation of the attenuation over the band: -ln T = K r - (q r)^2 / 2.
        part : "all", "direct" or "diffuse"
            Direct light is neither scattered nor reflected.

        Returns
        -------
        mean, stderr : arrays, shape (n, n_planes, n_y, n_x) or (n_planes, n_y, n_x) for scalars
            stderr is infinite where not one photon was tallied.

        Raises
        ------
        RenderError
            The trace cannot answer: scattering or walls asked for that it was made without, or between walls
            another surface than its own.
        """
        scalar = all(np.ndim(v) == 0 for v in (a, b, rho, surface))
        columns = np.broadcast_arrays(*(np.atleast_1d(np.asarray(v, float)) for v in (a, b, rho, surface)))
        if hardening:
            changes, shares = within_band(hardening)
            spread = [np.repeat(v, len(changes)) for v in columns]
            spread[0] = spread[0] + np.tile(changes, len(columns[0]))
            batches = self._batches(*spread, part=part)
            split = batches.reshape(len(batches), len(columns[0]), len(shares), -1)
            batches = np.einsum("bwhp,h->bwp", split, shares)
        else:
            batches = self._batches(*columns, part=part)
        mean, stderr = (self._spread(v) for v in mean_and_stderr(batches))
        return (mean[0], stderr[0]) if scalar else (mean, stderr)

    def batches(self, a: float, b: float, rho: float = 0.0, surface: float = 0.0, part: str = "all") -> Array:
        """One map per independent batch, shape (n_batches, n_planes, n_y, n_x)."""
        columns = [np.array([v], float) for v in (a, b, rho, surface)]
        return self._spread(self._batches(*columns, part=part)[:, 0])

    def _batches(self, a: Array, b: Array, rho: Array, surface: Array, *, part: str) -> Array:
        self._refuse_other_surface(surface)
        waters = Waters(a, b, rho, surface)
        weights = self.row_weights(waters)
        if part != "all":
            weights[:, self.is_direct != (part == "direct")] = 0
        varying = np.flatnonzero(self.varying(b) & weights.any(axis=0))
        more = self._of_varying(self.tally[:, varying], waters, varying) if len(varying) else 0.0
        weights[:, varying] = 0
        used = np.flatnonzero(weights.any(axis=0))
        first, last = (used[0], used[-1] + 1) if len(used) else (0, 0)
        if 2 * len(used) > last - first:
            # A few rows that do not count cost less than a copy of the others.
            tally, weights = self.tally[:, first:last], weights[:, first:last]
        else:
            tally, weights = self.tally[:, used], weights[:, used]
        weights = np.ascontiguousarray(weights, dtype=np.float32)
        change = (a + b - self.reference.absorption_per_m - self.reference.scattering_per_m)[:, None]
        along = np.exp(-change * self._straight_of_tally)
        return np.asarray((np.stack([weights @ batch for batch in tally]) + more) * along, dtype=float)

    def _refuse_other_surface(self, surface: Array) -> None:
        """Of light that met two walls and the surface the tally of a map says that it met walls."""
        traced = self.reference.surface_reflectance
        if self.reference.wall_albedo > 0 and self.histories[:, 2].any() and (surface != traced).any():
            raise RenderError(
                "this response was traced under another surface",
                found=float(surface[surface != traced][0]),
                rule=f"between walls that reflect: tank.surface_reflectance = {traced:g}, as it was traced",
                remedy="trace again with that surface",
            )

    def weighed(self, tallies: Array, waters: Waters, rows: Rows) -> Array:
        """Tallies of some rows in other waters, without the attenuation along the straight line.

        Parameters
        ----------
        tallies : array, shape (k, n_rows, n_cells)
            Of cells as in `straight_m`.

        Returns
        -------
        array, shape (k, n_waters, n_cells)
        """
        weights, varying = self.row_weights(waters, rows), self.varying(waters.b, rows)
        weights[:, varying] = 0  # a few rows that do not count cost less than a copy of the others
        weights = weights.astype(tallies.dtype)
        light = np.stack([weights @ tally for tally in tallies])
        if not varying.any():
            return light
        some = np.arange(len(self.histories))[rows][varying]
        return np.asarray(light + self._of_varying(tallies[:, varying], waters, some))

    def uncertain(self, tallies: Array, waters: Waters, rows: Rows) -> Array:
        """Error of what `weighed` gives by the number of scatterings that open-ended rows do not tell."""
        b = waters.b
        some = np.arange(len(self.histories))[rows][varying := self.varying(b, rows)]
        if not len(some):
            return np.zeros((len(tallies), len(b), tallies.shape[2]))
        before = self.reference.scattering_per_m
        beyond = self._lengths.beyond(self.histories[some, 0], self.excess_m[some], before)
        light = self._of_varying(tallies[:, varying] * beyond, waters, some)
        return OPEN_ENDED_ERROR * np.abs(np.log(np.maximum(b, TINY) / before))[:, None] * light

    def _of_varying(self, tallies: Array, waters: Waters, rows: NDArray[np.integer[Any]]) -> Array:
        """The same of open-ended rows, whose factor is another in every cell; (k, n_waters, n_cells)."""
        n, b = self.histories[rows, 0], waters.b
        ref, excess = self.reference, self.excess_m[rows]
        along = np.exp((ref.absorption_per_m - waters.a)[:, None] * excess)
        factor = self._reflecting(waters, rows) * along
        more = np.exp((b - ref.scattering_per_m)[:, None] * self._straight_of_tally)
        out = np.empty((len(tallies), len(b), tallies.shape[2]), tallies.dtype)
        step = max(_AT_ONCE // max(len(rows) * tallies.shape[2], 1), 1)
        for first in range(0, len(b), step):
            some = slice(first, first + step)
            chances = self._chances(b[some], n, excess, rows) * factor[some, :, None]
            np.einsum("wtc,ktc->kwc", chances.astype(tallies.dtype), tallies, out=out[:, some])
        return out * more

    def _chances(
        self, b: Array, n: NDArray[np.integer[Any]], excess_m: Array, rows: NDArray[np.integer[Any]]
    ) -> Array:
        """`Lengths.chances` of some rows, as last asked for where they are few."""
        name, key = b"chances" + rows.tobytes(), b.tobytes()
        known, chances = self._last.get(name, (None, np.zeros(0)))
        if known != key:
            chances = self._lengths.chances(n, excess_m, b, self.reference.scattering_per_m)
            if chances.size <= _AT_ONCE:
                self._last[name] = key, chances
        return chances

    @cached_property
    def _lengths(self) -> Lengths:
        return Lengths.of(self._straight_of_tally)

    def varying(self, b: Array, rows: Rows = slice(None)) -> Mask:
        """Which of some rows have another factor in every cell, shape (n_rows,)."""
        before, open_ended = self.reference.scattering_per_m, self.open_ended[rows]
        return open_ended & bool(before > 0 and (b != before).any() and np.ptp(self.straight_m) > 0)

    @cached_property
    def _straight_of_tally(self) -> Array:
        """Straight line to every cell of the tally, shape (n_cells,), m."""
        if self.merged is None:
            return self.straight_m.reshape(-1)
        straight = np.empty(self.tally.shape[2])
        straight[self.merged.ravel()] = self.straight_m.ravel()
        return straight

    def read_from(self, cells: NDArray[np.integer[Any]]) -> NDArray[np.integer[Any]]:
        """Cells of the tally that some cells of the maps, by their numbers, are read from; of their shape."""
        return cells if self.merged is None else self.merged.ravel()[cells]

    def _spread(self, values: Array) -> Array:
        """Values of the cells of the tally as maps: shape (n, n_cells) to (n, n_planes, n_y, n_x)."""
        return values.reshape(-1, *self.shape) if self.merged is None else values[:, self.merged]

    def row_weights(self, waters: Waters, rows: Rows = slice(None)) -> Array:
        """Factor of every row, or of some, without the attenuation along the straight line; (n, n_rows).

        Of open-ended rows that in the middle of the cells, see `weighed`.
        """
        ref, (a, b, rho, surface, panes) = self.reference, waters
        if (b > 0).any() and ref.scattering_per_m == 0:
            raise RenderError(
                "this response was traced without scattering",
                found=float(b.max()),
                rule="b > 0 needs a trace with b > 0",
                remedy="trace again with reference_scattering_per_m > 0",
            )
        if (rho > 0).any() and ref.wall_albedo == 0:
            raise RenderError(
                "this response was traced with black walls",
                found=float(rho.max()),
                rule="albedo > 0 needs a trace with reflecting walls",
                remedy="trace again with reference_wall_albedo > 0 in a scene with a [tank]",
            )
        change = (a + b - ref.absorption_per_m - ref.scattering_per_m)[:, None]
        key = (*(v.tobytes() for v in (b, rho, surface)), panes)
        name = rows.tobytes() if isinstance(rows, np.ndarray) else repr(rows).encode()
        known, factor = self._last.get(name, (None, np.zeros(0)))
        if known != key:
            factor = self._scattering(b, rows) * self._reflecting(waters, rows)
            self._last[name] = key, factor
        return np.asarray(factor * np.exp(-change * self.excess_m[rows]))

    def _reflecting(self, waters: Waters, rows: Rows) -> Array:
        """Factor (rho / rho_0)^m s^k (w / w_0)^j of rows, shape (n, n_rows)."""
        ref, (_, m, k, *j) = self.reference, self.histories[rows].T
        _, _, rho, surface, panes = waters
        by_panes: Array | float = 1.0
        if panes is not None and j:
            # What a pane does not mirror is for what is behind it to send back; on average over directions.
            before, part = ref.pane_reflectance, ref.by_panes
            rho = rho * (1 - part * panes) / (1 - part * before)
            by_panes = (panes / before) ** j[0]
        walls = (rho / ref.wall_albedo if ref.wall_albedo else np.zeros_like(rho))[:, None] ** m
        mirrored = (surface / (ref.surface_reflectance or 1.0))[:, None] ** k
        return np.asarray(walls * mirrored * by_panes)

    def _scattering(self, b: Array, rows: Rows) -> Array:
        """Factor (b / b_0)^n of every row, shape (n, n_rows).

        Of open-ended rows as `open_ended` says, for the mean of the straight lines to the cells.
        """
        n, reference = self.histories[rows, 0], self.reference.scattering_per_m
        if reference == 0:
            return np.zeros((len(b), 1)) ** n
        factor = (b / reference)[:, None] ** n
        top = self.open_ended[rows]
        if top.any() and (b != reference).any():
            length = self.excess_m[rows][top] + self._mean_straight_m
            more, more_before = (gammainc(n[top], rate * length) for rate in (b[:, None], reference))
            factor[:, top] = np.exp((b[:, None] - reference) * length) * more / more_before
        return np.asarray(factor)

    @cached_property
    def _mean_straight_m(self) -> float:
        return float(self.straight_m.mean())

    @cached_property
    def open_ended(self) -> Mask:
        """Rows of the highest class of n, of unreflected and of reflected light."""
        n, reflected = self.histories[:, 0], self.histories[:, 1:].any(axis=1)
        highest = [n[reflected == kind].max(initial=0) for kind in (False, True)]
        return np.asarray((n > 0) & (n == np.where(reflected, highest[1], highest[0])))


def mean_and_stderr(batches: Array) -> tuple[Array, Array]:
    """Mean over the first axis and its standard error; infinite where nothing was ever counted."""
    mean = batches.mean(axis=0)
    stderr = batches.std(axis=0, ddof=1) / np.sqrt(len(batches))
    return mean, np.where(batches.any(axis=0), stderr, np.inf)
