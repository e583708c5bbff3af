"""The same experiment with the tank empty: no water, and the beam as it leaves the window into air."""

from __future__ import annotations

from lightfield.errors import SceneError
from lightfield.formula.own_formulas import lit
from lightfield.scene import Scene
from lightfield.scene.lamp.width import widened


def in_air(scene: Scene) -> Scene:
    """A scene without its water.

    Nothing absorbs or scatters, nothing lies mirrored in a surface or in panes. A flat window sends the beam
    of water n = `lamp.window_index` times as wide into air, I(theta / n) / n^2, as readings in air see it.
    On-axis intensity is what light is relative to, so the factor 1 / n^2 is left to the gain.

    Raises
    ------
    SceneError
        A window that bends the beam of an apparent source.
    """
    values: dict[str, object] = {}
    if scene.tank is not None and scene.surface_reflects:
        values |= {"tank.surface": "none"}
    if scene.pane_reflectance:
        values |= {"tank.panes": "none"}
    n = scene.lamp.window_index
    if n != 1.0:
        if scene.lamp.apparent_distance_m:
            raise SceneError(
                "the beam of this lamp in air is not known",
                where="lamp.window_index",
                found=n,
                rule="1 with an apparent source, whose place a window moves",
                remedy="give the beam as it is in air, and lamp.window_index = 1",
            )
        scene = lit(scene)
        lamp = widened(scene.lamp, n).model_copy(update={"window_index": 1.0})
        scene = scene.model_copy(update={"lamp": lamp})
    dry = scene.model_copy(update={"water": type(scene.water)()})
    return dry.with_values(values)
