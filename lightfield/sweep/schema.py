"""What a store holds: variables, coordinates and attributes, in the CF conventions."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.errors import UsageError
from lightfield.maps.dataset import PLACE, QUANTITIES, scene_attributes
from lightfield.render.response.grid import Grid
from lightfield.sweep.axes import COMPOUND, Axis
from lightfield.sweep.sweep_plan import SweepPlan
from lightfield.sweep.zarrfile import Variable
from lightfield.version import __version__

_STATUS = ("pending", "done", "failed")
#: Letters of why a case failed that are kept. Chosen.
LONGEST_MESSAGE = 240
MESSAGE = f"<U{LONGEST_MESSAGE}"
_AREA_UNITS = {"irradiance": "W nm-1", "scalar_irradiance": "W nm-1", "radiance": "W sr-1 nm-1"}


@dataclass(frozen=True)
class SweepKind:
    """What a sweep keeps of its cases, and what a worker does with some of them.

    Parameters
    ----------
    variables, coordinates, attributes : callable
        Of a plan: what the store declares, the values of its coordinates, and what it says of itself.
    target : callable
        Of the path of a store and its variables: what `block` is told.
    block : callable
        Computes a block of cases and writes it: (block, cases, trace of every case, target) to `BlockDone`.
    told : dict
        All else that the numbers depend on.
    """

    variables: Callable[[SweepPlan], dict[str, Variable]]
    coordinates: Callable[[SweepPlan], dict[str, np.ndarray]]
    attributes: Callable[[SweepPlan], dict[str, Any]]
    target: Callable[[SweepPlan, Path, dict[str, Variable]], Any]
    block: Callable[..., Any]
    told: dict[str, float | str]


def variables_of(plan: SweepPlan) -> dict[str, Variable]:
    """Every variable of the store; raises as `beside_axes`."""
    cases, grid, maps = plan.cases, plan.grids[0], map_dims(plan)
    dims, shape = tuple(axis.name for axis in cases.axes), cases.shape
    quantity, units, meaning, area_units = quantity_of(plan)
    variables: dict[str, Variable] = {}
    sizes = {maps[0]: plan.bands, **dict(zip(maps[1:], grid.shape, strict=True))}
    for name, unit, text in (
        ("wavelength_nm", "nm", "centre of the band"),
        *((name, "m", words) for name, words in PLACE.items()),
    ):
        dim = maps[("wavelength_nm", "z_m", "y_m", "x_m").index(name)]
        along = dims if dim != name else ()
        whole = (*(shape if along else ()), sizes[dim])
        attrs = {"units": unit, "long_name": text} | (
            {"axis": name[0].upper()} if unit == "m" and not along else {}
        )
        variables[name] = Variable((*along, dim), whole, whole, "f8", attrs)
    per_map = (plan.bands, *grid.shape)
    if plan.settings.maps:
        for name, text in (
            (quantity, meaning),
            (f"{quantity}_stderr", f"Monte Carlo standard error of {quantity}"),
        ):
            attrs = {"units": units, "long_name": text}
            if name == quantity:
                attrs["ancillary_variables"] = f"{quantity}_stderr"
            variables[name] = Variable(
                (*dims, *maps), (*shape, *per_map), (*plan.chunks, *per_map), "f4", attrs
            )
    for name, _, unit, text in derived_variables(quantity, units, area_units):
        variables[name] = Variable(
            (*dims, *maps[:2]),
            (*shape, *per_map[:2]),
            (*plan.chunks, *per_map[:2]),
            "f8",
            {"units": unit, "long_name": text},
        )
    return beside_axes(plan, variables)


def beside_axes(plan: SweepPlan, results: dict[str, Variable]) -> dict[str, Variable]:
    """Coordinates along the axes, results, and the state of every case.

    Raises
    ------
    UsageError
        An axis has the name of something else in the store.
    """
    along: dict[str, Variable] = {}
    for axis in plan.cases.axes:
        along |= _axis_coordinates(plan, axis)
    others = results | _state_variables(plan)
    for name in along:
        if name in others or any(variable.dims.count(name) > 1 for variable in others.values()):
            raise UsageError(
                "this name is taken", where="name of an axis", found=name,
                rule="the store has a variable or a dimension of its own that is called so",
                remedy="choose another name",
            )  # fmt: skip
    return along | others


def _state_variables(plan: SweepPlan) -> dict[str, Variable]:
    """The state of every case."""
    dims, shape = tuple(axis.name for axis in plan.cases.axes), plan.cases.shape
    variables: dict[str, Variable] = {}
    flags: dict[str, Any] = {"flag_values": [0, 1, 2], "flag_meanings": " ".join(_STATUS)}
    for name, dtype, about in (
        ("status", "i1", {"long_name": "state of the case", **flags}),
        ("message", MESSAGE, {"long_name": "why it failed"}),
        ("trace", "i4", {"long_name": "trace that the case was evaluated from; -1: none"}),
        ("photons", "i8", {"long_name": "photons of that trace", "units": "1"}),
        (
            "reached_relative_error",
            "f8",
            {"long_name": "relative standard error that 95 % of its lit cells have", "units": "1"},
        ),
    ):
        variables[name] = Variable(dims, shape, shape, dtype, about)
    return variables


def derived_variables(quantity: str, units: str, area_units: str) -> list[tuple[str, str, str, str]]:
    """Name in the store, name in `derived.derive`, unit and meaning of every derived quantity."""
    told = [
        (
            f"on_axis_{quantity}",
            "on_axis",
            units,
            f"{quantity} on the lamp's axis; NaN where it misses the plane",
        ),
        ("plane_power", "plane_power", area_units, "integral over the plane"),
        (
            "half_width_m",
            "half_width",
            "m",
            "half width at half maximum of the spot, geometric mean over x, y",
        ),
        (
            "formula_error_on_axis",
            "formula_error_axis",
            "1",
            "closed-form model over render, minus one, on the lamp's axis",
        ),
        ("formula_error_of_power", "formula_error_power", "1", "the same for the integral over the plane"),
    ]
    errors = [
        (f"{name}_stderr", f"{key}_stderr", unit, f"Monte Carlo standard error of {name}")
        for name, key, unit, _ in told
    ]
    return [entry for pair in zip(told, errors, strict=True) for entry in pair]


def quantity_of(plan: SweepPlan) -> tuple[str, str, str, str]:
    """Name, unit and meaning of the maps, and unit of their integral over a plane."""
    varied = {q for axis in plan.cases.axes for q in axis.values.get("detector.quantity", ())}
    if len(varied) < 2:
        quantity = varied.pop() if varied else plan.cases.scene.detector.quantity
        return quantity, *QUANTITIES[quantity], _AREA_UNITS[quantity]
    # One variable for several quantities: each in its own unit, told by the coordinate.
    units = ", ".join(f"{q}: {QUANTITIES[q][0]}" for q in sorted(varied))
    area = ", ".join(f"{q}: {_AREA_UNITS[q]}" for q in sorted(varied))
    return "reading", units, "light at the detector, in the unit of its quantity", area


def map_dims(plan: SweepPlan) -> tuple[str, str, str, str]:
    """Dimensions of a map: coordinates where all cases share them, else plain counts."""
    first = plan.grids[0]
    same = [
        all(np.array_equal(getattr(g, k), getattr(first, k)) for g in plan.grids)
        for k in ("z_m", "y_m", "x_m")
    ]
    z, y, x = (
        name if ok else plain
        for name, plain, ok in zip(("z_m", "y_m", "x_m"), ("plane", "row", "column"), same, strict=True)
    )
    bands = any("detector.bands_nm" in axis.values for axis in plan.cases.axes)
    return "band" if bands else "wavelength_nm", z, y, x


def coordinates(plan: SweepPlan) -> dict[str, np.ndarray]:
    """Values of every coordinate."""
    cases, result = plan.cases, axis_coordinates(plan)
    names = dict(zip(("wavelength_nm", "z_m", "y_m", "x_m"), map_dims(plan), strict=True))
    for name, dim in names.items():
        if name == dim:
            result[name] = _places(plan.grids[0], cases.scene.detector.bands_nm)[name]
            continue
        table = [
            _places(_grid_of(plan, n), cases.build(n, False).detector.bands_nm)[name]
            for n in range(cases.count)
        ]
        result[name] = np.array(table).reshape(*cases.shape, -1)
    return result


def axis_coordinates(plan: SweepPlan) -> dict[str, np.ndarray]:
    """Values along the axes."""
    result: dict[str, np.ndarray] = {}
    for axis in plan.cases.axes:
        for path, values in axis.values.items():
            result[path] = _coordinate(values)
        if axis.name not in axis.values:
            result[axis.name] = np.arange(axis.size)
    return result


def attributes(plan: SweepPlan) -> dict[str, Any]:
    """Global attributes: conventions, scene, plan, seed, software."""
    scene = plan.cases.scene
    return {
        **scene_attributes(scene, "sweep over the light field of an underwater lamp"),
        "history": f"lightfield {__version__} sweep",
        "quantity": quantity_of(plan)[0],
        "sweep_axes": json.dumps(axes_as_plain(plan)),
        "requested_relative_error": plan.settings.rel_error,
        "photon_budget_per_trace": plan.settings.max_photons,
        "seed": plan.settings.seed,
        "traces": len(plan.traces),
        "cases": plan.cases.count,
        "complete": "no",
    }


def _axis_coordinates(plan: SweepPlan, axis: Axis) -> dict[str, Variable]:
    known = plan.cases.scene.parameters()
    result = {}
    for path, values in axis.values.items():
        data = _coordinate(values)
        unit, text = COMPOUND.get(
            path, (known[path].unit, known[path].meaning) if path in known else ("", "")
        )
        attrs = {key: v for key, v in (("units", unit), ("long_name", text or path)) if v}
        result[path] = Variable((axis.name,), data.shape, data.shape, data.dtype.str, attrs)
    if axis.name not in axis.values:
        steps = (axis.size,)
        result[axis.name] = Variable((axis.name,), steps, steps, "i8", {"long_name": ", ".join(axis.values)})
    return result


def _coordinate(values: tuple[Any, ...]) -> np.ndarray:
    if all(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
        return np.array(values)
    return np.array([v if isinstance(v, str) else json.dumps(v) for v in values])


def _grid_of(plan: SweepPlan, number: int) -> Grid:
    steps = np.unravel_index(number, plan.cases.shape)
    sizes = [plan.cases.axes[i].size for i in plan.grid_axes]
    return plan.grids[int(np.ravel_multi_index([int(steps[i]) for i in plan.grid_axes], sizes))]


def _places(grid: Grid, bands_nm: Sequence[tuple[float, float]]) -> dict[str, np.ndarray]:
    return {
        "wavelength_nm": np.asarray(bands_nm, float).mean(axis=1),
        "z_m": np.asarray(grid.z_m, float),
        "y_m": np.asarray(grid.y_m, float),
        "x_m": np.asarray(grid.x_m, float),
    }


def axes_as_plain(plan: SweepPlan) -> dict[str, dict[str, list[Any]]]:
    """Values of every path of every axis."""
    return {axis.name: {path: list(v) for path, v in axis.values.items()} for axis in plan.cases.axes}
