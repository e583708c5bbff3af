"""The store of a sweep: its variables, its journal, its lock, and whether it may be continued.

    STORE.zarr/               xarray opens it: maps, errors, derived quantities, over the varied parameters
    STORE.zarr/.lightfield/   plan.json (what the store is for), journal.jsonl (blocks on disk), traces/ (while needed)

A block counts as done once its line is in the journal, which is written after the block's chunks are on disk.
"""

from __future__ import annotations

import fcntl
import json
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from datetime import datetime, timezone
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from lightfield import __version__
from lightfield.dataset import QUANTITIES
from lightfield.errors import OutputError
from lightfield.render.grid import Grid
from lightfield.scene import Scene
from lightfield.sweep import zarrfile
from lightfield.sweep.axes import COMPOUND, Axis
from lightfield.sweep.plan import Plan
from lightfield.sweep.zarrfile import Variable

FORMAT = 1  # of the store; raised whenever the same plan would give other numbers
STATUS = ("pending", "done", "failed")
MESSAGE = "<U240"
AREA_UNITS = {"irradiance": "W nm-1", "scalar_irradiance": "W nm-1", "radiance": "W sr-1 nm-1"}


class SweepStore:
    """A store on disk.

    Parameters
    ----------
    path : Path
    plan : Plan
    """

    def __init__(self, path: Path, plan: Plan) -> None:
        self.path, self.plan = path, plan
        self.variables = layout(plan)
        self.inner = path / ".lightfield"
        self.traces = self.inner / "traces"
        self.journal: list[dict[str, Any]] = []

    @contextmanager
    def opened(self) -> Iterator[SweepStore]:
        """Create the store, or take up what is there; nobody else may write to it meanwhile.

        Raises
        ------
        OutputError
            Something else is there, another sweep runs on it, or it was made for another sweep.
        """
        started = (self.inner / "plan.json").exists()
        # Without a plan, our own folder is what a killed process left before it had begun.
        ours = started or self.inner.is_dir() or not self.path.exists()
        if not ours and (not self.path.is_dir() or any(self.path.iterdir())):
            raise OutputError("there is something else here", where=str(self.path), rule="a new or an unfinished store",
                              remedy="choose another name with -o")  # fmt: skip
        try:
            self.traces.mkdir(parents=True, exist_ok=True)
            with (self.inner / "lock").open("w") as lock:
                try:
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except OSError:
                    raise OutputError("another sweep is writing to this store", where=str(self.path),
                                      remedy="wait for it, or choose another name with -o") from None  # fmt: skip
                self._take_up() if started else self._create()
                yield self
        except PermissionError as error:
            raise OutputError("cannot write here", where=str(self.path), found=error.strerror,
                              remedy="choose a writable folder with -o") from error  # fmt: skip

    def done(self) -> set[int]:
        """Numbers of the blocks that are on disk."""
        return {entry["block"] for entry in self.journal if "block" in entry}

    def traced(self) -> dict[int, dict[str, Any]]:
        """What is known of every finished trace, by number."""
        return {entry["trace"]: entry for entry in self.journal if "trace" in entry}

    def record(self, **entry: Any) -> None:
        """Append a line to the journal; it is on disk when this returns."""
        with (self.inner / "journal.jsonl").open("ab") as file:
            file.write(json.dumps(entry).encode() + b"\n")
            file.flush()
            os.fsync(file.fileno())
        self.journal.append(entry)

    def drop_trace(self, number: int) -> None:
        """Remove a trace that no block needs any more."""
        trace_file(self.path, number).unlink(missing_ok=True)

    def summarise(self) -> None:
        """Write what is known of every case: status, message, trace, photons, error reached."""
        cases, traced = self.plan.cases, self.traced()
        status, message = np.zeros(cases.count, "i1"), np.zeros(cases.count, MESSAGE)
        photons, reached = np.zeros(cases.count, "i8"), np.full(cases.count, np.nan)
        for entry in self.journal:
            if "block" in entry:
                status[self.plan.blocks[entry["block"]].cases] = 1
                for number, text in entry["failed"].items():
                    status[int(number)], message[int(number)] = 2, text
        for number, entry in traced.items():
            which = self.plan.trace_of_case == number
            photons[which], reached[which] = entry["photons"], entry["reached"]
        trace = self.plan.trace_of_case
        for name, values in (("status", status), ("message", message), ("trace", trace), ("photons", photons),
                             ("reached_relative_error", reached)):  # fmt: skip
            zarrfile.write_whole(self.path, name, self.variables[name], values.reshape(cases.shape))

    def finish(self) -> None:
        """Mark the store as complete and remove the traces."""
        self.summarise()
        shutil.rmtree(self.traces, ignore_errors=True)
        zarrfile.set_attrs(self.path, {"complete": "yes"})

    def _create(self) -> None:
        zarrfile.create(self.path, self.variables, attributes(self.plan))
        for name, values in coordinates(self.plan).items():
            zarrfile.write_whole(self.path, name, self.variables[name], values)
        self.summarise()
        # Last: without a plan there is no store to continue.
        _write(self.inner / "plan.json", fingerprint(self.plan))

    def _take_up(self) -> None:
        refuse_another_sweep(json.loads((self.inner / "plan.json").read_text()), fingerprint(self.plan), self.path)
        zarrfile.remove_leftovers(self.path)
        journal = self.inner / "journal.jsonl"
        lines = journal.read_bytes().split(b"\n") if journal.exists() else [b""]
        if lines[-1]:  # a line that was cut off: what it said did not happen
            _write_bytes(journal, b"".join(line + b"\n" for line in lines[:-1]))
        self.journal = [json.loads(line) for line in lines[:-1]]


