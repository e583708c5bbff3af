"""What is hidden in every set: effects together, with which lamp, which errors, which unknown beside them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.hidden_effects.benches import BENCHES, Order, bench_named, number_of, table_of, true_scene
from benchmarks.hidden_effects.catalogue import LAMPS as EARLIER_LAMPS
from benchmarks.hidden_effects.catalogue import NOISES, Truth
from benchmarks.many_effects import campaign
from lightfield.experiments.hide import draw_effect
from lightfield.fitting import effects

#: Size of a hidden effect over its typical size, log-uniform: from invisible to gross.
STRENGTH = (0.5, 10.0)
#: Part of the sets that are read plane by plane, not in random order.
PLANE_BY_PLANE = 0.25
#: How the errors differ from what the table states.
ERRORS = ("half stated", "double stated", "serial", "cluster")
#: Influences that no entry of the table describes.
UNKNOWNS = ("ripple", "flicker", "shadow", "kink")
#: Six shapes of lamp; the last two are goniophotometer tables.
LAMPS: Mapping[str, Path] = {
    **{name: EARLIER_LAMPS / f"{name}.csv" for name in ("flat-top", "peaked", "shoulder")},
    **{
        name: Path(__file__).parent / "lamps" / f"{name}.csv"
        for name in ("ring", "measured-spot", "measured-flood")
    },
}
#: Named forms of the beam: what a lamp of its own shape replaces.
BEAM_FORMS = ("beam_shape", "beam_skirt")

_ALONG = (
    "apparent_source", "beam_offset", "beam_tilt", "beam_shape", "beam_skirt", "lamp_drift", "scattering",
    "water_gradient", "background", "saturation", "water_drift", "acceptance", "detector_tilt", "lamp_size",
)  # fmt: skip
#: Effects that may act in each tank, from which sets are drawn.
MAY_ACT: Mapping[str, Sequence[str]] = {
    "line": _ALONG,
    "grid": (*_ALONG, "beam_ellipticity", "stratification"),
    "wide": (*(n for n in _ALONG if n != "lamp_size"), "wall_reflection"),
    "column": ("beam_tilt", "beam_shape", "lamp_drift", "scattering", "background", "saturation",
               "surface_reflection"),
    "air": ("apparent_source", "beam_tilt", "beam_skirt", "background", "saturation", "window_refraction"),
}  # fmt: skip
#: What came to the table after the sets above were drawn, in tanks that show it, with what it acts beside;
#: sizes of two to ten times the typical one, three sets each.
LATER: Sequence[tuple[str, tuple[str, ...]]] = (
    ("line", ("plane_gain",)), ("grid", ("plane_gain", "beam_offset")),
    ("column", ("wall_reflection", "floor_reflection")), ("column", ("surface_reflection", "waves")),
    ("colour", ("attenuation_spectrum",)), ("colour", ("attenuation_spectrum", "background")),
    ("colour", ("scattering", "scattering_slope")), ("colour", ("scattering", "scattering_spectrum")),
    ("colour", ("beam_colour", "background")),
)  # fmt: skip
LATER_STRENGTH, LATER_DRAWS = (2.0, 10.0), 3
#: Which of these tanks that of a campaign is.
_CAMPAIGN_TANK = {
    "campaign-line": "line", "campaign-grid": "grid", "campaign-fine": "line", "campaign-wide": "wide",
    "campaign-column": "column",
}  # fmt: skip
#: In which tank the sets of a stratum are read, in turn.
_TANKS = ("line", "grid", "line", "wide", "grid", "line", "column", "grid", "line", "air", "line", "grid")
_SIMPLE_TANKS = ("line", "grid")
#: Sets of every number of effects, of every lamp with 0 to 3, of every error with 0 to 4, of every unknown
#: beside 1 to 3.
CLEAN, LAMP, MISSPECIFIED, UNKNOWN = 36, 5, 8, 8


@dataclass(frozen=True)
class Trial:
    """One data set.

    Parameters
    ----------
    truth : Truth
        Its stratum is "clean", "lamp", "misspecified", "unknown" or "later" or "campaign".
    lamp, errors : str
        Of `LAMPS` or of `campaign.SHAPES`, of `ERRORS`; "" for a Gaussian, and for errors as stated.
    """

    truth: Truth
    lamp: str
    errors: str
    order: Order
    noise: float
    draw: int
    key: str = field(init=False)

    def __post_init__(self) -> None:
        t = self.truth
        parts = (t.stratum, f"{t.bench}{t.beam}", self.lamp or self.errors or t.unknown, t.label)
        object.__setattr__(
            self, "key", f"{'/'.join(p for p in parts if p)}/{self.order}/{self.noise:g}/{self.draw}"
        )

    @property
    def seed(self) -> int:
        return number_of(self.key)


def _chosen(bench: str, count: int, without: Sequence[str], rng: np.random.Generator) -> list[str]:
    """Names of effects that can act together."""
    table, out = effects.table(), list[str]()
    for name in rng.permutation([n for n in MAY_ACT[bench] if n not in without]).tolist():
        if len(out) < count and all(table[name].combines_with(table[other]) for other in out):
            out.append(name)
    return out


def _trial(
    stratum: str, bench: str, count: int, draw: int, lamp: str = "", errors: str = "", unknown: str = ""
) -> Trial:
    rng = np.random.default_rng(number_of(f"{stratum} {bench} {count} {lamp}{errors}{unknown} {draw}"))
    beam = int(rng.integers(BENCHES[bench].beams))
    names = _chosen(bench, count, BEAM_FORMS if lamp else (), rng)
    scene, table = (
        true_scene(BENCHES[bench], beam),
        table_of(BENCHES[bench], "random", np.random.default_rng(0)),
    )
    values = {}
    for name in names:
        strength = float(np.exp(rng.uniform(*np.log(STRENGTH))))
        values |= draw_effect(scene, table, name, rng, strength)
    if lamp:
        values |= {"lamp.profile": "table", "lamp.intensity_table": str(LAMPS[lamp])}
    truth = Truth(
        stratum, bench, beam, " + ".join(names) or "nothing", tuple(names), tuple(values.items()),
        f"unknown:{unknown}" if unknown else "",
    )  # fmt: skip
    order: Order = "plane" if rng.random() < PLANE_BY_PLANE else "random"
    return Trial(truth, lamp, errors, order, float(rng.choice(NOISES)), draw)


def _later(bench: str, names: tuple[str, ...], draw: int) -> Trial:
    rng = np.random.default_rng(number_of(f"later {bench} {' '.join(names)} {draw}"))
    scene = true_scene(BENCHES[bench], 0)
    table, values = table_of(BENCHES[bench], "random", np.random.default_rng(0)), dict[str, object]()
    for name in names:
        strength = float(np.exp(rng.uniform(*np.log(LATER_STRENGTH))))
        values |= draw_effect(scene.with_values(values), table, name, rng, strength)
    truth = Truth("later", bench, 0, " + ".join(names), names, tuple(values.items()))
    return Trial(truth, "", "", "random", float(rng.choice(NOISES)), draw)


def _campaign(plan: campaign.Plan) -> Trial:
    rng, bench = plan.rng, bench_named(plan.bench)
    beam = int(rng.integers(bench.beams))
    scene, table = true_scene(bench, beam), table_of(bench, "random", np.random.default_rng(0))
    may = MAY_ACT[_CAMPAIGN_TANK[plan.bench]]
    weight = {n: campaign.FAVOURED if n in campaign.FIELD else 1.0 for n in may if n not in plan.must}
    if plan.shape:
        weight = {n: w for n, w in weight.items() if n not in BEAM_FORMS}
    if not plan.draw % 2:
        weight.pop("scattering", None)
        weight.pop("wall_reflection", None)
    odds = np.array([*weight.values()])
    order_of_draw = rng.choice([*weight], len(weight), replace=False, p=odds / odds.sum()).tolist()
    known, names = effects.table(), list(plan.must)
    for name in order_of_draw:
        if len(names) < plan.count and all(known[name].combines_with(known[other]) for other in names):
            names.append(name)
    values: dict[str, object] = {}
    for name in names:
        strength = float(np.exp(rng.uniform(*np.log(campaign.STRENGTH))))
        values |= draw_effect(scene, table, name, rng, strength)
    if plan.shape:
        path = campaign.lamp_table(plan.shape, plan.bench, beam)
        values |= {"lamp.profile": "table", "lamp.intensity_table": str(path)}
    truth = Truth(
        "campaign", plan.bench, beam, " + ".join(names) or "nothing", tuple(names), tuple(values.items())
    )
    order: Order = "plane" if rng.random() < campaign.PLANE_BY_PLANE else "random"
    return Trial(truth, plan.shape, "", order, float(rng.choice(campaign.NOISES)), plan.draw)


def _planned() -> Iterator[Trial]:
    for count in range(7):
        for draw in range(CLEAN):
            bench = _TANKS[draw % len(_TANKS)]
            yield _trial("clean", bench if count <= 4 else _SIMPLE_TANKS[draw % 2], count, draw)
    for lamp in LAMPS:
        for count in range(4):
            for draw in range(LAMP):
                yield _trial("lamp", _SIMPLE_TANKS[(draw + count) % 2], count, draw, lamp=lamp)
    for errors in ERRORS:
        for count in range(5):
            for draw in range(MISSPECIFIED):
                yield _trial("misspecified", _SIMPLE_TANKS[(draw + count) % 2], count, draw, errors=errors)
    for unknown in UNKNOWNS:
        for count in (1, 2, 3):
            for draw in range(UNKNOWN):
                yield _trial("unknown", _SIMPLE_TANKS[(draw + count) % 2], count, draw, unknown=unknown)
    for draw in range(LATER_DRAWS):
        for bench, names in LATER:
            yield _later(bench, names, draw)
    yield from map(_campaign, campaign.plans())


def trials() -> list[Trial]:
    """Every set: strata one after the other, so that every N-th is a fair sample of all."""
    return list(_planned())
