"""Beams of ten shapes, by formulas that the package does not have, with numbers drawn for each."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

Array = np.ndarray
#: Kinds of shape, and the shapes of each.
KINDS = {
    "steep edge": ("flat", "reflector", "spill"),
    "kink": ("trapezoid", "cone"),
    "ring or hole": ("hole", "two rings", "doughnut", "diffraction"),
    "wide": ("cosine power",),
}
SHAPES = tuple(name for names in KINDS.values() for name in names)


class Lamp(NamedTuple):
    """A beam.

    Parameters
    ----------
    half_deg : float
        About its half width.
    light : callable
        Intensity, of any scale, at angles from the axis, deg.
    """

    shape: str
    half_deg: float
    light: Callable[[Array], Array]


def drawn(shape: str, rng: np.random.Generator) -> Lamp:
    """A lamp of a shape."""
    half, draw = rng.uniform(3.5, 7.0), rng.uniform
    core, light = _gaussian(half), None
    match shape:
        case "flat":
            power = draw(4.0, 12.0)
            light = _sum((1.0, lambda t: 0.5 ** ((t / half) ** power)), (0.002, _bell(3 * half)))
        case "reflector":
            edge, skirt = draw(0.25, 0.7), draw(0.002, 0.02)
            light = _sum(
                (1.0, lambda t: (1 + 0.1 * np.cos(2 * np.pi * t / half)) / (1 + np.exp((t - half) / edge))),
                (skirt, _bell(2.5 * half)),
            )
        case "spill":
            part = draw(0.05, 0.2)
            light = _sum((1.0, _super(half)), (part, _super(2.2 * half)))
        case "trapezoid":
            slope = draw(0.3, 0.7)
            light = _sum(
                (1.0, lambda t: np.clip((half * (1 + slope) - t) / (2 * half * slope), 0, 1)),
                (0.004, _bell(2 * half)),
            )
        case "cone":
            light = _sum((1.0, lambda t: np.clip(1 - t / (2 * half), 0, 1)), (0.01, _bell(2 * half)))
        case "hole":
            deep, wide = draw(0.2, 0.6), draw(0.25, 0.5) * half
            light = _sum(
                (1.0, lambda t: core(t) * (1 - deep * np.exp(-((t / wide) ** 2)))),
                (1e-3, lambda t: np.exp(-t / (2 * half))),
            )
        case "two rings":
            near, far = draw(0.05, 0.25), draw(0.02, 0.1)
            light = _sum(
                (1.0, core), (near, _ring(1.9 * half, 0.3 * half)), (far, _ring(3 * half, 0.35 * half))
            )
        case "doughnut":
            light = _sum((1.0, lambda t: ((t / half) ** 2 + 0.3) * np.exp(-1.3 * (t / half) ** 2)))
        case "diffraction":  # its zeros are filled, as a window of some size fills them
            light = _sum((0.97, lambda t: np.sinc(1.39 * t / half / np.pi) ** 2), (0.01, _bell(2 * half)))
        case "cosine power":
            half = draw(12.0, 25.0)
            power = np.log(0.5) / np.log(np.cos(np.radians(half)))
            light = _sum(
                (
                    1.0,
                    lambda t: (
                        np.cos(np.radians(np.minimum(t, 89.9))) ** power
                        * (1 + 0.15 * np.exp(-((t / (0.3 * half)) ** 2)))
                    ),
                )
            )
    assert light is not None, shape
    return Lamp(shape, half, light)


def _sum(*parts: tuple[float, Callable[[Array], Array]]) -> Callable[[Array], Array]:
    return lambda t: np.asarray(sum(weight * light(t) for weight, light in parts))


def _gaussian(half: float) -> Callable[[Array], Array]:
    return lambda t: np.exp(-np.log(2) * (t / half) ** 2)


def _super(half: float) -> Callable[[Array], Array]:
    return lambda t: np.exp(-np.log(2) * (t / half) ** 4)


def _bell(wide: float) -> Callable[[Array], Array]:
    return lambda t: np.exp(-((t / wide) ** 2))


def _ring(at: float, wide: float) -> Callable[[Array], Array]:
    return lambda t: np.exp(-(((t - at) / wide) ** 2))
