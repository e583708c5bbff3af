"""Where each effect shows: tanks, detectors and layouts, and what is hidden in them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.hidden_effects.benches import number_of
from lightfield.experiments.hide import draw_effect
from lightfield.experiments.layouts import Order, scan
from lightfield.fitting import effects
from lightfield.readings import Readings
from lightfield.scene import Scene

ROOT = Path(__file__).resolve().parents[1]
#: Sizes over the typical one of what is asked about; of what acts beside it, drawn between them.
STRENGTHS = (2.5, 5.0, 10.0)
#: How many others act beside it, and how often nothing is hidden.
BESIDE, NULLS = 2, 300
IRRADIANCE = "W m^-2 nm^-1"
#: What acts beside it: what most tanks have.
COMPANY = ("background", "beam_offset", "lamp_drift", "saturation")
_TANK = {"width_m": 2.0, "depth_m": 1.6, "length_m": 9.0, "lamp_depth_m": 0.6}
_PURE = {"base": "pure", "absorption_per_m": 0.03}


@dataclass(frozen=True)
class Campaign:
    """A set-up that shows some effects.

    Parameters
    ----------
    scene : mapping
        What is true but for width and absorption, which the experimenter has 10 to 25 % wrong.
    effects : sequence of str
        What is hidden here, in turn.
    units : str
        Of readings on an absolute scale; "": they are relative.
    company : sequence of str
        What may act beside it.
    """

    name: str
    scene: Mapping[str, Any]
    layout: str
    effects: Sequence[str]
    order: Order = "random"
    units: str = ""
    company: Sequence[str] = COMPANY

    def table(self, rng: np.random.Generator) -> tuple[Scene, Readings]:
        """The scene, and where and when it is read."""
        scene = Scene.from_dict(dict(self.scene))
        table = scan(scene, self.layout, self.order, rng)
        return scene, replace(table, scale="absolute", units=self.units) if self.units else table


def _scene(
    tank: Mapping[str, Any] | None = None,
    water: Mapping[str, Any] | None = None,
    colours_nm: Sequence[float] = (),
    planes_m: Sequence[float] = (2.0, 3.0, 4.0, 5.0, 6.0),
    **lamp: Any,
) -> dict[str, Any]:
    detector: dict[str, Any] = {"planes_m": list(planes_m), "width_m": 1.6}
    if colours_nm:
        detector["bands_nm"] = [[c - 5.0, c + 5.0] for c in colours_nm]
    whole = {
        "lamp": {"hwhm_deg": 6.0, "radius_m": 0.01} | lamp,
        "water": dict(water or {"absorption_per_m": 0.1}),
        "detector": detector,
    }
    return whole if tank is None else whole | {"tank": _TANK | tank}


_COLOURS = (450.0, 500.0, 550.0, 600.0, 650.0)
CAMPAIGNS = (
    Campaign(
        "line", _scene(), "line",
        ("apparent_source", "beam_offset", "beam_tilt", "beam_shape", "beam_skirt", "beam_asymmetry",
         "lamp_drift", "lamp_size", "scattering", "water_gradient", "water_drift", "background",
         "saturation", "acceptance", "detector_tilt", "cosine_error", "spectral_hardening", "plane_gain",
         "attenuation_profile", "lamp_power_curve", "background_curve", "background:switched",
         "background:on for a while"),
    ),
    Campaign("grid", _scene(), "grid", ("beam_ellipticity", "stratification", "stratification:bottom layer")),
    Campaign(
        "turbid", _scene(water={"absorption_per_m": 0.1, "scattering_per_m": 0.2}), "line", ("settling",)
    ),
    Campaign("walls", _scene({}, hwhm_deg=14.0), "line", ("wall_reflection",)),
    Campaign("grey walls", _scene({"wall_albedo": 0.3}, hwhm_deg=14.0), "column", ("floor_reflection",)),
    Campaign(
        "short tank",
        _scene({"wall_albedo": 0.7, "length_m": 5.5}, planes_m=(1.5, 2.5, 3.5, 4.5), hwhm_deg=14.0),
        "column", ("end_reflection",),
    ),
    Campaign("column", _scene({}, hwhm_deg=14.0), "column", ("surface_reflection",)),
    Campaign(
        "tank of glass",
        _scene({"surface": "flat", "panes": "all", "pane_reflectance": 0.0}, hwhm_deg=14.0),
        "line", ("pane_reflection",),
    ),
    Campaign("open surface", _scene({"surface": "flat"}, hwhm_deg=14.0), "column", ("waves",)),
    Campaign("air", _scene(), "air", ("window_refraction", "immersion")),
    Campaign("to and fro", _scene(), "line", ("lag",), order="rows"),
    Campaign(
        "measured lamp",
        _scene(profile="table", intensity_table=str(ROOT / "many_effects" / "lamps" / "measured-flood.csv")),
        "line", ("table_width",),
    ),
    Campaign(
        "colours", _scene(water=_PURE, colours_nm=_COLOURS), "half",
        ("cdom", "chlorophyll", "sediment", "stray_light", "wavelength_shift", "beam_colour",
         "attenuation_spectrum"),
    ),
    Campaign(
        "turbid colours",
        _scene(water=_PURE | {"scattering_per_m": 0.15}, colours_nm=_COLOURS[::2], planes_m=(2.0, 4.0, 6.0)),
        "half",
        ("scattering_slope", "scattering_spectrum"),
    ),
    Campaign("octave", _scene(water=_PURE, colours_nm=(380.0, 450.0, 550.0, 650.0, 760.0)), "half",
             ("second_order",)),
    Campaign(
        "calibrated", _scene(water=_PURE, colours_nm=_COLOURS), "half", ("lamp_power", "lamp_spectrum"),
        units=IRRADIANCE, company=("beam_offset", "beam_tilt", "lamp_drift"),
    ),
    Campaign("daylight", _scene(water=_PURE, colours_nm=_COLOURS), "half", ("background_spectrum",)),
)  # fmt: skip


@dataclass(frozen=True)
class Trial:
    """One data set.

    Parameters
    ----------
    asked : str
        The effect that it is about, in its first form or "effect:form"; "" where nothing is hidden.
    hidden : tuple of str
    values : tuple of (str, object)
        Parameters of all that is hidden.
    """

    campaign: Campaign
    asked: str
    hidden: tuple[str, ...]
    values: tuple[tuple[str, Any], ...]
    draw: int
    key: str = field(init=False)

    def __post_init__(self) -> None:
        what = " + ".join(self.hidden) or "nothing"
        object.__setattr__(self, "key", f"{self.campaign.name}/{self.asked or '-'}/{what}/{self.draw}")

    @property
    def seed(self) -> int:
        return number_of(self.key)

    @property
    def effect(self) -> str:
        return effect_of(self.asked)


def effect_of(asked: str) -> str:
    """Effect of which a form is asked about."""
    return asked.partition(":")[0]


def _hidden(campaign: Campaign, asked: str, beside: int, draw: int) -> Trial:
    rng = np.random.default_rng(number_of(f"{campaign.name} {asked} {beside} {draw}"))
    scene, table = campaign.table(np.random.default_rng(0))
    known = effects.table() | effects.curves()
    effect = effect_of(asked)
    names = [effect]
    for name in rng.permutation([n for n in campaign.company if n != effect]).tolist():
        together = all(known[name].combines_with(known[other]) for other in names)
        if len(names) <= beside and together and name not in known[effect].contains:
            names.append(name)
    values: dict[str, Any] = {}
    for k, name in enumerate(names):
        low, high = np.log([STRENGTHS[0], STRENGTHS[-1]])
        strength = STRENGTHS[draw % len(STRENGTHS)] if k == 0 else float(np.exp(rng.uniform(low, high)))
        values |= draw_effect(scene, table, asked if k == 0 else name, rng, strength)
    return Trial(campaign, asked, tuple(names), tuple(values.items()), draw)


def trials() -> Iterator[Trial]:
    """Every effect at every size, alone and beside others; and nothing, in each campaign in turn."""
    for draw in range(len(STRENGTHS)):
        for campaign in CAMPAIGNS:
            for asked in campaign.effects:
                yield _hidden(campaign, asked, 0, draw)
                yield _hidden(campaign, asked, BESIDE, draw)
    for draw in range(NULLS):
        yield Trial(CAMPAIGNS[draw % len(CAMPAIGNS)], "", (), (), draw)
