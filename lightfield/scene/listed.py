"""Parameters that live in lists of a scene: points of a spectrum, and numbers of effects of the user's own.

"water.absorption_at.450nm" is the absorption at 450 nm, "effect.shadow.depth" the depth of an effect
`shadow`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import Any, Protocol

from lightfield.scene.own.own_effect import OwnEffect
from lightfield.scene.parameters import Parameter
from lightfield.scene.water.water import Water

_AT_FIELD = "absorption_at"
AT = f"water.{_AT_FIELD}."
OWN_FIELD = "effect"
OWN = f"{OWN_FIELD}."


class Listing(Protocol):
    """A scene, as far as its lists go."""

    @property
    def water(self) -> Water: ...

    @property
    def effect(self) -> tuple[OwnEffect, ...]: ...


def is_listed(path: str) -> bool:
    """Is it a path of something in a list?"""
    return path.startswith((AT, OWN))


def listed_parameters(scene: Listing) -> Iterator[Parameter]:
    """Every number in the lists of a scene."""
    for wavelength, value in scene.water.absorption_at:
        path, meaning = f"{AT}{wavelength:g}nm", f"absorption at {wavelength:g} nm"
        yield Parameter(path, "1/m", meaning, 0.0, 100.0, None, value)
    for effect in scene.effect:
        for name, p in effect.parameters.items():
            meaning = p.meaning or f"{name} of the effect {effect.name}"
            low, high = p.range
            path = _own_path(effect.name, name)
            yield Parameter(path, p.unit, meaning, low, high, p.neutral, p.now)


def listed_value(scene: Listing, path: str) -> float | None:
    """The number at a path, None where the scene has none."""
    return next((p.value for p in listed_parameters(scene) if p.path == path), None)


def with_listed(scene: Listing, values: Mapping[str, Any]) -> dict[str, Any]:
    """Values by path, those of lists put in their places: the whole lists.

    Raises
    ------
    KeyError
        With the path that a scene's lists have nothing at.
    """
    named = {path: value for path, value in values.items() if is_listed(path)}
    out = {path: value for path, value in values.items() if path not in named}
    if not named:
        return out
    of_effects = set[str]().union(
        *(_own_paths(effect.name, tuple(effect.parameters)) for effect in scene.effect)
    )
    points = {w: f"{AT}{w:g}nm" for w, _ in scene.water.absorption_at}
    missing = next((path for path in named if path not in of_effects and path not in points.values()), None)
    if missing is not None:
        raise KeyError(missing)
    if not named.keys().isdisjoint(points.values()):
        out[AT[:-1]] = tuple((w, named.get(points[w], value)) for w, value in scene.water.absorption_at)
    if not named.keys().isdisjoint(of_effects):
        out[OWN_FIELD] = tuple(_changed(effect, named) for effect in scene.effect)
    return out


@lru_cache(4096)
def _own_path(effect: str, name: str) -> str:
    return f"{OWN}{effect}.{name}"


@lru_cache(4096)
def _own_paths(effect: str, names: tuple[str, ...]) -> frozenset[str]:
    return frozenset(_own_path(effect, name) for name in names)


def _changed(effect: OwnEffect, named: Mapping[str, Any]) -> OwnEffect:
    parameters = effect.parameters
    if named.keys().isdisjoint(_own_paths(effect.name, tuple(parameters))):
        return effect
    values = {name: named.get(_own_path(effect.name, name)) for name in parameters}
    new = {
        name: parameters[name].model_copy(update={"value": value})
        for name, value in values.items()
        if value is not None
    }
    return effect.model_copy(update={"parameters": parameters | new}) if new else effect
