"""Tables of numbers that are no measurement of a lamp under water, at the places of a real layout."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from lightfield.arrays import Array
from lightfield.experiments.layouts import SECONDS_PER_READING, positions
from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
from lightfield.scene import Scene

#: Values, and how far they scatter about anything that one could call their law.
Drawn = tuple[Array, Array]

LAYOUTS = ("line", "line", "line", "half", "grid")
#: What a spectrometer says of its errors: part of the reading, part of the largest.
_RELATIVE, _FLOOR = 0.01, 0.001


def believed() -> Scene:
    """A lamp of 4 degrees in water of 0.12 per metre, five planes, no tank."""
    return Scene.from_dict({"lamp": {"hwhm_deg": 4.0}, "water": {"absorption_per_m": 0.12}})


def _light(places: Mapping[str, Array], hwhm_deg: float) -> Array:
    """Light of a lamp at the places, 1 where it is brightest."""
    scene = believed().with_values({"lamp.hwhm_deg": hwhm_deg})
    x, y, z = (places[name] for name in ("x_m", "y_m", "z_m"))
    light = direct_field(scene, x, y, z, np.full(len(z), 550.0), np.full(len(z), "water"))
    return np.asarray(light / light.max())


def _uniform(places: Mapping[str, Array], rng: np.random.Generator) -> Drawn:
    n = len(places["z_m"])
    return rng.random(n), np.full(n, 1 / np.sqrt(12))


def _lognormal(places: Mapping[str, Array], rng: np.random.Generator) -> Drawn:
    value = np.exp(rng.uniform(0.3, 1.5) * rng.standard_normal(len(places["z_m"])))
    return value, np.full(len(value), value.std())


def _permuted(places: Mapping[str, Array], rng: np.random.Generator) -> Drawn:
    """A good measurement whose rows lost their places."""
    light = _light(places, rng.uniform(3.0, 8.0))
    value = rng.permutation(light * (1 + 0.005 * rng.standard_normal(len(light))))
    return value, np.full(len(value), value.std())


def _constant(places: Mapping[str, Array], rng: np.random.Generator) -> Drawn:
    """A detector that is stuck."""
    noise = rng.choice([0.0, 1e-4, 1e-2])
    n = len(places["z_m"])
    return 1 + noise * rng.standard_normal(n), np.full(n, max(noise, 1e-6))


def _quantised(places: Mapping[str, Array], rng: np.random.Generator) -> Drawn:
    """A beam read with two to eight levels."""
    steps = int(rng.integers(1, 8))
    value = np.round(_light(places, rng.uniform(3.0, 8.0)) * steps) / steps
    return value, np.full(len(value), 1 / steps / np.sqrt(12))


def _two_lamps(places: Mapping[str, Array], rng: np.random.Generator) -> Drawn:
    """Rows of two measurements, of another lamp each, in one table."""
    one = _light(places, rng.uniform(3.0, 5.0))
    two = _light(places, rng.uniform(5.0, 9.0)) * rng.uniform(1.5, 5.0)
    value = np.where(rng.random(len(one)) < 0.5, one, two)
    return value * (1 + 0.005 * rng.standard_normal(len(one))), np.abs(two - one) / 2 + 1e-3


KINDS: Mapping[str, Callable[[Mapping[str, Array], np.random.Generator], Drawn]] = {
    "uniform": _uniform,
    "lognormal": _lognormal,
    "permuted": _permuted,
    "constant": _constant,
    "quantised": _quantised,
    "two lamps mixed": _two_lamps,
}
#: Standard errors of the table from the scatter of its values; None: no column.
ERRORS: Mapping[str, Callable[[Array, Array], Array] | None] = {
    "none": None,
    "as a spectrometer states them": lambda v, _: np.hypot(_RELATIVE * v, _FLOOR * np.abs(v).max()),
    "the scatter": lambda _, scatter: scatter,
    "3 times too small": lambda _, scatter: scatter / 3,
    "10 times too small": lambda _, scatter: scatter / 10,
    "3 times too large": lambda _, scatter: scatter * 3,
    "10 times too large": lambda _, scatter: scatter * 10,
}


@dataclass(frozen=True)
class Table:
    """One table of garbage: kind of its values, kind of its errors, and which of that sort."""

    kind: str
    errors: str
    draw: int

    @property
    def seed(self) -> int:
        """The same on every machine."""
        return zlib.crc32(f"{self.kind}/{self.errors}/{self.draw}".encode())

    def readings(self) -> Readings:
        """The table, with times in random order, as a careful experimenter would hand it in."""
        rng = np.random.default_rng(self.seed)
        places = positions(believed(), LAYOUTS[self.draw % len(LAYOUTS)])
        value, scatter = KINDS[self.kind](places, rng)
        state = ERRORS[self.errors]
        n = len(value)
        return Readings.from_arrays(
            **places,
            value=value,
            stderr=np.full(n, np.nan) if state is None else state(value, scatter),
            time_s=SECONDS_PER_READING * rng.permutation(n),
            quantity="irradiance",
        )


def tables(count: int) -> list[Table]:
    """The first `count` tables, of all sorts in turn."""
    sorts = [(kind, errors) for kind in KINDS for errors in ERRORS]
    return [Table(*sorts[i % len(sorts)], i // len(sorts)) for i in range(count)]
