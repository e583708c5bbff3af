"""What one worker does: trace a reference water, or evaluate a block of cases and write it. Runs anywhere."""

from __future__ import annotations

import os
import resource
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, replace
from functools import lru_cache
from itertools import groupby
from math import prod
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from lightfield.errors import LightfieldError, OutputError, one_line
from lightfield.formula.own_formulas import has_own_straight_light, lit
from lightfield.progress import Listener, heard_by
from lightfield.render.backend import THREADS_VARIABLE, limited_threads
from lightfield.render.maps import TracedMaps, in_its_colours, render_scene
from lightfield.render.response.grid import Grid, scene_grid
from lightfield.render.response.response import Reference, TransportResponse
from lightfield.render.response.response_cache import is_damage, read_arrays, write_arrays
from lightfield.render.settings import Settings
from lightfield.scene import Scene
from lightfield.scene.acts import TRACED, Acts
from lightfield.scene.all_parameters import only
from lightfield.scene.bands import over_bands, pieces, refuse_unlit
from lightfield.scene.lamp.colour import REFERENCE_NM, in_colour
from lightfield.scene.water.coefficients import coefficients_in, is_grey
from lightfield.storage.tables import kept_by_tables
from lightfield.sweep import zarrfile
from lightfield.sweep.cases import Cases
from lightfield.sweep.derived import FormulaAtPlaces, GridFormula, at_places, derive, straight_widths_m
from lightfield.sweep.schema import LONGEST_MESSAGE, derived_variables, quantity_of
from lightfield.sweep.sharing import Trace
from lightfield.sweep.store import trace_file
from lightfield.sweep.sweep_plan import Block, SweepPlan, SweepSettings
from lightfield.sweep.zarrfile import Variable

_EVALUATE_BYTES = 64e6  # of the batches of maps that are evaluated in one go
_TELL_EVERY_S = 1.0
_GEOMETRY = TRACED | Acts.PLACES
_Geometry = tuple[GridFormula | None, tuple[np.ndarray, np.ndarray]]
# One thread at a time computes: Dr.Jit's state is the process's, and two responses need twice the memory.
_busy = threading.Lock()


@dataclass(frozen=True)
class TraceDone:
    """Report of a trace; `found`: one that lay beside the store already."""

    number: int
    photons: int
    reached: float
    seconds: float
    worker: str
    peak_bytes: int
    found: bool = False


@dataclass(frozen=True)
class BlockDone:
    """Report of a block: what failed and why, by case; digests of the files written, by name.

    Parameters
    ----------
    again : bool
        It failed for the machine's sake, and is to be done again.
    """

    number: int
    failed: dict[int, str]
    files: dict[str, str]
    seconds: float
    worker: str
    peak_bytes: int
    again: bool = False


@dataclass(frozen=True)
class MapTarget:
    """Where and how blocks are written.

    Parameters
    ----------
    path : Path
        The store.
    variables : dict of Variable
        Its layout.
    quantity : str
        What the maps are of.
    derived : dict of str to str
        Variables beside the maps, and what `derive` calls them.
    settings : SweepSettings
        Of traces that a case needs for itself.
    """

    path: Path
    variables: dict[str, Variable]
    quantity: str
    derived: dict[str, str]
    settings: SweepSettings


def map_target(plan: SweepPlan, path: Path, variables: dict[str, Variable]) -> MapTarget:
    """Where and how the blocks of a sweep of maps are written."""
    quantity, units, _, area_units = quantity_of(plan)
    derived = {name: key for name, key, _, _ in derived_variables(quantity, units, area_units)}
    return MapTarget(path, variables, quantity, derived, plan.settings)


def do_trace(trace: Trace, scene: Scene, settings: SweepSettings, path: Path) -> TraceDone:
    """Trace a scene, and leave the response beside the store; one that is there already is not traced again.

    Raises
    ------
    LightfieldError
        The scene cannot be traced.
    """
    with _busy:
        started, file = time.perf_counter(), trace_file(path, trace.number)
        stored = _read(file)
        found = stored is not None
        if stored is None:
            _loaded.cache_clear()  # a trace needs the room of the response that was used last
            # One thread, or sums would be taken in another order each time and repeat to six digits only.
            threads = int(os.environ.get(THREADS_VARIABLE) or 1)
            with limited_threads(threads), heard_by(_to_whoever_waits(trace.number, path)):
                rendering = render_scene(
                    in_colour(scene, REFERENCE_NM),  # of other colours a case has traces of its own
                    rel_error=settings.rel_error,
                    max_photons=settings.max_photons,
                    seed=trace.seed,
                    reference=trace.reference,
                    cache=False,
                )
            _save(file, rendering.response, rendering.reached)
            stored = rendering.response, rendering.reached
        response, reached = stored
        seconds = time.perf_counter() - started
        return TraceDone(trace.number, response.photons, reached, seconds, worker_name(), peak_bytes(), found)


def topic_of(path: Path) -> str:
    """Under which name a worker tells how far its traces for a store are."""
    return f"lightfield traces {path}"


