"""The smoothest curves that readings can tell of: functions of Demmler and Reinsch (1975, Numer. Math. 24,
375-382) on nodes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from lightfield.arrays import Array
from lightfield.scene.curve import Nodes

#: Nodes of a curve: three for each bend of the finest function. Chosen.
NODES = 61
#: A curve that a fit tries is clipped here, a factor of 1100. Chosen: no number overflows. A lamp's profile
#: may be more (`curves.py`).
_LARGEST = 7.0
#: What differs by less is one: coordinates as a part of their range, curves of their largest value. Derived:
#: as `least_squares` holds a parameter to be at a bound.
_SAME_PART = 1e-6
#: What is left of the largest eigenvalue is none. Derived: rounding of doubles, with room.
_ROUNDING = 1e-10
#: All that has no second differences, of lamps and waters over time and wavelength: derived.
_LINES: list[Array] = [np.ones(NODES), np.linspace(-1, 1, NODES)]


def path_of(field: str, k: int) -> str:
    """Name of the k-th amplitude of a curve, k = 1, 2..."""
    return f"{field}.{k}"


@dataclass(frozen=True)
class Basis:
    """Functions of a curve, on its nodes.

    Parameters
    ----------
    field : str
        Dotted path of the scene's curve.
    place : array, shape (n_nodes,)
        deg, m, s or nm.
    functions : array, shape (n_nodes, n_functions)
        ln of a factor, m^-1, or readings.
    told : int
        So many functions would follow any readings at all along this coordinate.
    size : array, shape (n_functions,)
        Weighted rms of what amplitudes of 1 change in the logarithm of the readings.
    most : float
        No value of the curve is larger.
    largest : array, shape (n_functions,), optional
        No amplitude is larger; as large as a curve may be unless given.
    """

    field: str
    place: Array
    functions: Array
    told: int
    size: Array
    most: float = _LARGEST
    largest: Array | None = None

    @cached_property
    def paths(self) -> tuple[str, ...]:
        """One per amplitude."""
        return tuple(path_of(self.field, k) for k in range(1, self.functions.shape[1] + 1))

    @cached_property
    def ends(self) -> dict[str, float]:
        """How large each amplitude may be, by path."""
        largest = np.full(len(self.paths), _LARGEST) if self.largest is None else self.largest
        return dict(zip(self.paths, np.minimum(largest, _LARGEST).tolist(), strict=True))

    @cached_property
    def bends(self) -> Array:
        """Root of the integral of the squared second derivative of each function, shape (n_functions,)."""
        step = np.diff(self.place).mean()
        return np.asarray(np.sqrt((np.diff(self.functions, 2, axis=0) ** 2).sum(axis=0) / step**3))

    def curve(self, amplitudes: Array) -> Array:
        """The curve at its nodes, shape (n_nodes,)."""
        return np.asarray(np.clip(self.functions[:, : len(amplitudes)] @ amplitudes, -self.most, self.most))

    def rms(self, values: Mapping[str, float]) -> float:
        """Weighted rms of what the curve changes in the logarithm of the readings."""
        return float(np.linalg.norm(self.size * self.amplitudes(values)))

    def amplitudes(self, values: Mapping[str, float]) -> Array:
        """Amplitudes of all functions among the values of a fit; 0 where it has none."""
        return np.array([values.get(path, 0.0) for path in self.paths])


@dataclass(frozen=True, eq=False)
class Family:
    """Curves on nodes, and which of them are rough.

    Parameters
    ----------
    place : array, shape (n_nodes,)
    rough : array, shape (k, n_nodes)
        Square root of the roughness of a curve by its nodes.
    smooth : list of array, shape (n_nodes,)
        All that is not rough.
    known : int
        So many of them the base model has; the others are functions too.
    beside : int
        So many levels more along the coordinate it follows by what is no such curve, as by its gain.
    """

    place: Array
    rough: Array
    smooth: list[Array]
    known: int
    beside: int = 0


def bent(at: Array) -> Family:
    """Curves over a coordinate that are rough where they bend; the base model has their level."""
    place = np.linspace(at.min(), at.max(), NODES)
    return Family(place, np.diff(np.eye(NODES), 2, axis=0), _LINES, 1)


def basis_of(
    field: str,
    family: Family,
    at: Array,
    weight: Array,
    acts: Callable[[Nodes, Array], Array],
    most: int,
    gains: NDArray[np.int_] | None = None,
) -> Basis | None:
    """The smoothest functions first: least rough for what they change in the readings; None where there are
    none.

    Parameters
    ----------
    field : str
        The scene's curve.
    at, weight : array, shape (n,)
        Coordinate of every reading, and 1 / (its relative error)^2.
    acts : callable
        What nodes change in the logarithm of the readings: `acts(nodes, at)`, linear in their values.
    most : int
        No more functions.
    gains : array of int, shape (n,), optional
        Readings that share a gain, which the base model has as well: no curve is one.
    """
    place = family.place
    count = len(place)
    design = np.empty((len(at), count))
    for j in range(count):
        unit = np.zeros(count)
        unit[j] = 1.0
        design[:, j] = acts(tuple(zip(place.tolist(), unit.tolist(), strict=True)), at)
    if gains is not None:
        total = np.maximum(np.bincount(gains, weight), np.finfo(float).tiny)
        mean = np.stack([np.bincount(gains, weight * column) / total for column in design.T], axis=1)
        design = design - mean[gains]
    metric = design.T @ (weight[:, None] * design) / weight.sum()
    functions: list[Array] = []
    taken: list[Array] = []
    for k, one in enumerate(family.smooth):
        rest = one - sum((t * (t @ metric @ one) for t in taken), np.zeros(count))
        size = float(np.sqrt(max(rest @ metric @ rest, 0.0)))
        if size <= _SAME_PART * float(np.abs(design @ one).max()):
            return None
        taken.append(rest / size)
        if k >= family.known:
            functions.append(rest / size)
    # All that is orthogonal to what is not rough; there the roughness is a metric too.
    others = linalg.null_space(np.array(taken) @ metric)
    change, roughness = others.T @ metric @ others, (r := family.rough @ others).T @ r
    share, vectors = linalg.eigh(change, roughness)
    share, vectors = share[::-1], vectors[:, ::-1]
    told = _levels(at[weight > 0]) - family.known - family.beside
    more = min(min(told, most) - len(functions), int((share > _ROUNDING * share[0]).sum()))
    functions += [others @ vectors[:, k] / np.sqrt(share[k]) for k in range(max(more, 0))]
    if not functions:
        return None
    # A function and its negative are one: it ends above where it begins.
    signed = [f if f[-1] >= f[0] else -f for f in functions]
    return Basis(field, place, np.stack(signed, axis=1), told, np.ones(len(signed)))


def _levels(at: Array) -> int:
    """How many different coordinates there are."""
    return int(1 + (np.diff(np.sort(at)) > _SAME_PART * max(float(np.ptp(at)), _SAME_PART)).sum())
