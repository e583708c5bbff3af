"""Curves that a scene states by their nodes: linear between them, constant beyond."""

from __future__ import annotations

from functools import lru_cache
from itertools import chain, pairwise
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field

from lightfield.arrays import Array
from lightfield.errors import RuleError

#: Nodes are coordinates of any kind, and departures that no exponential takes out of the range of numbers.
_FARTHEST, LARGEST = 1e12, 20.0
#: Of a beam: as far as a Gaussian falls, ten and more half widths off its axis.
LARGEST_OF_BEAM = 300.0
Coordinate = Annotated[float, Field(strict=True, ge=-_FARTHEST, le=_FARTHEST)]
Departure = Annotated[float, Field(strict=True, ge=-LARGEST, le=LARGEST)]
BeamDeparture = Annotated[float, Field(strict=True, ge=-LARGEST_OF_BEAM, le=LARGEST_OF_BEAM)]
#: What is added to readings has their unit, whichever it is.
ReadingDeparture = Annotated[float, Field(strict=True, ge=-1e9, le=1e9)]


def _rising(nodes: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    at = [first for first, _ in nodes]
    if any(not after > before for before, after in pairwise(at)):
        rule = "the first numbers of a curve's nodes must rise"
        raise RuleError(rule, "sort the nodes, drop doubles", found=at)
    return nodes


#: Coordinate and value of every node; no nodes stand for no departure at all.
Curve = Annotated[tuple[tuple[Coordinate, Departure], ...], AfterValidator(_rising)]
BeamCurve = Annotated[tuple[tuple[Coordinate, BeamDeparture], ...], AfterValidator(_rising)]
ShownCurve = Annotated[tuple[tuple[Coordinate, ReadingDeparture], ...], AfterValidator(_rising)]
Nodes = tuple[tuple[float, float], ...]


def value_at(nodes: Nodes, at: Array) -> Array:
    """The curve at some coordinates.

    Parameters
    ----------
    nodes : tuple of pairs
        At least one.
    at : array
        In the unit of the nodes' coordinate.
    """
    place, value = _columns(nodes)
    return np.asarray(np.interp(at, place, value))


def sum_of(one: Nodes, other: Nodes) -> Nodes:
    """Nodes of the sum of two curves, either of which may have none."""
    if not one or not other:
        return one or other
    every = np.union1d([at for at, _ in one], [at for at, _ in other])
    together = value_at(one, every) + value_at(other, every)
    return tuple(zip(every.tolist(), together.tolist(), strict=True))


def integral_to(nodes: Nodes, at: Array) -> Array:
    """Integral of the curve from 0 to some coordinates; arguments as for `value_at`."""
    place, value = _columns(nodes)
    return _from_first(place, value, np.asarray(at, float)) - _from_first(place, value, np.zeros(1))


def _from_first(place: Array, value: Array, at: Array) -> Array:
    """Integral from the first node, of linear pieces and of the constants beyond them."""
    whole = np.concatenate([[0.0], np.cumsum(0.5 * (value[1:] + value[:-1]) * np.diff(place))])
    k = np.clip(np.searchsorted(place, at, side="right") - 1, 0, len(place) - 1)
    step = np.where(at < place[0], at - place[0], at - place[k])
    return np.asarray(whole[k] + 0.5 * (value[k] + np.interp(at, place, value)) * step)


@lru_cache(maxsize=64)
def _columns(nodes: Nodes) -> tuple[Array, Array]:
    place, value = np.fromiter(chain.from_iterable(nodes), float, 2 * len(nodes)).reshape(-1, 2).T
    return place, value
