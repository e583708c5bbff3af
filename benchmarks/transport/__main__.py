"""Benchmarks of the light transport beside stock Mitsuba and MCX-CL: `python -m benchmarks.transport`."""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.transport import mcx, ours, report
from lightfield.render.backend import use_backend
from lightfield.storage.cache import cache_dir
from lightfield.storage.files import write_text

HERE = Path(__file__).resolve().parent
TANK = {"width_m": 3.6, "depth_m": 2.4, "lamp_depth_m": 1.2, "length_m": 9.0, "behind_lamp_m": 0.0}
# Radii along x and one corner, on three of the five planes.
PLACES = [(0.0, 0.0), (0.35, 0.0), (0.7, 0.0), (0.97, 0.0), (0.97, 0.97)]
STOCK_PLANES = [4.5, 6.5, 8.5]


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.transport", description=__doc__)
    parser.add_argument(
        "-o", "--output", type=Path, default=HERE / "results", help="results.md and results.json"
    )
    parser.add_argument("--quick", action="store_true", help="a tenth of the photons: to try the script")
    parser.add_argument(
        "--peer", type=Path, default=cache_dir() / "benchmark-peer", help="the peer's environment"
    )
    options = parser.parse_args()
    share = 0.1 if options.quick else 1.0
    backend = use_backend()
    result: dict[str, Any] = {"machine": report.machine(backend), "load_before": os.getloadavg()}
    steps = {
        "stock": lambda: stock(share, backend.llvm_path),
        "symmetric": lambda: ours.time_to_two_percent(2e7 * share, symmetry=True),
        "plain": lambda: ours.time_to_two_percent(2e7 * share, symmetry=False),
        "mcx": lambda: mcx.run(options.peer, {**TANK, "a": ours.A, "b": ours.B, "g": ours.G,
                               "hwhm_deg": ours.HWHM_DEG, "photons": int(5e5 * share), "repeats": 3}),
        "tank": lambda: ours.photon_rate(1e7 * share, TANK),
        "mcx_again": lambda: mcx.run(options.peer, {**TANK, "a": ours.A, "b": ours.B, "g": ours.G,
                                     "hwhm_deg": ours.HWHM_DEG, "photons": int(5e5 * share), "repeats": 3}),
        "open": lambda: ours.photon_rate(1e7 * share, None),
        "spectrum": lambda: ours.spectral_cost(1e7 * share),
        "evaluate": lambda: ours.evaluate_time(symmetry=False),
        "evaluate_symmetric": lambda: ours.evaluate_time(symmetry=True),
        "paper_scene": lambda: ours.in_fresh_process(f"paper_scene({2e7 * share})", dict(os.environ)),
    }  # fmt: skip
    for name, step in steps.items():
        print(f"{name} ...", flush=True)
        result[name] = step() | {"load": os.getloadavg()[0]}
    result["stock_total"] = stock_total(result["stock"]["detectors"])
    result["agreement"] = agreement(result["stock"]["detectors"], result["symmetric"])
    for name in ("symmetric", "plain"):
        for bulky in ("mean", "stderr", "x"):
            result[name].pop(bulky)
    options.output.mkdir(parents=True, exist_ok=True)
    table = report.table(result)
    for name, text in (("results.json", json.dumps(result, indent=1) + "\n"), ("results.md", table)):
        write_text(options.output / name, text)
    print(table)
    print(f"written to {options.output}")


def stock(share: float, llvm: Path | None) -> dict[str, Any]:
    """Stock Mitsuba at a few detectors, in a process of its own."""
    detectors = [[x, y, z] for z in STOCK_PLANES for x, y in PLACES]
    case = {"variant": "llvm_ad_mono", "a": ours.A, "b": ours.B, "g": ours.G, "hwhm_deg": ours.HWHM_DEG,
            "cell_m": 2.0 / 65, "spp": 1024, "seeds": max(2, round(12 * share)),
            "detectors": detectors}  # fmt: skip
    env = dict(os.environ) | ({"DRJIT_LIBLLVM_PATH": str(llvm)} if llvm else {})
    done = subprocess.run(
        [sys.executable, HERE / "stock.py", json.dumps(case)], capture_output=True, text=True, env=env
    )
    if done.returncode:
        raise SystemExit(f"stock Mitsuba did not run: {done.stderr.strip().splitlines()[-1]}")
    return {"variant": case["variant"], "detectors": json.loads(done.stdout.splitlines()[-1])}


def stock_total(detectors: list[dict[str, float]]) -> dict[str, float]:
    """Seconds of all pixels of five planes, each charged what the median detector takes."""
    pixels = len(ours.PLANES) * 65**2
    return {
        kind: pixels * float(np.median([d[f"{kind}_2_percent"] for d in detectors]))
        for kind in ("wall", "cpu")
    }


def agreement(detectors: list[dict[str, float]], maps: dict[str, Any]) -> list[dict[str, float]]:
    """Ratio of stock to this package's scattered irradiance at the detectors, and its standard error."""
    found = []
    for d in detectors:
        at = (ours.PLANES.index(d["z"]), *(int(np.abs(maps["x"] - d[k]).argmin()) for k in ("y", "x")))
        value, error = maps["mean"][at], maps["stderr"][at]
        ratio = d["mean"] / value
        found.append({"x": d["x"], "y": d["y"], "z": d["z"], "ratio": float(ratio),
                      "stderr": float(ratio * np.hypot(d["stderr"] / d["mean"], error / value))})  # fmt: skip
    return found


if __name__ == "__main__":
    main()
