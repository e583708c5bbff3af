"""Everything that is hidden: which effect, where, of what size and form; and every set made of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.hidden_effects.benches import BENCHES, Order, number_of, table_of, true_scene
from lightfield.experiments.hide import draw_effect
from lightfield.fitting import effects

#: Size of a hidden effect over its typical size in the table of effects.
STRENGTHS = (0.4, 2.0, 10.0)
NOISES = (0.004, 0.01)
DRAWS = 8
NULL_DRAWS = 24
#: Random sequences of the responses that a diagnosis uses.
SEQUENCES = 3
NOISE_KINDS: Mapping[str, Mapping[str, float]] = {
    "independent": {},
    "serial": {"serial": 0.4},
    "plane gain": {"plane_gain": 0.003},
    "outliers": {"outliers": 0.02},
}
LAMPS = Path(__file__).parent / "lamps"


@dataclass(frozen=True)
class Truth:
    """Something hidden.

    Parameters
    ----------
    stratum : str
        "null", "one", "other physics", "two" or "unknown".
    hidden : tuple of str
        Right answer: names of the table of effects; empty for none and for what has no name.
    values : dict
        Values of scene parameters.
    unknown : str
        Kind of an influence that is in no table.
    any_of : tuple of str
        Names that are right, alone or together, where nature follows none of the table's formulas.
    """

    stratum: str
    bench: str
    beam: int
    label: str
    hidden: tuple[str, ...] = ()
    values: tuple[tuple[str, Any], ...] = ()
    unknown: str = ""
    any_of: tuple[str, ...] = ()


@dataclass(frozen=True)
class Trial:
    """One data set: a truth, read with some noise in some order."""

    truth: Truth
    noise_kind: str
    order: Order
    noise: float
    draw: int

    @property
    def key(self) -> str:
        t = self.truth
        return f"{t.bench}{t.beam}/{t.label}/{self.noise_kind}/{self.order}/{self.noise:g}/{self.draw}"

    @property
    def seed(self) -> int:
        return number_of(self.key)

    @property
    def sequence(self) -> int:
        """Random numbers of the responses that it is judged with: sets that share them share their errors."""
        return self.draw // 2 % SEQUENCES


@cache
def _drawn(bench: str, beam: int, name: str, strength: float, form: int) -> tuple[tuple[str, Any], ...]:
    rng = np.random.default_rng(number_of(f"{bench}{beam} {name} {strength:g} {form}"))
    table = table_of(BENCHES[bench], "random", np.random.default_rng(0))
    named = f"{name}:{effects.get(name).forms[form].name}"
    return tuple(draw_effect(true_scene(BENCHES[bench], beam), table, named, rng, strength).items())


def _one(bench: str, name: str, strength: float, form: int = 0, beam: int = 0) -> Truth:
    label = f"{name}{' second form' if form else ''} x{strength:g}"
    stratum = "other physics" if form else "one"
    return Truth(stratum, bench, beam, label, (name,), _drawn(bench, beam, name, strength, form))


def _two(bench: str, names: tuple[str, str], strength: float, beam: int = 0) -> Truth:
    values = tuple(pair for name in names for pair in _drawn(bench, beam, name, strength, 0))
    return Truth("two", bench, beam, f"{names[0]} + {names[1]} x{strength:g}", names, values)


ONE = {
    "line": (
        "apparent_source", "beam_offset", "beam_tilt", "beam_shape", "beam_skirt", "lamp_drift", "scattering",
        "water_gradient", "spectral_hardening", "background", "saturation", "acceptance", "detector_tilt",
        "lamp_size", "water_drift", "settling",
    ),
    "grid": ("apparent_source", "beam_tilt", "beam_ellipticity", "lamp_drift", "background", "saturation",
             "stratification", "beam_asymmetry"),
    "wide": ("wall_reflection",),
    "column": ("surface_reflection",),
    "air": ("window_refraction", "immersion"),
    "colour": ("cdom", "chlorophyll", "sediment", "stray_light", "wavelength_shift"),
}  # fmt: skip
TWO = (
    ("line", ("apparent_source", "background")), ("line", ("beam_tilt", "saturation")),
    ("line", ("lamp_drift", "background")), ("line", ("beam_skirt", "lamp_drift")),
    ("line", ("beam_shape", "background")), ("line", ("scattering", "background")),
    ("line", ("scattering", "saturation")), ("line", ("beam_offset", "water_gradient")),
    ("line", ("scattering", "beam_offset")), ("line", ("scattering", "apparent_source")),
    ("line", ("detector_tilt", "background")), ("line", ("spectral_hardening", "beam_offset")),
    ("grid", ("beam_ellipticity", "saturation")), ("grid", ("beam_tilt", "lamp_drift")),
    ("wide", ("wall_reflection", "saturation")), ("column", ("surface_reflection", "background")),
    ("air", ("window_refraction", "background")), ("colour", ("cdom", "background")),
    ("column", ("wall_reflection", "floor_reflection")), ("column", ("surface_reflection", "waves")),
)  # fmt: skip


def _scattering(phase: dict[str, Any], b: float) -> tuple[tuple[str, Any], ...]:
    return (("water.phase", phase), ("water.scattering_per_m", b))


def _other_physics() -> Iterator[Truth]:
    for water, b in (("average", 0.15), ("harbor", 0.1), ("clear", 0.2), ("coastal", 0.05)):
        values = _scattering({"type": "petzold", "water": water}, b)
        yield Truth("other physics", "line", 1, f"Petzold {water} b={b:g}", ("scattering",), values)
    for n, mu, b in ((1.1, 3.62, 0.15), (1.05, 3.4, 0.08), (1.15, 3.9, 0.25)):
        values = _scattering({"type": "fournier-forand", "n": n, "mu": mu}, b)
        yield Truth("other physics", "line", 2, f"Fournier-Forand n={n:g} b={b:g}", ("scattering",), values)
    for lamp in ("flat-top", "peaked", "shoulder"):
        shape = (("lamp.profile", "table"), ("lamp.intensity_table", str(LAMPS / f"{lamp}.csv")))
        yield Truth(
            "other physics", "line", 3, f"measured lamp, {lamp}", ("beam_shape",), shape,
            any_of=("beam_shape", "beam_skirt"),
        )  # fmt: skip
    for extra, width in ((0.05, 2.0), (0.1, 0.5)):
        layer = (
            ("water.layer_absorption_per_m", extra),
            ("water.layer_centre_m", 6.0), ("water.layer_width_m", width),
        )  # fmt: skip
        yield Truth("other physics", "line", 0, f"layer {width:g} m thick", ("water_gradient",), layer)
    for strength in STRENGTHS[1:]:
        for name in ("lamp_drift", "saturation", "water_gradient", "background"):
            yield _one("line", name, strength, form=1)


def truths() -> list[Truth]:
    """Every truth of the benchmark."""
    out = [
        Truth("null", bench.name, beam, "nothing")
        for bench in BENCHES.values()
        for beam in range(bench.beams)
    ]
    out += [_one(bench, name, s, beam=k % BENCHES[bench].beams)
            for bench, names in ONE.items() for k, name in enumerate(names) for s in STRENGTHS]  # fmt: skip
    out += list(_other_physics())
    out += [_two(bench, names, s) for bench, names in TWO for s in STRENGTHS[1:]]
    out += [
        Truth("unknown", bench, beam, f"unknown {kind}", unknown=f"unknown:{kind}")
        for kind in ("ripple", "flicker", "shadow", "kink")
        for bench, beam in (("line", 0), ("line", 1), ("grid", 0))
    ]
    return out


def trials() -> list[Trial]:
    """Every set of the benchmark, such that the first N are a fair sample of all."""
    numbered: list[tuple[float, Trial]] = []
    for truth in truths():
        if truth.stratum == "null":
            for kind in NOISE_KINDS:
                for draw in range(NULL_DRAWS):
                    order: Order = "plane" if kind == "plane gain" or draw % 4 == 3 else "random"
                    trial = Trial(truth, kind, order, NOISES[draw % 2], draw)
                    numbered.append((draw / 3, trial))
        else:
            for draw in range(DRAWS):
                trial = Trial(
                    truth, "independent", "plane" if draw % 4 == 3 else "random", NOISES[draw % 2], draw
                )
                numbered.append((draw, trial))
    return [trial for _, trial in sorted(numbered, key=lambda n: (int(n[0]), n[1].seed))]


def quick_trials(count: int = 60) -> list[Trial]:
    """A few sets of every kind, from few renders."""
    chosen = [
        t
        for t in trials()
        if t.truth.bench == "line"
        and t.truth.beam < 2
        and t.draw < (3 if t.truth.stratum == "null" else 1)
        and not t.truth.label.endswith(("x0.4", "x2"))
    ]
    return chosen[:count]
