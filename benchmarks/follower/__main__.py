"""How fast the follower is, on one thread, each beside a peer that is measured in the same run.

    python -m benchmarks.follower [--photons N] [--page FOLDER]

Nothing is asserted. Times are processor time, the least of several repetitions.
"""

from __future__ import annotations

import argparse
import platform
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.ndimage import map_coordinates, spline_filter
from scipy.optimize import least_squares
from threadpoolctl import threadpool_limits

from lightfield.formula.vector import direct_flux, on_receivers, with_back
from lightfield.render.flux.traced_field import TracedField
from lightfield.scene import Scene
from lightfield.storage.files import write_text
from lightfield.studies.follower.array_light import ArrayModel, Space, light_of, pose_names
from lightfield.studies.follower.array_noise import SensorNoise
from lightfield.studies.follower.design.compared import ArraySetting, judged_array, task_poses
from lightfield.studies.follower.design.exchange import Mounting, optimise_array
from lightfield.studies.follower.elements import Elements, elements_of
from lightfield.studies.follower.estimation.pose import Estimator
from lightfield.studies.follower.estimation.tracking import Tracker
from lightfield.studies.follower.frames import placed
from lightfield.studies.follower.information import nuisances_of
from lightfield.studies.follower.survey import array_of
from lightfield.studies.following.loop import run_loop
from lightfield.studies.following.truth_and_belief import light_of_mission

HERE = Path(__file__).resolve().parent
SCENE = HERE.parents[1] / "scenes" / "leader_follower" / "turbid.toml"
#: Of the least: what is done meanwhile by others takes time, never saves it.
REPEATS = 7
TEXT = """\
# The follower's speed

Made by `python -m benchmarks.follower`: processor time on one thread, the least of {repeats} repetitions
(of the last two rows: one), in the turbid water of `scenes/leader_follower` (25 photodiodes, a trace of
{photons:.0e} photons), on {machine}. The peer does the same by a library's usual means, in the same run.

| what | asked for | here | the peer | peer / here |
|---|---:|---:|---|---:|
{rows}

{notes}
"""


def least(work: Callable[[], object], times: int) -> float:
    """Processor seconds of one call."""
    found = []
    for _ in range(REPEATS):
        started = time.process_time()
        for _ in range(times):
            work()
        found.append((time.process_time() - started) / times)
    return min(found)


def prediction(model: ArrayModel, light: TracedField, pose: np.ndarray) -> tuple[float, float, str]:
    """Readings of all elements at one pose; the peer evaluates the same splines one by one with SciPy."""
    mean = light._mean

    def peer() -> np.ndarray:
        place, normal = (v[0] for v in placed(model.elements, pose[None]))
        at = light.histories.cells(place).T
        flux = [map_coordinates(one, at, order=3, prefilter=False, mode="nearest") for one in mean]
        diffuse = np.stack(flux, axis=1) * light._factor(place)
        return on_receivers(direct_flux(light.scene, place), normal) + with_back(diffuse, normal)

    off = np.abs(peer() / model.readings(pose[None])[0] - 1).max()
    mine, theirs = least(lambda: model.readings(pose[None]), 100), least(peer, 100)
    return mine, theirs, f"Predictions of the two agree to {off:.0e}."


