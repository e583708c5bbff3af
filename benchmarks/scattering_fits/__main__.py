"""How true is what a fit finds in scattering water? Readings by an independent walk of photons, diagnosed.

Run from the root: `python -m benchmarks.scattering_fits [--seeds N] [--modes diagnose] [--case NAME]`.
The fields of the walk are stored beside this file; `--walk` makes them again with `walk.c` (a C compiler and
seven minutes of a processor).
Every row is diagnosed twice: with all light from one trace that is reweighed, as a search does, and as
`diagnose` ends. Nothing is asserted. Results are kept in `found.csv`; what is there is not done again.
"""

from __future__ import annotations

import argparse
import csv
import subprocess
import tempfile
import time
from dataclasses import dataclass
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
#: Errors of the instrument: of a reading, of the dark over the largest reading, of a stay at a plane.
RELATIVE, DARK, STAY = 0.005, 0.0005, 0.002
ABSORPTION_PER_M, HWHM_DEG = 0.1, 3.81
#: What the experimenter believes.
BELIEVED = "[lamp]\nhwhm_deg = 4.2\n[water]\nbase = 'none'\nabsorption_per_m = 0.15\n"
MODES = ("search", "diagnose")
INTRODUCTION = f"""\
# What is found in scattering water

Made by `python -m benchmarks.scattering_fits`; nothing is asserted. Readings on a scan through the axis in
{len(PLANES_M)} planes ({PLANES_M[0]} to {PLANES_M[-1]} m, to {RINGS_M[-1]} m aside), their scattered light
walked photon by photon (`walk.c`, {PHOTONS:.0e} photons) by code that shares nothing with the package;
errors of {100 * RELATIVE:g} % of a reading, {100 * DARK:g} % of the largest, {100 * STAY:g} % of a stay.
True are a half width of {HWHM_DEG:g} degrees and an absorption of {ABSORPTION_PER_M:g} per m; the
experimenter believes 4.2 and 0.15, and in no scattering.

`search`: all light from one trace in other water, reweighed (`diffuse=response_for`). `diagnose`: the same,
then settled with light that is followed without photons, times a traced ratio. Pull: found less true over the
stated error; its root mean square over the seeds should be near one. Within 1 and 2: how often the true b
lies within so many stated errors, with the binomial error of that part (Agresti and Coull 1998); all: the
same of all numbers that were fitted, which hang together: their parts are known about as well as those of b.
A seed is that of the readings' noise and of the traces that settle a fit.

| truth, per m | light | n | named | mean b | stated | scatter | pull | rms | in 1 | in 2 | all: 1, 2 |
|---|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|
"""
FOUND = (
    "water.scattering_per_m", "water.phase.g", "water.absorption_per_m", "lamp.hwhm_deg",
    "lamp.apparent_distance_m",
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """One water and lamp."""

    name: str
    b: float
    g: float
    behind_m: float = 0.0

    @property
    def truth(self) -> dict[str, float]:
        """By path."""
        return {
            "water.scattering_per_m": self.b,
            "water.phase.g": self.g,
            "water.absorption_per_m": ABSORPTION_PER_M,
            "lamp.hwhm_deg": HWHM_DEG,
            "lamp.apparent_distance_m": self.behind_m,
        }


CASES = (
    Case("b 0.1, g 0.924", 0.1, 0.924),
    Case("b 0.2, g 0.97", 0.2, 0.97),
    Case("b 0.4, g 0.96", 0.4, 0.96),
    Case("b 0.7, g 0.95", 0.7, 0.95),
    Case("b 0.7, g 0.88", 0.7, 0.88),
    Case("b 0.2, g 0.924, source 2.5 m behind", 0.2, 0.924, 2.5),
)


def field(case: Case, walk: bool) -> np.ndarray:
    """Rows of z, r, scattered irradiance and its error, from the store or walked anew."""
    path = HERE / "fields" / f"b{case.b:g}_g{case.g:g}_z{case.behind_m:g}.csv"
    if walk or not path.exists():
        with tempfile.TemporaryDirectory() as folder:
            program = str(Path(folder) / "walk")
            subprocess.run(["cc", "-O3", "-o", program, str(HERE / "walk.c"), "-lm"], check=True)
            numbers = (
                PHOTONS, 1, HWHM_DEG, case.behind_m, ABSORPTION_PER_M, case.b, case.g, HALF_WIDTH_M,
                len(PLANES_M), *PLANES_M, len(RINGS_M), *RINGS_M,
            )  # fmt: skip
            made = subprocess.run([program, *map(str, numbers)], check=True, capture_output=True, text=True)
        with atomic_path(path) as temporary:
            temporary.write_text("z_m,r_m,irradiance,stderr\n" + made.stdout)
    return np.loadtxt(path, delimiter=",", skiprows=1)


def in_the_middle(rows: np.ndarray) -> np.ndarray:
    """Light in the middle of the rings, from means over them: f + h^2 (f''/6 + f'/(3 r)), f smooth in r^2."""
    out = np.empty(len(rows))
    for plane in np.unique(rows[:, 0]):
        here = rows[:, 0] == plane
        r, mean = rows[here, 1], rows[here, 2]
        smooth = np.polynomial.Polynomial.fit(r**2, np.log(mean), 4)
        first, second = smooth.deriv(1)(r**2), smooth.deriv(2)(r**2)
        slope = 2 * r * first
        bending = slope**2 + 2 * first + 4 * r**2 * second
        out[here] = mean / (1 + HALF_WIDTH_M**2 * (bending / 6 + slope / (3 * r)))
    return out


def readings_of(case: Case, seed: int, walk: bool, repeats: int = 1) -> Readings:
    """A scan on both sides of the axis, with the errors of an instrument; repeats have them together."""
    rows, own = field(case, walk), np.sqrt(repeats)
    z, light = np.repeat(rows[:, 0], 2 * repeats), np.repeat(in_the_middle(rows), 2 * repeats)
    x = np.repeat(np.stack([rows[:, 1], -rows[:, 1]], axis=1).ravel(), repeats)
    scene = Scene.from_toml(BELIEVED).with_values(case.truth)
    light = light + direct_field(scene, x, 0 * x, z)
    rng = np.random.default_rng([seed, int(1000 * case.b), int(1000 * case.g)])
    _, plane = np.unique(z, return_inverse=True)
    value = light / light.max() * (1 + STAY * rng.standard_normal(len(PLANES_M)))[plane]
    stderr = own * np.hypot(RELATIVE * value, DARK)
    columns = {
        "x_m": x, "y_m": 0 * x, "z_m": z, "value": value + stderr * rng.standard_normal(len(x)),
        "stderr": stderr, "time_s": 30.0 * np.arange(len(x)),
    }  # fmt: skip
    head = f'# quantity = "irradiance"\n# scale = "relative"\n# plane_gain_percent = {100 * STAY}\n'
    body = "\n".join(",".join(f"{v:.8g}" for v in row) for row in zip(*columns.values(), strict=True))
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
    scene = Scene.from_toml(BELIEVED)
    for seed in range(args.seeds):
        for case in CASES:
            for mode in args.modes.split(",") if case.name.startswith(args.case) else ():
                if (case.name, str(seed), mode) in done:
                    continue
                readings = readings_of(case, seed, args.walk and seed == 0 and mode == MODES[0])
                begun = time.process_time()
                with threadpool_limits(1):
                    source = response_for if mode == "search" else "trace"
                    found = diagnose(readings, scene, diffuse=source, seed=seed, advise=False)
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
    lines += [
        "",
        "Pulls of every number, and how often the truth lies within one and two of its errors (68 and 95 %",
        "if errors are right), with the binomial error of that part.",
        "",
        "| parameter | light | n | pull, mean | pull, rms | within 1 | within 2 |",
        "|---|---|---:|---:|---:|---:|---:|",
    ]
    for path in FOUND:
        for mode in MODES:
            pulls = np.concatenate([_pulls(c, _of(rows, c, mode), path) for c in CASES])
            if len(pulls):
                inside = [_share(np.abs(pulls) < k) for k in (1, 2)]
                lines.append(
                    f"| `{path}` | {mode} | {len(pulls)} | {pulls.mean():+.2f} | "
                    f"{np.sqrt(np.mean(pulls**2)):.2f} | {inside[0]} | {inside[1]} |"
                )
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
    value, error = _known(rows, path)
    return (value - case.truth[path]) / error


def _share(inside: np.ndarray) -> str:
    """Part of the pulls that are inside, with its binomial standard error (of two more of either kind)."""
    near, n = (float(np.sum(inside)) + 2) / (len(inside) + 4), len(inside) + 4
    return f"{100 * np.mean(inside):.0f} ± {100 * np.sqrt(near * (1 - near) / n):.0f} %"


def _line(case: Case, mode: str, rows: list[dict[str, str]], path: str) -> str:
    (value, error), pulls = _known(rows, path), _pulls(case, rows, path)
    named = sum("scattering" in r["effects"] for r in rows)
    head = f"| {case.name} | {mode} | {len(rows)} | {named} |"
    if not len(value):
        return f"{head} | | | | | | | |"
    scatter = f"{value.std(ddof=1):.3f}" if len(value) > 1 else ""
    every = np.abs(np.concatenate([_pulls(case, rows, path) for path in FOUND]))
    return (
        f"{head} {value.mean():.3f} | {error.mean():.3f} | {scatter} | {pulls.mean():+.1f} | "
        f"{np.sqrt(np.mean(pulls**2)):.1f} | {_share(np.abs(pulls) < 1)} | {_share(np.abs(pulls) < 2)} | "
        f"{100 * np.mean(every < 1):.0f}, {100 * np.mean(every < 2):.0f} % |"
    )


if __name__ == "__main__":
    main()