def trace_file(store: Path, number: int) -> Path:
    """Where the response of a trace is kept while blocks need it."""
    return store / ".lightfield" / "traces" / f"{number:06d}.npz"


def fingerprint(plan: Plan) -> dict[str, Any]:
    """All that the numbers of a store depend on."""
    texts = [i for i, a in enumerate(plan.cases.axes) if any(isinstance(v, str) for vs in a.values.values() for v in vs)]
    return {
        "scene": plan.cases.scene.model_dump(mode="json", exclude={"name", "description"}),
        "scene_digest": plan.cases.scene.digest(),
        "axes": [{"name": axis.name, "values": {k: list(v) for k, v in axis.values.items()}} for axis in plan.cases.axes],
        # Text may name a table, whose content counts as well.
        "contents": [_digest(scene) for i in texts for _, scene in plan.cases.subset([i])],
        "settings": asdict(plan.settings),
        "software": {"lightfield": __version__, "mitsuba": version("mitsuba"), "drjit": version("drjit"),
                     "store format": str(FORMAT)},
    }  # fmt: skip


def refuse_another_sweep(found: Mapping[str, Any], wanted: Mapping[str, Any], path: Path) -> None:
    """Raise when a store was made for another sweep, naming what differs.

    Raises
    ------
    OutputError
    """
    found, wanted = json.loads(json.dumps(found)), json.loads(json.dumps(wanted))
    if found == wanted:
        return
    before, now = _flat(found), _flat(wanted)
    changed = [
        f"{key} {before.get(key, 'absent')} -> {now.get(key, 'absent')}"
        for key in sorted(before.keys() | now.keys())
        if before.get(key) != now.get(key) and key not in ("scene_digest", "contents")
    ]
    text = "; ".join(change if len(change) < 100 else change[:97] + "..." for change in changed[:4])
    if len(changed) > 4:
        text += f"; and {len(changed) - 4} more"
    raise OutputError(
        f"this store belongs to another sweep ({text or 'the content of a table differs'})", where=str(path),
        rule="one store, one scene, one plan, one version", remedy="choose another name with -o, or remove the store",
    )  # fmt: skip


