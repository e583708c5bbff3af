"""This package's side of the benchmarks. Every figure is of the public entry points, overheads included."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.transport.clock import Clock
from lightfield.render.maps import Rendering, render_scene
from lightfield.scene import Scene

A, B, G, HWHM_DEG = 0.05, 0.15, 0.92, 3.81
PLANES = [4.5, 5.5, 6.5, 7.5, 8.5]
AT = np.array([525.0])
ROOT = Path(__file__).resolve().parents[2]


def scene_of(tank: dict[str, Any] | None = None, **water: Any) -> Scene:
    """Five planes of 65 x 65 cells over 2 m x 2 m."""
    values: dict[str, Any] = {
        "lamp": {"hwhm_deg": HWHM_DEG},
        "water": {"phase": {"type": "henyey-greenstein", "g": G}}
        | (water or {"absorption_per_m": A, "scattering_per_m": B}),
        "detector": {"planes_m": PLANES, "width_m": 2.0, "pixels": 65, "bands_nm": [[500.0, 550.0]]},
    }
    return Scene.from_dict(values | ({"tank": tank} if tank else {}))


def timed_render(scene: Scene, photons: float, **options: Any) -> tuple[Rendering, dict[str, float]]:
    """A render of so many photons and its seconds; kernels are compiled beforehand."""
    render_scene(scene, rel_error=1e-5, max_photons=1e5, cache=False, **options)
    clock = Clock()
    rendering = render_scene(scene, rel_error=1e-5, max_photons=photons, cache=False, **options)
    return rendering, clock.read()


def relative_variance(rendering: Rendering, part: str = "diffuse") -> np.ndarray:
    """Relative variance of the mean, every cell, shape (5, 65, 65); cells of one ring share theirs.

    An error from ten batches is itself uncertain by a quarter; cells of equal radius and equally many mirror
    images have the same error, so that their average is what a cell needs.
    """
    mean, stderr = (v[0] for v in rendering.relative_maps(AT, part))
    x, y = np.meshgrid(rendering.grid.x_m, rendering.grid.y_m)
    ring = np.round(np.hypot(x, y) / 0.06).astype(int)
    images = np.ones(ring.shape, int)
    if rendering.response.merged is not None:
        images = np.bincount(rendering.response.merged[0].ravel())[rendering.response.merged[0]]
    _, ring = np.unique(10 * ring + images, return_inverse=True)
    ring = ring.reshape(x.shape)
    ratio = (stderr / mean) ** 2
    return np.array(
        [(np.bincount(ring.ravel(), plane.ravel()) / np.bincount(ring.ravel()))[ring] for plane in ratio]
    )


def time_to_two_percent(photons: float, symmetry: bool) -> dict[str, Any]:
    """Seconds until every pixel, and 95 % of them, know the scattered irradiance to 2 %."""
    rendering, times = timed_render(scene_of(), photons, symmetry=symmetry)
    excess = relative_variance(rendering) / 0.02**2
    mean, stderr = (v[0] for v in rendering.relative_maps(AT, "diffuse"))
    shares = {"every_pixel": excess.max(), "95_percent": np.quantile(excess, 0.95)}
    result: dict[str, Any] = {"photons": rendering.response.photons, **times}
    for name, share in shares.items():
        result |= {f"{kind}_{name}": seconds * float(share) for kind, seconds in times.items()}
    return result | {"mean": mean, "stderr": stderr, "x": rendering.grid.x_m}


def photon_rate(photons: float, tank: dict[str, Any] | None) -> dict[str, Any]:
    """Photons per second with five planes of 65 x 65 cells, and the share of the light that water absorbs."""
    rendering, times = timed_render(scene_of(tank), photons)
    energy = rendering.energy
    return {"photons": rendering.response.photons, **times, "absorbed": energy.absorbed / energy.emitted}


def spectral_cost(photons: float) -> dict[str, Any]:
    """Seconds of a render with one map and with 61, 400 to 700 nm, in water that varies over them."""
    wavelengths = np.linspace(400, 700, 61)
    scene = scene_of(base="pure", chlorophyll_mg_per_m3=1.0, scattering_per_m=0.05)
    render_scene(scene, rel_error=1e-5, max_photons=1e5, cache=False)
    clock = Clock()
    rendering = render_scene(scene, rel_error=1e-5, max_photons=photons, cache=False)
    result: dict[str, Any] = {"photons": rendering.response.photons, "trace": clock.read()}
    for name, at in (("one", wavelengths[30:31]), ("sixty_one", wavelengths)):
        clock = Clock()
        mean, stderr = rendering.maps(at)
        lit = mean > 1e-4 * mean.max(axis=(2, 3), keepdims=True)
        errors = [float(np.quantile((s[k] / m[k]), 0.95)) for m, s, k in zip(mean, stderr, lit, strict=True)]
        result[name] = {**clock.read(), "largest_error_95": max(errors)}
    return result


def evaluate_time(symmetry: bool, repeats: int = 25) -> dict[str, float]:
    """Milliseconds for five 65 x 65 maps of another water, with errors."""
    response = render_scene(
        scene_of(), rel_error=0.02, max_photons=4e6, cache=False, symmetry=symmetry
    ).response
    seconds: dict[str, list[float]] = {"all": [], "diffuse": []}
    for part, of_part in seconds.items():
        for i in range(repeats):
            start = time.perf_counter()
            response.evaluate(A + 0.004 * i, B - 0.003 * i, part=part)
            of_part.append(time.perf_counter() - start)
    return {
        "median_ms": 1e3 * float(np.median(seconds["all"])), "least_ms": 1e3 * min(seconds["all"]),
        "diffuse_median_ms": 1e3 * float(np.median(seconds["diffuse"])),
        "megabytes": response.tally.nbytes / 1e6,
    }  # fmt: skip


def paper_scene(photons: float = 1e8) -> None:
    """The paper's tank, with walls and water surface: prints speed and peak memory."""
    scene = Scene.load(ROOT / "scenes" / "unh_tow_tank" / "scene.toml")
    start = time.perf_counter()
    rendering = render_scene(scene, cache=False, max_photons=photons)
    rendering.maps()
    seconds = time.perf_counter() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(json.dumps({"seconds": seconds, "photons": rendering.response.photons, "peak_gib": peak,
                      "rate": rendering.response.photons / seconds,
                      "reached": rendering.reached}))  # fmt: skip


def in_fresh_process(call: str, env: dict[str, str]) -> dict[str, Any]:
    """Run one function of this module in a new interpreter."""
    code = f"from benchmarks.transport import ours; ours.{call}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=env)
    if done.returncode:
        return {"problem": (done.stderr.strip().splitlines() or ["no message"])[-1]}
    return dict(json.loads(done.stdout.splitlines()[-1]))
