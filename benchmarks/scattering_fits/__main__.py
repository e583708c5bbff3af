"""How true is what a fit finds in scattering water? Readings by an independent walk of photons, diagnosed.

Run from the root: `python -m benchmarks.scattering_fits [--seeds N] [--modes diagnose] [--case NAME]`.
The fields of the walk are stored beside this file; `--walk` makes them again with `walk.c` (a C compiler and
half an hour of a processor).
Every row is diagnosed twice: with all light from one trace that is reweighed, as a search does, and as
`diagnose` ends. Nothing is asserted. Results are kept in `found.csv`; what is there is not done again.
"""

from __future__ import annotations

import argparse
import csv
import subprocess
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from lightfield.diagnosis.diagnose import Diagnosis, diagnose
from lightfield.formula.field import direct_field
from lightfield.readings import Readings, read_table
from lightfield.render.diffuse.source import response_for
from lightfield.scene import Scene
from lightfield.storage.files import atomic_path

HERE = Path(__file__).resolve().parent
STORE = HERE / "found.csv"
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
#: Where dissolved matter is hidden: wavelengths that are read, what clear water absorbs there; slope of the
#: matter's absorption (Bricaud, Morel and Prieur 1981).
WATER = HERE / "water.csv"
COLOURS = tuple(map(tuple, np.loadtxt(WATER, delimiter=",", skiprows=2, usecols=(0, 1))))
SLOPE_PER_NM = 0.014
#: The experimenter's half width over the true one; his absorption.
WIDER, BELIEVED_PER_M = 4.2 / HWHM_DEG, 0.15
MODES = ("search", "diagnose")
INTRODUCTION = f"""\
# What is found in scattering water

Made by `python -m benchmarks.scattering_fits`; nothing is asserted. Readings on a scan through the axis in
{len(PLANES_M)} planes ({PLANES_M[0]} to {PLANES_M[-1]} m, to {RINGS_M[-1]} m aside), their scattered light
walked photon by photon (`walk.c`, {PHOTONS:.0e} photons) by code that shares nothing with the package;
errors of {100 * RELATIVE:g} % of a reading, {100 * DARK:g} % of the largest, {100 * STAY:g} % of a stay.
True are a half width of {HWHM_DEG:g} degrees and an absorption of {ABSORPTION_PER_M:g} per m; the
experimenter believes in {WIDER * HWHM_DEG:.1f} and {BELIEVED_PER_M:g}, and in no scattering.
Rows with walls are of a tank {TANK_M[0]:g} m wide, {TANK_M[1]:g} m deep and {TANK_M[2] + TANK_M[3]:g} m long,
taken for black, and of a lamp of {HWHM_IN_TANK_DEG:g} degrees
(1e9 photons with walls of 0.35, 3e8 with those of 0.45).
With CDOM (its absorption at 440 nm in 1/m) every place is read at
{", ".join(f"{at:g}" for at, _ in COLOURS)} nm, in water whose colour is known but for the dissolved matter.

`search`: all light from one trace in other water, reweighed (`diffuse=response_for`). `diagnose`: the same,
then settled with light that is followed without photons, times a traced ratio. Pull: found less true over the
stated error; its root mean square over the seeds should be near one. Within 1 and 2: how often the true b
lies within so many stated errors, with the binomial error of that part (Agresti and Coull 1998); all: the
same of all numbers that were fitted, which hang together: their parts are known about as well as those of b.
Named: what is hidden and nothing else; the numbers of a row are of these sets.
A seed is that of the readings' noise and of the traces that settle a fit.

Errors of `diagnose` are too large where scattering is strong. Part of it: the noise of readings is judged
beside the search's light, which does not fit there (b 0.7, g 0.95: in eleven sets 0.8 to 3.3 times its
variance, 2.0 in the mean), and not again beside light that does; without that the pulls of these sets would
have an rms of 0.73 instead of 0.51. What the ratio's polynomials leave out, 0.2 %, is 4 to 9 % of an error.

Between walls scattering is hardly told from absorption: noise-free light of walls of 0.35 is met by walls
alone, more absorption and a wider beam to a chi-square of 10 (108 readings). The simpler model is named, for
sure, and its errors do not know of the other.

Rows of `search` are of an
earlier state of the code.

| truth, per m | light | n | named | mean b | stated | scatter | pull | rms | in 1 | in 2 | all: 1, 2 |
|---|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|
"""
FOUND = (
    "water.scattering_per_m", "water.phase.g", "water.absorption_per_m", "lamp.hwhm_deg",
    "lamp.apparent_distance_m", "tank.wall_albedo", "water.cdom_440_per_m",
)  # fmt: skip


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
        with atomic_path(path) as temporary:
            head = "z_m,r_m" + ",irradiance,stderr" * len(case.absorptions)
            temporary.write_text(f"{head}\n{made.stdout}")
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