def layout(plan: Plan) -> dict[str, Variable]:
    """Every variable of the store."""
    cases, grid, maps = plan.cases, plan.grids[0], map_dims(plan)
    dims, shape = tuple(axis.name for axis in cases.axes), cases.shape
    quantity, units, meaning, area_units = quantity_of(plan)
    variables: dict[str, Variable] = {}
    for axis in cases.axes:
        variables |= _axis_coordinates(plan, axis)
    sizes = {maps[0]: plan.bands, **dict(zip(maps[1:], grid.shape, strict=True))}
    for name, unit, text in (
        ("wavelength_nm", "nm", "centre of the band"), ("z_m", "m", "distance of the plane from the lamp"),
        ("y_m", "m", "height above the lamp"), ("x_m", "m", "horizontal distance from the axis"),
    ):  # fmt: skip
        dim = maps[("wavelength_nm", "z_m", "y_m", "x_m").index(name)]
        along = dims if dim != name else ()
        whole = (*(shape if along else ()), sizes[dim])
        attrs = {"units": unit, "long_name": text} | ({"axis": name[0].upper()} if unit == "m" and not along else {})
        variables[name] = Variable((*along, dim), whole, whole, "f8", attrs)
    per_map = (plan.bands, *grid.shape)
    if plan.settings.maps:
        for name, text in ((quantity, meaning), (f"{quantity}_stderr", f"Monte Carlo standard error of {quantity}")):
            attrs = {"units": units, "long_name": text}
            if name == quantity:
                attrs["ancillary_variables"] = f"{quantity}_stderr"
            variables[name] = Variable((*dims, *maps), (*shape, *per_map), (*plan.chunks, *per_map), "f4", attrs)
    for name, _, unit, text in derived_variables(quantity, units, area_units):
        variables[name] = Variable(
            (*dims, *maps[:2]), (*shape, *per_map[:2]), (*plan.chunks, *per_map[:2]), "f8",
            {"units": unit, "long_name": text},
        )  # fmt: skip
    flags = {"flag_values": [0, 1, 2], "flag_meanings": " ".join(STATUS)}
    for name, dtype, attrs in (
        ("status", "i1", {"long_name": "state of the case", **flags}), ("message", MESSAGE, {"long_name": "why it failed"}),
        ("trace", "i4", {"long_name": "trace that the case was evaluated from; -1: none"}),
        ("photons", "i8", {"long_name": "photons of that trace", "units": "1"}),
        ("reached_relative_error", "f8", {"long_name": "relative standard error that 95 % of its lit cells have",
                                          "units": "1"}),
    ):  # fmt: skip
        variables[name] = Variable(dims, shape, shape, dtype, attrs)
    return variables


def derived_variables(quantity: str, units: str, area_units: str) -> list[tuple[str, str, str, str]]:
    """Name in the store, name in `derived.derive`, unit and meaning of every derived quantity."""
    told = [
        (f"on_axis_{quantity}", "on_axis", units, f"{quantity} on the axis"),
        ("plane_power", "plane_power", area_units, "integral over the plane"),
        ("half_width_m", "half_width", "m", "half width at half maximum of the spot (circle of equal area)"),
        ("formula_error_on_axis", "formula_error_axis", "1", "closed-form model over render, minus one, on the axis"),
        ("formula_error_of_power", "formula_error_power", "1", "the same for the integral over the plane"),
    ]
    errors = [(f"{name}_stderr", f"{key}_stderr", unit, f"Monte Carlo standard error of {name}")
              for name, key, unit, _ in told]  # fmt: skip
    return [entry for pair in zip(told, errors, strict=True) for entry in pair]


def quantity_of(plan: Plan) -> tuple[str, str, str, str]:
    """Name, unit and meaning of the maps, and unit of their integral over a plane."""
    varied = {q for axis in plan.cases.axes for q in axis.values.get("detector.quantity", ())}
    if not varied:
        quantity = plan.cases.scene.detector.quantity
        return quantity, *QUANTITIES[quantity], AREA_UNITS[quantity]
    if len(varied) == 1:
        quantity = varied.pop()
        return quantity, *QUANTITIES[quantity], AREA_UNITS[quantity]
    # One variable for several quantities: each in its own unit, told by the coordinate.
    units = ", ".join(f"{q}: {QUANTITIES[q][0]}" for q in sorted(varied))
    area = ", ".join(f"{q}: {AREA_UNITS[q]}" for q in sorted(varied))
    return "reading", units, "light at the detector, in the unit of its quantity", area


