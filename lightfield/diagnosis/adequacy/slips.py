"""Readings set aside: slips that strike anywhere, or a structure that no effect of the table reaches?

Slips fall on readings at random. So under the null hypothesis the places set aside are a random choice of all
places. Scan statistic (Naus 1965, J. Am. Stat. Assoc. 60, 532): along every coordinate and every row
of the layout, the window in which so many of them were least to be expected; its chance is calibrated by
choosing places at random (permutation test), which takes care of the number of windows and of coordinates
that go together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from lightfield.arrays import Array
from lightfield.diagnosis.adequacy.structure import Span, Structure
from lightfield.diagnosis.problem.layout import AIR_APART_M, LEAST_RANGE, Labels, Layout
from lightfield.readings.columns import PLACE_DECIMALS

#: Rows of places beside each other: numbers along them are no lengths.
_ROWS = ("along x", "along y", "along z")
#: Probability with which slips alone are called a structure, by their places or by their number. Chosen:
#: rarer than a false alarm (`level.ALPHA`), to which it adds; test_slips.py holds it.
FALSE_ALARM = 0.003
#: Random choices of as many places. Derived: six of them are then beyond FALSE_ALARM, known to two fifths.
PERMUTATIONS = 1999
#: Where a chance is less than so many of its own errors from FALSE_ALARM they are drawn again, so often at
#: most: it is known to a tenth then, and the verdict hardly hangs on the seed. Chosen.
_CLEAR, _TIMES = 3.0, 20
#: Fewer readings than this are near each other by chance. Derived: two have one distance, and none is rare.
_FEWEST = 3
#: Factor between the numbers of struck places that a window is tried with, once they are more than a few.
#: Chosen: random choices are counted in the same steps, so that FALSE_ALARM stays what it is (test_slips.py).
_COUNTS_APART = 1.25
#: Decimals in m and in the scan to which readings are of one place and moment. Chosen: rounding of a table.
_MOMENT_DECIMALS = 6


def structure(
    aside: NDArray[np.bool_],
    misfit: Array,
    usable: NDArray[np.bool_],
    layout: Layout,
    prediction: Array,
    rate: float,
    rng: np.random.Generator,
) -> Structure | None:
    """What the readings set aside have in common, if it is more than chance.

    Parameters
    ----------
    aside, usable : array of bool, shape (n,)
        Readings set aside; all that were not saturated.
    misfit : array, shape (n,)
        Reading minus model: readings on one side of the model belong together.
    prediction : array, shape (n,)
        Model.
    rate : float
        Part of the readings that slips may spoil.
    """
    rows = np.flatnonzero(usable)
    # Wavelengths read at one place and moment share its slip, and count once.
    moment = np.stack([layout.x_m, layout.y_m, layout.z_m, layout.air, layout.position], axis=1)[rows]
    _, first, unit = np.unique(
        np.round(moment, _MOMENT_DECIMALS), axis=0, return_index=True, return_inverse=True
    )
    unit = unit.ravel()
    struck = np.bincount(unit, weights=aside[rows]) > 0
    above = np.bincount(unit, weights=(aside * np.sign(misfit))[rows]) > 0
    found = [_scan(_sequences(layout, prediction, rows[first]), struck, above, rng)]
    if layout.channel[rows].max() > layout.channel[rows].min():
        found.append(_scan({"wavelength": layout.wavelength_nm[rows]}, aside[rows], (misfit > 0)[rows], rng))
    together = min((f for f in found if f is not None), key=lambda f: f.chance, default=None)
    if together is not None and together.chance * len(found) < FALSE_ALARM:
        if together.coordinate == "place":
            box_m = _box_m(layout, rows[first][together.members])
            return Structure("place", together.chance, box_m=box_m, rate=rate)
        return Structure(together.coordinate, together.chance, together.span, rate=rate)
    # A slip may strike a place with all its wavelengths, or one reading: too many are so either way.
    ways = [(int(hit.sum()), len(hit)) for hit in (struck, aside[rows])]
    many = max(float(special.bdtrc(hits - 1, of, rate)) if hits else 1.0 for hits, of in ways)
    return Structure(None, many, rate=rate) if many < FALSE_ALARM else None


@dataclass(frozen=True)
class _Window:
    coordinate: str
    span: Span
    members: Labels
    chance: float


def _sequences(layout: Layout, prediction: Array, at: Labels) -> dict[str, Array]:
    """Coordinates along which neighbours are sought, simplest first: values at the places."""
    x, y, z = layout.x_m[at], layout.y_m[at], layout.z_m[at]
    plane = layout.plane[at]
    out = {"x": x, "y": y, "plane": z + AIR_APART_M * layout.air[at]}
    with np.errstate(divide="ignore", invalid="ignore"):
        out |= {"x/z": x / z, "y/z": y / z}
    out["angle"] = np.degrees(layout.angle_rad[at])
    out["signal"] = np.argsort(np.argsort(prediction[at])).astype(float)
    for name, keys in zip(_ROWS, ((x, y, plane), (y, x, plane), (z, x, y)), strict=True):
        place = np.empty(len(at))
        place[np.lexsort(keys)] = np.arange(len(at))
        out[name] = place
    if layout.has_time:
        out["time"] = layout.position[at]
    return {name: v for name, v in out.items() if np.isfinite(v).all() and np.ptp(v) > LEAST_RANGE}


def _scan(
    sequences: dict[str, Array], struck: NDArray[np.bool_], above: NDArray[np.bool_], rng: np.random.Generator
) -> _Window | None:
    """The window that holds most of what was struck, beyond chance, and the chance of one like it."""
    seen = np.r_[np.flatnonzero(struck & above), np.flatnonzero(struck & ~above)]
    n, m, up = len(struck), len(seen), int((struck & above).sum())
    if m < _FEWEST or m == n:
        return None
    hits, drawn = 1, 1  # what is seen is one of the choices
    for _ in range(_TIMES):
        random = np.argpartition(rng.random((PERMUTATIONS, n)), m - 1, axis=1)[:, :m]
        least, (name, first, last) = _least(sequences, np.vstack([seen[None], random]), up)
        hits, drawn = hits + int((least[1:] <= least[0]).sum()), drawn + PERMUTATIONS
        if abs(hits - FALSE_ALARM * drawn) > _CLEAR * np.sqrt(FALSE_ALARM * drawn):
            break
    value, rounding = sequences[name], 10.0**-PLACE_DECIMALS
    members = seen[(value[seen] >= first - rounding) & (value[seen] <= last + rounding)]
    chance = hits / drawn
    kind = "place" if name in _ROWS else name
    return _Window(kind, _span(name, first, last), members, chance)


def _least(sequences: dict[str, Array], places: Labels, up: int) -> tuple[Array, tuple[str, float, float]]:
    """Chance of the densest window of every choice of places, and the coordinate and ends of the first one's.

    Parameters
    ----------
    places : array of int, shape (choices, m)
    up : int
        So many of them are above the model, and come first.
    """
    n, m = len(next(iter(sequences.values()))), places.shape[1]
    least, best = np.full(len(places), np.inf), ("", 0.0, 0.0)
    for name, value in sequences.items():
        levels, level = np.unique(np.round(value, PLACE_DECIMALS), return_inverse=True)
        upto = np.cumsum(np.bincount(level))
        for group in {(0, m), (0, up), (up, m)}:
            among = np.sort(level[places[:, slice(*group)]], axis=1)
            here, low, high = _densest(among, upto, n)
            if here[0] < least[0]:
                best = (name, float(levels[low]), float(levels[high]))
            least = np.minimum(least, here)
    return least, best


def _densest(among: Labels, upto: Labels, n: int) -> tuple[Array, int, int]:
    """Smallest chance of the windows from one struck place to another, for every choice of places.

    Parameters
    ----------
    among : array of int, shape (choices, m)
        Levels of the struck places, sorted.
    upto : array of int, shape (levels,)
        Number of places up to each level.

    Returns
    -------
    chance : array, shape (choices,)
    low, high : int
        Levels between which the first choice is densest.
    """
    m = among.shape[1]
    before, tail = np.r_[0, upto[:-1]], _tails(m, n)
    least, ends = np.ones(len(among)), (0, 0)
    for k in _counts(m):
        size = upto[among[:, k - 1 :]] - before[among[:, : m - k + 1]]
        here = size.argmin(axis=1)
        found = tail[k, size[np.arange(len(size)), here]]
        if found[0] < least[0]:
            ends = (int(among[0, here[0]]), int(among[0, here[0] + k - 1]))
        least = np.minimum(least, found)
    return least, *ends


def _tails(m: int, n: int) -> Array:
    """Hypergeometric chance that a window of w of n places holds k or more of m, shape (m + 1, n + 1)."""
    ln, k, w = special.gammaln, np.arange(m + 1.0)[:, None], np.arange(n + 1.0)
    inside = ln(m + 1) - ln(k + 1) - ln(m - k + 1)
    outside = ln(n - m + 1) - ln(w - k + 1) - ln(n - m - w + k + 1)
    return np.exp(inside + outside - ln(n + 1) + ln(w + 1) + ln(n - w + 1))[::-1].cumsum(axis=0)[::-1]


def _counts(m: int) -> list[int]:
    """How many struck places a window may hold: one by one, then in growing steps."""
    out, k = [], _FEWEST
    while k < m:
        out.append(k)
        k = max(k + 1, int(_COUNTS_APART * k))
    return [*out, m] if m >= _FEWEST else []


def _span(name: str, low: float, high: float) -> Span:
    """Ends of a window along a coordinate, as people count it."""
    if name == "time":
        return low + 1, high + 1
    if name == "plane" and low > 0.5 * AIR_APART_M:
        return low - AIR_APART_M, high - AIR_APART_M
    return low, high


def _box_m(layout: Layout, rows: Labels) -> tuple[Span, Span, Span]:
    x, y, z = ((float(v[rows].min()), float(v[rows].max())) for v in (layout.x_m, layout.y_m, layout.z_m))
    return x, y, z
