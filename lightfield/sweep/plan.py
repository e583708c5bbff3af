"""The plan of a sweep: which cases share a trace, and in which blocks they are evaluated and written."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from lightfield.errors import LightfieldError, UsageError
from lightfield.render.maps import transport_key
from lightfield.render.response.grid import Grid, band_wavelengths, scene_grid
from lightfield.render.response.response import Reference
from lightfield.render.response.store import digest_of
from lightfield.render.settings import Settings
from lightfield.scene import Scene
from lightfield.scene.acts import ATTENUATION, TRACED, Acts
from lightfield.scene.all_parameters import only, without
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m
from lightfield.sweep.axes import Axis, checked_axes
from lightfield.sweep.cases import Cases

BLOCK_BYTES = 24e6  # of one variable's maps, uncompressed: small enough to lose, large enough to compress
BLOCK_CASES = 256
MOST_CASES = 2_000_000
# Light that scattered n times in a reference water b0 counts (b / b0)^n exp((b0 - b) L). Over a path L the
# variance of that factor is exp(spread) - 1, spread = (b0 - b)^2 L / b0 (Poisson of mean b0 L).
# Beyond 1.5 single photons show as bright cells that the stated error does not cover: another trace then.
MOST_SPREAD = 1.5


@dataclass(frozen=True)
class SweepSettings:
    """How a sweep is computed.

    Parameters
    ----------
    rel_error : float
        Relative standard error asked of every trace, in its reference water.
    max_photons : float
        Photon budget of every trace.
    seed : int
    maps : bool
        Keep the maps, not the derived quantities alone.
    """

    rel_error: float = 0.05
    max_photons: float = 2e6
    seed: int = 0
    maps: bool = True

    def __post_init__(self) -> None:
        Settings(self.rel_error, self.max_photons)  # refuses what no trace can have


@dataclass(frozen=True)
class Trace:
    """One trace: a scene in its reference water, and the seed.

    Parameters
    ----------
    number : int
    scene : Scene
    reference : Reference
    seed : int
    cases : int
        How many cases are evaluated from it.
    """

    number: int
    scene: Scene
    reference: Reference
    seed: int
    cases: int


@dataclass(frozen=True)
class Block:
    """Cases that are written together: one chunk of the store.

    Parameters
    ----------
    number : int
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
class Plan:
    """Everything that is decided before the first photon.

    Parameters
    ----------
    cases : Cases
    settings : SweepSettings
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
        Axes along which the trace changes.
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


def make_plan(scene: Scene, axes: list[Axis], settings: SweepSettings) -> Plan:
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
            remedy="give detector.planes_m instead; single positions: `lightfield render`, case by case",
        )
    transport, keys, grids = _transport_axes(cases)
    if len({grid.shape for grid in grids}) > 1:
        raise UsageError(
            "maps of different shapes cannot share a store",
            found=sorted({g.shape for g in grids}),
            rule="planes, rows and columns",
            remedy="one sweep for each",
        )
    waters, problems = _waters(cases, transport)
    traces, trace_of_case = _traces(cases, settings, transport, keys, grids, waters, problems)
    bands = len(scene.detector.bands_nm)
    limit = int(np.clip(BLOCK_BYTES / (4 * np.prod(grids[0].shape) * bands), 1, BLOCK_CASES))
    chunks = _chunks(cases.shape, transport, limit)
    blocks = _blocks(cases.shape, chunks, trace_of_case)
    return Plan(cases, settings, chunks, traces, blocks, trace_of_case, problems, grids, tuple(transport))


def _transport_axes(cases: Cases) -> tuple[list[int], list[str], list[Grid]]:
    """Axes along which light must be traced anew, and key and grid of every combination of their steps."""
    transport = []
    for i, axis in enumerate(cases.axes):
        at = [0] * len(cases.axes)
        keys = set()
        for at[i] in _telling_steps(axis):
            keys.add(_key(cases.at(at)))
            if len(keys) > 1:
                transport.append(i)
                break
    keys_of, grids = [], []
    for _, scene in cases.subset(transport):
        keys_of.append(_key(scene))
        grids.append(scene_grid(scene))
    return transport, keys_of, grids


def _telling_steps(axis: Axis) -> list[int]:
    """Steps that tell whether a trace depends on what an axis sets.

    It depends on a number or it does not, whatever the number is, but zero may switch a thing off; two texts
    may name the same table.
    """
    steps = {0}
    for values in axis.values.values():
        if not all(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
            return list(range(axis.size))
        others = [n for n, value in enumerate(values) if value != values[0]]
        zeros = [n for n in others if values[n] == 0]
        steps.update(others[:1], others[-1:], zeros[:1])
    return sorted(steps)


def _key(scene: Scene) -> str:
    """What a trace depends on beside the reference; light off the surface is told apart afterwards."""
    scene = only(scene, TRACED | Acts.PLACES)
    try:
        return digest_of(transport_key(scene, scene_grid(scene), Reference(0.0, 0.0, 0.0)))
    except (OSError, ValueError, TypeError) as error:  # its cases fail with their own message
        return f"impossible: {error}"


def _waters(cases: Cases, transport: list[int]) -> tuple[np.ndarray, dict[int, str]]:
    """Least absorption, most scattering, wall albedo, surface reflectance of cases, shape (n_cases, 4)."""
    numbers = np.arange(cases.count).reshape(cases.shape)
    problems: dict[int, str] = {}
    # Checking every case takes long: where a trace is possible, single cases are checked when evaluated.
    for steps, _ in cases.subset(transport):
        alike = numbers[_where(cases, transport, steps)].ravel()
        if problem_of(cases, int(alike[0])):
            problems |= {int(n): problem for n in alike if (problem := problem_of(cases, int(n)))}
    table = np.zeros((*cases.shape, 4))
    # Water and walls apart: where both vary, each has far fewer values than there are cases.
    for columns, parts, values_of in (
        (slice(0, 2), ("water.", "detector."), _coefficients),
        (slice(2, 4), ("tank.",), _reflectances),
    ):
        axes = [i for i, a in enumerate(cases.axes) if any(path.startswith(parts) for path in a.values)]
        for steps, scene in cases.subset(axes):
            where = _where(cases, axes, steps)
            try:
                table[where][..., columns] = values_of(scene)
            except (LightfieldError, ValueError, TypeError, OSError) as error:
                problem = " ".join(str(error).split())
                for number in numbers[where].ravel():
                    problems.setdefault(int(number), problem)
    return table.reshape(-1, 4), problems


def _where(cases: Cases, axes: list[int], steps: tuple[int, ...]) -> tuple[Any, ...]:
    """Index of the cases with these steps along some axes."""
    at: list[Any] = [slice(None)] * len(cases.shape)
    for i, step in zip(axes, steps, strict=True):
        at[i] = step
    return (*at, ...)


def _coefficients(scene: Scene) -> tuple[float, float]:
    wavelengths = band_wavelengths(scene).ravel()
    a, b = absorption_per_m(scene.water, wavelengths), scattering_per_m(scene.water, wavelengths)
    return float(a.min()), float(b.max())


def _reflectances(scene: Scene) -> tuple[float, float]:
    return (scene.tank.wall_albedo, scene.tank.surface_reflectance) if scene.tank else (0.0, 0.0)


def problem_of(cases: Cases, number: int) -> str:
    """Why a case cannot be; empty when it can."""
    try:
        cases.build(number)
    except (LightfieldError, ValueError, TypeError) as error:
        return " ".join(str(error).split())
    return ""


def _traces(
    cases: Cases,
    settings: SweepSettings,
    transport: list[int],
    keys: list[str],
    grids: list[Grid],
    waters: np.ndarray,
    problems: dict[int, str],
) -> tuple[tuple[Trace, ...], np.ndarray]:
    """Traces, and the number of the trace that each case is evaluated from."""
    steps = np.array(np.unravel_index(np.arange(cases.count), cases.shape))
    sizes = [cases.axes[i].size for i in transport]
    combination = (
        np.ravel_multi_index(tuple(steps[transport]), sizes) if transport else np.zeros(cases.count, int)
    )
    unique = {key: n for n, key in enumerate(dict.fromkeys(keys))}
    key_of_case = np.array([unique[key] for key in keys])[combination]
    usable = np.ones(cases.count, bool)
    usable[list(problems)] = False
    trace_of_case = np.full(cases.count, -1)
    traces: list[Trace] = []
    grid_of = dict(zip(reversed(keys), reversed(grids), strict=True))  # the first one of every key
    # Cases of a key, ascending, for all keys in one go.
    ordered = np.argsort(np.where(usable, key_of_case, len(unique)), kind="stable")
    ends = np.searchsorted(key_of_case[ordered[: usable.sum()]], np.arange(len(unique)), side="right")
    for key, left in zip(unique, np.split(ordered, ends)[:-1], strict=True):
        far = float(grid_of[key].z_m.max())
        while len(left):
            near = _spread(waters[left], far) <= MOST_SPREAD
            members, left = left[near], left[~near]
            trace_of_case[members] = len(traces)
            traces.append(_trace(cases, settings, key, members, waters[members], len(traces)))
    return tuple(traces), trace_of_case


def _spread(waters: np.ndarray, far_m: float) -> np.ndarray:
    """Spread of the weights of waters about the most turbid of them, shape (n,)."""
    b, most = waters[:, 1], waters[:, 1].max()
    if most == 0:
        return np.zeros_like(b)
    # Direct light is an expected value: without reflection, clear water has no weights to spread.
    direct_alone = (b == 0) & (waters[:, 2:] == 0).all(axis=1)
    return np.asarray(np.where(direct_alone, 0.0, (most - b) ** 2 * far_m / most))


def _trace(
    cases: Cases, settings: SweepSettings, key: str, members: np.ndarray, waters: np.ndarray, number: int
) -> Trace:
    a, b, rho, surface = waters[:, 0].min(), *(float(column.max()) for column in waters[:, 1:].T)
    reference = Reference(float(a), b, rho)
    scene = without(cases.build(int(members[0]), validate=False), ATTENUATION)
    plain: dict[str, Any] = {
        "water.absorption_per_m": reference.absorption_per_m,
        "water.scattering_per_m": b,
    }
    if scene.tank is not None:
        plain |= {"tank.wall_albedo": rho, "tank.surface_reflectance": surface}
        plain["tank.surface"] = "flat" if surface > 0 else "none"
    text = f"{settings.seed} {key} {reference} {surface > 0}"
    seed = int(hashlib.sha256(text.encode()).hexdigest()[:12], 16) % 4_000_000
    return Trace(number, scene.with_values(plain, validate=False), reference, seed, len(members))


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