def _to_whoever_waits(number: int, path: Path) -> Listener:
    """Tell the part of a trace that is done through Dask, now and then; outside a worker nobody."""
    from distributed import get_worker

    try:
        worker = get_worker()
    except ValueError:
        return lambda words, part: None
    told_at = [0.0]

    def listener(words: str, part: float) -> None:
        now = time.monotonic()
        if now - told_at[0] >= _TELL_EVERY_S:
            told_at[0] = now
            worker.log_event(topic_of(path), {"trace": number, "part": part})

    return listener


def do_block(block: Block, cases: Cases, trace_of_case: Sequence[int], target: MapTarget) -> BlockDone:
    """Evaluate the cases of a block and write its chunks; a case that cannot be evaluated is reported.

    Parameters
    ----------
    trace_of_case : sequence of int
        Trace of every case of the block; negative: none.
    """
    with _busy, threadpool_limits(1, "blas"):  # more threads of BLAS would round differently
        started = time.perf_counter()
        failed: dict[int, str] = {}
        written = {*target.derived, target.quantity, f"{target.quantity}_stderr"}
        results = {
            name: np.full((len(block.cases), *variable.shape[len(cases.shape) :]), np.nan)
            for name, variable in target.variables.items()
            if name in written
        }
        for number in sorted(set(trace_of_case)):
            mine = [i for i, t in enumerate(trace_of_case) if t == number]
            scenes = _scenes(cases, block, mine, failed)
            if number < 0 or not scenes:
                continue
            response = _response(trace_file(target.path, number))
            for i, scene, mean, stderr in evaluated(response, scenes, failed, block, target.settings):
                grid = scene_grid(scene)
                mean, stderr = grid.in_water(mean), grid.in_water(stderr)
                try:
                    formula, places = _formula(scene, grid)
                except LightfieldError as error:
                    failed[int(block.cases[i])] = one_line(error)[:LONGEST_MESSAGE]
                    continue
                found = derive(mean, stderr, formula, grid, scene.lamp, response.merged, places)
                if target.quantity in results:
                    results[target.quantity][i], results[f"{target.quantity}_stderr"][i] = mean, stderr
                for name, key in target.derived.items():
                    if key in found:
                        results[name][i] = found[key]
        files = write_block(block, cases, target.path, target.variables, results)
        seconds = time.perf_counter() - started
        return BlockDone(block.number, failed, files, seconds, worker_name(), peak_bytes())


def write_block(
    block: Block, cases: Cases, path: Path, variables: dict[str, Variable], results: dict[str, np.ndarray]
) -> dict[str, str]:
    """Write the chunks of a block, one per variable; digests of the files, by name.

    Parameters
    ----------
    results : dict of str to array, shape (n_cases, ...)
    """
    files: dict[str, str] = {}
    for name, values in results.items():
        variable, shape = variables[name], values.shape[1:]
        edge = tuple(
            min(c, s - j * c) for j, c, s in zip(block.index, variable.chunks, cases.shape, strict=False)
        )
        index = (*block.index, *(0,) * len(shape))
        file, told = zarrfile.write_chunk(path, name, variable, index, values.reshape(*edge, *shape))
        files[file] = told
    return files


