"""The tanks, lamps and layouts that the readings of the benchmark are taken with."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lightfield.experiments.layouts import Order, positions, table_at
from lightfield.readings import Readings
from lightfield.scene import Scene

PLANES = [4.5, 5.5, 6.5, 7.5, 8.5]
COLOURS = [450.0, 500.0, 550.0, 600.0, 650.0]
WINDOW_M = 0.02
_HELD_OUT_PLANES = (5.0, 7.0, 8.0)


@dataclass(frozen=True)
class Bench:
    """One set-up.

    Parameters
    ----------
    layout : str
        Of `lightfield.experiments.layouts`, or "colour": seven places per plane, five wavelengths each.
    hwhm_deg, absorption_per_m : (low, high)
        The true beam and water are somewhere in here.
    beams : int
        How many different beams and waters.
    """

    name: str
    scene: dict[str, Any]
    layout: str
    hwhm_deg: tuple[float, float]
    absorption_per_m: tuple[float, float]
    beams: int


def _scene(tank: dict[str, Any] | None, **parts: dict[str, Any]) -> dict[str, Any]:
    detector = {"planes_m": PLANES, "width_m": 2.0}
    whole: dict[str, Any] = {
        "lamp": {"radius_m": WINDOW_M},
        "water": {},
        "detector": detector | parts.pop("detector", {}),
    }
    if tank is not None:
        whole["tank"] = {"width_m": 3.66, "depth_m": 2.44, "length_m": 12.0, "lamp_depth_m": 1.22} | tank
    return whole | parts


BENCHES = {
    bench.name: bench
    for bench in (
        Bench("line", _scene({}), "line", (3.5, 4.6), (0.09, 0.16), 4),
        Bench("grid", _scene({}), "grid", (3.5, 4.6), (0.09, 0.16), 2),
        Bench(
            "wide",
            _scene({"width_m": 2.0}, detector={"width_m": 1.8}),
            "line", (12.0, 15.5), (0.09, 0.16), 2,
        ),
        Bench(
            "column",
            _scene({"lamp_depth_m": 0.6}, detector={"width_m": 1.8}),
            "column", (12.0, 15.5), (0.09, 0.16), 1,
        ),
        Bench("air", _scene(None), "air", (3.5, 4.6), (0.09, 0.16), 1),
        Bench(
            "colour",
            _scene(
                {},
                water={"base": "pure"},
                detector={"bands_nm": [[c - 10, c + 10] for c in COLOURS]},
            ),
            "colour", (3.5, 4.6), (0.02, 0.05), 1,
        ),
    )
}  # fmt: skip

#: How many different beams and waters the tanks of campaigns have: one for every set.
_MANY = 1_000_000


def _campaign(name: str, like: str, layout: str, hwhm_deg: tuple[float, float]) -> Bench:
    return replace(
        BENCHES[like], name=f"campaign-{name}", layout=layout, hwhm_deg=hwhm_deg,
        absorption_per_m=(0.06, 0.16), beams=_MANY,
    )  # fmt: skip


#: Tanks of the field cases, and two that show walls and a surface, each with lamps and waters of its own.
CAMPAIGN = {
    bench.name: bench
    for bench in (
        _campaign("line", "line", "line", (3.4, 5.6)),
        _campaign("grid", "grid", "grid", (3.4, 5.6)),
        _campaign("fine", "line", "fine", (3.4, 5.6)),
        _campaign("wide", "wide", "line", BENCHES["wide"].hwhm_deg),
        _campaign("column", "column", "column", BENCHES["column"].hwhm_deg),
    )
}


def bench_named(name: str) -> Bench:
    """A bench of the benchmark, or of campaigns."""
    return (BENCHES | CAMPAIGN)[name]


def number_of(text: str) -> int:
    """A number that depends on the text alone, the same on every machine."""
    return zlib.crc32(text.encode())


def beam_of(bench: Bench, which: int) -> dict[str, float]:
    """True half width and absorption."""
    rng = np.random.default_rng(number_of(f"{bench.name} beam {which}"))
    return {
        "lamp.hwhm_deg": float(rng.uniform(*bench.hwhm_deg)),
        "water.absorption_per_m": float(rng.uniform(*bench.absorption_per_m)),
    }


def true_scene(bench: Bench, which: int) -> Scene:
    """The set-up with its true beam and water, and nothing hidden."""
    return Scene.from_dict(bench.scene).with_values(beam_of(bench, which))


def believed_scene(truth: Scene, rng: np.random.Generator) -> Scene:
    """What the experimenter thinks of a true scene: half width and absorption wrong by 10 to 25 %."""
    wrong = 1 + rng.choice([-1, 1], 2) * rng.uniform(0.10, 0.25, 2)
    return truth.with_values(
        {
            "lamp.hwhm_deg": truth.lamp.hwhm_deg / float(wrong[0]),
            "water.absorption_per_m": truth.water.absorption_per_m / float(wrong[1]),
            "lamp.radius_m": 0.0,
        }
    )


def table_of(bench: Bench, order: Order, rng: np.random.Generator) -> Readings:
    """Places and times of the readings, no values yet."""
    scene = Scene.from_dict(bench.scene)
    if bench.layout == "colour":
        places = positions(scene, "line")
        some = np.flatnonzero(np.abs(np.round(places["x_m"] / 0.3) * 0.3 - places["x_m"]) < 1e-6)
        places = {name: column[some] for name, column in places.items()}
        return table_at(places, COLOURS, scene, order, rng)
    return table_at(positions(scene, bench.layout), [np.nan], scene, order, rng)


def held_out_places(bench: Bench) -> dict[str, np.ndarray]:
    """Places between the readings, where a fitted scene is compared with the truth; none in colour."""
    if bench.layout == "colour":
        return {name: np.zeros(0) for name in ("x_m", "y_m", "z_m")}
    reach = Scene.from_dict(bench.scene).detector.width_m / 2
    x = np.linspace(-0.75, 0.75, 7) * reach
    y = np.array([-0.35, 0.2]) * reach if bench.layout in ("grid", "column") else np.zeros(1)
    z, y, x = (a.ravel() for a in np.meshgrid(_HELD_OUT_PLANES, y, x, indexing="ij"))
    return {"x_m": x, "y_m": y, "z_m": z}


def with_held_out(bench: Bench, table: Readings) -> Readings:
    """The table followed by the held-out places."""
    more = held_out_places(bench)
    n = len(more["x_m"])
    both = np.r_[np.arange(len(table)), np.zeros(n, int)]
    longer = table.subset(both)
    changed = {name: np.r_[getattr(table, name), column] for name, column in more.items()}
    changed["medium"] = np.r_[table.medium, np.full(n, "water")]
    return replace(longer, **changed)
