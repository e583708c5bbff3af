"""The light of every truth, rendered in full once and kept on disk."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np

from benchmarks.hidden_effects.benches import bench_named, number_of, true_scene, with_held_out
from benchmarks.hidden_effects.catalogue import Truth
from lightfield.readings import Readings
from lightfield.scene import Scene
from lightfield.scene.acts import AFTERWARDS
from lightfield.scene.all_parameters import paths_on
from lightfield.scene.water.ageing import ages
from lightfield.storage.files import atomic_path

#: The error of the light is at most half the least noise of the readings, 0.4 %, and stated with it.
PHOTONS, REL_ERROR = 1e8, 0.002


def lit_scene(truth: Truth) -> Scene:
    """The true scene without what acts after the light has arrived."""
    optical = {path: value for path, value in truth.values if path not in paths_on(AFTERWARDS)}
    return true_scene(bench_named(truth.bench), truth.beam).with_values(optical)


def scene_of(truth: Truth) -> Scene:
    """The true scene."""
    return true_scene(bench_named(truth.bench), truth.beam).with_values(dict(truth.values))


def _file(truth: Truth, folder: Path, hours: list[float]) -> Path:
    told = json.dumps([truth.bench, lit_scene(truth).digest(), PHOTONS, REL_ERROR, *hours])
    return folder / "light" / f"{hashlib.sha256(told.encode()).hexdigest()[:20]}.npz"


def light_of(truth: Truth, folder: Path, table: Readings) -> tuple[np.ndarray, np.ndarray]:
    """Light at the readings and then the held-out places, and its Monte Carlo error, shape (n + m,).

    For unit on-axis intensity; rendered now unless it was before, at these very places, and where the water
    changes in time at these very times.

    Parameters
    ----------
    table : Readings
        Places and times.
    """
    ageing = ages(lit_scene(truth).water)
    path = _file(truth, folder, (np.asarray(table.time_s) / 3600).tolist() if ageing else [])
    readings = with_held_out(bench_named(truth.bench), table)
    places = np.stack([readings.x_m, readings.y_m, readings.z_m])
    if path.exists():
        with np.load(path) as stored:
            if "places" in stored and np.array_equal(stored["places"], places):
                return stored["light"], stored["stderr"]
    from lightfield.render.at_readings import rendered_light  # loads Mitsuba

    seed = 1000 + number_of(path.stem) % 100_000
    light, stderr = rendered_light(
        lit_scene(truth), readings, seed=seed, rel_error=REL_ERROR, max_photons=PHOTONS, symmetry=True
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        np.savez(stream, light=light, stderr=stderr, places=places)
    return light, stderr