def row_of(case: Case, seed: int, mode: str, found: Diagnosis, seconds: float) -> dict[str, str]:
    """What was found, as a row of the store."""
    row = {"case": case.name, "seed": str(seed), "mode": mode, "verdict": found.verdict.verdict,
           "effects": " + ".join(found.verdict.effects), "seconds": f"{seconds:.1f}"}  # fmt: skip
    best = found.verdict.explanations[0] if found.verdict.explanations else None
    known = dict(best.parameters) if best else {}
    for path in FOUND:
        if path in known:
            row[path] = f"{known[path].value:.5g}"
            row[path + " error"] = f"{known[path].stderr:.3g}" if known[path].stderr is not None else ""
    return row


def main() -> None:
    """Diagnose what is missing in the store, then write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=4, help="noise seeds of every case")
    parser.add_argument("--modes", default=",".join(MODES), help="of these two, with a comma between")
    parser.add_argument("--case", default="", help="only cases whose name begins so")
    parser.add_argument("--walk", action="store_true", help="walk the photons again")
    args = parser.parse_args()
    rows = load()
    done = {(r["case"], r["seed"], r["mode"]) for r in rows}
    for seed in range(args.seeds):
        for case in CASES:
            for mode in args.modes.split(",") if case.name.startswith(args.case) else ():
                if (case.name, str(seed), mode) in done:
                    continue
                readings = readings_of(case, seed, args.walk and seed == 0 and mode == MODES[0])
                begun = time.process_time()
                with threadpool_limits(1):
                    source = response_for if mode == "search" else "trace"
                    found = diagnose(readings, case.believed, diffuse=source, seed=seed, advise=False)
                rows.append(row_of(case, seed, mode, found, time.process_time() - begun))
                save(rows)
                print(rows[-1], flush=True)
    with atomic_path(HERE / "README.md") as temporary:
        temporary.write_text(page(rows))


def load() -> list[dict[str, str]]:
    """Rows of the store."""
    if not STORE.exists():
        return []
    with STORE.open(newline="") as file:
        return list(csv.DictReader(file))


def save(rows: list[dict[str, str]]) -> None:
    """Write the store whole."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    with atomic_path(STORE) as temporary, temporary.open("w", newline="") as file:
        writer = csv.DictWriter(file, names, restval="")
        writer.writeheader()
        writer.writerows(rows)


def page(rows: list[dict[str, str]]) -> str:
    """The page of the benchmark."""
    lines = INTRODUCTION.splitlines()
    for case in CASES:
        for mode in MODES:
            lines.append(_line(case, mode, _of(rows, case, mode), "water.scattering_per_m"))
    lines += ["", *_otherwise(rows)]
    lines += [
        "",
        "Pulls of every number, of all rows, and how often the truth lies within one and two errors (68 and",
        "95 % if errors are right), with the binomial error of that part; at the end of all numbers, with",
        "the error that the scatter between sets tells. Sets named otherwise are in the list above alone.",
        "",
        "| parameter | light | n | pull, mean | pull, rms | within 1 | within 2 |",
        "|---|---|---:|---:|---:|---:|---:|",
    ]
    for path in FOUND:
        for mode in MODES:
            pulls = np.concatenate([_pulls(c, _named(c, _of(rows, c, mode)), path) for c in CASES])
            if len(pulls):
                inside = [_share(np.abs(pulls) < k) for k in (1, 2)]
                lines.append(
                    f"| `{path}` | {mode} | {len(pulls)} | {pulls.mean():+.2f} | "
                    f"{np.sqrt(np.mean(pulls**2)):.2f} | {inside[0]} | {inside[1]} |"
                )
    lines += [_together(rows, mode) for mode in MODES]
    lines += [
        "",
        "Processor time of a diagnosis without advice, s, median (a first one also traces for the search):",
        "",
    ]
    for mode in MODES:
        spent = [float(r["seconds"]) for r in rows if r["mode"] == mode]
        if spent:
            lines.append(f"- {mode}: {np.median(spent):.1f} (largest {max(spent):.0f})")
    return "\n".join(lines) + "\n"


