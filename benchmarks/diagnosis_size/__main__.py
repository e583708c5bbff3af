"""Time and memory of a diagnosis against the number of readings, beside dense algebra of the same size.

Run from the root: `python -m benchmarks.diagnosis_size [--sizes N,N,...]`. Every row is measured in a process
of its own, whose peak memory it states; nothing is asserted.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from threadpoolctl import threadpool_limits

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.problem.layout import layout_of
from lightfield.diagnosis.problem.noise import Budget, Noise
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.experiments.measure import Instrument, LightAtReadings, measure
from lightfield.fitting.diffuse_light import has_diffuse_light
from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
from lightfield.scene import Scene
from lightfield.storage.files import write_text

HERE = Path(__file__).resolve().parent
SIZES = (300, 1000, 3000, 10_000, 20_000)
#: The dense covariance of more readings takes more memory than most machines have; nor are they asked more
#: than whether nothing is missing.
MOST_DENSE = 10_000
PLANES_M = (4.5, 5.5, 6.5, 7.5, 8.5)
#: As many columns as a test of a fit has replicates.
COLUMNS, RHO, TOLERANCE, NOISE = 999, 0.3, 0.003, 0.005
#: Of the trace of the true scattered light, whose random numbers no diagnosis uses.
PHOTONS, SEED = 3e7, 990_001
HIDDEN: dict[str, dict[str, float]] = {
    "nothing": {},
    "offset": {"lamp.offset_x_m": 0.02},
    "three effects": {"lamp.offset_x_m": 0.03, "lamp.drift_per_hour": 0.3, "detector.background": 0.01},
    "scattering": {"water.scattering_per_m": 0.1},
}
DIRECT = ("nothing", "offset", "three effects")
WATERS: dict[str, dict[str, Any]] = {
    "open water": {},
    "tank": {"tank": {"wall_albedo": 0.0}},
    "murky tank": {
        "water": {"absorption_per_m": 0.12, "scattering_per_m": 0.1},
        "tank": {"wall_albedo": 0.2},
    },
}
#: Number of readings, what is hidden, where, and whether the places are even.
TRACED = (
    (1000, "offset", "open water", True),
    (10_000, "offset", "open water", True),
    (10_000, "nothing", "open water", True),
    (10_000, "scattering", "open water", True),
    (300, "offset", "tank", False),
    (1000, "offset", "murky tank", True),
    (3900, "offset", "murky tank", True),
)

TEXT = """\
# Diagnosis of many readings

Made by `python -m benchmarks.diagnosis_size`; nothing is asserted. Readings on a square grid in five planes
(4.5 to 8.5 m, 1.8 m wide), taken plane by plane, errors of {noise:g} % and a dark floor; one thread.
Processor time in seconds, peak memory of the process in MB (an empty one takes about {empty:.0f}).

## The whole diagnosis

Direct light only (`--no-trace`). Nothing hidden; a beam 2 cm off the axis; three effects at once. Where no
two explain these, every pair is tried, and all is done again within the tolerance: that is the most that a
diagnosis does.

{diagnoses}

## With traced light

Scattering, and in a tank walls and surface, are tested too, with traces that are in the cache; "first" is
the process that made them. "Uneven" are random places in the same planes. The murky tank itself scatters
(0.1 per metre), and its walls reflect 20 %. The true light is traced in its own water, with other random
numbers.

{traced}

## Its algebra alone

Factor of one covariance (plane gain, serial correlation 0.3), and {columns} columns whitened by it; then with
the tolerated smooth error of 0.3 % as well. Beside them SciPy's dense Cholesky decomposition and triangular
solution for the same covariance, in the same run. "Ratio" is dense time over ours, "chi-square" the largest
relative difference in the sum of squares of a column. Up to 512 readings both are the same.

