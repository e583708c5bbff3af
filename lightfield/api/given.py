"""What users give: a scene or readings, or the file that holds them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING

from lightfield.readings import ErrorBudget, Readings, read_table, write_table
from lightfield.readings.columns import LAYOUT, REQUIRED
from lightfield.readings.importing.importer import import_index
from lightfield.scene import Scene
from lightfield.scene.effects_file import with_effects

if TYPE_CHECKING:
    from lightfield.fitting.light_source import DiffuseSource

AnyPath = str | PathLike[str]


def scene_of(scene: Scene | AnyPath, effects_file: AnyPath | None = None) -> Scene:
    """A scene, read from its file where one is named, with the effects of another file beside its own."""
    return with_effects(scene if isinstance(scene, Scene) else Scene.load(scene), effects_file)


def named(names: str | Sequence[str]) -> list[str]:
    """Names, also of one string with commas as the command line has them."""
    return [one.strip() for one in names.split(",") if one.strip()] if isinstance(names, str) else list(names)


def readings_of(
    readings: Readings | AnyPath, scene: Scene | None = None, *, layout: bool = False
) -> Readings:
    """A reading table, read from its file where one is named; of a layout the values may be absent."""
    if isinstance(readings, Readings):
        return readings
    return read_table(fspath(readings), scene, LAYOUT if layout else REQUIRED)


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


def light_of(trace: bool) -> DiffuseSource | None:
    """Where scattered and reflected light comes from: the renderer, or nowhere."""
    if not trace:
        return None
    from lightfield.render.diffuse.source import response_for

    return response_for