def _of(rows: list[dict[str, str]], case: Case, mode: str) -> list[dict[str, str]]:
    """What was found in one case one way."""
    return [r for r in rows if (r["case"], r["mode"]) == (case.name, mode)]


def _known(rows: list[dict[str, str]], path: str) -> tuple[np.ndarray, np.ndarray]:
    """Values and errors of what has both."""
    pairs = [(r[path], r[path + " error"]) for r in rows if r.get(path) and r.get(path + " error")]
    found = np.array(pairs, float).reshape(-1, 2)
    return found[:, 0], found[:, 1]


def _pulls(case: Case, rows: list[dict[str, str]], path: str) -> np.ndarray:
    if path not in case.truth:
        return np.zeros(0)
    value, error = _known(rows, path)
    return (value - case.truth[path]) / error


def _share(inside: np.ndarray) -> str:
    """Part of the pulls that are inside, with its binomial standard error (of two more of either kind)."""
    near, n = (float(np.sum(inside)) + 2) / (len(inside) + 4), len(inside) + 4
    return f"{100 * np.mean(inside):.0f} ± {100 * np.sqrt(near * (1 - near) / n):.0f} %"


def _named(case: Case, rows: list[dict[str, str]]) -> list[dict[str, str]]:
    """Where what is hidden was named, and nothing else."""
    return [r for r in rows if set(r["effects"].split(" + ")) == case.hidden]


def _otherwise(rows: list[dict[str, str]]) -> list[str]:
    """What was named in place of what is hidden, and how far its numbers are from the truth."""
    lines = []
    for case in CASES:
        for mode in MODES:
            other = [r for r in _of(rows, case, mode) if r not in _named(case, [r])]
            for name in sorted({r["effects"] for r in other}):
                here = [r for r in other if r["effects"] == name]
                sure = sum(r["verdict"] == "identified" for r in here)
                pulls = ((path, _pulls(case, here, path)) for path in case.truth)
                off = ", ".join(
                    f"`{path}` {np.mean(_known(here, path)[0]):.3g} (pull {p.mean():+.1f})"
                    for path, p in pulls
                    if len(p)
                )
                lines.append(
                    f"- {case.name}, {mode}: {len(here)} named `{name or 'nothing'}`, {sure} for sure; "
                    f"mean {off or 'of nothing'}."
                )
    return ["Named otherwise:", "", *(lines or ["- none"])]


def _together(rows: list[dict[str, str]], mode: str) -> str:
    """Pulls of all numbers of all sets, those of one set as often as they hang together."""
    sets = [
        np.abs(np.concatenate([_pulls(case, [r], path) for path in case.truth]))
        for case in CASES
        for r in _named(case, _of(rows, case, mode))
    ]
    every = np.concatenate(sets)
    inside = []
    for k in (1, 2):
        parts = np.array([np.mean(pulls < k) for pulls in sets])
        inside.append(f"{100 * parts.mean():.0f} ± {100 * parts.std(ddof=1) / np.sqrt(len(parts)):.0f} %")
    rms = np.sqrt(np.mean(every**2))
    return f"| all | {mode} | {len(every)} of {len(sets)} sets | | {rms:.2f} | {inside[0]} | {inside[1]} |"


def _line(case: Case, mode: str, found: list[dict[str, str]], path: str) -> str:
    rows = _named(case, found)
    (value, error), pulls = _known(rows, path), _pulls(case, rows, path)
    head = f"| {case.name} | {mode} | {len(found)} | {len(rows)} |"
    if not len(value):
        return f"{head} | | | | | | | |"
    scatter = f"{value.std(ddof=1):.3f}" if len(value) > 1 else ""
    every = np.abs(np.concatenate([_pulls(case, rows, path) for path in case.truth]))
    return (
        f"{head} {value.mean():.3f} | {error.mean():.3f} | {scatter} | {pulls.mean():+.1f} | "
        f"{np.sqrt(np.mean(pulls**2)):.1f} | {_share(np.abs(pulls) < 1)} | {_share(np.abs(pulls) < 2)} | "
        f"{100 * np.mean(every < 1):.0f}, {100 * np.mean(every < 2):.0f} % |"
    )


if __name__ == "__main__":
    main()
