"""Several tables of one water under each other, with the scattered light of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from lightfield.arrays import Array
from lightfield.errors import MeasurementError
from lightfield.scene.water.water import Water
from lightfield.studies.attenuation.excess import Excess
from lightfield.studies.attenuation.ratios import Ratios


@dataclass(frozen=True, eq=False)
class Stack:
    """Several tables of one water under each other.

    Parameters
    ----------
    tables : sequence of Ratios
    excess : sequence of Excess
        One per table.
    """

    tables: Sequence[Ratios]
    excess: Sequence[Excess]

    @property
    def reflects(self) -> bool:
        """Do walls or a surface send light back?"""
        return any(table.scene.reflects for table in self.tables)

    @property
    def y(self) -> Array:
        """shape (n_rows, n_colours)"""
        return np.concatenate([t.y for t in self.tables])

    @property
    def sigma(self) -> Array:
        """shape (n_rows, n_colours)"""
        return np.concatenate([t.stderr for t in self.tables])

    @property
    def path_m(self) -> Array:
        """shape (n_rows,), m"""
        return np.concatenate([t.path_m for t in self.tables])

    @property
    def alphas(self) -> Array:
        """Columns of X of one constant per table, shape (n_rows, n_colours, n_tables)."""
        which = np.repeat(np.arange(len(self.tables)), [len(t.path_m) for t in self.tables])
        column = (which[:, None] == np.arange(len(self.tables))).astype(float)
        return np.repeat(column[:, None, :], self.y.shape[1], axis=1)

    def errors_of_light(self, a: Array, b: Array) -> Array:
        """Of `light`, as k independent contributions, shape (n_colours, n_rows, k)."""
        modes = block_diag(*(e.modes for e in self.excess))
        return np.concatenate([e.error_over_typical(a, b) for e in self.excess]).T[:, :, None] * modes

    def shared(self, traced: bool) -> tuple[Array, Array]:
        """H and errors of stays and, if asked for, of the traced light."""
        blocks, errors = (list(each) for each in zip(*(t.shared for t in self.tables), strict=True))
        if traced:
            blocks = [np.hstack([h, e.modes]) for h, e in zip(blocks, self.excess, strict=True)]
            errors = [
                np.concatenate([s, np.ones(e.modes.shape[1])])
                for s, e in zip(errors, self.excess, strict=True)
            ]
        return block_diag(*blocks), np.concatenate(errors)

    def light(self, a: Array, b: Array) -> Array:
        """ln(all light / direct light), shape (n_rows, n_colours)."""
        return np.concatenate([e.value(a, b) for e in self.excess])

    def of_water(self, water: Water, scattered: bool = True) -> Array:
        """ln of what a water lets through, mean over every band, shape (n_rows, n_colours).

        Parameters
        ----------
        scattered : bool
            False: every scattered photon is lost.
        """
        rows = []
        for table, excess in zip(self.tables, self.excess, strict=True):
            a, b = table.seen.coefficients(water)
            ln = -np.multiply.outer(table.path_m, a + b)
            if scattered:
                ln += excess.value(a.ravel(), b.ravel()).reshape(ln.shape)
            rows.append(table.seen.mean_ln(ln))
        return np.concatenate(rows)

    def slopes(self, a: Array, b: Array) -> tuple[Array, Array]:
        """Its derivatives by a and b, m."""
        by_a, by_b = zip(*(e.slopes(a, b) for e in self.excess), strict=True)
        return np.concatenate(by_a), np.concatenate(by_b)


def same_water(tables: Sequence[Ratios]) -> Array:
    """The wavelengths of several tables of one water, shape (n_colours,), nm.

    Raises
    ------
    MeasurementError
        They were not read at the same wavelengths.
    """
    first = tables[0].wavelength_nm
    for other in tables[1:]:
        if len(other.wavelength_nm) != len(first) or not np.allclose(other.wavelength_nm, first, atol=0.01):
            raise MeasurementError(
                "the tables have different wavelengths",
                found=f"{len(first)} and {len(other.wavelength_nm)}",
                rule="the same wavelengths in all tables of one water",
                remedy="import them with the same bands",
            )
    return first
