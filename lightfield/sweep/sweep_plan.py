"""The plan of a sweep: which cases share a trace, and in which blocks they are evaluated and written."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from types import EllipsisType
from typing import Any

import numpy as np

from lightfield.errors import LightfieldError, UsageError, one_line
from lightfield.formula.own_formulas import lit
from lightfield.render.limits import OF_SWEEPS
from lightfield.render.maps import transport_key
from lightfield.render.response.grid import Grid, detector_grid, scene_grid
from lightfield.render.response.response import Reference
from lightfield.render.response.response_cache import digest_of
from lightfield.render.settings import Settings
from lightfield.scene import Scene
from lightfield.scene.acts import TRACED, Acts
from lightfield.scene.all_parameters import only
from lightfield.scene.bands import middles_nm, molecular_share
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m
from lightfield.sweep.axes import Axis, apply, checked_axes
from lightfield.sweep.cases import Cases
from lightfield.sweep.sharing import Trace, common_reference, served_together

_BLOCK_BYTES = 24e6  # of one variable's maps, uncompressed: small enough to lose, large enough to compress
BLOCK_CASES = 256
MOST_CASES = 2_000_000
_SEEDS = 4_000_000  # more than there can be traces; the tracer's seed * 1009 + batch stays below 2**32

Changes = tuple[tuple[str, Any], ...]  # values by path


@dataclass(frozen=True)
class SweepSettings:
    """How a sweep is computed.

    Parameters
    ----------
    rel_error : float
        Relative standard error asked of every trace, in its reference water.
    max_photons : float
        Photon budget of every trace.
    maps : bool
        Keep the maps, not the derived quantities alone.
    """

    rel_error: float = OF_SWEEPS.rel_error
    max_photons: float = OF_SWEEPS.max_photons
    seed: int = 0
    maps: bool = True

    def __post_init__(self) -> None:
        Settings(self.rel_error, self.max_photons)  # refuses what no trace can have


@dataclass(frozen=True)
class Block:
    """Cases that are written together: one chunk of the store.

    Parameters
    ----------
    index : tuple of int
        Chunk index along the case dimensions.
    cases : array of int
        Case numbers, in the order of the chunk.
    traces : tuple of int
        Numbers of the traces that its cases need.
    """

    number: int
    index: tuple[int, ...]
    cases: np.ndarray
    traces: tuple[int, ...]


@dataclass(frozen=True)
class SweepPlan:
    """Everything that is decided before the first photon.

    Parameters
    ----------
    chunks : tuple of int
        Cases of a block along every axis.
    traces : tuple of Trace
    blocks : tuple of Block
    trace_of_case : array of int, shape (n_cases,)
        -1 where the case has no scene.
    problems : dict of int to str
        Cases that have no scene, and why.
    grids : list of Grid
        Detector grid of every combination of `grid_axes`, the last running fastest.
    grid_axes : tuple of int
        Axes along which detector or tank change.
    """

    cases: Cases
    settings: SweepSettings
    chunks: tuple[int, ...]
    traces: tuple[Trace, ...]
    blocks: tuple[Block, ...]
    trace_of_case: np.ndarray
    problems: dict[int, str]
    grids: list[Grid]
    grid_axes: tuple[int, ...]

    @property
    def cells(self) -> int:
        """Values of one map, all planes together."""
        return int(np.prod(self.grids[0].shape))

    @property
    def bands(self) -> int:
        """Wavelength bands."""
        return len(self.cases.scene.detector.bands_nm)


def make_plan(scene: Scene, axes: list[Axis], settings: SweepSettings) -> SweepPlan:
    """Decide what is traced and what is evaluated.

    Parameters
    ----------
    scene : Scene
    axes : list of Axis
    settings : SweepSettings

    Raises
    ------
    UsageError
        Nothing or too much is varied, or maps of different shapes would have to share a store.
    SceneError
        An unknown path or an impossible value.
    """
    cases = Cases(scene, tuple(checked_axes(axes, scene)))
    if cases.count > MOST_CASES:
        raise UsageError(
            "too many cases", found=cases.count, rule=f"at most {MOST_CASES}", remedy="coarser ranges"
        )
    if scene.detector.positions_m is not None:
        raise UsageError(
            "a sweep needs detector planes",
            found="detector.positions_m",
            remedy="give detector.planes_m instead; single positions: render them case by case",
        )
    grid_axes = tuple(_axes_on(cases, Acts.PLACES | Acts.BOX))
    grids = _grids(cases, grid_axes)
    if len({grid.shape for grid in grids}) > 1:
        raise UsageError(
            "maps of different shapes cannot share a store",
            found=sorted({g.shape for g in grids}),
            rule="planes, rows and columns",
            remedy="one sweep for each",
        )
    transport = _transport(cases)
    waters, problems = _waters(cases, list(transport))
    of_grid = _combination(cases, grid_axes)
    far = np.array([grid.z_m.max() for grid in grids])[of_grid]
    chord = np.array([_chord_m(scene) for _, scene in cases.subset(grid_axes)])[of_grid]
    traces, trace_of_case = _traces(cases, settings, transport, far, chord, waters, problems)
    bands = len(scene.detector.bands_nm)
    limit = int(np.clip(_BLOCK_BYTES / (4 * np.prod(grids[0].shape) * bands), 1, BLOCK_CASES))
    chunks = _chunks(cases.shape, list(transport), limit)
    blocks = _blocks(cases.shape, chunks, trace_of_case)
    return SweepPlan(cases, settings, chunks, traces, blocks, trace_of_case, problems, grids, grid_axes)


def plan_of_single_cases(scene: Scene, axes: list[Axis], settings: SweepSettings, most: int) -> SweepPlan:
    """Up to `most` cases that share nothing: each is a block, and finds by itself what it needs of light.

    Raises
    ------
    UsageError, SceneError
        Nothing or too much is varied; an unknown path or an impossible value.
    """
    cases = Cases(scene, tuple(checked_axes(axes, scene)))
    if cases.count > most:
        raise UsageError("too many cases", found=cases.count, rule=f"at most {most}", remedy="coarser ranges")
    none, chunks = np.full(cases.count, -1), (1,) * len(cases.shape)
    return SweepPlan(cases, settings, chunks, (), _blocks(cases.shape, chunks, none), none, {}, [], ())


def _axes_on(cases: Cases, what: Acts) -> list[int]:
    """Axes that set something which acts on any of these stages."""
    return [i for i, axis in enumerate(cases.axes) if any(cases.acts(path) & what for path in axis.values)]


def _grids(cases: Cases, axes: Sequence[int]) -> list[Grid]:
    """Detector grid of every combination of the steps of some axes, alike ones made once."""
    known: dict[object, Grid] = {}
    found = []
    for _, scene in cases.subset(axes):
        key = scene.detector, scene.plane_size_m
        if key not in known:
            known[key] = detector_grid(scene)
        found.append(known[key])
    return found


def _combination(cases: Cases, axes: Sequence[int]) -> np.ndarray:
    """Which combination of the steps of some axes each case has, the last running fastest; (n_cases,)."""
    of_case = np.zeros(cases.shape, int)
    for i in axes:
        size = cases.axes[i].size
        steps = np.arange(size).reshape([size if k == i else 1 for k in range(len(cases.shape))])
        of_case = of_case * size + steps
    return of_case.ravel()


def _transport(cases: Cases) -> dict[int, list[Changes]]:
    """Axes along which light must be traced anew, and in what every step of them differs from the scene."""
    told = {i: _told(cases, cases.axes[i]) for i in _axes_on(cases, TRACED | Acts.PLACES)}
    return {i: steps for i, steps in told.items() if len(set(steps)) > 1}


def _told(cases: Cases, axis: Axis) -> list[Changes]:
    """In what a trace of every step differs from one of the scene as it is."""
    values = {path: v for path, v in axis.values.items() if cases.acts(path) & (TRACED | Acts.PLACES)}
    if all(isinstance(v, int | float) and not isinstance(v, bool) for vs in values.values() for v in vs):
        now = {path: cases.scene.get(path) for path in values}
        return [
            tuple((path, v[n]) for path, v in sorted(values.items()) if v[n] != now[path])
            for n in range(axis.size)
        ]
    # A text may name the same table as another does, or the same thing as a number of another path.
    as_it_is, name = _key(cases.scene), min(values)
    keys = [_key(apply(cases.scene, axis.at(n), validate=False)) for n in range(axis.size)]
    return [() if key == as_it_is else ((name, key),) for key in keys]


def _key(scene: Scene) -> str:
    """What a trace depends on beside the reference; light off the surface is told apart afterwards."""
    try:
        scene = only(lit(scene), TRACED | Acts.PLACES)
        return digest_of(transport_key(scene, scene_grid(scene), Reference(0.0, 0.0, 0.0)))
    except (LightfieldError, OSError, ValueError, TypeError) as error:
        # Its cases fail with their own message.
        return f"impossible: {error}"


def _waters(cases: Cases, transport: list[int]) -> tuple[np.ndarray, dict[int, str]]:
    """Least absorption, most scattering, wall albedo, surface reflectance of cases, and the molecular part of
    the scattering, shape (n_cases, 5)."""
    numbers = np.arange(cases.count).reshape(cases.shape)
    problems: dict[int, str] = {}
    # Checking every case takes long: where a trace is possible, single cases are checked when evaluated.
    for steps in np.ndindex(*(cases.axes[i].size for i in transport)):
        alike = numbers[_where(cases, transport, steps)].ravel()
        if why_impossible(cases, int(alike[0])):
            problems |= {int(n): problem for n in alike if (problem := why_impossible(cases, int(n)))}
    table = np.zeros((*cases.shape, 5))
    # Water and walls apart: where both vary, each has far fewer values than there are cases.
    water = Acts.ABSORPTION | Acts.SCATTERING | Acts.BASE | Acts.COLOUR | Acts.PLACES
    for columns, what, values_of in (
        ([0, 1, 4], water, _coefficients),
        ([2, 3], Acts.REFLECTION, lambda scene: scene.reflectances),
    ):
        axes = _axes_on(cases, what)
        for steps, scene in cases.subset(axes):
            where = _where(cases, axes, steps)
            try:
                table[where][..., columns] = values_of(scene)
            except (LightfieldError, ValueError, TypeError, OSError) as error:
                problem = one_line(error)
                for number in numbers[where].ravel():
                    problems.setdefault(int(number), problem)
    return table.reshape(-1, 5), problems


def _where(cases: Cases, axes: list[int], steps: tuple[int, ...]) -> tuple[slice | int | EllipsisType, ...]:
    """Index of the cases with these steps along some axes."""
    at: list[slice | int] = [slice(None)] * len(cases.shape)
    for i, step in zip(axes, steps, strict=True):
        at[i] = step
    return (*at, ...)


def _coefficients(scene: Scene) -> tuple[float, float, float]:
    wavelengths = middles_nm(scene).ravel()
    a, b = absorption_per_m(scene.water, wavelengths), scattering_per_m(scene.water, wavelengths)
    return float(a.min()), float(b.max()), molecular_share(scene)


def _chord_m(scene: Scene) -> float:
    """Mean way from wall to wall, m: four times the volume over the surface; 0 in open water."""
    if scene.tank is None:
        return 0.0
    x, y, z = (high - low for low, high in scene.tank.box_m)
    return 2 / (1 / x + 1 / y + 1 / z)


def why_impossible(cases: Cases, number: int) -> str:
    """Why a case cannot be; empty when it can."""
    try:
        cases.build(number)
    except (LightfieldError, ValueError, TypeError) as error:
        return one_line(error)
    return ""


def _traces(
    cases: Cases,
    settings: SweepSettings,
    transport: dict[int, list[Changes]],
    far_m: np.ndarray,
    chord_m: np.ndarray,
    waters: np.ndarray,
    problems: dict[int, str],
) -> tuple[tuple[Trace, ...], np.ndarray]:
    """Traces, and the number of the trace that each case is evaluated from."""
    alike = _alike(cases, transport)
    usable = np.ones(cases.count, bool)
    usable[list(problems)] = False
    ordered = np.flatnonzero(usable)[np.argsort(alike[usable], kind="stable")]
    starts = np.flatnonzero(np.diff(alike[ordered], prepend=-1))
    trace_of_case = np.full(cases.count, -1)
    traces: list[Trace] = []
    taken: set[int] = set()
    as_it_is = _key(cases.scene)
    steps_of = np.array(np.unravel_index(ordered[starts], cases.shape)).T.tolist()
    for steps, left in zip(steps_of, np.split(ordered, starts[1:]), strict=False):
        key = f"{as_it_is} {sorted(pair for i, told in transport.items() for pair in told[steps[i]])}"
        while len(left):
            members, left = served_together(left, waters, far_m, chord_m)
            trace_of_case[members] = len(traces)
            reference = common_reference(waters[members])
            seed = _seed(f"{settings.seed} {key} {reference}", taken)
            traces.append(Trace(len(traces), int(members[0]), reference, seed, len(members)))
    return tuple(traces), trace_of_case


def _alike(cases: Cases, transport: dict[int, list[Changes]]) -> np.ndarray:
    """Equal numbers for cases that one reference water serves, ascending from the first case; (n_cases,)."""
    of_case = np.zeros(cases.shape, int)
    for i, told in transport.items():
        kinds = {step: n for n, step in enumerate(dict.fromkeys(told))}
        along = np.array([kinds[step] for step in told])
        of_case = of_case * len(kinds) + along.reshape([-1 if k == i else 1 for k in range(len(cases.shape))])
    return of_case.ravel()


def _seed(text: str, taken: set[int]) -> int:
    """The seed of a trace that a text tells: the same in every plan, unless it is taken; now it is."""
    seed = int(hashlib.sha256(text.encode()).hexdigest()[:12], 16) % _SEEDS
    while seed in taken:
        seed = (seed + 1) % _SEEDS
    taken.add(seed)
    return seed


def _chunks(shape: tuple[int, ...], transport: list[int], limit: int) -> tuple[int, ...]:
    """Block size along every axis: one along axes that need their own trace, then as many cases as fit."""
    chunks = [1] * len(shape)
    for i in reversed(range(len(shape))):
        if i not in transport:
            chunks[i] = max(1, min(shape[i], limit // int(np.prod(chunks))))
    return tuple(chunks)


def _blocks(shape: tuple[int, ...], chunks: tuple[int, ...], trace_of_case: np.ndarray) -> tuple[Block, ...]:
    numbers = np.arange(int(np.prod(shape))).reshape(shape)
    blocks: list[Block] = []
    for index in product(*(range(-(-size // chunk)) for size, chunk in zip(shape, chunks, strict=True))):
        where = tuple(slice(i * c, (i + 1) * c) for i, c in zip(index, chunks, strict=True))
        members = numbers[where].ravel()
        traces = tuple(sorted({int(t) for t in trace_of_case[members] if t >= 0}))
        blocks.append(Block(len(blocks), index, members, traces))
    return tuple(blocks)
