"""Waters and lamps whose scattered light other code walked photon by photon, and readings of them."""

from __future__ import annotations

import subprocess
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings, read_table
from lightfield.scene import Scene
from lightfield.storage.files import write_text

HERE = Path(__file__).resolve().parent
PLANES_M = (3.5, 4.5, 5.5, 6.5, 7.5, 8.5)
RINGS_M = tuple(round(0.1 * k, 1) for k in range(1, 11))
HALF_WIDTH_M, PHOTONS = 0.05, 1e8
#: In a tank light is counted in two cells, so high, not in a ring: more photons are sent.
HALF_HEIGHT_M = 0.1
RINGS_IN_TANK_M = RINGS_M[:-1]
#: A tank with the lamp in its middle: width, height, from the back wall to the window, to the end, m.
TANK_M = (2.0, 2.44, 0.5, 11.5)
#: Errors of the instrument: of a reading, of the dark over the largest reading, of a stay at a plane.
RELATIVE, DARK, STAY = 0.005, 0.0005, 0.002
ABSORPTION_PER_M, HWHM_DEG = 0.1, 3.81
HWHM_IN_TANK_DEG = 13.0
#: Where dissolved matter is hidden: wavelengths that are read, what clear water absorbs there (the table goes
#: further by one each way); slope of the matter's absorption (Bricaud, Morel and Prieur 1981).
WATER = HERE / "water.csv"
COLOURS = tuple(map(tuple, np.loadtxt(WATER, delimiter=",", skiprows=2, usecols=(0, 1))))[1:-1]
SLOPE_PER_NM = 0.014
#: The experimenter's half width over the true one; his absorption.
WIDER, BELIEVED_PER_M = 4.2 / HWHM_DEG, 0.15


@dataclass(frozen=True)
class Case:
    """One water and lamp, in a tank where walls reflect; dissolved matter's absorption at 440 nm."""

    name: str
    b: float
    g: float
    behind_m: float = 0.0
    walls: float = 0.0
    cdom: float = 0.0
    photons: float = PHOTONS

    @property
    def truth(self) -> dict[str, float]:
        """By path."""
        return {
            "water.scattering_per_m": self.b,
            "water.phase.g": self.g,
            "water.absorption_per_m": ABSORPTION_PER_M,
            "lamp.hwhm_deg": HWHM_IN_TANK_DEG if self.walls else HWHM_DEG,
            "lamp.apparent_distance_m": self.behind_m,
            **({"tank.wall_albedo": self.walls} if self.walls else {}),
            **({"water.cdom_440_per_m": self.cdom} if self.cdom else {}),
        }

    @property
    def hidden(self) -> set[str]:
        """Names of the effects."""
        there = {"apparent_source": self.behind_m, "wall_reflection": self.walls, "cdom": self.cdom}
        return {"scattering", *(name for name, size in there.items() if size)}

    @property
    def believed(self) -> Scene:
        """The experimenter's scene."""
        water: dict[str, object] = {"base": "none", "absorption_per_m": BELIEVED_PER_M}
        if self.cdom:
            water |= {"base": "table", "table": str(WATER), "cdom_slope_per_nm": SLOPE_PER_NM}
        whole: dict[str, dict[str, object]] = {
            "lamp": {"hwhm_deg": WIDER * self.truth["lamp.hwhm_deg"]},
            "water": water,
        }
        if self.cdom:
            whole["detector"] = {"bands_nm": [[at - 1, at + 1] for at, _ in COLOURS]}
        if self.walls:
            width, height, back, end = TANK_M
            whole["tank"] = {
                "width_m": width, "depth_m": height, "behind_lamp_m": back, "length_m": back + end,
            }  # fmt: skip
        return Scene.from_dict(whole)

    @property
    def absorptions(self) -> tuple[float, ...]:
        """At every wavelength that is read, 1/m."""
        if not self.cdom:
            return (ABSORPTION_PER_M,)
        return tuple(
            ABSORPTION_PER_M + clear + self.cdom * float(np.exp(-SLOPE_PER_NM * (at - 440)))
            for at, clear in COLOURS
        )


CASES = (
    Case("b 0.1, g 0.924", 0.1, 0.924),
    Case("b 0.2, g 0.97", 0.2, 0.97),
    Case("b 0.4, g 0.96", 0.4, 0.96),
    Case("b 0.7, g 0.95", 0.7, 0.95),
    Case("b 0.7, g 0.88", 0.7, 0.88),
    Case("b 0.2, g 0.924, source 2.5 m behind", 0.2, 0.924, 2.5),
    Case("b 0.15, g 0.924, walls 0.35", 0.15, 0.924, walls=0.35, photons=1e9),
    Case("b 0.15, g 0.924, walls 0.45, CDOM 0.12", 0.15, 0.924, walls=0.45, cdom=0.12, photons=3e8),
)


