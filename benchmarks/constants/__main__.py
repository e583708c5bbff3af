"""Constants of the fast light in ten unlike tanks, and how often traces lie outside their stated errors.

    python -m benchmarks.constants [--seeds N] [--page FOLDER]

Nothing is asserted. A constant is judged by what a finer one changes, place by place.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from benchmarks.reuse.fits import places
from lightfield.render.diffuse import source
from lightfield.render.diffuse.shift import SMOOTH_RATIOS
from lightfield.render.maps import render_scene
from lightfield.render.reflected import orders, room
from lightfield.render.reflected.reflected_light import ReflectedLight
from lightfield.scene import Scene
from lightfield.storage.files import write_text

HERE = Path(__file__).resolve().parent
#: Width, depth, length (m), surface, wall albedo, half width (degrees), absorption (1/m).
TANKS: dict[str, tuple[float, float, float, str, float, float, float]] = {
    "tow tank": (3.66, 2.44, 36.6, "flat", 0.1, 3.81, 0.10),
    "basin": (3.0, 2.0, 12.0, "none", 0.3, 4.0, 0.08),
    "narrow, bright": (1.2, 1.2, 8.0, "none", 0.9, 8.0, 0.05),
    "shallow mirror": (3.0, 1.2, 8.0, "flat", 0.2, 6.0, 0.15),
    "short, wide lamp": (2.0, 2.0, 7.0, "none", 0.6, 25.0, 0.10),
    "pool": (8.0, 3.0, 25.0, "flat", 0.6, 12.0, 0.07),
    "channel": (1.0, 2.5, 30.0, "flat", 0.4, 5.0, 0.30),
    "murky tank": (2.0, 2.0, 8.0, "none", 0.5, 5.0, 0.90),
    "white cube": (6.5, 6.5, 6.5, "none", 0.8, 30.0, 0.04),
    "pencil of light": (1.5, 1.5, 10.0, "flat", 0.7, 1.0, 0.12),
}
PLANES = [2.5, 4.0, 5.5]
G = 0.9  # between two traced ones
#: Reaches of the smoothing of ratios, as parts of the one in use.
REACHES = (0.5, 1.0, 2.0)
SEEDED: dict[str, dict[str, Any]] = {
    "open water": {"water": {"absorption_per_m": 0.1, "scattering_per_m": 0.3}},
    "walls": {
        "water": {"absorption_per_m": 0.1, "scattering_per_m": 0.1},
        "tank": {"width_m": 2.0, "depth_m": 2.0, "length_m": 8.0, "wall_albedo": 0.6},
    },
    "surface": {
        "water": {"absorption_per_m": 0.1, "scattering_per_m": 0.05},
        "tank": {"width_m": 3.0, "depth_m": 1.2, "length_m": 8.0, "surface": "flat"},
    },
}
BATCHES = 10
TEXT = """\
# Constants of fast light, and errors over seeds

Made by `python -m benchmarks.constants`; nothing is asserted.

## In ten unlike tanks

Light that walls and surface reflected and nothing scattered (`render/reflected`): by how much, at most and in
the mean over 75 places, it changes (%) where attenuation is interpolated over steps of a quarter, where
{more} reflections are followed one by one instead of {reflections}, and where the light on a patch has all
its terms instead of nine.

| tank | attenuation: most | mean | reflections: most | mean | terms: most | mean |
|---|---:|---:|---:|---:|---:|---:|
{tanks}

Light that was scattered, at g = {g:g} between two traced values (`render/diffuse/between_g`), beside a fresh
trace: rms difference (%) and mean square in units of both stated errors, for a smoothing of ratios that
reaches half as far, as far as it does, and twice as far.

| tank | {reaches} |
|---|{columns}|
{ratios}

## Over {seeds} seeds

Diffuse light of {photons:.0e} photons in {batches} batches at three places far from each other, beside the
mean over all seeds: how many of the differences are beyond so many stated errors (of a normal distribution,
after the t of nine degrees of freedom that ten batches have), and their mean square.

