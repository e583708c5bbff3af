"""Readings whose light is written out here, sums and closed forms of its own; and one rendered table."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.arrays import Array
from lightfield.readings import Readings
from lightfield.readings.table.read import read_table
from lightfield.scene import Scene

SCENES = Path(__file__).resolve().parents[2] / "scenes"
#: What is true, and what the experimenter believes: half width (degrees), absorption (1/m).
TRUE, BELIEVED = (4.6, 0.105), (4.0, 0.12)
#: Part of the reading, and of the brightest.
_RELATIVE, _FLOOR = 0.005, 0.0005
_PLANES_M, _ACROSS_M, _SECONDS = (4.5, 5.5, 6.5, 7.5, 8.5), 0.8, 20.0


@dataclass(frozen=True)
class Places:
    """Where and when: x, z in m, time in s, shape (n,)."""

    x: Array
    z: Array
    time: Array


Light = Callable[[Places], Array]


def _beam(
    at: Places, offset_m: float = 0.0, tilt_deg: float = 0.0, zero_m: float = 0.0
) -> tuple[Array, Array]:
    """Angle from the axis (degrees), and cosine / r^2 and decay, of a lamp `zero_m` behind its window."""
    dx, z = at.x - offset_m, at.z + zero_m
    r = np.hypot(dx, z)
    angle = np.degrees(np.arctan2(dx, z)) - tilt_deg
    return np.abs(angle), z / r**3 * np.exp(-TRUE[1] * np.hypot(dx, at.z))


def _gaussian(at: Places, **moved: float) -> Array:
    angle, rest = _beam(at, **moved)
    return np.exp(-np.log(2) * (angle / TRUE[0]) ** 2) * rest


def _over_the_brightest(value: Array) -> Array:
    return value / value.max()


def _drifting(at: Places, value: Array, per_hour: float) -> Array:
    return value * (1 + per_hour * at.time / 3600)


def _ring(at: Places) -> Array:
    angle, rest = _beam(at, offset_m=0.03)
    return (np.exp(-np.log(2) * (angle / TRUE[0]) ** 2) + 0.3 * np.exp(-((angle - 5.0) ** 2))) * rest


def _flat(at: Places) -> Array:
    angle, rest = _beam(at)
    return np.exp(-np.log(2) * (angle / TRUE[0]) ** 3) * rest


def _cloudy(at: Places) -> Array:
    """Absorption that grows by 0.012 per m^2."""
    return _gaussian(at) * np.exp(-0.5 * 0.012 * at.z**2)


def _shadowed(at: Places) -> Array:
    """A strut that takes 4 % of the light on a hand's breadth, which is no effect of the table."""
    return _gaussian(at) * (1 - 0.04 * (np.abs(at.x - 0.3) < 0.1))


def _saturating(value: Array, part: float) -> Array:
    shown = _over_the_brightest(value)
    return shown * (1 - part * shown)


#: What is hidden by name, and the light of it. The table's name for each; none for what has no name.
LIGHTS: Mapping[str, tuple[tuple[str, ...], Light]] = {
    "nothing": ((), _gaussian),
    "weak drift": (("lamp_drift",), lambda at: _drifting(at, _gaussian(at), 0.02)),
    "weak background": (("background",), lambda at: _over_the_brightest(_gaussian(at)) + 0.0012),
    "apparent source": (("apparent_source",), lambda at: _gaussian(at, zero_m=0.35)),
    "gradient": (("water_gradient",), _cloudy),
    "tilt and saturation": (
        ("beam_tilt", "saturation"), lambda at: _saturating(_gaussian(at, tilt_deg=0.4), 0.04)
    ),
    "shape and background": (("beam_shape", "background"), lambda at: _over_the_brightest(_flat(at)) + 0.003),
    "offset, background and drift": (
        ("beam_offset", "background", "lamp_drift"),
        lambda at: _drifting(at, _over_the_brightest(_gaussian(at, offset_m=0.04)), 0.15) + 0.004,
    ),
    "shadow": ((), _shadowed),
    "ring and offset": (("beam_profile", "beam_offset"), _ring),
}  # fmt: skip
#: How the errors are: as stated, correlated from reading to reading, or with gross ones among them.
NOISES = {"nothing": ("stated", "serial", "outliers")}


