"""Which effects there are: those of the package, and those of installed packages."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import lru_cache
from importlib.metadata import entry_points

from lightfield.errors import UsageError, did_you_mean
from lightfield.fitting.effects import air, detector, free_form, lamp, own, tank, water
from lightfield.fitting.effects.effect import Effect, Form
from lightfield.scene import Scene

ENTRY_POINT_GROUP = "lightfield.effects"

#: One module per part of the scene, in the order in which a diagnosis tries and names what they list.
_PARTS = (lamp, water, tank, detector, air)


def _from_entry_points() -> Iterable[Effect]:
    for entry in entry_points(group=ENTRY_POINT_GROUP):
        where = f"{entry.group}: {entry.name} = {entry.value}"
        try:
            found = entry.load()
            found = found() if callable(found) and not isinstance(found, Effect) else found
            listed = [found] if isinstance(found, Effect) else list(found)
        except Exception as error:  # another package's code: whatever it raises is its defect
            raise UsageError(
                "effects of another package cannot be loaded",
                where=where,
                found=f"{type(error).__name__}: {error}",
                remedy="fix or uninstall that package",
            ) from error
        for effect in listed:
            if not isinstance(effect, Effect):
                raise UsageError(
                    "an entry point gives something that is not an effect",
                    where=where,
                    found=type(effect).__name__,
                    rule="an Effect, a sequence of Effects, or a function returning one of these",
                    remedy="fix or uninstall that package",
                )
            _check_paths(effect, where)
            yield effect


def _check_paths(effect: Effect, where: str) -> None:
    """Refuse what no scene has."""
    known = Scene.from_dict({"tank": {}}).parameters()
    for path in effect.paths:
        if path not in known:
            raise UsageError(
                f"the effect {effect.name} frees a parameter that no scene has",
                where=where,
                found=path,
                remedy=did_you_mean(path, known) or "`Scene.parameters` lists them",
            )


@lru_cache(maxsize=1)
def table() -> Mapping[str, Effect]:
    """Every known effect by name: those of the package, then those of installed packages.

    Raises
    ------
    UsageError
        A third-party entry point gives something else, or a name that is already taken.
    """
    effects = {effect.name: effect for part in _PARTS for effect in part.EFFECTS}
    for effect in _from_entry_points():
        if effect.name in effects:
            raise UsageError(
                "an installed package gives an effect the name of another",
                where=ENTRY_POINT_GROUP,
                found=effect.name,
                rule="effects have names of their own",
                remedy="rename it in that package, or uninstall it",
            )
        effects[effect.name] = effect
    return effects


def curves() -> Mapping[str, Effect]:
    """Every free-form effect by name: what is tried where named effects do not suffice."""
    return {effect.name: effect for effect in free_form.EFFECTS}


def all_of(scene: Scene) -> Mapping[str, Effect]:
    """Every effect that may act in a scene by name: those of the table, and the scene's own.

    Raises
    ------
    UsageError
        An effect of the scene's own has the name of another.
    """
    known, mine = {**table(), **curves()}, {effect.name: effect for effect in own.effects_of(scene)}
    taken = sorted(known.keys() & mine.keys())
    if taken:
        raise UsageError(
            "an effect of one's own has the name of another",
            where="effect",
            found=", ".join(taken),
            rule="names that the table of effects does not have",
            remedy="rename it",
        )
    return {**table(), **mine}


def get(name: str, scene: Scene | None = None) -> Effect:
    """The effect called `name`.

    Parameters
    ----------
    scene : Scene, optional
        Whose own effects count too.

    Raises
    ------
    UsageError
        No effect has that name; the error gives the nearest, or lists those that exist.
    """
    effects = {**table(), **curves(), **({} if scene is None else all_of(scene))}
    if name not in effects:
        near = did_you_mean(name, effects)
        rule = None if near else f"one of {', '.join(effects)}"
        raise UsageError("unknown effect", found=name, rule=rule, remedy=near)
    return effects[name]


def effect_name(key: str) -> str:
    """The effect of "effect:form"."""
    return key.partition(":")[0]


def get_form(name: str, scene: Scene | None = None) -> tuple[Effect, Form]:
    """The effect and form that "effect" (its first form) or "effect:form" names; as `get`.

    Raises
    ------
    UsageError
        No effect has that name, or it has no such form.
    """
    title, _, wanted = name.partition(":")
    effect = get(title, scene)
    forms = [form for form in effect.forms if wanted in ("", form.name)]
    if not forms:
        known = ", ".join(form.name for form in effect.forms)
        raise UsageError(f"unknown form of {title}", found=wanted, rule=f"one of {known}")
    return effect, forms[0]
