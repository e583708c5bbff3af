"""Runs over any parameters of the scene, as a sweep: one case, one block, continued where it stopped."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from lightfield.errors import BackendError, LightfieldError, OutputError, one_line
from lightfield.maps.dataset import CONVENTIONS
from lightfield.render.limits import FIELD_PHOTONS, PHOTONS
from lightfield.scene import Scene
from lightfield.storage import inputs
from lightfield.studies.defaults import RUNS
from lightfield.studies.follower.elements import elements_of
from lightfield.studies.follower.survey import array_of
from lightfield.studies.following.metrics import METRICS, OF_DOCKING, OF_FOLLOWING, spreads_of
from lightfield.studies.following.study import follow, with_belief
from lightfield.studies.following.truth_and_belief import densest_per_m
from lightfield.sweep.axes import Axis
from lightfield.sweep.cases import Cases
from lightfield.sweep.runner import Report, SweepProgress, run_sweep
from lightfield.sweep.schema import LONGEST_MESSAGE, SweepKind, axes_as_plain, axis_coordinates, beside_axes
from lightfield.sweep.sweep_plan import Block, SweepPlan, SweepSettings, plan_of_single_cases
from lightfield.sweep.work import BlockDone, peak_bytes, worker_name, write_block
from lightfield.sweep.zarrfile import Variable
from lightfield.version import __version__

#: What such a store says that it holds.
QUANTITY = "following"
_TASK = "follower.mission.task"
#: A case takes seconds.
MOST_CASES = 10_000
#: Of a metric over the runs of a case: suffix of its name, and what it is.
_KEPT = {"": "mean over the runs", "_stderr": "standard error of the mean over the runs"}


@dataclass(frozen=True)
class FollowTarget:
    """What a worker is told beside its cases."""

    path: Path
    variables: dict[str, Variable]
    runs: int
    seed: int
    photons: float
    densest: float


def run_follow_sweep(
    scene: Scene,
    axes: list[Axis],
    path: Path,
    *,
    runs: int = RUNS,
    seed: int = 0,
    photons: float = FIELD_PHOTONS,
    workers: int = 0,
    report: Report | None = None,
) -> tuple[SweepPlan, SweepProgress]:
    """Run the mission of a scene over a grid of its parameters, into a store; or what is left of it.

    All cases whose lamp, tank and way are alike are weighed from one trace, which lies in the cache.

    Parameters
    ----------
    scene : Scene
        With an array.
    axes : list of Axis
    path : Path
        The store.
    runs, seed, photons
        See `study.follow`.
    workers : int
        Local processes; 0: this one.

    Raises
    ------
    UsageError, SceneError, OutputError
        Nothing is varied, or what no scene has; the store belongs to another sweep.
    """
    array_of(scene)
    scene = with_belief(scene, "")
    settings = SweepSettings(max_photons=max(photons, PHOTONS.low), seed=seed, maps=False)
    plan = plan_of_single_cases(scene, axes, settings, MOST_CASES)
    densest, contents = 0.0, set()
    for number in range(plan.cases.count):
        try:
            case = plan.cases.build(number)
            densest = max(densest, densest_per_m(case))
            contents.add(elements_of(array_of(case)).as_csv())
            mission = case.follower_here.mission
            if mission.leader == "table":
                contents.add(inputs.content_digest(str(mission.leader_table), inputs.TABLE))
        except LightfieldError:
            continue  # the case says so itself
    content = sha256("".join(sorted(contents)).encode()).hexdigest()[:16]
    told: dict[str, float | str] = {
        "runs": runs,
        "photons": photons,
        "densest_per_m": densest,
        "arrays": content,
    }

    def target(_: SweepPlan, store: Path, variables: dict[str, Variable]) -> FollowTarget:
        return FollowTarget(store, variables, runs, seed, photons, densest)

    def attributes(plan: SweepPlan) -> dict[str, Any]:
        return _attributes(plan, runs, photons)

    kind = SweepKind(_variables, axis_coordinates, attributes, target, do_block, told)
    return plan, run_sweep(plan, path, kind=kind, workers=workers, report=report)


def do_block(block: Block, cases: Cases, trace_of_case: Sequence[int], target: FollowTarget) -> BlockDone:
    """Run the follower of every case of a block and write its metrics.

    Raises
    ------
    BackendError, OutputError
        The machine cannot compute, or not write.
    """
    started = time.perf_counter()
    failed: dict[int, str] = {}
    kept = [name for name in METRICS if name in target.variables]
    results = {name + suffix: np.full(len(block.cases), np.nan) for name in kept for suffix in _KEPT}
    for i, number in enumerate(map(int, block.cases)):
        try:
            scene = cases.build(number)
            found = follow(
                {scene.name: scene}, runs=target.runs, seed=target.seed, photons=target.photons,
                densest=target.densest,
            )  # fmt: skip
        except (BackendError, OutputError):
            raise  # of the machine: no answer about the case
        except LightfieldError as error:
            failed[number] = one_line(error)[:LONGEST_MESSAGE]
            continue
        for name, one in spreads_of(found.cases[0].runs).items():
            for suffix, value in zip(_KEPT, (one.mean, one.error), strict=True):
                results[name + suffix][i] = value
    files = write_block(block, cases, target.path, target.variables, results)
    return BlockDone(block.number, failed, files, time.perf_counter() - started, worker_name(), peak_bytes())


def as_data(data: xr.Dataset) -> dict[str, Any]:
    """Values along the axes, and of every metric; null where a case has none."""
    found: dict[str, Any] = {
        "axes": json.loads(data.attrs["sweep_axes"]),
        "message": data.message.values.tolist(),
    }
    for name in (metric + suffix for metric in METRICS if metric in data for suffix in _KEPT):
        values = data[name].values
        nothing: Any = None  # JSON knows no NaN
        found[name] = np.where(np.isfinite(values), values, nothing).tolist()
    return found


def _variables(plan: SweepPlan) -> dict[str, Variable]:
    cases, found = plan.cases, dict[str, Variable]()
    dims = tuple(axis.name for axis in cases.axes)
    tasks = {value for axis in cases.axes for value in axis.values.get(_TASK, ())} or {cases.scene.get(_TASK)}
    for name, (unit, meaning) in METRICS.items():
        if (name in OF_DOCKING and "dock" not in tasks) or (name in OF_FOLLOWING and "follow" not in tasks):
            continue
        for suffix, what in _KEPT.items():
            attrs = {"units": unit, "long_name": f"{what}: {meaning}"}
            found[name + suffix] = Variable(dims, cases.shape, plan.chunks, "f8", attrs)
    return beside_axes(plan, found)


def _attributes(plan: SweepPlan, runs: int, photons: float) -> dict[str, Any]:
    scene = plan.cases.scene
    return {
        "Conventions": CONVENTIONS,
        "title": str(scene.name or "runs of a follower"),
        "source": f"closed loop in {'traced' if photons else 'direct'} light, lightfield {__version__}",
        "quantity": QUANTITY,
        "scene_toml": scene.to_toml(),
        "sweep_axes": json.dumps(axes_as_plain(plan)),
        "seed": plan.settings.seed,
        "runs": runs,
        "traces": 0,
        "cases": plan.cases.count,
        "lightfield_version": __version__,
        "complete": "no",
    }
