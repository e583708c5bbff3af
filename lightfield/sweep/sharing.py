"""One trace for many cases: what is traced, and which waters it serves neither too unequally nor wrong."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import gammainc

from lightfield.arrays import TINY
from lightfield.render.response.open_ended import HELD_FROM
from lightfield.render.response.response import Reference
from lightfield.scene import Scene
from lightfield.scene.acts import ATTENUATION
from lightfield.scene.all_parameters import without
from lightfield.sweep.cases import Cases

# Light that scattered n times in a reference water b0 counts (b / b0)^n exp((b0 - b) L). Over a path L the
# variance of that factor is exp(spread) - 1, spread = (b0 - b)^2 L / b0 (Poisson of mean b0 L).
# Beyond 1.5 single photons show as bright cells that the stated error does not cover: another trace then.
MOST_SPREAD = 1.5
# Reflected light that scattered more often than a tally tells apart is known of other water to a part of
# 0.4 |ln(b / b0)| (`open_ended`). It is most of all in dense water: there b may differ by a tenth.
_MOST_UNTOLD = 0.1
# What molecules scatter is counted as forward scattering where a trace has fewer of them: of so many of a
# photon's scatterings by the farthest plane. Cells are then wrong by a tenth of it, a third at worst, and
# power on a plane by less.
_MOST_OTHER = 0.02
# Most of what walls send on, for the length of light's way between them: a bound of the allowed albedo's.
_WHITEST = 0.98


@dataclass(frozen=True)
class Trace:
    """One trace: which scene, its reference water, and the seed.

    Parameters
    ----------
    first : int
        Number of the first case that is evaluated from it; all of them have its beam and geometry.
    cases : int
        How many cases are evaluated from it.
    """

    number: int
    first: int
    reference: Reference
    seed: int
    cases: int

    def scene(self, cases: Cases) -> Scene:
        """What is traced: beam and geometry of its cases in the reference water."""
        scene = without(cases.build(self.first, validate=False), ATTENUATION)
        plain: dict[str, Any] = {
            "water.absorption_per_m": self.reference.absorption_per_m,
            "water.scattering_per_m": self.reference.scattering_per_m,
        }
        if scene.tank is not None:
            plain |= {
                "tank.wall_albedo": self.reference.wall_albedo,
                "tank.surface_reflectance": self.reference.surface_reflectance,
                "tank.surface": "flat" if self.reference.surface_reflectance > 0 else "none",
            }
        return scene.with_values(plain, validate=False)


def served_together(
    left: np.ndarray, waters: np.ndarray, far_m: np.ndarray, chord_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Of cases that one beam and geometry serve, those of one reference water; and the others.

    Parameters
    ----------
    left : array of int
        Their numbers.
    waters : array, shape (n_cases, 5)
        Of every case: absorption, scattering (1/m), wall albedo, surface reflectance, and the part of the
        scattering that is molecular.
    far_m, chord_m : array, shape (n_cases,), m
        Distance of the farthest plane, and mean way from wall to wall; 0 in open water.
    """
    if len(left) == 1:  # as most are where every case has a beam of its own
        return left, left[:0]
    some, far, chord = waters[left], far_m[left[0]], chord_m[left[0]]
    near = (_spread(some, far, chord) <= MOST_SPREAD) & (_untold(some, far) <= _MOST_UNTOLD)
    near &= _other_molecules(some, far) <= _MOST_OTHER
    near[near] = _same_reflections(waters[left][near])
    return left[near], left[~near]


def common_reference(waters: np.ndarray) -> Reference:
    """The water of one trace for (n, 5) waters: it absorbs as the clearest, scatters and reflects most."""
    (a, *_), (_, b, rho, surface, _) = waters.min(axis=0).tolist(), waters.max(axis=0).tolist()
    return Reference(a, b, rho, surface, float(_of_most_turbid(waters)[4]))


def _of_most_turbid(waters: np.ndarray) -> np.ndarray:
    return np.asarray(waters[waters[:, 1].argmax()])


def _other_molecules(waters: np.ndarray, far_m: float) -> np.ndarray:
    """Scatterings by molecules that a trace in the most turbid of waters counts as others, shape (n,)."""
    b, share = waters[:, 1], waters[:, 4]
    return np.asarray(b * np.abs(share - _of_most_turbid(waters)[4]) * far_m)


def _spread(waters: np.ndarray, far_m: float, chord_m: float) -> np.ndarray:
    """Spread of the weights of waters about the most turbid of them, shape (n,); the way of light between
    walls is that of all its flights."""
    b = waters[:, 1]
    if not b.any():
        return np.zeros_like(b)
    most = b.max()
    # Direct light is an expected value: without reflection, clear water has no weights to spread.
    rho = np.minimum(waters[:, 2], _WHITEST)
    direct_alone = (b == 0) & (waters[:, 2:4] == 0).all(axis=1)
    way = far_m + np.where(rho > 0, chord_m / (1 - rho), 0.0)
    return np.asarray(np.where(direct_alone, 0.0, (most - b) ** 2 * way / most))


def _untold(waters: np.ndarray, far_m: float) -> np.ndarray:
    """Part of reflected light that is scattered so often, times |ln(b / b0)|, shape (n,)."""
    b, most = waters[:, 1], waters[:, 1].max()
    if most == 0 or not waters[:, 2:4].any():
        return np.zeros_like(b)
    return np.asarray(gammainc(HELD_FROM + 1, b * far_m) * np.log(most / np.maximum(b, TINY)))


def _same_reflections(waters: np.ndarray) -> np.ndarray:
    """Waters whose walls and surface are those of the brightest, or black; shape (n,).

    Without a surface there is a lid like the walls: as good as a black surface where these are black.
    A response tells few reflections apart and holds all higher ones together: with other walls these would be
    weighed wrong, in a short bright tank by as much as (rho0 - rho) / (1 - rho0).
    """
    rho, surface = waters[:, 2], waters[:, 3]
    brightest = np.lexsort((surface, rho))[-1]
    walls, black_top = (rho == 0) | (rho == rho[brightest]), (rho == 0) & (surface == 0)
    return np.asarray(walls & ((surface == surface[brightest]) | black_top))
