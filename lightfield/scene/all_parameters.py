"""All parameters of scenes at once: which act on a stage of the light's way, and a scene without them."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import Any

from lightfield.scene.acts import Acts
from lightfield.scene.detector import Detector
from lightfield.scene.lamp.lamp import Lamp
from lightfield.scene.listed import OWN_FIELD
from lightfield.scene.own.own_effect import OwnEffect
from lightfield.scene.parameters import Part, acts_of, fields_on, neutral_of, switched_off
from lightfield.scene.scene import Scene
from lightfield.scene.tank import Tank
from lightfield.scene.water.water import Water

PARTS: dict[str, type[Part]] = {"lamp": Lamp, "water": Water, "tank": Tank, "detector": Detector}


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


def neutral_values(what: Acts) -> dict[str, Any]:
    """Values that switch off what acts on any of these stages, by dotted path; of fields that have one."""
    return {
        f"{part}.{name}": value
        for part, model in PARTS.items()
        for name, value in neutral_of(model).items()
        if acts_of(model, name) & what
    }


@cache
def chosen_by(model: type[Part]) -> dict[str, tuple[str, tuple[str, ...]]]:
    """Fields that count beside some choices alone: the field that holds the choice, and these choices."""
    found: dict[str, tuple[str, tuple[str, ...]]] = {
        n: (use, ("table",)) for n, use in model.tables_of.items()
    }
    for name, field in model.model_fields.items():
        extra = field.json_schema_extra
        if isinstance(extra, dict) and isinstance(choices := extra.get("only_for"), list):
            use, *allowed = map(str, choices)
            found[name] = use, tuple(allowed)
    return {name: found[name] for name in model.model_fields if name in found}


def without_effect(scene: Scene) -> dict[str, str]:
    """What a scene states and a choice beside it leaves without effect, and that choice; by dotted path."""
    parts = ((name, model, getattr(scene, name)) for name, model in PARTS.items())
    return {
        f"{part}.{name}": choice
        for part, model, said in parts
        if said is not None
        for name, (choice, uses) in chosen_by(model).items()
        if name in said.model_fields_set and getattr(said, choice) not in uses
        if getattr(said, name) is not None
    }


def unused_words(scene: Scene) -> str:
    """What a scene states without effect, each with the choice beside it, as a line; or nothing."""
    told = []
    for path, choice in without_effect(scene).items():
        chosen = scene.get(f"{path.partition('.')[0]}.{choice}")
        told.append(f"{path} ({choice} is {chosen if isinstance(chosen, str) else 'peaks'})")
    return f"stated, but not used: {', '.join(told)}" if told else ""


def _reset(scene: Scene, names: dict[str, tuple[str, ...]]) -> Scene:
    changed = {}
    for part, resets in names.items():
        now = getattr(scene, part)
        if now is not None and resets:
            fields = type(now).model_fields
            changed[part] = now.model_copy(update={n: fields[n].get_default() for n in resets})
    return scene.model_copy(update=changed)
