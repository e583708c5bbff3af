"""The render, class of light by class, against photons walked by a program that shares nothing with it.

    python -m benchmarks.classes [--photons FACTOR] [--page FOLDER] [--kept]

Nothing is asserted; the page tells. Walked light is kept under build/classes.
"""

from __future__ import annotations

import argparse
import hashlib
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.classes.page import Light, compared, page
from benchmarks.classes.scenes import CLASSES, FIRST_CLASS, SCENES, WALKED_CLASSES, Case
from lightfield.render.maps import render_scene
from lightfield.render.response.light_classes import light_classes
from lightfield.render.settings import BY_PHOTONS
from lightfield.scene import Scene
from lightfield.storage.files import write_text

HERE = Path(__file__).resolve().parent
KEPT = HERE.parents[1] / "build" / "classes"
PROGRAM = HERE / "walk.c"
COMPILED = ("cc", "-O3", "-march=native")
#: Of the first scene; the others follow.
WALK_BATCHES, WALK_SEED = 32, 20
#: Renders of a scene, each of ten batches, and the photons of each.
RENDER_SEEDS, RENDER_PHOTONS = (1, 2, 3), 4e7
WAVELENGTH_NM = 525.0


@dataclass(frozen=True)
class Rendered:
    """What the renders of a scene say.

    Parameters
    ----------
    batches : array, shape (n_batches, n_classes, n_planes, n, n), 1/m^2
        For unit on-axis radiant intensity.
    map_error : float
        Largest relative difference between the sum of the classes and the map of all light.
    seconds : float
    """

    batches: np.ndarray
    map_error: float
    seconds: float


def walked(case: Case, factor: float) -> tuple[np.ndarray, float]:
    """Light of a scene by `walk.c`, from the store or walked anew.

    Parameters
    ----------
    factor : float
        On the photons of the case.

    Returns
    -------
    batches : array, shape (n_batches, n_classes, n_planes, n, n), 1/m^2
    seconds : float
        That the walk took.
    """
    seed, source = WALK_SEED + SCENES.index(case), PROGRAM.read_text()
    text = case.walked(factor * case.photons, seed, WALK_BATCHES)
    name = hashlib.sha256((source + text).encode()).hexdigest()[:16]
    kept = KEPT / f"walked_{name}.npz"
    if not kept.exists():
        KEPT.mkdir(parents=True, exist_ok=True)
        program, scene = KEPT / f"walk_{name}", KEPT / f"scene_{name}.txt"
        write_text(scene, text)
        subprocess.run([*COMPILED, "-o", str(program), str(PROGRAM), "-lm"], check=True)
        start = time.perf_counter()
        told = subprocess.run([str(program), str(scene)], check=True, capture_output=True, text=True).stdout
        seconds = time.perf_counter() - start
        program.unlink()
        scene.unlink()
        shape = (WALK_BATCHES, WALKED_CLASSES, len(case.planes_m), case.cells, case.cells)
        np.savez_compressed(kept, batches=np.array(told.split(), float).reshape(shape), seconds=seconds)
    with np.load(kept) as stored:
        return stored["batches"], float(stored["seconds"])


def rendered(case: Case, factor: float, again: bool) -> Rendered:
    """Light of a scene by the package; `again`: as the last run left it, where it did.

    Parameters
    ----------
    factor : float
        On the photons of a render.
    """
    kept = KEPT / f"rendered_{hashlib.sha256(f'{case.parts}{factor}'.encode()).hexdigest()[:16]}.npz"
    if again and kept.exists():
        with np.load(kept) as stored:
            return Rendered(stored["batches"], float(stored["map_error"]), float(stored["seconds"]))
    scene, parts, whole = Scene.from_dict(case.parts), [], 0.0
    start = time.perf_counter()
    for seed in RENDER_SEEDS:
        rendering = render_scene(
            scene, rel_error=BY_PHOTONS, max_photons=factor * RENDER_PHOTONS, seed=seed, cache=False
        )
        response = rendering.response
        kinds = light_classes(response.histories)
        own = [kinds == FIRST_CLASS + k for k in range(len(CLASSES))]
        light = np.stack([response.tally[:, rows].sum(axis=1, dtype=float) for rows in own], axis=1)
        parts.append(light.reshape(-1, len(CLASSES), *response.shape))
        all_light, _ = rendering.relative_maps(np.array([WAVELENGTH_NM]))
        whole = max(whole, float(np.abs(parts[-1].sum(axis=1).mean(axis=0) / all_light[0] - 1).max()))
    found = Rendered(np.concatenate(parts), whole, time.perf_counter() - start)
    np.savez_compressed(kept, batches=found.batches, map_error=found.map_error, seconds=found.seconds)
    return found


def main() -> int:
    """Compare everywhere and write the page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.classes", description=__doc__)
    parser.add_argument("--photons", type=float, default=1.0, help="factor on all numbers of photons")
    parser.add_argument("--page", type=Path, default=HERE)
    parser.add_argument("--kept", action="store_true", help="renders as the last run left them")
    args = parser.parse_args()
    rows, lights = [], []
    for case in SCENES:
        walk, seconds = walked(case, args.photons)
        render = rendered(case, args.photons, args.kept)
        light = Light(case, walk, render.batches, render.map_error, seconds, render.seconds)
        lights.append(light)
        some = compared(light)
        rows += some
        print(case.name, f"walk {seconds:.0f} s, render {render.seconds:.0f} s", file=sys.stderr)
        for row in some:
            print("   ", row.told(), file=sys.stderr)
    args.page.mkdir(parents=True, exist_ok=True)
    text = page(lights, rows, args.photons, len(RENDER_SEEDS), RENDER_PHOTONS * args.photons)
    write_text(args.page / "README.md", text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
