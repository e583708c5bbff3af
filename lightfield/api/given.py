"""What users give: a scene or readings, or the file that holds them."""

from __future__ import annotations

from os import PathLike, fspath
from typing import TYPE_CHECKING

from lightfield.readings import Readings, read_table
from lightfield.readings.columns import LAYOUT, REQUIRED
from lightfield.scene import Scene
from lightfield.scene.effects_file import with_effects

if TYPE_CHECKING:
    from lightfield.fitting.light_source import DiffuseSource

AnyPath = str | PathLike[str]


def scene_of(scene: Scene | AnyPath, effects_file: AnyPath | None = None) -> Scene:
    """A scene, read from its file where one is named, with the effects of another file beside its own."""
    return with_effects(scene if isinstance(scene, Scene) else Scene.load(scene), effects_file)


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


def light_of(trace: bool) -> DiffuseSource | None:
    """Where scattered and reflected light comes from: the renderer, or nowhere."""
    if not trace:
        return None
    from lightfield.render.diffuse.source import response_for

    return response_for
