"""Readings set aside: slips that strike anywhere, or a structure that no effect of the table reaches?

Slips fall on readings at random. So under the null hypothesis the places set aside are a random choice of all
places. Scan statistic (Naus 1965, JASA 60, 532): along every coordinate and every row of the layout, the
window in which so many of them were least to be expected; its chance is calibrated by choosing places at
random (permutation test), which takes care of the number of windows and of coordinates that go together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from lightfield.arrays import Array
from lightfield.diagnosis.problem.layout import Labels, Layout

#: Probability with which slips alone are called a structure, by their places or by their number.
LEVEL = 0.003
#: Random choices of as many places.
PERMUTATIONS = 1999
#: Fewer readings than this are near each other by chance.
_FEWEST = 3


@dataclass(frozen=True)
class Structure:
    """Why readings set aside are not slips.

    Parameters
    ----------
    coordinate : str, optional
        Along which they lie together: "x", "y", "plane", "x/z", "y/z", "angle", "wavelength", "signal",
        "place" (neighbours in a row) or "time"; None: they are only too many.
    where : str
        That in words.
    chance : float
        Probability of it if they were slips.
    """

    coordinate: str | None
    where: str
    chance: float


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
    _, first, unit = np.unique(np.round(moment, 6), axis=0, return_index=True, return_inverse=True)
    unit = unit.ravel()
    struck = np.bincount(unit, weights=aside[rows]) > 0
    above = np.bincount(unit, weights=(aside * np.sign(misfit))[rows]) > 0
    found = [_scan(_sequences(layout, prediction, rows[first]), struck, above, rng)]
    if layout.channel[rows].max() > layout.channel[rows].min():
        waves = {"wavelength": (layout.wavelength_nm[rows], "nm")}
        found.append(_scan(waves, aside[rows], (misfit > 0)[rows], rng))
    together = min((f for f in found if f is not None), key=lambda f: f.chance, default=None)
    if together is not None and together.chance * len(found) < LEVEL:
        if together.coordinate == "place":
            return Structure("place", _place(layout, rows[first][together.members]), together.chance)
        return Structure(together.coordinate, together.where, together.chance)
    many = float(special.bdtrc(struck.sum() - 1, len(struck), rate)) if struck.any() else 1.0
    if many < LEVEL:
        return Structure(None, f"more of them than the {100 * rate:g} % that slips explain", many)
    return None


@dataclass(frozen=True)
class _Window:
    coordinate: str
    where: str
    members: Labels
    chance: float


def _sequences(layout: Layout, prediction: Array, at: Labels) -> dict[str, tuple[Array, str]]:
    """Coordinates along which neighbours are sought, simplest first: values at the places, and unit."""
    x, y, z = layout.x_m[at], layout.y_m[at], layout.z_m[at]
    plane = layout.plane[at]
    out = {"x": (x, "m"), "y": (y, "m"), "plane": (z + 1e3 * layout.air[at], "m")}
    with np.errstate(divide="ignore", invalid="ignore"):
        out |= {"x/z": (x / z, ""), "y/z": (y / z, "")}
    out["angle"] = (np.degrees(layout.angle_rad[at]), "degrees")
    out["signal"] = (np.argsort(np.argsort(prediction[at])).astype(float), "")
    rows = {"along x": (x, y, plane), "along y": (y, x, plane), "along z": (z, x, y)}
    for name, keys in rows.items():
        place = np.empty(len(at))
        place[np.lexsort(keys)] = np.arange(len(at))
        out[name] = (place, "")
    if layout.has_time:
        out["time"] = (layout.position[at], "")
    return {name: (v, u) for name, (v, u) in out.items() if np.isfinite(v).all() and np.ptp(v) > 1e-6}


def _scan(
    sequences: dict[str, tuple[Array, str]],
    struck: NDArray[np.bool_],
    above: NDArray[np.bool_],
    rng: np.random.Generator,
) -> _Window | None:
    """The window that holds most of what was struck, beyond chance, and the chance of one like it."""
    seen = np.r_[np.flatnonzero(struck & above), np.flatnonzero(struck & ~above)]
    n, m, up = len(struck), len(seen), int((struck & above).sum())
    if m < _FEWEST or m == n:
        return None
    random = np.argpartition(rng.random((PERMUTATIONS, n)), m - 1, axis=1)[:, :m]
    places = np.vstack([seen[None], random])
    least = np.full(len(places), np.inf)
    best = ("", 0.0, 0.0)
    for name, (value, _) in sequences.items():
        levels, level = np.unique(np.round(value, 4), return_inverse=True)
        upto = np.cumsum(np.bincount(level))
        for group in {(0, m), (0, up), (up, m)}:
            among = np.sort(level[places[:, slice(*group)]], axis=1)
            here, low, high = _densest(among, upto, n)
            if here[0] < least[0]:
                best = (name, float(levels[low]), float(levels[high]))
            least = np.minimum(least, here)
    name, first, last = best
    value, unit = sequences[name]
    members = seen[(value[seen] >= first - 1e-4) & (value[seen] <= last + 1e-4)]
    chance = float((least <= least[0]).sum()) / len(places)
    kind = "place" if name.startswith("along") else name
    return _Window(kind, _where(name, first, last, unit), members, chance)


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
    """How many struck places a window may hold: three to ten, then in steps of a quarter."""
    out, k = [], _FEWEST
    while k < m:
        out.append(k)
        k = max(k + 1, int(1.25 * k))
    return [*out, m] if m >= _FEWEST else []


def _where(name: str, low: float, high: float, unit: str) -> str:
    said = {"plane": "z", "angle": "the angle from the axis", "wavelength": "the wavelength"}.get(name, name)
    if name == "signal":
        return "among readings of equal size"
    if name == "time":
        return f"in the scan, readings {low + 1:.0f} to {high + 1:.0f}"
    if name == "plane" and low > 500:
        low, high = low - 1e3, high - 1e3
    ends = f"{low:.3g}" if f"{low:.3g}" == f"{high:.3g}" else f"{low:.3g} to {high:.3g}"
    return f"where {said} is {ends} {unit}".rstrip()


def _place(layout: Layout, rows: Labels) -> str:
    ends = []
    for name, value in (("x", layout.x_m), ("y", layout.y_m), ("z", layout.z_m)):
        low, high = (f"{round(end, 4) + 0.0:.3g}" for end in (value[rows].min(), value[rows].max()))
        ends.append(f"{name} = {low}" if low == high else f"{name} = {low} to {high}")
    return f"at neighbouring places, {', '.join(ends)} m"
