"""Influences that no effect of the table describes, to test whether a diagnosis says so."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.problem.layout import Layout
from lightfield.errors import UsageError

PREFIX = "unknown:"
Drawn = tuple[Array, dict[str, float]]


def _ripple(layout: Layout, rng: np.random.Generator) -> Drawn:
    """Interference in the window: a sine of the angle."""
    depth, period, phase = rng.uniform(0.02, 0.08), rng.uniform(1.0, 2.0), rng.uniform(0, 2 * np.pi)
    angle = np.degrees(layout.angle_rad)
    factor = 1 + depth * np.sin(2 * np.pi * angle / period + phase)
    return factor, {"depth": depth, "period_deg": period, "phase": phase}


def _flicker(layout: Layout, rng: np.random.Generator) -> Drawn:
    """An unstable supply: an Ornstein-Uhlenbeck process of time."""
    size, memory = rng.uniform(0.02, 0.06), rng.uniform(100, 400)
    order = np.argsort(layout.time_s)
    gaps = np.diff(layout.time_s[order], prepend=layout.time_s[order][:1])
    walk = np.empty(layout.size)
    state = rng.standard_normal()
    for place, gap in zip(order, gaps, strict=True):
        keep = np.exp(-gap / memory)
        state = keep * state + np.sqrt(1 - keep**2) * rng.standard_normal()
        walk[place] = state
    return np.exp(size * walk), {"size": size, "memory_s": memory}


def _shadow(layout: Layout, rng: np.random.Generator) -> Drawn:
    """A cable or strut in front of part of the range of x."""
    depth, width = rng.uniform(0.1, 0.3), rng.uniform(0.05, 0.09)
    places = np.unique(layout.x_m)
    inner = places[(places > places.min() + 0.05) & (places < places.max() - 0.05)]
    inner = inner[np.abs(inner) < 0.6 * np.abs(places).max()]
    if not inner.size:
        raise UsageError(
            "this effect cannot act here", found=f"{PREFIX}shadow: x from {places[0]:g} to {places[-1]:g} m",
            rule="a place with others more than 5 cm to either side of it",
            remedy="choose a layout that goes across the beam, such as line",
        )  # fmt: skip
    centre = float(rng.choice(inner))
    factor = 1 - depth * np.exp(-(((layout.x_m - centre) / width) ** 2))
    return factor, {"depth": depth, "width_m": width, "x_m": centre}


def _kink(layout: Layout, rng: np.random.Generator) -> Drawn:
    """Vignetting by the edge of the window: a kink in the beam at some angle."""
    slope, at = rng.uniform(0.02, 0.08), rng.uniform(2.0, 5.0)
    beyond = np.clip(np.degrees(layout.angle_rad) - at, 0, None)
    return np.exp(-slope * beyond), {"slope_per_deg": slope, "angle_deg": at}


_KINDS: Mapping[str, Callable[[Layout, np.random.Generator], Drawn]] = {
    "ripple": _ripple,
    "flicker": _flicker,
    "shadow": _shadow,
    "kink": _kink,
}


def draw(name: str, layout: Layout, rng: np.random.Generator) -> Drawn:
    """Factor on the light at every reading, shape (n,), and what it was made of.

    Raises
    ------
    UsageError
        No such influence.
    """
    kind = name.removeprefix(PREFIX)
    if kind not in _KINDS:
        raise UsageError(
            "unknown kind of unknown", found=name, rule="one of " + ", ".join(PREFIX + k for k in _KINDS)
        )
    return _KINDS[kind](layout, rng)