| scene | n | beyond 1 (31.7 %) | beyond 2 (4.6 %) | beyond 3 (0.27 %) | mean square |
|---|---:|---:|---:|---:|---:|
{seeded}
"""


def scene_of(name: str) -> Scene:
    """One of the tanks."""
    width, depth, length, surface, albedo, hwhm, a = TANKS[name]
    tank = {"width_m": width, "depth_m": depth, "length_m": length, "surface": surface, "wall_albedo": albedo}
    return Scene.from_dict(
        {
            "lamp": {"hwhm_deg": hwhm},
            "water": {"absorption_per_m": a},
            "tank": tank,
            "detector": {"planes_m": PLANES},
        }
    )


@contextmanager
def changed(module: Any, name: str, value: object) -> Iterator[None]:
    """A constant of a module, for a while."""
    before = getattr(module, name)
    setattr(module, name, value)
    try:
        yield
    finally:
        setattr(module, name, before)


def of_reflections(name: str) -> list[float]:
    """Largest and mean change, %, by each constant."""
    scene, where = scene_of(name), places(PLANES)
    nodes, _ = room.between_attenuations(np.array([scene.water.absorption_per_m + 1e-6]))
    c = 0.5 * (nodes[1] + nodes[2])

    def light() -> np.ndarray:
        return ReflectedLight.at(scene, *where).evaluate(scene, c)

    now, found = light(), []
    for module, constant, value in (
        (room, "C_STEP", room.C_STEP / 4),
        (orders, "REFLECTIONS", 3 * orders.REFLECTIONS),
        (room, "terms_of_light", orthonormal),
    ):
        with changed(module, constant, value):
            change = np.abs(light() / now - 1)
        found += [100 * float(change.max()), 100 * float(change.mean())]
    return found


def orthonormal(parts: int) -> np.ndarray:
    """As many terms as parts, the constant first."""
    at = (2 * np.arange(parts) + 1) / parts - 1
    u, v = (g.ravel() for g in np.meshgrid(at, at, indexing="ij"))
    powers = [u**i * v**j for i in range(parts) for j in range(parts)]
    terms = np.linalg.qr(np.stack(powers, axis=1))[0]
    return np.asarray(terms * np.sign(terms[0]), np.float32)


def of_ratios(name: str) -> list[str]:
    """Beside a fresh trace, by reach of the smoothing."""
    scene = scene_of(name).with_values({"water.scattering_per_m": 0.15, "water.phase.g": G})
    x, y, z = places(PLANES)
    fresh = source.response_for(scene, x, y, z, g_nodes=(G,), seed=5)
    truth, error = fresh.evaluate(scene)
    out = []
    for reach in REACHES:
        with changed(source, "SMOOTH_RATIOS", (*SMOOTH_RATIOS[:2], reach * SMOOTH_RATIOS[2])):
            light, stated = source.response_for(scene, x, y, z).evaluate(scene)
        apart = light / truth - 1
        pull = (light - truth) / np.hypot(stated, error)
        out.append(f"{100 * np.sqrt(np.mean(apart**2)):.2f} | {np.mean(pull**2):.2f}")
    return out


def over_seeds(values: dict[str, Any], seeds: int, photons: float) -> np.ndarray:
    """Normal scores of diffuse light at three places, shape (seeds, 3)."""
    detector = {"positions_m": [[0.0, 0.0, 2.0], [0.4, 0.0, 4.0], [-0.6, 0.3, 6.0]]}
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 5.0}, "detector": detector, **values})
    found = []
    for seed in range(seeds):
        rendering = render_scene(scene, rel_error=1e-5, max_photons=photons, seed=seed, cache=False)
        found.append([v[0].ravel() for v in rendering.relative_maps(np.array([525.0]), "diffuse")])
    mean, stderr = np.array(found).transpose(1, 0, 2)
    t = (mean - mean.mean(axis=0)) / stderr * np.sqrt(seeds / (seeds - 1))
    return np.asarray(np.sign(t) * stats.norm.isf(stats.t.sf(np.abs(t), BATCHES - 1)))


def _rows(names: Any, cells: Callable[[str], list[str]]) -> str:
    lines = []
    for name in names:
        lines.append(f"| {name} | " + " | ".join(cells(name)) + " |")
        print(lines[-1], file=sys.stderr, flush=True)
    return "\n".join(lines)


def main() -> int:
    """Work everything out and write the page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.constants", description=__doc__)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--photons", type=float, default=6e4, help="of every seed's trace")
    parser.add_argument("--page", type=Path, default=HERE)
    args = parser.parse_args()

    def seeded(name: str) -> list[str]:
        scores = over_seeds(SEEDED[name], args.seeds, args.photons)
        beyond = [f"{100 * np.mean(np.abs(scores) > k):.1f} %" for k in (1, 2)]
        rare = f"{100 * np.mean(np.abs(scores) > 3):.2f} %"
        return [str(scores.size), *beyond, rare, f"{np.mean(scores**2):.2f}"]

    text = TEXT.format(
        more=3 * orders.REFLECTIONS,
        reflections=orders.REFLECTIONS,
        tanks=_rows(TANKS, lambda name: [f"{v:.2f}" for v in of_reflections(name)]),
        g=G,
        reaches=" | ".join(f"reach x {r:g}: rms | chi2/n" for r in REACHES),
        columns="|".join(["---:|---:"] * len(REACHES)),
        ratios=_rows(TANKS, of_ratios),
        seeds=args.seeds,
        photons=args.photons,
        batches=BATCHES,
        seeded=_rows(SEEDED, seeded),
    )
    args.page.mkdir(parents=True, exist_ok=True)
    write_text(args.page / "README.md", text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
