"""Sets as campaigns give them: layouts and errors of the field cases, lamps and effects drawn anew."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.hidden_effects.benches import CAMPAIGN, beam_of, number_of
from lightfield.arrays import Array
from lightfield.storage.files import write_text

#: How many sets are planned, half of them with scattered or reflected light.
SETS = 200
#: Relative noise: of the field cases alone, and with the error of their light.
NOISES = (0.005, 0.008)
#: Size of a hidden effect over its typical size, log-uniform.
STRENGTH = (1.0, 12.0)
#: Part of the sets that are read plane by plane; that have a lamp which is no Gaussian; that show walls or a
#: surface, of those whose light is not direct alone.
PLANE_BY_PLANE, OTHER_LAMP, REFLECTED = 0.1, 0.4, 0.25
#: How often a set has nought to six effects, and how many at most beside a lamp that is no Gaussian.
COUNTS, BESIDE_LAMP = (0.06, 0.14, 0.2, 0.2, 0.2, 0.12, 0.08), 4
#: Tanks that show walls or the surface, and what must be hidden there.
_MIRRORS = (("wide", ("wall_reflection",)), ("column", ("surface_reflection",)))
#: Effects of the field cases are drawn so much more often than others.
FAVOURED = 3.0
FIELD = (
    "beam_offset", "beam_tilt", "apparent_source", "lamp_drift", "background", "saturation",
    "water_gradient",
)  # fmt: skip

Shape = Callable[[Array, np.random.Generator], Array]


def _fermi(q: Array, width: float) -> Array:
    return 1 / (1 + np.exp((q - 1) / width))


def _soft_flood(q: Array, rng: np.random.Generator) -> Array:
    """Flat, with a soft edge, and a wide weak halo."""
    edge, halo, wide = rng.uniform(0.08, 0.3), rng.uniform(0.0, 0.12), rng.uniform(2.0, 4.0)
    return np.asarray((1 - halo) * _fermi(q, edge) + halo * np.exp(-np.log(2) * (q / wide) ** 2))


def _ringed(q: Array, rng: np.random.Generator) -> Array:
    """A core with a ring about it."""
    core, part = rng.uniform(0.6, 0.9), rng.uniform(0.2, 0.5)
    at, width = rng.uniform(0.9, 1.4), rng.uniform(0.25, 0.5)
    return np.asarray(
        (1 - part) * np.exp(-np.log(2) * (q / core) ** 2) + part * np.exp(-(((q - at) / width) ** 2))
    )


def _pedestal(q: Array, rng: np.random.Generator) -> Array:
    """A Gaussian on a flat pedestal that ends."""
    part, end, edge = rng.uniform(0.1, 0.4), rng.uniform(1.8, 3.0), rng.uniform(0.05, 0.2)
    return np.asarray((1 - part) * np.exp(-np.log(2) * (q / 0.8) ** 2) + part * _fermi(q / end, edge))


def _batwing(q: Array, rng: np.random.Generator) -> Array:
    """Darker on its axis than around it."""
    return np.asarray((1 + rng.uniform(0.3, 0.9) * q**2) * np.exp(-np.log(2) * q ** rng.uniform(3.5, 6.0)))


def _cusp(q: Array, rng: np.random.Generator) -> Array:
    """Peaked: straight flanks in the logarithm, round at the top."""
    top = rng.uniform(0.1, 0.5)
    return np.asarray(np.exp(-np.log(2) * (np.hypot(q, top) - top) / (np.hypot(1, top) - top)))


def _far_ring(q: Array, rng: np.random.Generator) -> Array:
    """A Gaussian, and the weak ring of a lens far outside."""
    part, at, width = rng.uniform(0.02, 0.1), rng.uniform(2.2, 3.2), rng.uniform(0.3, 0.6)
    return np.asarray(np.exp(-np.log(2) * q**2) + part * np.exp(-(((q - at) / width) ** 2)))


def _power_law(q: Array, rng: np.random.Generator) -> Array:
    """A reflector's flank: a power of the angle."""
    power = rng.uniform(1.5, 3.0)
    return np.asarray((1 + (2 ** (1 / power) - 1) * q**2) ** -power)


#: Lamps that are no Gaussian, over the angle in half widths; their numbers are drawn for every set.
SHAPES: Mapping[str, Shape] = {
    "soft-flood": _soft_flood, "ringed": _ringed, "pedestal": _pedestal, "batwing": _batwing, "cusp": _cusp,
    "far-ring": _far_ring, "power-law": _power_law,
}  # fmt: skip
#: Where tables of lamps are written.
WRITTEN = Path(__file__).resolve().parents[2] / "build" / "many_effects" / "lamps"
#: The table of a lamp: its step and its end, half widths.
_STEP, _END = 0.01, 9.0


def lamp_table(shape: str, bench: str, beam: int) -> Path:
    """The table of one lamp, written unless it is there."""
    path = WRITTEN / f"{bench}-{beam}-{shape}.csv"
    if not path.exists():
        q = np.arange(0.0, _END, _STEP)
        value = SHAPES[shape](q, np.random.default_rng(number_of(path.stem)))
        angle = q * beam_of(CAMPAIGN[bench], beam)["lamp.hwhm_deg"]
        rows = [f"{a:.6g},{v:.6g}" for a, v in zip(angle, value / value[0], strict=True)]
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, "\n".join(["angle_deg,intensity", *rows]) + "\n")
    return path


@dataclass(frozen=True)
class Plan:
    """What a set shall have; the rest of its luck is in `rng`."""

    draw: int
    bench: str
    count: int
    shape: str
    must: tuple[str, ...]
    rng: np.random.Generator


def plans() -> Iterator[Plan]:
    """Every set; those with odd numbers have scattered or reflected light."""
    for draw in range(SETS):
        rng = np.random.default_rng(number_of(f"campaign {draw}"))
        count = int(rng.choice(len(COUNTS), p=COUNTS))
        shape = str(rng.choice(list(SHAPES))) if rng.random() < OTHER_LAMP else ""
        count = min(count, BESIDE_LAMP) if shape else count
        tank, must = str(rng.choice(["line", "grid", "fine"])), tuple[str, ...]()
        if draw % 2:
            must, count = ("scattering",), max(count, 1)
            if rng.random() < REFLECTED:
                tank, must = _MIRRORS[draw // 2 % 2]
        yield Plan(draw, f"campaign-{tank}", count, shape, must, rng)