def evaluated(
    response: TransportResponse,
    scenes: list[tuple[int, Scene]],
    failed: dict[int, str],
    block: Block,
    settings: SweepSettings,
) -> Iterator[tuple[int, Scene, np.ndarray, np.ndarray]]:
    """Maps of many waters from one response, many at a time: (place in the block, scene, mean, stderr).

    mean and stderr have shape (n_bands, n_planes, n_y, n_x) and absolute units.
    """
    most = max(1, int(_EVALUATE_BYTES / (8 * response.tally.shape[0] * response.tally.shape[2])))

    def together(pair: tuple[int, Scene]) -> tuple[object, ...]:
        i, scene = pair
        # Straight light of its own is worked out case by case, and own effects fail so.
        return scene.water.hardening_per_m, _evaluations(scene), i if has_own_straight_light(scene) else None

    for _, alike in groupby(scenes, key=together):
        members = list(alike)
        per_case = prod(_evaluations(members[0][1]))
        step = max(1, most // per_case)
        for first in range(0, len(members), step):
            part = members[first : first + step]
            try:
                if has_own_straight_light(part[0][1]):
                    mean, stderr = _by_itself(response, part[0][1], settings)
                    means, errors = mean[None], stderr[None]
                else:
                    means, errors = _evaluate(response, [scene for _, scene in part])
            except LightfieldError as error:
                failed |= {int(block.cases[i]): one_line(error)[:LONGEST_MESSAGE] for i, _ in part}
                continue
            for (i, scene), mean, stderr in zip(part, means, errors, strict=True):
                if not np.isfinite(mean).all() or np.isnan(stderr).any():
                    failed[int(block.cases[i])] = "the evaluated map has values that are not numbers"
                    continue
                yield i, scene, mean, stderr


def _evaluate(response: TransportResponse, scenes: list[Scene]) -> tuple[np.ndarray, np.ndarray]:
    """Maps of cases alike in hardening and wavelengths, shape (n, n_bands, n_planes, n_y, n_x)."""
    columns, weights = [], []
    for scene in scenes:
        (at, intensity), (rho, surface) = over_bands(scene), scene.reflectances
        if _evaluations(scene) == (1, 1):  # one map serves all bands
            at, intensity = at[:1, :1], intensity.mean(axis=1, keepdims=True)
        a, b = coefficients_in(scene.water, at.ravel(), response.reference.molecular_share)
        columns.append(np.array([a, b, np.full_like(a, rho), np.full_like(a, surface)]))
        weights.append(intensity / intensity.shape[1])
    shape = (len(scenes), *_evaluations(scenes[0]), *response.shape)
    hardening = scenes[0].water.hardening_per_m
    a, b, rho, surface = np.concatenate(columns, axis=1)
    mean, stderr = response.evaluate(a, b, rho, surface, hardening=hardening)
    factor = np.array(weights)[..., None, None, None]
    with np.errstate(invalid="ignore"):
        # Wavelengths of a band share their photons: errors add up, they do not average out.
        return (mean.reshape(shape) * factor).sum(axis=2), (stderr.reshape(shape) * factor).sum(axis=2)


def _by_itself(
    response: TransportResponse, scene: Scene, settings: SweepSettings
) -> tuple[np.ndarray, np.ndarray]:
    """Maps of a case with straight light of its own, shape (n_bands, n_planes, n_y, n_x)."""
    grid = replace(scene_grid(scene), inside=None)  # what lies outside is taken out of the maps of all cases
    how = Settings(settings.rel_error, settings.max_photons, settings.seed)
    return TracedMaps(scene, response, grid, in_its_colours(scene, response, grid, how)).maps()


def _evaluations(scene: Scene) -> tuple[int, int]:
    """How many bands, and wavelengths in each, are evaluated: one where all are alike."""
    grey = is_grey(scene.water) and not has_own_straight_light(scene)
    return (1, 1) if grey else (len(scene.detector.bands_nm), pieces(scene))


def _scenes(cases: Cases, block: Block, places: list[int], failed: dict[int, str]) -> list[tuple[int, Scene]]:
    scenes = []
    for i in places:
        try:
            scene = lit(cases.build(int(block.cases[i])))
            refuse_unlit(scene)
            scenes.append((i, scene))
        except (LightfieldError, ValueError, TypeError) as error:
            failed[int(block.cases[i])] = one_line(error)[:LONGEST_MESSAGE]
    return scenes


def _formula(scene: Scene, grid: Grid) -> tuple[np.ndarray | None, FormulaAtPlaces | None]:
    """Maps of the formula, shape (n_bands, n_planes, n_y, n_x), and it itself; None where it has none."""
    own = has_own_straight_light(scene)
    formula, widths = _worked_out(scene) if own else _geometry(only(scene, _GEOMETRY))
    if formula is None:
        return None, None
    return formula.bands(scene), at_places(scene, grid.z_m, widths)


def _worked_out(scene: Scene) -> _Geometry:
    """Geometry of the formula, and half widths of straight light."""
    grid = scene_grid(scene)
    formula = GridFormula.of(scene, grid)
    return formula, (np.empty(0),) * 2 if formula is None else straight_widths_m(scene, grid)


#: The same of a scene of lamp, tank and detector alone, remembered for the next case.
_geometry = kept_by_tables(4)(_worked_out)


# -- responses on disk -------------------------------------------------------------------------------


def _response(file: Path) -> TransportResponse:
    """The response that was used last, or another one in its place."""
    return _loaded(str(file), file.stat().st_mtime_ns if file.exists() else 0)


@lru_cache(maxsize=1)
def _loaded(file: str, _modified: int) -> TransportResponse:
    stored = _read(Path(file))
    if stored is None:
        raise OutputError("the trace is gone or damaged", where=file, remedy="run its sweep again")
    return stored[0]


def _save(file: Path, response: TransportResponse, reached: float) -> None:
    told = {"reference": np.array(astuple(response.reference)), "reached": np.array(reached)}
    write_arrays(file, response.packed() | told)


def _read(file: Path) -> tuple[TransportResponse, float] | None:
    """A response and the error it reached; None when it is missing or damaged."""
    try:
        stored = read_arrays(file)
        reference = Reference(*stored["reference"].tolist())
        return TransportResponse.unpacked(stored, reference), float(stored["reached"])
    except FileNotFoundError:
        return None
    except Exception as error:
        if not is_damage(error):
            raise
        file.unlink(missing_ok=True)
        return None


# -- this process ------------------------------------------------------------------------------------


def worker_name() -> str:
    """Host and process that computes."""
    return f"{os.uname().nodename}:{os.getpid()}"


def peak_bytes() -> int:
    """Most memory that this process has held, in bytes.

    Linux hands ``ru_maxrss`` on to whatever a process starts: a small worker of a large parent reports the
    parent's. Its own is the high-water mark of its own memory (proc(5), VmHWM).
    """
    try:
        status = Path("/proc/self/status").read_text(encoding="ascii")
        return next(int(line.split()[1]) * 1024 for line in status.splitlines() if line.startswith("VmHWM:"))
    except (OSError, StopIteration):
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return peak if sys.platform == "darwin" else peak * 1024
