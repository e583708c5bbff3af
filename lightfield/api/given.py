"""What users give: a scene or readings, or the file that holds them."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, partial, wraps
from numbers import Integral, Real
from os import PathLike, fspath
from pathlib import Path
from types import NoneType, UnionType
from typing import (
    TYPE_CHECKING,
    Literal,
    ParamSpec,
    TypeGuard,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np

from lightfield.errors import UsageError
from lightfield.readings import ErrorBudget, Readings, read_table, write_table
from lightfield.readings.columns import LAYOUT, REQUIRED
from lightfield.readings.importing.importer import import_index
from lightfield.render.limits import PHOTONS, REL_ERROR, SEED
from lightfield.scene import Scene
from lightfield.scene.effects_file import with_effects

if TYPE_CHECKING:
    from lightfield.fitting.diffuse_light import DiffuseSource

AnyPath = str | PathLike[str]
_P = ParamSpec("_P")
_R = TypeVar("_R")

#: Numbers that are taken in one range everywhere, by the argument's name: what is said, and what is so.
RANGES: Mapping[str, tuple[str, Callable[[float], bool]]] = {
    "seed": (SEED.rule, SEED.holds),
    "max_photons": (PHOTONS.rule, PHOTONS.holds),
    "rel_error": (REL_ERROR.rule, REL_ERROR.holds),
    "alpha": ("0.0005 to 0.5", lambda value: 0.0005 <= value <= 0.5),
    "half_width": ("above 0 to 100 m", lambda value: 0 < value <= 100),
    "elements": ("2 to 200", lambda value: 2 <= value <= 200),
    "box": ("0.01 to 10 m", lambda value: 0.01 <= value <= 10),
    "tilt_max": ("0 to 80 degrees", lambda value: 0 <= value <= 80),
    "spacing": ("0 to 10 m", lambda value: 0 <= value <= 10),
    # More runs side by side tell no more, and take minutes.
    "runs": ("1 to 200", lambda value: 1 <= value <= 200),
    # As follower.mission.duration_s.
    "duration": ("above 0 to 3600 s", lambda value: 0 < value <= 3600),
}


def checked(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Refuse arguments of another kind than the function's annotations say, in one sentence.

    Raises
    ------
    UsageError
        Names the argument, what was given and what is taken.
    """
    signature = inspect.signature(function)
    kinds = cache(partial(get_type_hints, function))  # not before it is called: imports stay quick

    @wraps(function)
    def call(*args: _P.args, **given: _P.kwargs) -> _R:
        for name, value in signature.bind(*args, **given).arguments.items():
            if name not in kinds():  # self
                continue
            if (rule := _broken(name, kinds()[name], value)) is not None:
                told = str(value)
                shown = value if len(told) < _SHOWN else type(value).__name__
                if told in _EMPTY:
                    shown = repr(value)
                raise UsageError("not what this argument takes", where=name, found=shown, rule=rule)
        return function(*args, **given)

    return call


#: Longer values are named by their type.
_SHOWN = 60
#: What a sentence does not show of itself.
_EMPTY = ("", "{}", "[]", "()")


def _broken(name: str, annotation: object, value: object) -> str | None:
    """The rule that a value breaks; None where it breaks none that is known here."""
    kinds = get_args(annotation) if get_origin(annotation) in (Union, UnionType) else (annotation,)
    if value is None and NoneType in kinds:
        return None
    kinds = tuple(kind for kind in kinds if kind is not NoneType)
    if PathLike[str] in kinds:
        return _broken_path(kinds, value)
    if Sequence[str] in kinds:
        fine = isinstance(value, str) or (_is_list(value) and all(isinstance(v, str) for v in _listed(value)))
        return None if fine else "a name, or a list of names"
    if len(kinds) > 1:
        return None
    (kind,) = kinds
    if kind is Readings:
        return None if isinstance(value, Readings) else "readings as `load` gives them"
    origin, inside = get_origin(kind), get_args(kind)
    if kind is bool:
        return None if isinstance(value, (bool, np.bool_)) else "True or False"
    if kind in (float, int):
        words, holds = RANGES.get(name, ("", lambda value: True))
        if not _is_number(value, Integral if kind is int else Real):
            return ", ".join(filter(None, ("a whole number" if kind is int else "a number", words)))
        return None if holds(float(value)) else words
    if origin is Literal:
        return None if value in inside else " or ".join(map(repr, inside))
    if origin is tuple:
        return _broken_tuple(inside, value)
    if origin is Mapping:
        return None if isinstance(value, Mapping) else "names with what belongs to each: {name: ...}"
    return _broken_list(inside[0], value) if origin is Sequence else None