def new_water(model: ArrayModel, light: TracedField, pose: np.ndarray, name: str) -> tuple[float, float, str]:
    """The first reading in a water that was not asked before, with its errors.

    The peer weighs the tally's cells, not splines of them, and both halves of each axis, batch by batch.
    """
    place, normal = (v[0] for v in placed(model.elements, pose[None]))
    at = getattr(light.scene.water, name)
    scenes = iter(
        light.scene.with_values({f"water.{name}": at * (1 + 1e-3 * k)}, validate=False)
        for k in range(1, 10_000)
    )
    z = light.grid.z_m
    axes = (light.grid.x_m, light.grid.y_m, z)
    first, step = (np.array([f(axis) for axis in axes]) for f in (lambda v: v[0], lambda v: v[1] - v[0]))

    def peer(scene: Scene) -> np.ndarray:
        water = TracedField(scene, light.grid, light.response)
        (a,), (b,) = water._water
        light_of_cells = light.response.batches(float(a), float(b), *scene.reflectances)
        found = []
        for each in light_of_cells.reshape(-1, 4, *light.grid.shape):
            splines = [spline_filter(one * (z**2)[:, None, None], order=3, mode="nearest") for one in each]
            cells = ((place - first) / step)[:, ::-1].T
            flux = [map_coordinates(one, cells, order=3, prefilter=False, mode="nearest") for one in splines]
            found.append(with_back(np.stack(flux, axis=1) / place[:, 2:] ** 2, normal))
        batches = on_receivers(direct_flux(scene, place), normal) + np.array(found)
        return np.stack([batches.mean(axis=0), batches.std(axis=0, ddof=1) / np.sqrt(len(batches))])

    scene = next(scenes)
    off = np.abs(peer(scene)[0] / light.in_water_of(scene).irradiance(place, normal)[0] - 1).max()
    mine = least(lambda: light.in_water_of(next(scenes)).irradiance(place, normal), 10)
    return mine, least(lambda: peer(next(scenes)), 3), f"Readings in new water ({name}) agree to {off:.0e}."


def estimate(estimator: Estimator, pose: np.ndarray) -> tuple[float, float, str]:
    """Pose, two covariances, rivals and fit of one reading; the peer is SciPy's least squares, one start."""
    rng = np.random.default_rng(0)
    clean = estimator.model.readings(pose[None])[0]
    sigma = np.sqrt(estimator.noise.variance(clean))
    drawn = iter([clean + sigma * rng.standard_normal(len(clean)) for _ in range(10_000)])
    prior, begin = estimator.nuisances["gain"], pose + np.array([0.05, -0.05, 0.2, 0.03, 0.03, 0.0])

    def peer(read: np.ndarray) -> np.ndarray:
        def residual(p: np.ndarray) -> np.ndarray:
            whole = np.append(p[:5], 0.0)
            predicted = np.exp(p[5]) * estimator.model.readings(whole[None])[0]
            return np.append((predicted - read) / sigma, p[5] / prior)

        scale = [0.1, 0.1, 1.0, 0.1, 0.1, 0.1]
        return least_squares(residual, np.append(begin[:5], 0.0), x_scale=scale).x

    same = [next(drawn) for _ in range(10)]
    apart = [abs(peer(read)[2] - estimator.estimate(read, begin).pose[2]) for read in same]
    mine = least(lambda: estimator.estimate(next(drawn), begin), 20)
    theirs = least(lambda: peer(next(drawn)), 10)
    return mine, theirs, f"Distances of the two agree to {1e3 * max(apart):.1g} mm."


def design(scene: Scene, space: Space, photons: float) -> tuple[float, float, str]:
    """Eight elements in 0.4 m; the peer draws arrays at random for as long, and keeps the best."""
    elements = elements_of(array_of(scene))
    light = light_of(scene, space, elements, photons=photons)
    light.reading(np.array([[0, 0, 6.5]]), np.array([[0, 0, -1.0]]))  # the trace, from the cache or made now
    started = time.process_time()
    best = optimise_array(scene, 8, Mounting(0.4), space=space, photons=photons).arrays[0]
    spent = time.process_time() - started
    setting = ArraySetting(
        light, task_poses(space), pose_names(scene), SensorNoise.of_scene(scene), nuisances_of(scene)
    )
    rng, found, tried = np.random.default_rng(0), np.inf, 0
    started = time.process_time()
    while time.process_time() - started < spent:
        place = np.zeros((8, 3))
        place[:, :2] = rng.uniform(-0.2, 0.2, (8, 2))
        tilt = np.tan(np.radians(rng.uniform(-40.0, 40.0, (8, 2))))
        normal = np.column_stack([tilt, -np.ones(8)])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        found = min(found, judged_array("random", Elements(place, normal), setting).criterion)
        tried += 1
    note = (
        f"In the same time {tried} arrays drawn at random come to A = {found:.3g}, "
        f"the optimiser to {best.criterion:.3g} ({found / best.criterion:.2g} times less)."
    )
    return spent, np.nan, note