def map_dims(plan: Plan) -> tuple[str, str, str, str]:
    """Dimensions of a map: coordinates where all cases share them, else plain counts."""
    first = plan.grids[0]
    same = [all(np.array_equal(getattr(g, k), getattr(first, k)) for g in plan.grids) for k in ("z_m", "y_m", "x_m")]
    z, y, x = (name if ok else plain for name, plain, ok in
               zip(("z_m", "y_m", "x_m"), ("plane", "row", "column"), same, strict=True))  # fmt: skip
    bands = any("detector.bands_nm" in axis.values for axis in plan.cases.axes)
    return "band" if bands else "wavelength_nm", z, y, x


def coordinates(plan: Plan) -> dict[str, np.ndarray]:
    """Values of every coordinate."""
    cases, result = plan.cases, {}
    for axis in cases.axes:
        for path, values in axis.values.items():
            result[path] = _coordinate(values)
        if axis.name not in axis.values:
            result[axis.name] = np.arange(axis.size)
    names = dict(zip(("wavelength_nm", "z_m", "y_m", "x_m"), map_dims(plan), strict=True))
    for name, dim in names.items():
        if name == dim:
            result[name] = _places(plan.grids[0], cases.scene.detector.bands_nm)[name]
            continue
        table = [_places(_grid_of(plan, n), cases.build(n, False).detector.bands_nm)[name] for n in range(cases.count)]
        result[name] = np.array(table).reshape(*cases.shape, -1)
    return result


def attributes(plan: Plan) -> dict[str, Any]:
    """Global attributes: conventions, scene, plan, seed, software."""
    scene = plan.cases.scene
    now = datetime.now(timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")
    return {
        "Conventions": "CF-1.11",
        "title": str(scene.name or "sweep over the light field of an underwater lamp"),
        "source": f"Monte Carlo light transport, lightfield {__version__}, mitsuba {version('mitsuba')}",
        "history": f"{now} lightfield sweep",
        "orientation": "x horizontal, y up, z along the axis from the lamp; indices grow with coordinates",
        "quantity": quantity_of(plan)[0],
        "scene_toml": scene.to_toml(),
        "scene_json": json.dumps(scene.model_dump(mode="json")),
        "scene_digest": scene.digest(),
        "sweep_axes": json.dumps(fingerprint(plan)["axes"]),
        "requested_relative_error": plan.settings.rel_error,
        "photon_budget_per_trace": plan.settings.max_photons,
        "seed": plan.settings.seed,
        "traces": len(plan.traces),
        "cases": plan.cases.count,
        "lightfield_version": __version__,
        "complete": "no",
    }


def _axis_coordinates(plan: Plan, axis: Axis) -> dict[str, Variable]:
    known = plan.cases.scene.parameters()
    result = {}
    for path, values in axis.values.items():
        data = _coordinate(values)
        unit, text = COMPOUND.get(path, (known[path].unit, known[path].meaning) if path in known else ("", ""))
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


def _grid_of(plan: Plan, number: int) -> Grid:
    steps = np.unravel_index(number, plan.cases.shape)
    sizes = [plan.cases.axes[i].size for i in plan.grid_axes]
    return plan.grids[int(np.ravel_multi_index([int(steps[i]) for i in plan.grid_axes], sizes))]


def _places(grid: Grid, bands: Any) -> dict[str, np.ndarray]:
    return {"wavelength_nm": np.asarray(bands, float).mean(axis=1), "z_m": np.asarray(grid.z_m, float),
            "y_m": np.asarray(grid.y_m, float), "x_m": np.asarray(grid.x_m, float)}  # fmt: skip


def _digest(scene: Scene) -> str:
    try:
        return scene.digest()
    except OSError as error:
        return str(error)


def _flat(value: Any, prefix: str = "") -> dict[str, str]:
    if isinstance(value, dict):
        return {k: v for key, part in value.items() for k, v in _flat(part, f"{prefix}.{key}" if prefix else key).items()}
    return {prefix.removeprefix("scene."): json.dumps(value)}


def _write(path: Path, content: Any) -> None:
    _write_bytes(path, json.dumps(content, indent=1).encode())


def _write_bytes(path: Path, content: bytes) -> None:
    from lightfield.files import atomic_path

    with atomic_path(path) as temporary:
        temporary.write_bytes(content)