def _broken_tuple(inside: Sequence[object], value: object) -> str | None:
    """Of so many numbers."""
    whole = inside[0] is int
    numbers, kind = _listed(value), Integral if whole else Real
    fine = len(numbers) == len(inside) and all(_is_number(v, kind) for v in numbers)
    return None if fine else f"{len(inside)} {'whole ' * whole}numbers: ({', '.join(['...'] * len(inside))})"


def _broken_list(inside: object, value: object) -> str | None:
    if inside is float:
        numbers = _listed(value)
        return None if numbers and all(_is_number(v, Real) for v in numbers) else "a list of numbers"
    if get_origin(inside) is tuple:
        pairs = [_listed(pair) for pair in _listed(value)]
        fine = all(len(pair) == 2 and all(_is_number(v, Real) for v in pair) for pair in pairs)
        return None if fine and not isinstance(value, str) else "a list of pairs, such as [(500, 550)]"
    return None if _is_list(value) else "a list"


def _broken_path(kinds: tuple[object, ...], value: object) -> str | None:
    """Of a file, or of what is in it."""
    several = Readings in kinds and Scene in kinds  # which of them it is, the function says
    if several or isinstance(value, PathLike) or (isinstance(value, str) and value):
        return None
    one = tuple(kind for kind in kinds if get_origin(kind) is not Sequence)
    if len(one) < len(kinds) and _is_list(value):
        return next(filter(None, (_broken_path(one, each) for each in _listed(value))), None)
    for kind, rule in (
        (Readings, "readings as `load` gives them, or the path of a file"),
        (Scene, "a Scene, or the path of its file"),
    ):
        if kind in kinds:
            return None if isinstance(value, kind) else rule
    for table in (one for one in kinds if isinstance(one, type) and one.__name__ == "DataFrame"):
        return None if isinstance(value, table) else "a table (DataFrame), or the path of its file"
    return "the path of a file"


def _is_number(value: object, kind: type) -> TypeGuard[Real]:
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    return isinstance(value, kind) and not np.isnan(float(value))


def _is_list(value: object) -> TypeGuard[Iterable[object]]:
    """Are there several? A scene is one, though Pydantic lets its parts be iterated over."""
    return isinstance(value, Iterable) and not isinstance(value, (str, bytes, Mapping, Scene))


def _listed(value: object) -> list[object]:
    return list(value) if _is_list(value) else []


def scene_of(scene: Scene | AnyPath, effects_file: AnyPath | None = None) -> Scene:
    """A scene, read from its file where one is named, with the effects of another file beside its own."""
    return with_effects(scene if isinstance(scene, Scene) else Scene.load(scene), effects_file)


def by_name(given: Iterable[tuple[str, str, Scene]]) -> dict[str, Scene]:
    """Scenes by what they are called.

    Parameters
    ----------
    given : iterable of (str, str, Scene)
        Where each was given, what it is called, and the scene.

    Raises
    ------
    UsageError
        Two of one name.
    """
    found: dict[str, Scene] = {}
    for where, name, scene in given:
        if name in found:
            raise UsageError(
                "two scenes of one name", where=where, found=name,
                rule="every scene has a name of its own", remedy="change the name in one of them",
            )  # fmt: skip
        found[name] = scene
    return found


