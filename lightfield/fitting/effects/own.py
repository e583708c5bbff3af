"""Effects of the user's own: what a scene's `[[effect]]` tables say, as entries of the table of effects."""

from __future__ import annotations

from lightfield.fitting.effects.effect import Effect, Form, Free
from lightfield.scene import Scene
from lightfield.scene.listed import OWN
from lightfield.scene.own.own_effect import STARTS, OwnEffect


def effects_of(scene: Scene) -> tuple[Effect, ...]:
    """Every effect of the user's own that a scene states, switched on or not."""
    return tuple(_effect(effect) for effect in scene.effect)


def _effect(own: OwnEffect) -> Effect:
    amplitudes, shapes = [], []
    for name, p in own.parameters.items():
        low, high = p.range
        if p.neutral is None:
            grid = tuple(low + part * (high - low) for part in STARTS)
            shapes.append(Free(f"{OWN}{own.name}.{name}", low, high, p.size, grid=grid))
        else:
            amplitudes.append(Free(f"{OWN}{own.name}.{name}", low, high, p.size))
    form = Form("formula", tuple(amplitudes), tuple(shapes))
    return Effect(own.name, own.family, (form,), own.physics, f"{own.stage}: {own.formula}", own.laboratory)
