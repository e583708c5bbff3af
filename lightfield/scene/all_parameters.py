"""All parameters of scenes at once: which act on a stage of the light's way, and a scene without them."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import Any

from pydantic import BaseModel

from lightfield.scene.acts import Acts
from lightfield.scene.detector import Detector
from lightfield.scene.lamp.lamp import Lamp
from lightfield.scene.listed import OWN_FIELD
from lightfield.scene.own.own_effect import OwnEffect
from lightfield.scene.parameters import acts_of, fields_on, neutral_of, switched_off
from lightfield.scene.scene import Scene
from lightfield.scene.tank import Tank
from lightfield.scene.water.water import Water

PARTS: dict[str, type[BaseModel]] = {"lamp": Lamp, "water": Water, "tank": Tank, "detector": Detector}


@cache
def paths_on(what: Acts) -> tuple[str, ...]:
    """Dotted paths of the fields that act on any of these stages."""
    return tuple(f"{part}.{name}" for part, model in PARTS.items() for name in fields_on(model, what))


def acts_on(path: str, effects: Iterable[OwnEffect] = ()) -> Acts:
    """What the parameter at a dotted path acts on; nothing, where no scene has it.

    Parameters
    ----------
    path : str
        "water.phase.g" acts as "water.phase" does, "water.absorption_at.450nm" as "water.absorption_at".
    effects : iterable of OwnEffect
        The scene's, of one of which the path may speak.
    """
    part, name, *_ = f"{path}.".split(".")
    if part == OWN_FIELD:
        return next((effect.acts for effect in effects if effect.name == name), Acts(0))
    known = part in PARTS and name in PARTS[part].model_fields
    return acts_of(PARTS[part], name) if known else Acts(0)


def without(scene: Scene, what: Acts) -> Scene:
    """The scene with every field that acts on any of these stages at its default."""
    return _reset(scene, {part: fields_on(model, what) for part, model in PARTS.items()})


def only(scene: Scene, what: Acts) -> Scene:
    """The scene with every field that acts on none of these stages at its default, without own effects."""
    kept = {part: fields_on(model, what) for part, model in PARTS.items()}
    plain = scene.model_copy(update={OWN_FIELD: ()}) if scene.effect else scene
    return _reset(plain, {p: tuple(n for n in m.model_fields if n not in kept[p]) for p, m in PARTS.items()})


def neutral(scene: Scene, what: Acts) -> bool:
    """Is everything that acts on any of these stages, and has a neutral value, at it?"""
    parts = (scene.lamp, scene.water, scene.tank, scene.detector)
    return all(part is None or switched_off(part, what) for part in parts)


def neutral_values(*paths: str) -> dict[str, Any]:
    """The values at which fields do nothing, by dotted path."""
    named = (path.split(".") for path in paths)
    return {f"{part}.{name}": neutral_of(PARTS[part])[name] for part, name in named}


def _reset(scene: Scene, names: dict[str, tuple[str, ...]]) -> Scene:
    changed = {}
    for part, resets in names.items():
        now = getattr(scene, part)
        if now is not None and resets:
            fields = type(now).model_fields
            changed[part] = now.model_copy(update={n: fields[n].get_default() for n in resets})
    return scene.model_copy(update=changed)
