"""A graphics card beside the processors of the same machine: `python -m benchmarks.transport.gpu`.

How many photons a second each traces, and whether their maps agree. Every figure comes from fresh processes,
one per scene and backend.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.transport import ours, report
from lightfield.render.backend import use_backend
from lightfield.render.backend.cuda import cuda_problem
from lightfield.render.maps import render_scene
from lightfield.scene import Scene
from lightfield.storage.files import write_text

HERE = Path(__file__).resolve().parent
#: Photons that are timed, and of each of the seeds that are compared.
TIMED, COMPARED = {"cuda": 4e8, "llvm": 4e7}, 2e7
SEEDS = {"cuda": range(4), "llvm": range(10, 14)}
BRIGHT_TANK = {
    "lamp": {"hwhm_deg": 8.0},
    "water": {"absorption_per_m": 0.1, "scattering_per_m": 0.3, "phase": {"type": "fournier-forand"}},
    "tank": {"width_m": 2.0, "depth_m": 1.5, "length_m": 5.0, "wall_albedo": 0.5, "surface": "flat",
             "surface_slope_deg": 5.0},
    "detector": {"planes_m": [1.5, 3.0, 4.5], "width_m": 1.0, "pixels": 21, "bands_nm": [[500, 550]]},
}  # fmt: skip
SCENES = {
    "paper": "the paper's tank, walls and surface",
    "open": "open water, b 0.15 per m",
    "bright": "tank of 2 m, walls 0.5, waves, b 0.3 per m",
}


def scene_of(name: str) -> Scene:
    """One of `SCENES`."""
    if name == "paper":
        return Scene.load(ours.ROOT / "scenes" / "unh_tow_tank" / "scene.toml")
    return ours.scene_of() if name == "open" else Scene.from_dict(BRIGHT_TANK)


def measure(name: str, kind: str) -> None:
    """Print seconds of the first render and photons/s of a long one, and each plane's irradiance by seed."""
    scene, began = scene_of(name), time.perf_counter()
    use_backend()
    render_scene(scene, rel_error=1e-5, max_photons=1e5, cache=False)
    first, began = time.perf_counter() - began, time.perf_counter()
    photons = render_scene(scene, rel_error=1e-5, max_photons=TIMED[kind], cache=False).response.photons
    rate = photons / (time.perf_counter() - began)
    planes = []
    for seed in SEEDS[kind]:
        mean, _ = render_scene(
            scene, rel_error=1e-5, max_photons=COMPARED, seed=seed, cache=False
        ).relative_maps(ours.AT, "diffuse")
        planes.append(mean[0].mean(axis=(1, 2)).tolist())
    print(json.dumps({"first": first, "photons": photons, "rate": rate, "planes": planes}))


def in_fresh_process(name: str, kind: str) -> dict[str, Any]:
    """The same in a new interpreter, on one backend."""
    code = f"from benchmarks.transport import gpu; gpu.measure({name!r}, {kind!r})"
    env = dict(os.environ) | {"LIGHTFIELD_BACKEND": kind}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=env)
    if done.returncode:
        raise SystemExit(f"{name} on {kind}: {(done.stderr.strip().splitlines() or ['no message'])[-1]}")
    return dict(json.loads(done.stdout.splitlines()[-1]))


def ratios(cuda: dict[str, Any], llvm: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Scattered and reflected light of each plane, card over processors, and its error by the seeds."""
    card, host = np.array(cuda["planes"]), np.array(llvm["planes"])
    ratio = card.mean(axis=0) / host.mean(axis=0)
    parts = [v.std(axis=0, ddof=1) / v.mean(axis=0) / np.sqrt(len(v)) for v in (card, host)]
    return ratio, ratio * np.hypot(*parts)


def table(card: str, machine: dict[str, Any], found: dict[str, dict[str, dict[str, Any]]]) -> str:
    """The page."""
    lines = [
        "# A graphics card beside the processors of its machine",
        "",
        f"{card}; {machine['processor']}, {machine['cores']} cores, LLVM {machine['llvm']}; Mitsuba "
        f"{machine['mitsuba']}, Dr.Jit {machine['drjit']}, Python {machine['python']}; {machine['date']}.",
        "Written by `python -m benchmarks.transport.gpu`. Rates are of whole renders: "
        f"{TIMED['cuda'] / 1e6:.0f} million photons on the card, {TIMED['llvm'] / 1e6:.0f} million on all "
        "processors; the first one of a process has Mitsuba started, and kernels compiled or read from the "
        "cache.",
        "",
        "| scene | card, million photons/s | processors | ratio | first render, s: card, processors |",
        "|---|---|---|---|---|",
    ]
    for name, label in SCENES.items():
        c, p = found[name]["cuda"], found[name]["llvm"]
        lines.append(
            f"| {label} | {c['rate'] / 1e6:.1f} | {p['rate'] / 1e6:.1f} | {c['rate'] / p['rate']:.1f} "
            f"| {c['first']:.1f}, {p['first']:.1f} |"
        )
    lines += ["", "Scattered and reflected light of each plane, card over processors, of other seeds "
              f"({len(SEEDS['cuda'])} each), with the standard error by the seeds:", ""]  # fmt: skip
    for name, label in SCENES.items():
        pairs = zip(*ratios(found[name]["cuda"], found[name]["llvm"]), strict=True)
        lines.append(f"- {label}: " + ", ".join(f"{v:.4f} +- {s:.4f}" for v, s in pairs))
    return "\n".join([*lines, ""])


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.transport.gpu", description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=HERE / "results" / "gpu.md")
    options = parser.parse_args()
    if problem := cuda_problem():
        raise SystemExit(f"not measured: {problem}")
    found = {name: {kind: in_fresh_process(name, kind) for kind in ("cuda", "llvm")} for name in SCENES}
    os.environ["LIGHTFIELD_BACKEND"] = "llvm"
    text = table(_card(), report.machine(use_backend()), found)
    write_text(options.output, text)
    print(text)


def _card() -> str:
    asked = ["nvidia-smi", "--query-gpu=name,driver_version", "--format=csv,noheader"]
    name, driver = subprocess.run(asked, capture_output=True, text=True, check=True).stdout.split(",")[:2]
    return f"{name.strip()}, driver {driver.strip().splitlines()[0]}"


if __name__ == "__main__":
    main()