def names_in(names: str | Sequence[str]) -> list[str]:
    """Names, also of one string with commas as the command line has them."""
    return [one.strip() for one in names.split(",") if one.strip()] if isinstance(names, str) else list(names)


def readings_of(
    readings: Readings | AnyPath, scene: Scene | None = None, *, layout: bool = False
) -> Readings:
    """A reading table, read from its file where one is named; of a layout the values may be absent."""
    if isinstance(readings, Readings):
        return readings
    return read_table(fspath(readings), scene, LAYOUT if layout else REQUIRED)


@checked
def load(path: AnyPath, scene: Scene | AnyPath | None = None) -> Readings:
    """Read a table of readings (CSV with a TOML head).

    Parameters
    ----------
    path : path-like
    scene : Scene or path-like, optional
        Also check against its tank, bands and quantity, and fill in its band.

    Raises
    ------
    MeasurementError
        All problems of the file, each with its line.
    """
    return read_table(fspath(path), None if scene is None else scene_of(scene))


@checked
def save(readings: Readings, path: AnyPath) -> Path:
    """Write a table of readings (CSV with a TOML head), whole or not at all; `load` reads it back.

    Parameters
    ----------
    readings : Readings
    path : path-like

    Raises
    ------
    OutputError
        It cannot be written.
    """
    write_table(readings, path)
    return Path(path)


@checked
def import_(
    index: AnyPath,
    *,
    column: Mapping[str, str] | None = None,
    quantity: str | None = None,
    units: str | None = None,
    band: Sequence[tuple[float, float]] = (),
    saturation_level: float | None = None,
    plane_gain_percent: float | None = None,
    position_mm: float | None = None,
    tolerance_percent: float | None = None,
    outlier_percent: float | None = None,
    calibration_percent: float | None = None,
) -> Readings:
    """Turn an instrument's files into one table of readings.

    Parameters
    ----------
    index : path-like
        CSV that says of every file where it was taken: file, medium, x_m, y_m, z_m, time_s, role (signal,
        dark, reference, ignore), integration_time_s, spectrum; only file and z_m are required. With a
        `column` for z_m a table of your own that has the places in it.
    column : mapping of str to str, optional
        Which column is what, by its name or number: of files of plain columns wavelength_nm, value, dark,
        reference; of a table of your own z_m, x_m, y_m, time_s, integration_time_s, medium, role, value.
    quantity : str
        irradiance, scalar_irradiance or radiance: what the head receives is not in its files.
    units : str
        Of the numbers in the files: counts, counts/s, relative, or "uW cm^-2 nm^-1" and the like.
    band : sequence of (float, float), nm
        Over which every spectrum is averaged.
    saturation_level : float, unit of the files, optional
        Full scale.
    plane_gain_percent, position_mm, tolerance_percent, outlier_percent, calibration_percent : float, optional
        Error budget: repeatability of a stay at a plane, error of positions, smooth misfit of no interest,
        part of readings spoilt by slips, error of an absolute calibration.

    Raises
    ------
    MeasurementError
        Something is not stated; or all problems of index and files, with their lines.
    """
    return import_index(
        index,
        quantity=quantity,
        units=units,
        bands_nm=list(band),
        saturation_level=saturation_level,
        columns=dict(column) if column else None,
        budget=ErrorBudget(
            plane_gain_percent,
            position_mm,
            tolerance_percent,
            outlier_percent,
            calibration_percent=calibration_percent,
        ),
    )


def diffuse_source(trace: bool, cache: bool = True) -> DiffuseSource | None:
    """Where scattered and reflected light comes from: the renderer, with its cache or without, or nowhere."""
    if not trace:
        return None
    from lightfield.render.diffuse.directed import Keeper
    from lightfield.render.diffuse.source import response_for

    return partial(response_for, keeper=Keeper(cache))