{algebra}
"""


def table_of(
    n: int, hidden: dict[str, float], water: str = "open water", even: bool = True
) -> tuple[Any, Scene]:
    """About n readings of a scene with something hidden, and the scene without."""
    side = round((n / len(PLANES_M)) ** 0.5)
    across = np.linspace(-0.9, 0.9, side)
    z, y, x = (a.ravel() for a in np.meshgrid(PLANES_M, across, across, indexing="ij"))
    if not even:
        places = np.random.default_rng(1)
        z, x, y = np.sort(places.choice(PLANES_M, n)), *places.uniform(-0.9, 0.9, (2, n))
    believed = Scene.from_dict(
        {"lamp": {"hwhm_deg": 4.0}, "water": {"absorption_per_m": 0.12}} | WATERS[water]
    )
    table = Readings.from_arrays(
        x_m=x, y_m=y, z_m=z, value=np.ones(len(z)), stderr=np.full(len(z), np.nan),
        time_s=2.0 * np.arange(len(z)), quantity="irradiance",
    ).check_against(believed)  # fmt: skip
    truth = believed.with_values(hidden)
    light = direct_field(truth, x, y, z)
    if has_diffuse_light(truth):
        light += _diffuse_light(believed, truth, x, y, z)
    rng = np.random.default_rng(0)
    return measure(truth, table, LightAtReadings(light), Instrument(NOISE), rng)[0], believed


def _diffuse_light(believed: Scene, truth: Scene, x: Any, y: Any, z: Any) -> Any:
    """Scattered and reflected light of the truth, traced in its own water, in its smooth form.

    A response traced in clear water would be off by more than 10,000 readings let pass, and what is timed
    would be the search for what that error looks like.
    """
    from lightfield.render.diffuse.followed import FollowedLight
    from lightfield.render.diffuse.ratio import traced_ratio
    from lightfield.render.diffuse.source import response_for

    middle = float(np.mean(truth.detector.bands_nm[0]))
    ratio = traced_ratio(truth, x, y, z, np.array([middle]), photons=PHOTONS, seed=SEED)
    followed = FollowedLight.of(response_for(believed, x, y, z), (x, y, z), [(truth, ratio)])
    return followed.light(truth, [None])[0]


def clocked(work: Callable[[], Any]) -> tuple[Any, float]:
    """What the work gives, and its processor time in seconds."""
    start = time.process_time()
    made = work()
    return made, time.process_time() - start


def diagnosis(n: int, hidden: str) -> dict[str, Any]:
    """One diagnosis."""
    readings, scene = table_of(n, HIDDEN[hidden])
    found, seconds = clocked(lambda: diagnose(readings, scene, diffuse=None))
    return {"n": len(readings), "seconds": seconds, "verdict": found.verdict.verdict}


def traced(n: int, hidden: str, water: str, even: bool) -> dict[str, Any]:
    """One diagnosis with scattered and reflected light."""
    readings, scene = table_of(n, HIDDEN[hidden], water, even)
    found, seconds = clocked(lambda: diagnose(readings, scene))
    return {"n": len(readings), "seconds": seconds, "verdict": found.verdict.verdict}


def noise_of(n: int) -> Noise:
    """The noise of such readings."""
    readings, _ = table_of(n, {})
    light = np.asarray(readings.value, float)
    sigma = np.hypot(NOISE * light, 0.0008 * light.max())
    return Noise(layout_of(readings), sigma, light, Budget(0.003, 0.0, TOLERANCE), 0 * sigma)


def algebra(n: int, tolerance: float, dense: bool) -> dict[str, Any]:
    """One factor and its columns, and their sums of squares."""
    noise = noise_of(n)
    columns = np.random.default_rng(1).standard_normal((noise.layout.size, COLUMNS)) * noise.sigma[:, None]

    def by_chain() -> np.ndarray:
        return Whitener(noise, RHO, 1.0, tolerance)(columns)

    def by_scipy() -> np.ndarray:
        covariance = noise.covariance(RHO, 1.0, tolerance)
        root = cholesky(covariance, lower=True, overwrite_a=True, check_finite=False)
        return solve_triangular(root, columns, lower=True, check_finite=False)

    white, seconds = clocked(by_scipy if dense else by_chain)
    return {"n": len(columns), "seconds": seconds, "squares": (white**2).sum(0)[:20].tolist()}


def measured(what: str, *arguments: Any) -> dict[str, Any]:
    """A row from a process of its own."""
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "benchmarks.diagnosis_size", "--row", json.dumps([what, *arguments])]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    row: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    print(what, *arguments, {k: v for k, v in row.items() if k != "squares"}, flush=True)
    return row


def row(what: str, *arguments: Any) -> dict[str, Any]:
    """Measure here."""
    with threadpool_limits(1, "blas"):
        rows: dict[str, Callable[..., dict[str, Any]]] = {
            "diagnosis": diagnosis, "traced": traced, "algebra": algebra, "empty": dict,
        }  # fmt: skip
        made = rows[what](*arguments)
    return made | {"peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024}


def page(sizes: list[int]) -> str:
    """Measure everything."""
    lines = ["| readings | hidden | verdict | time | memory |", "|---:|---|---|---:|---:|"]
    for n in sizes:
        for hidden in DIRECT:
            if n > MOST_DENSE and hidden != "nothing":
                continue
            found = measured("diagnosis", n, hidden)
            told = f"{hidden} | {found['verdict']}"
            lines.append(f"| {found['n']} | {told} | {found['seconds']:.1f} | {found['peak_mb']:.0f} |")
    paths = [
        "| readings | places | water | hidden | verdict | time | memory | first |",
        "|---:|---|---|---|---|---:|---:|---:|",
    ]
    for n, hidden, water, even in TRACED:
        if n <= max(sizes):
            first = "-"
            if hidden != "nothing":  # that alone finds nothing to trace which the rows before have not
                begun = measured("traced", n, hidden, water, even)
                first = f"{begun['seconds']:.1f} s, {begun['peak_mb']:.0f} MB"
            found = measured("traced", n, hidden, water, even)
            told = f"{'even' if even else 'uneven'} | {water} | {hidden} | {found['verdict']}"
            cost = f"{found['seconds']:.1f} | {found['peak_mb']:.0f} | {first}"
            paths.append(f"| {found['n']} | {told} | {cost} |")
    more = [
        "| readings | tolerance | time | memory | dense: time | memory | ratio | chi-square |",
        "|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for n in sizes:
        for tolerance in (0.0, TOLERANCE):
            ours = measured("algebra", n, tolerance, False)
            beside = "- | - | - | -"
            if n <= MOST_DENSE:
                peer = measured("algebra", n, tolerance, True)
                apart = np.abs(np.array(ours["squares"]) / peer["squares"] - 1).max()
                ratio = peer["seconds"] / ours["seconds"]
                beside = f"{peer['seconds']:.2f} | {peer['peak_mb']:.0f} | {ratio:.1f} | {apart:.0e}"
            mine = f"{100 * tolerance:g} % | {ours['seconds']:.2f} | {ours['peak_mb']:.0f}"
            more.append(f"| {ours['n']} | {mine} | {beside} |")
    return TEXT.format(
        noise=100 * NOISE, columns=COLUMNS, empty=measured("empty")["peak_mb"],
        diagnoses="\n".join(lines), traced="\n".join(paths), algebra="\n".join(more),
    )  # fmt: skip


def main() -> None:
    """Write the page, or one row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", default=",".join(map(str, SIZES)), help="numbers of readings")
    parser.add_argument("--row", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.row:
        print(json.dumps(row(*json.loads(args.row))))
        return
    text = page([int(n) for n in args.sizes.split(",")])
    write_text(HERE / "README.md", text)


if __name__ == "__main__":
    main()
