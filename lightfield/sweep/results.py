"""Reading a sweep's store: check and open it, choose cases by value, one case as a rendering's data set."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from traceback import walk_tb
from typing import Any

import numpy as np
import xarray as xr

from lightfield.errors import Complaint, OutputError, UsageError
from lightfield.formula.own_formulas import lit
from lightfield.maps.dataset import QUANTITIES
from lightfield.scene import Scene
from lightfield.scene.messages import nearest_keys
from lightfield.sweep import journal
from lightfield.sweep.axes import apply
from lightfield.sweep.zarrfile import CONSOLIDATED, refuse_foreign_metadata

_GIVE = "give what a sweep wrote"


#: Digits to which a value may be rounded: 0.0464, as figures print it, means the step 0.046416; and those a
#: number has.
_FEWEST_DIGITS, _ALL_DIGITS = 3, 17
#: Steps that an error lists.
_SHOWN = 8


@dataclass(frozen=True)
class Soundness:
    """What a store was found to hold, all of it as it was written.

    Parameters
    ----------
    files : int
        Files that have the digest in the journal.
    blocks : int
        Blocks of cases on disk.
    complete : bool
        Whether that is all of them.
    """

    files: int
    blocks: int
    complete: bool


def verify(path: str | Path) -> Soundness:
    """Hold every file of a store against the digests in its journal; reads all of it, and decodes no chunk.

    Digests tell of damage, not of malice: the metadata must declare what a sweep writes, too.

    Raises
    ------
    OutputError
        Not a store of a sweep, or a damaged one, with all files that are.
        Metadata that ask for what a sweep does not write.
    """
    store = Path(path)
    if not (store / CONSOLIDATED).is_file() and not (store / journal.NAME).is_file():
        raise OutputError("not a sweep's store", where=str(path), remedy=_GIVE)
    if not (store / journal.NAME).is_file():
        raise OutputError(
            "this store has no journal, so nothing tells whether its numbers are right", where=str(path),
            rule=f"{journal.NAME} has a digest of every file",
            remedy="run its sweep again: it makes the damage good"
            if (store / journal.NAME).parent.is_dir()
            else "copy the store with its hidden folder, or run its sweep into another one",
        )  # fmt: skip
    for _ in range(2):  # a sweep that runs may write between the first reading of the journal and of a file
        entries, lost = journal.journal_entries(store)
        blocks = {entry["block"] for entry in entries if "block" in entry}
        expected = [entry["complete"] for entry in entries if "complete" in entry]
        problems = journal.damaged_files(store, entries)
        if (
            lost
            or (expected and len(blocks) != expected[-1])
            or not any("files" in entry for entry in entries)
        ):
            problems.insert(0, journal.NAME)
        if not problems:
            refuse_foreign_metadata(store)
            files = {name for entry in entries for name in entry.get("files", {})}
            return Soundness(len(files), len(blocks), bool(expected))
    raise OutputError(
        f"{len(problems)} file{'s' * (len(problems) > 1)} of this store damaged or missing",
        where=str(path),
        rule="every file has the digest that the journal noted",
        remedy="run its sweep again: it makes the damage good",
        problems=[
            Complaint("not as it was written" if (store / name).exists() else "missing", where=name)
            for name in problems
        ],
    )


def open_store(path: str | Path, quantity: str | None = None) -> xr.Dataset:
    """Check a store and open it; all files are read once, the values of variables on demand.

    Parameters
    ----------
    path : path-like
    quantity : str, optional
        What it must hold, instead of maps of light.

    Raises
    ------
    OutputError
        Not a store of a sweep, a damaged one, or one that declares what no sweep writes.
    """
    verify(path)
    try:
        data = xr.open_zarr(path, consolidated=True)
        for axis, values in json.loads(data.attrs["sweep_axes"]).items():
            if data[axis].dims != (axis,) or any(len(data[name]) != len(v) for name, v in values.items()):
                raise ValueError(f"axis {axis}")
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise OutputError(
            "cannot read this store", where=str(path), found=str(error), remedy="run its sweep again"
        ) from error
    held = data.attrs.get("quantity")
    if held != quantity if quantity else held not in (*QUANTITIES, "reading"):
        raise OutputError(
            "this store holds something else", where=str(path), found=str(held),
            rule=quantity or "maps of light",
            remedy="xarray opens it as it is",
        )  # fmt: skip
    rises = "wavelength_nm" not in data.dims or data.indexes["wavelength_nm"].is_monotonic_increasing
    return data if rises else data.sortby("wavelength_nm")


@contextmanager
def decoded(path: str | Path) -> Iterator[None]:
    """Name the store when what is read from it cannot be decoded; digests tell of damage, not of malice.

    Raises
    ------
    OutputError
    """
    try:
        yield
    except Exception as error:  # whatever a chunk makes the decoder raise
        modules = [frame.f_globals.get("__name__", "") for frame, _ in walk_tb(error.__traceback__)]
        if not any(name.partition(".")[0] in ("zarr", "numcodecs") for name in modules):
            raise
        raise OutputError(
            "a file of this store cannot be decoded", where=str(path), found=str(error),
            rule="Blosc, as a sweep writes it", remedy="run the sweep again, into another store",
        ) from error  # fmt: skip


def axes_of(data: xr.Dataset) -> list[str]:
    """Names of the varied dimensions, in order."""
    return list(json.loads(data.attrs["sweep_axes"]))


def chosen_cases(data: xr.Dataset, assignments: Sequence[str]) -> xr.Dataset:
    """Keep the cases with given values: `path=value`; a number may be rounded, see `step_of`.

    Raises
    ------
    UsageError
        Not an assignment, not a dimension, or a value that is not among the steps.
    """
    for text in assignments:
        name, equals, value = (part.strip() for part in text.partition("="))
        names = [*axes_of(data), "z_m", "wavelength_nm"]
        if not equals or not value:
            raise UsageError(
                "not a case",
                where="case",
                found=text,
                rule="path=value",
                remedy=f"for example {names[0]}=VALUE",
            )
        if name not in data.dims:
            raise UsageError(
                f"{name} is no dimension of this sweep", where="case", remedy=nearest_keys(name, names)
            )
        data = data.isel({name: [step_of(data[name].values, name, value)]})
    return data


def step_of(steps: np.ndarray, name: str, value: str) -> int:
    """Number of the step that a value means: it, or it rounded to three digits or more.

    Raises
    ------
    UsageError
        The value is not among the steps, or rounded so far that it means several.
    """
    if steps.dtype.kind in "fi":
        try:
            number = float(value)
        except ValueError:
            number = float("nan")
        for digits in range(_ALL_DIGITS, _FEWEST_DIGITS - 1, -1):
            meant = [k for k, step in enumerate(steps) if float(f"{step:.{digits}g}") == number]
            if len(meant) == 1:
                return meant[0]
        several = ", ".join(f"{step:g}" for step in steps[:_SHOWN]) + (", ..." if len(steps) > _SHOWN else "")
        raise UsageError(
            "no such value", where=f"case {name}", found=value, rule=several, remedy="choose one of these"
        )
    known = [str(step) for step in steps]
    if value not in known:
        raise UsageError(
            "no such value",
            where=f"case {name}",
            found=value,
            rule=", ".join(known),
            remedy="choose one of these",
        )
    return known.index(value)


def case_values(data: xr.Dataset, steps: Mapping[str, int]) -> dict[str, Any]:
    """What a case sets, by path; `steps` counts within `data`, which may be a part of the store."""
    result: dict[str, Any] = {}
    for name, values in json.loads(data.attrs["sweep_axes"]).items():
        for path, given in values.items():
            value = data[path].values[steps[name]].item()
            # What is neither number nor text stands in the coordinate as JSON.
            as_json = isinstance(value, str) and not any(isinstance(v, str) for v in given)
            result[path] = json.loads(value) if as_json else value
    return result


def case_label(values: Mapping[str, Any]) -> str:
    """Short name of a case, usable as a folder: another one for all other values."""
    return "_".join(f"{path}={_word(value)}" for path, value in values.items())


def _word(value: Any) -> str:
    """A value in a name, as short as tells it from all others."""
    if isinstance(value, float):
        short = f"{value:g}"
        return short if float(short) == value else repr(value)
    text = value if isinstance(value, str) else json.dumps(value, separators=(",", ":"))
    return re.sub(r"[%/= ]", lambda found: f"%{ord(found[0]):02X}", text)


def as_rendering(data: xr.Dataset, steps: Mapping[str, int]) -> xr.Dataset:
    """One case as the data set of a rendering, for `lightfield.maps.dataset.write_exr_planes`.

    Raises
    ------
    OutputError
        The store holds no maps, or the case has none.
    """
    name = data.attrs["quantity"]
    if name not in data:
        raise OutputError(
            "this store holds no maps",
            rule="its sweep kept the derived quantities alone",
            remedy="sweep again with maps",
        )
    values = case_values(data, steps)
    case = data.isel(dict(steps))
    if int(case.status) != 1:
        why = str(case.message.values) or "not computed yet"
        raise OutputError(f"no map of {case_label(values)}", found=why, remedy="choose another case")
    scene = lit(apply(Scene.from_toml(data.attrs["scene_toml"]), values))  # as a rendering's
    quantity = scene.detector.quantity
    dims = ("wavelength_nm", "z_m", "y_m", "x_m")
    maps = {quantity: (dims, case[name].values), f"{quantity}_stderr": (dims, case[f"{name}_stderr"].values)}
    bands = np.asarray(scene.detector.bands_nm, float)
    return xr.Dataset(
        {**maps, "wavelength_bounds_nm": (("wavelength_nm", "bound"), bands)},
        coords={dim: (dim, np.asarray(case[dim].values, float)) for dim in dims},
        attrs={
            "quantity": quantity,
            "scene_toml": scene.to_toml(),
            "scene_json": json.dumps(scene.model_dump(mode="json")),
            "scene_digest": scene.digest(),
            "lightfield_version": data.attrs["lightfield_version"],
            "seed": data.attrs["seed"],
            "photons": int(case.photons),
            "reached_relative_error": float(case.reached_relative_error),
        },
    )
