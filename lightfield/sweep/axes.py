"""What a sweep varies: ranges on the command line or in a plan file, one axis per dimension of the result."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from lightfield.errors import LightfieldError, SceneError, UsageError
from lightfield.scene import Scene
from lightfield.storage import inputs, toml

# Two numbers that people vary and that a scene does not hold: they set absorption and scattering together.
ATTENUATION, ALBEDO = "water.attenuation_per_m", "water.single_scattering_albedo"
COMPOUND = {
    ATTENUATION: ("1/m", "beam attenuation coefficient c = a + b"),
    ALBEDO: ("1", "single-scattering albedo b / c"),
}
_COMPOUND_SETS = ("water.absorption_per_m", "water.scattering_per_m")
FORMS = "start:stop:count, start:stop:count:log, or value,value,..."


@dataclass(frozen=True)
class Axis:
    """One dimension of a sweep.

    Parameters
    ----------
    name : str
        Name of the dimension: the parameter's dotted path, or a name of its own for several together.
    values : mapping of str to tuple
        For every path it sets, one value per step; all of one length.
    """

    name: str
    values: Mapping[str, tuple[Any, ...]]

    @property
    def size(self) -> int:
        """Number of steps."""
        return len(next(iter(self.values.values())))

    def at(self, step: int) -> dict[str, Any]:
        """Values of one step, by path."""
        return {path: values[step] for path, values in self.values.items()}


def parse_axis(text: str, where: str = "range") -> Axis:
    """Axis from `PATH=RANGE` as on the command line.

    Parameters
    ----------
    text : str
        `water.scattering_per_m=0:0.5:11`, `...=0.01:1:9:log` or `tank.wall_albedo=0,0.2,0.4`.
    where : str
        What errors call the place of the text.

    Raises
    ------
    UsageError
        Not of that form.
    """
    path, equals, given = (part.strip() for part in text.partition("="))
    if not equals or not path or not given:
        raise UsageError("not a range", where=where, found=text, rule="path=range", remedy=f"give {FORMS}")
    if set(given) & set("[{"):
        raise UsageError(
            "lists and tables are varied in a plan file",
            where=f"{where} {path}",
            found=given,
            rule=FORMS,
            remedy="a plan file with a [[vary]] table: path, and values = [...] of these",
        )
    parts = given.split(":")
    if len(parts) == 1:
        try:
            values = [toml.value(word) for word in given.split(",")]
        except ValueError as error:
            raise UsageError("not a value", where=f"{where} {path}", found=given, rule=str(error)) from error
        return axis_of(path, {path: values}, f"{where} {path}")
    scale = parts[3] if len(parts) == 4 else "linear"
    try:
        start, stop, count = float(parts[0]), float(parts[1]), int(parts[2])
        if len(parts) > 4:
            raise ValueError
    except (ValueError, IndexError):
        what = "write decimals with a point" if "," in given else "say how many values"
        remedy = f"{what}, as in {':'.join(parts[:2]).replace(',', '.')}:11"
        raise UsageError(
            "not a range", where=f"{where} {path}", found=given, rule=FORMS, remedy=remedy
        ) from None
    return axis_of(path, {path: span(start, stop, count, scale, f"{where} {path}")}, f"{where} {path}")


def span(start: float, stop: float, count: int, scale: str = "linear", where: str = "range") -> list[float]:
    """Evenly spaced values, both ends included; `scale` "log" spaces their logarithms.

    Raises
    ------
    UsageError
        An impossible range.
    """
    if scale not in ("linear", "log"):
        raise UsageError(
            "unknown scale", where=where, found=scale, rule="linear or log", remedy="leave it out, or say log"
        )
    if not 1 <= count <= 100_000 or (count == 1 and start != stop):
        raise UsageError(
            "impossible count",
            where=where,
            found=count,
            rule="2 to 100000 values between two ends",
            remedy="give another count, or the one value alone",
        )
    if not (math.isfinite(start) and math.isfinite(stop)):
        raise UsageError(
            "not a range", where=where, found=f"{start}:{stop}", rule="finite ends", remedy="give two numbers"
        )
    if scale == "log" and not (start > 0 and stop > 0):
        raise UsageError(
            "not a log range", where=where, found=f"{start}:{stop}", rule="both ends above 0",
            remedy="begin above 0, or leave out log",
        )  # fmt: skip
    steps = np.geomspace(start, stop, count) if scale == "log" else np.linspace(start, stop, count)
    # Twelve digits: 0.30000000000000004 would be an ugly coordinate.
    return [float(f"{value:.12g}") for value in steps]


def read_plan(path: str | Path) -> tuple[list[Axis], dict[str, Any]]:
    """Axes and settings from a plan file (TOML).

    Each `[[vary]]` has `path` and either `values` or `start`, `stop`, `count` (and `scale = "log"`); or
    `name` and `together`, a table of paths with lists of equal length. `[settings]` may set rel_error,
    max_photons, seed, maps.

    Raises
    ------
    UsageError
        Not readable, not TOML, or not a plan.
    """
    where = str(path)
    try:
        data = toml.loads(inputs.read_utf8(path, inputs.PLAN, "TOML"))
    except ValueError as error:
        raise UsageError(f"not TOML: {error}", where=where, remedy="correct that line") from error
    wrong = sorted(set(data) - {"vary", "settings"})
    for name, kind in (("vary", list), ("settings", dict)):
        wrong += [] if isinstance(data.get(name, kind()), kind) else [name]
    if wrong:
        raise UsageError("not a plan", where=where, found=", ".join(wrong), rule="[[vary]] and [settings]")
    axes = [
        _planned(entry, f"{where}, [[vary]] number {n}") for n, entry in enumerate(data.get("vary", []), 1)
    ]
    return axes, dict(data.get("settings", {}))


def _planned(entry: Any, where: str) -> Axis:
    keys = set(entry) if isinstance(entry, dict) else set()
    name = entry.get("name", entry.get("path")) if keys else None
    if not isinstance(name, str):
        raise UsageError(
            "not a range", where=where, found=entry, rule="a table with a path or a name, in quotes"
        )
    if {"name", "together"} == keys and isinstance(entry["together"], dict) and entry["together"]:
        return axis_of(name, entry["together"], where)
    if {"path", "values"} == keys and isinstance(entry["values"], list):
        return axis_of(name, {name: entry["values"]}, where)
    if {"path", "start", "stop", "count"} <= keys <= {"path", "start", "stop", "count", "scale"}:
        start, stop, count = entry["start"], entry["stop"], entry["count"]
        if all(isinstance(v, int | float) for v in (start, stop)) and isinstance(count, int):
            values = span(float(start), float(stop), count, str(entry.get("scale", "linear")), where)
            return axis_of(name, {name: values}, where)
    raise UsageError(
        "not a range",
        where=where,
        found=", ".join(sorted(keys)),
        rule="path with values; path with start, stop, count (and scale); or name with together",
    )


def axis_of(name: str, values: Mapping[str, Any], where: str) -> Axis:
    """A dimension from lists of values by path.

    Raises
    ------
    UsageError
        Not a name, lists of unequal length, or a value twice.
    """
    if not name or "/" in name or name.startswith("."):
        raise UsageError(
            "not a name of a dimension",
            where=where,
            found=name,
            rule="it names a folder of the store: no slash, and no dot in front",
        )
    lengths = {len(v) if isinstance(v, list) else 0 for v in values.values()}
    if len(lengths) != 1 or 0 in lengths:
        raise UsageError(
            "lists of unequal length, or none",
            where=where,
            rule="one value per step for every path",
            remedy="give every path a list of as many values",
        )
    steps = [_hashable(list(step)) for step in zip(*values.values(), strict=True)]
    if len(set(steps)) < len(steps):
        raise UsageError(
            "a value stands twice", where=where, rule="every value once", remedy="drop the double"
        )
    return Axis(name, {path: tuple(v) for path, v in values.items()})


def _hashable(value: Any) -> Any:
    """Equal for equal values, and fit for a set."""
    if isinstance(value, dict):
        return frozenset((key, _hashable(part)) for key, part in value.items())
    return tuple(map(_hashable, value)) if isinstance(value, list | tuple) else value


def checked_axes(axes: Sequence[Axis], scene: Scene) -> list[Axis]:
    """The same axes, whole numbers where the scene wants them; every value is tried in the scene on its own.

    Raises
    ------
    UsageError
        No axis, two that set the same parameter, or a part of a scene as a whole.
    SceneError
        An unknown path, or a value that the parameter cannot have.
    """
    if not axes:
        raise UsageError("nothing is varied", remedy=f"a parameter and its range: {FORMS}; or a plan file")
    paths = [path for axis in axes for path in axis.values]
    whole = next((path for path in paths if path in Scene.model_fields), None)
    if whole is not None:
        raise UsageError(
            "not a parameter",
            found=whole,
            rule="the path of one parameter, such as lamp.hwhm_deg",
            remedy="vary what changes in it; a plan file varies several parameters together",
        )
    # Names of coordinates: of paths, and of axes that set several.
    names = [name for axis in axes for name in {axis.name, *axis.values}]
    for double in sorted({name for name in names if names.count(name) > 1}):
        raise UsageError(
            "varied twice",
            found=double,
            rule="one axis per parameter",
            remedy="write all its values into one",
        )
    compound = [path for path in paths if path in COMPOUND]
    for path in paths:
        if compound and path in _COMPOUND_SETS:
            raise UsageError(
                "both set absorption and scattering",
                found=f"{path} and {compound[0]}",
                rule="vary one pair or the other",
            )
    result = []
    for axis in axes:
        values = {
            path: tuple(_as_declared(scene, path, v) for v in given) for path, given in axis.values.items()
        }
        for path, given in values.items():
            _check_range(scene, path, given)
        result.append(Axis(axis.name, values))
        _check_alone(scene, result[-1])
    return result


def _check_range(scene: Scene, path: str, values: Sequence[Any]) -> None:
    known = scene.parameters().get(path)
    if known is None and path not in COMPOUND:
        return
    for value in values:
        if known is not None:
            allowed, rule = isinstance(value, int | float) and known.allows(value), known.range
        else:
            most = 1.0 if path == ALBEDO else math.inf
            allowed, rule = isinstance(value, int | float) and 0 <= value <= most, f"0 to {most:g}"
        if not allowed:
            what = "impossible value" if isinstance(value, int | float) else "not a number"
            raise SceneError(what, where=path, found=value, rule=rule, remedy="vary it in that range")


def _check_alone(scene: Scene, axis: Axis) -> None:
    """One step at least must work with the scene as it is; another may need what a second axis sets, but not
    a value that no scene has."""
    problem: LightfieldError | None = None
    works = False
    for step in range(axis.size):
        values = axis.at(step).values()
        if works and not any(isinstance(value, str | dict) for value in values):
            continue  # ranges of numbers are checked before
        try:
            apply(scene, axis.at(step))
            works = True
        except LightfieldError as error:
            if any(_is_about(error, value) for value in values):
                raise
            problem = problem or error
    if problem is not None and not works:
        raise problem


def _is_about(error: LightfieldError, value: Any) -> bool:
    """Does it name a word or a table itself, and not what has to go with it?"""
    if isinstance(value, dict):
        return bool(error.found == value)
    found = error.found.values() if isinstance(error.found, dict) else (error.found,)
    return isinstance(value, str) and value in found


def _as_declared(scene: Scene, path: str, value: Any) -> Any:
    """Floats for numbers, whole numbers where the parameter is one, tuples for lists."""
    if isinstance(value, list | tuple):
        return tuple(_as_declared(scene, path, part) for part in value)
    if isinstance(value, str):
        return _as_spelled(scene, path, value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return value
    current = None if path in COMPOUND else scene.get(path)
    if isinstance(current, int) and not isinstance(current, bool) and float(value).is_integer():
        return int(value)
    return float(value)


def _as_spelled(scene: Scene, path: str, name: str) -> str:
    """A name as the scene spells it, whatever the case it is written in."""
    try:
        found = scene.with_values({path: name}).get(path)
    except LightfieldError:
        return name  # refused where it is tried, or possible beside another axis alone
    return found if isinstance(found, str) and found.lower() == name.lower() else name


def apply(scene: Scene, values: Mapping[str, Any], validate: bool = True) -> Scene:
    """The scene with these values, compound ones included.

    Raises
    ------
    SceneError, UsageError
        As `Scene.with_values`; or an impossible single-scattering albedo.
    """
    values = dict(values)
    if ATTENUATION in values or ALBEDO in values:
        a, b = (float(scene.get(path)) for path in _COMPOUND_SETS)
        c = float(values.pop(ATTENUATION, a + b))
        albedo = float(values.pop(ALBEDO, b / (a + b) if a + b else 0.0))
        if not 0 <= albedo <= 1 or c < 0:
            raise UsageError(
                "impossible water",
                where=f"{ATTENUATION}, {ALBEDO}",
                found=(c, albedo),
                rule="attenuation from 0, albedo 0 to 1",
            )
        values |= {_COMPOUND_SETS[0]: c * (1 - albedo), _COMPOUND_SETS[1]: c * albedo}
    if not validate:
        values = {path: _made(scene, path, value) for path, value in values.items()}
    return scene.with_values(values, validate=validate)


def _made(scene: Scene, path: str, value: Any) -> Any:
    """What a table, or a list of tables, stands for in the scene, as a phase function; else the value."""
    parts = value if isinstance(value, tuple) else (value,)
    if not any(isinstance(part, dict) for part in parts):
        return value
    above, _, name = path.rpartition(".")
    try:
        return TypeAdapter(type(scene.get(above)).model_fields[name].annotation).validate_python(value)
    except (ValidationError, KeyError):
        return value  # its case says why it cannot be