@dataclass(frozen=True)
class Set:
    """One table of readings, by its light and its errors."""

    light: str
    noise: str

    @property
    def name(self) -> str:
        return self.light if self.noise == "stated" else f"{self.light}, {self.noise} errors"

    @property
    def hidden(self) -> tuple[str, ...]:
        return LIGHTS[self.light][0]

    @property
    def asked(self) -> list[str] | None:
        return ASKED.get(self.light)


#: Effects that are asked about, where not all are: a search among all takes several times as long.
_SOME = [
    "beam_offset",
    "beam_tilt",
    "background",
    "saturation",
    "lamp_drift",
    "water_drift",
    "apparent_source",
]
ASKED = {
    "offset, background and drift": _SOME,
    "ring and offset": [
        "beam_profile",
        "beam_skirt",
        "beam_shape",
        "beam_offset",
        "background",
        "lamp_drift",
    ],
    "shadow": ["lamp_drift"],
}
SETS = tuple(Set(light, noise) for light in LIGHTS for noise in NOISES.get(light, ("stated",)))


@dataclass(frozen=True)
class Bundled:
    """A table that comes with the package, of light that was rendered in full: with scattered light.

    Parameters
    ----------
    folder : str
        In `scenes/`.
    """

    name: str
    folder: str
    hidden: tuple[str, ...]
    asked: list[str]


BUNDLED = (
    Bundled(
        "rendered, scattering", "hidden_effect", ("scattering",),
        ["scattering", "background", "beam_offset", "lamp_drift"],
    ),
)  # fmt: skip
#: Of a number the first group that uses it is diagnosed: those of direct light take less time each.
GROUPS: Mapping[str, Sequence[Set | Bundled]] = {"direct": SETS, "bundled": BUNDLED}


def given(one: Set | Bundled) -> tuple[Readings, Scene, dict[str, Any]]:
    """What is diagnosed, and how."""
    if isinstance(one, Set):
        return readings_of(one), believed(), {"diffuse": None, "advise": False}
    folder = SCENES / one.folder
    scene = Scene.load(folder / "scene.toml")
    return read_table(folder / "data.csv", scene), scene, {"diffuse": "trace"}


def believed() -> Scene:
    """No tank: direct light alone."""
    return Scene.from_dict({"lamp": {"hwhm_deg": BELIEVED[0]}, "water": {"absorption_per_m": BELIEVED[1]}})


def readings_of(one: Set) -> Readings:
    """Five planes of 21 readings in random order, a line across each."""
    rng = np.random.default_rng(zlib.crc32(one.name.encode()))
    z, x = (v.ravel() for v in np.meshgrid(_PLANES_M, np.linspace(-_ACROSS_M, _ACROSS_M, 21), indexing="ij"))
    at = Places(x, z, _SECONDS * rng.permutation(z.size))
    light = _over_the_brightest(LIGHTS[one.light][1](at))
    sigma = np.hypot(_RELATIVE * light, _FLOOR)
    noise = rng.standard_normal(z.size)
    if one.noise == "serial":
        order = np.argsort(at.time)
        for before, now in pairwise(order):
            noise[now] = 0.4 * noise[before] + np.sqrt(1 - 0.4**2) * noise[now]
    if one.noise == "outliers":
        noise[rng.choice(z.size, 4, replace=False)] += rng.choice([-1, 1], 4) * rng.uniform(6, 15, 4)
    return Readings.from_arrays(
        x_m=at.x, z_m=at.z, time_s=at.time, value=light + sigma * noise, stderr=sigma, quantity="irradiance"
    )