def loop(scene: Scene, photons: float) -> tuple[float, float, str]:
    """120 s at 10 Hz, one run; the peer estimates with the on-line tracker, reading by reading."""
    elements = elements_of(array_of(scene))
    light = light_of_mission(scene, elements, photons=photons).in_water_of(scene)
    run_loop(scene.with_values({"follower.mission.duration_s": 0.2}), light, elements, runs=1)
    seconds = {}
    for runs in (1, 8):
        started = time.process_time()
        track = run_loop(scene, light, elements, runs=runs)
        seconds[runs] = time.process_time() - started
    tracker = Tracker(Estimator.of_scene(scene, light, Space.of_scene(scene)))
    started, count = time.process_time(), 100
    model = ArrayModel(light, elements)
    for k in range(count):
        tracker.update(model.readings(track.pose[-1, :1])[0], 0.1 * k)
    peer = (time.process_time() - started) / count * len(track.time_s)
    note = f"Eight runs side by side take {seconds[8]:.1f} s, {seconds[8] / 8:.1f} s each."
    return seconds[1], peer, note


def main() -> int:
    """Measure, print, write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--photons", type=float, default=3e6)
    parser.add_argument("--page", type=Path, default=HERE)
    args = parser.parse_args()
    scene = Scene.load(SCENE).with_values({"follower.mission.believes": "field"})
    space, elements = Space.of_scene(scene), elements_of(array_of(scene))
    light = light_of(scene, space, elements, photons=args.photons)
    assert isinstance(light, TracedField)
    pose = np.array([0.2, 0.1, 6.5, 0.05, 0.02, 0.0])
    estimator = Estimator.of_scene(scene, light, space)
    rows, notes, model = [], [], ArrayModel(light, elements)
    usual = "`scipy.ndimage`, batch by batch"
    for what, asked, unit, factor, peer, (mine, theirs, note) in (
        ("prediction of 25 readings", 0.1, "ms", 1e3, "`scipy.ndimage.map_coordinates`",
         prediction(model, light, pose)),
        ("the same in water of another absorption, with errors", 2, "ms", 1e3, usual,
         new_water(model, light, pose, "absorption_per_m")),
        ("the same in water of another scattering, with errors", 2, "ms", 1e3, usual,
         new_water(model, light, pose, "scattering_per_m")),
        ("pose of one reading, from nine starts, with its errors", 10, "ms", 1e3,
         "`scipy.optimize.least_squares`, one start", estimate(estimator, pose)),
        ("120 s of closed loop at 10 Hz", 20, "s", 1.0, "estimates by the on-line tracker alone",
         loop(scene, args.photons)),
        ("best array of 8 elements", 60, "s", 1.0, "arrays at random, see below",
         design(scene, space, args.photons)),
    ):  # fmt: skip
        shown = f"{factor * theirs:.3g} {unit}, " if np.isfinite(theirs) else ""
        ratio = f"{theirs / mine:.2g}" if np.isfinite(theirs) else "–"
        rows.append(f"| {what} | {asked:g} {unit} | {factor * mine:.3g} {unit} | {shown}{peer} | {ratio} |")
        notes.append(note)
        print(rows[-1], flush=True)
    text = TEXT.format(
        repeats=REPEATS, photons=args.photons,
        machine=f"{platform.machine()}, Python {platform.python_version()}",
        rows="\n".join(rows), notes="\n".join(notes),
    )  # fmt: skip
    write_text(args.page / "README.md", text)
    return 0


if __name__ == "__main__":
    with threadpool_limits(1):
        sys.exit(main())
