"""Which scene the values of a fit stand for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache

from lightfield.fitting.curves import Curves, Stated, field_of
from lightfield.fitting.parameter import is_gain
from lightfield.scene import Scene
from lightfield.scene.listed import OWN, OWN_FIELD
from lightfield.scene.own.own_effect import OwnEffect

#: So many scenes are remembered: most steps of a fit change something else. Chosen: memory alone.
REMEMBERED = 16
#: Groups of paths of which is remembered which are among others. Chosen: memory alone.
_GROUPS = 1024

Chosen = tuple[tuple[str, float], ...]


@dataclass(frozen=True, eq=False)
class SceneOfValues:
    """A scene whose parameters, and what amplitudes of curves stand for, take values.

    Parameters
    ----------
    scene : Scene
        Values that are not given are its own.
    curves : Curves
        What amplitudes of curves among the values stand for.
    """

    scene: Scene
    curves: Curves

    def at(self, values: Mapping[str, float], validate: bool = True) -> Scene:
        """The scene with these values; gains are not part of a scene."""
        return self.with_values({k: v for k, v in values.items() if not is_gain(k)}, validate)

    def with_values(self, values: Mapping[str, float], validate: bool = False) -> Scene:
        """The scene with values of its parameters, and of amplitudes of curves."""
        return self.scene.with_values(self.stated(values), validate=validate)

    def stated(self, values: Mapping[str, float]) -> Stated:
        """Values as a scene takes them: nodes of curves in place of amplitudes, effects of the user's own in
        place of their parameters."""
        out = self.curves.stated(values)
        if not self.scene.effect:
            return out
        own = tuple([item for item in out.items() if item[0].startswith(OWN)])
        if not own:
            return out
        rest = {path: value for path, value in out.items() if not path.startswith(OWN)}
        return {**rest, OWN_FIELD: self.effects(own)}

    @cached_property
    def effects(self) -> Callable[[Chosen], tuple[OwnEffect, ...]]:
        """The scene's own effects with values of their parameters: several parts of a prediction ask."""
        return lru_cache(REMEMBERED)(lambda own: self.scene.with_values(dict(own), validate=False).effect)

    def of_chosen(self, those: Chosen) -> Scene:
        """The scene with these values; those of late are remembered."""
        return self._remembered(those)

    @cached_property
    def _remembered(self) -> Callable[[Chosen], Scene]:
        return lru_cache(REMEMBERED)(lambda those: self.with_values(dict(those)) if those else self.scene)


def chosen(values: Mapping[str, float], paths: frozenset[str], own: bool = True) -> Chosen:
    """Those of the values that lie at some paths, or in effects of the user's own, in one order.

    Parameters
    ----------
    own : bool
        Count effects of the user's own as well; who does not ask them need not follow them.
    """
    return tuple([(path, values[path]) for path in _those(tuple(values), paths, own)])


@lru_cache(_GROUPS)
def _those(given: tuple[str, ...], paths: frozenset[str], own: bool) -> tuple[str, ...]:
    return tuple(sorted(path for path in given if field_of(path) in paths or (own and path.startswith(OWN))))
