"""A file of effects of the user's own: the `[[effect]]` tables of a scene, apart from it."""

from __future__ import annotations

import os

from lightfield.errors import SceneError
from lightfield.scene.listed import OWN_FIELD
from lightfield.scene.scene import Scene
from lightfield.storage import inputs


def with_effects(scene: Scene, path: str | os.PathLike[str] | None) -> Scene:
    """The scene with the effects of a file beside its own.

    Parameters
    ----------
    path : path-like, optional
        TOML file with nothing but `[[effect]]` tables; without one the scene stays as it is.

    Raises
    ------
    SceneError
        Not such a file, or two effects of one name.
    """
    if path is None:
        return scene
    empty = not inputs.read_bytes(path, inputs.EFFECTS).strip()
    given = None if empty else Scene.load(path)
    others = [] if given is None else sorted(given.model_fields_set - {OWN_FIELD})
    if given is None or others or not given.effect:
        raise SceneError(
            "not a file of effects",
            where=os.fspath(path),
            found=", ".join(others) or "no effect",
            rule="[[effect]] tables and nothing else",
            remedy="leave the rest to the scene" if others else "docs/own_effects.md has an example",
        )
    own = {effect.name for effect in scene.effect}
    if twice := [effect.name for effect in given.effect if effect.name in own]:
        raise SceneError(
            "the scene has effects of these names itself",
            where=os.fspath(path),
            found=", ".join(twice),
            rule="an effect stands in the scene, or in this file",
            remedy="rename them here, or leave them out: those of the scene are considered anyway",
        )
    return scene.with_values({OWN_FIELD: (*scene.effect, *given.effect)})
