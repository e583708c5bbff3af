"""A map against the formula's, by cells and by rings: within a relative error, beyond it, or unknown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lightfield.arrays import Array
from lightfield.formula.cells import axis_cells, pitch_m

#: Relative errors of the formula.
ERROR_LEVELS = (0.05, 0.10)
SIGMAS = 3.0
#: What is within a level is known to it by so many Monte Carlo standard errors.
_KNOWN_SIGMAS = 2.0
#: Part of a cell that is rounding.
_ROUNDING = 1e-9
#: How an error compares with a level.
WITHIN, BEYOND, OPEN = 0, 1, 2


@dataclass(frozen=True)
class Profile:
    """Mean over rings around the lamp's axis, each array of shape (n_rings,)."""

    r_m: Array
    render: Array
    stderr: Array
    formula: Array

    def standings(self, level: float) -> Array:
        """How every ring's error stands to a level, see `standing`, together with the rings beside it.

        Each counts by its error: the few cells on the axis, and those of one ring, may not be known alone.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            off, weight = self.formula / self.render - 1, (self.render / self.stderr) ** 2
        known = np.isfinite(weight) & np.isfinite(off) & (weight > 0)
        off, weight = np.where(known, off, 0.0), np.where(known, weight, 0.0)

        def around(values: Array) -> Array:
            return np.convolve(values, np.ones(3), mode="full")[1:-1]

        total = around(weight)
        with np.errstate(divide="ignore", invalid="ignore"):
            mean, error = around(weight * off) / total, total**-0.5
        together = standing(np.ones_like(error), error, 1 + mean, level)
        alone = standing(self.render, self.stderr, self.formula, level)
        return np.where(alone == BEYOND, BEYOND, np.where(total > 0, together, OPEN))


class Within(NamedTuple):
    """Up to where the formula is within a relative error, and from where on it is not.

    Parameters
    ----------
    radius_m : float, m
        Every ring up to there is known to be; infinite where all are; NaN where nothing is known, or lit.
    beyond_m : float, m
        The first ring that is known not to be; NaN where none is.
    is_left : bool
        Hardly a ring lies between: what is not within is beyond.
    """

    radius_m: float
    beyond_m: float
    is_left: bool


def excess(render: Array, stderr: Array, formula: Array) -> Array:
    """Relative error of the formula that Monte Carlo noise cannot explain; zero where no light was rendered.

    NaN outside the tank.
    """
    beyond = np.abs(formula - render) - SIGMAS * stderr
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.maximum(beyond, 0) / render
    return np.where(render > 0, relative, np.where(np.isnan(render), np.nan, 0.0))


def standing(render: Array, stderr: Array, formula: Array, level: float) -> Array:
    """`BEYOND` a relative error, `WITHIN` it, or `OPEN`: with what the render is uncertain by, either may be.

    Where no light was rendered nothing is beyond; what a render is not known to half of the level is open.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        off, error = np.abs(formula - render) / render, stderr / render
    known = (off <= level) & (_KNOWN_SIGMAS * error <= level)
    beyond = excess(render, stderr, formula) > level
    return np.where(beyond, BEYOND, np.where(known, WITHIN, OPEN))


def radial_profile(
    render: Array, stderr: Array, formula: Array, x_m: Array, y_m: Array, centre: tuple[float, float] = (0, 0)
) -> Profile:
    """Means over rings one pixel wide that lie wholly on the plane and in the tank.

    Errors of different cells are taken as independent: a photon rarely meets a plane twice.
    """
    radius = np.hypot(*np.meshgrid(x_m - centre[0], y_m - centre[1]))
    pitch = pitch_m(x_m) or 1.0
    # Rounding, not flooring: with cells on a centred grid no cell then lies on the border of two rings.
    ring = np.round(radius / pitch).astype(int)
    reach = min(x_m[-1] - centre[0], centre[0] - x_m[0], y_m[-1] - centre[1], centre[1] - y_m[0]) + pitch / 2
    known = np.isfinite(render)
    whole = min(int(reach / pitch + 0.5 + 1e-9), int(ring[~known].min(initial=ring.max() + 1)))
    # About a corner of the outermost cells the first ring with any in it is cut by the edge.
    rings = max(whole, int(ring[known].min(initial=ring.max())) + 1)
    inside = (ring < rings) & known
    count = np.bincount(ring[inside], minlength=rings)
    used = count > 0

    def mean(values: Array) -> Array:
        return np.bincount(ring[inside], values[inside], minlength=rings)[used] / count[used]

    error = np.sqrt(mean(known_error(stderr) ** 2) / count[used])
    # A ring in which no cell ever counted a photon has an unknown, not a vanishing, error.
    silent = mean(np.isfinite(stderr).astype(float)) == 0
    return Profile(mean(radius), mean(render), np.where(silent, np.inf, error), mean(formula))


def on_axis(
    render: Array, stderr: Array, formula: Array, x_m: Array, y_m: Array, axis_m: tuple[float, float] = (0, 0)
) -> Profile:
    """Mean of the cell, or the equally near cells, where the lamp's axis meets the plane; NaN where it misses
    it."""
    near = axis_cells(x_m - axis_m[0], y_m - axis_m[1])
    if not meets(x_m, y_m, axis_m):
        nothing = np.full(1, np.nan)
        return Profile(nothing, nothing, nothing, nothing)
    error = np.sqrt(np.sum(stderr[near] ** 2)) / near.sum()
    return Profile(
        np.hypot(*np.meshgrid(x_m - axis_m[0], y_m - axis_m[1]))[near][:1],
        render[near].mean(keepdims=True),
        np.array([error]),
        formula[near].mean(keepdims=True),
    )


def meets(x_m: Array, y_m: Array, at_m: tuple[float, float]) -> bool:
    """Is a place in one of the cells of a plane? Of a single row or column the width is not known."""
    return all(
        len(cells) == 1 or np.abs(cells - at).min() <= 0.5 * pitch_m(cells) * (1 + _ROUNDING)
        for cells, at in zip((x_m, y_m), at_m, strict=True)
    )


def known_error(stderr: Array) -> Array:
    return np.where(np.isfinite(stderr), stderr, 0.0)