def field(case: Case, walk: bool) -> np.ndarray:
    """Rows of z, r, and diffuse light and its error at every wavelength, from the store or walked anew."""
    also = (f"_w{case.walls:g}" if case.walls else "") + (f"_c{case.cdom:g}" if case.cdom else "")
    path = HERE / "fields" / f"b{case.b:g}_g{case.g:g}_z{case.behind_m:g}{also}.csv"
    if walk or not path.exists():
        rings = RINGS_IN_TANK_M if case.walls else RINGS_M
        width, height, back, end = TANK_M
        tank = (HALF_HEIGHT_M, width, height, -back, end, case.walls) if case.walls else ()
        with tempfile.TemporaryDirectory() as folder:
            program = str(Path(folder) / "walk")
            subprocess.run(["cc", "-O3", "-o", program, str(HERE / "walk.c"), "-lm"], check=True)
            numbers = (
                case.photons, 1, case.truth["lamp.hwhm_deg"], case.behind_m, case.b, case.g, HALF_WIDTH_M,
                len(case.absorptions), *case.absorptions, len(PLANES_M), *PLANES_M, len(rings), *rings, *tank,
            )  # fmt: skip
            made = subprocess.run([program, *map(str, numbers)], check=True, capture_output=True, text=True)
        head = "z_m,r_m" + ",irradiance,stderr" * len(case.absorptions)
        write_text(path, f"{head}\n{made.stdout}")
    return np.loadtxt(path, delimiter=",", skiprows=1)


def in_the_middle(rows: np.ndarray, case: Case) -> np.ndarray:
    """Light in the middle of rings or cells, from means over them, shape (n_wavelengths, n_rows).

    Of a ring f + h^2 (f''/6 + f'/(3 r)); of a cell f + h^2 f''/6 + H^2 f_yy/6, H half its height, f_yy = f'/r
    as of round light. f is smooth in r^2.
    """
    out = np.empty((len(case.absorptions), len(rows)))
    second_way = HALF_HEIGHT_M**2 / 6 if case.walls else HALF_WIDTH_M**2 / 3
    for plane in np.unique(rows[:, 0]):
        here = rows[:, 0] == plane
        r = rows[here, 1]
        for channel, mean in enumerate(rows[here, 2::2].T):
            smooth = np.polynomial.Polynomial.fit(r**2, np.log(mean), 4)
            first, second = smooth.deriv(1)(r**2), smooth.deriv(2)(r**2)
            slope = 2 * r * first
            bending = slope**2 + 2 * first + 4 * r**2 * second
            out[channel, here] = mean / (1 + HALF_WIDTH_M**2 * bending / 6 + second_way * slope / r)
    return out


def readings_of(case: Case, seed: int, walk: bool, repeats: int = 1) -> Readings:
    """A scan on both sides of the axis, with the errors of an instrument; repeats have them together."""
    rows, own = field(case, walk), np.sqrt(repeats)
    z, diffuse = np.repeat(rows[:, 0], 2 * repeats), np.repeat(in_the_middle(rows, case), 2 * repeats, axis=1)
    x = np.repeat(np.stack([rows[:, 1], -rows[:, 1]], axis=1).ravel(), repeats)
    parts = [case.b, case.g, case.walls, case.cdom]
    rng = np.random.default_rng([seed, *(int(1000 * v) for v in parts if v)])
    _, plane = np.unique(z, return_inverse=True)
    stay = (1 + STAY * rng.standard_normal(len(PLANES_M)))[plane]
    grey = replace(case, cdom=0.0)
    true = grey.believed.with_values(grey.truth)
    columns: dict[str, list[np.ndarray]] = {}
    for channel, a in enumerate(case.absorptions):
        water = true.with_values({"water.absorption_per_m": a})
        light = diffuse[channel] + direct_field(water, x, 0 * x, z)
        value = light / light.max() * stay
        stderr = own * np.hypot(RELATIVE * value, DARK)
        one = {
            "x_m": x, "y_m": 0 * x, "z_m": z, "value": value + stderr * rng.standard_normal(len(x)),
            "stderr": stderr, "time_s": 30.0 * np.arange(len(x)),
        }  # fmt: skip
        if case.cdom:
            one["wavelength_nm"] = np.full(len(x), COLOURS[channel][0])
        for name, values in one.items():
            columns.setdefault(name, []).append(values)
    table = np.array([np.concatenate(values) for values in columns.values()]).T
    head = f'# quantity = "irradiance"\n# scale = "relative"\n# plane_gain_percent = {100 * STAY}\n'
    body = "\n".join(",".join(f"{v:.8g}" for v in row) for row in table)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "readings.csv"
        path.write_text(f"{head}{','.join(columns)}\n{body}\n")
        return read_table(path)
