"""The cases of a sweep: every combination of its axes, as scenes, by one running number."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lightfield.errors import SceneWarning
from lightfield.scene import Scene
from lightfield.scene.acts import Acts
from lightfield.scene.all_parameters import PARTS, acts_on, chosen_by
from lightfield.sweep.axes import COMPOUND, Axis, apply

#: Maps are of time 0, in water, by a detector that stands still, before anything is read out.
UNSEEN = Acts.TIME | Acts.AIR | Acts.AGEING | Acts.MOTION | Acts.READOUT


@dataclass(frozen=True)
class Cases:
    """Every combination of the axes, numbered with the last axis running fastest.

    Parameters
    ----------
    scene : Scene
        Holds whatever is not varied.
    axes : tuple of Axis
    """

    scene: Scene
    axes: tuple[Axis, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """Steps along every axis."""
        return tuple(axis.size for axis in self.axes)

    @property
    def count(self) -> int:
        """Number of cases."""
        return int(np.prod(self.shape))

    def acts(self, path: str) -> Acts:
        """What a path of an axis acts on."""
        return Acts.ABSORPTION | Acts.SCATTERING if path in COMPOUND else acts_on(path, self.scene.effect)

    def values(self, number: int) -> dict[str, Any]:
        """What case `number` sets, by path."""
        return self._set_by([int(step) for step in np.unravel_index(number, self.shape)])

    def build(self, number: int, validate: bool = True) -> Scene:
        """Scene of case `number`.

        Raises
        ------
        SceneError, UsageError
            Values that do not go together.
        """
        return apply(self.scene, self.values(number), validate)

    def subset(self, axes: Sequence[int]) -> Iterator[tuple[tuple[int, ...], Scene]]:
        """Scenes of all combinations of some axes, the others at their first step: (steps, scene)."""
        for steps in np.ndindex(*(self.axes[i].size for i in axes)):
            at = [0] * len(self.axes)
            for i, step in zip(axes, steps, strict=True):
                at[i] = step
            yield steps, self.at(at)

    def at(self, steps: Sequence[int]) -> Scene:
        """Scene of one step along every axis, its values unchecked."""
        return apply(self.scene, self._set_by(steps), validate=False)

    def _set_by(self, steps: Sequence[int]) -> dict[str, Any]:
        return {
            path: value
            for axis, n in zip(self.axes, steps, strict=True)
            for path, value in axis.at(n).items()
        }


def idle(cases: Cases) -> list[str]:
    """Which paths do nothing in any case of a sweep, each with why, for people."""
    told = []
    for path in (path for axis in cases.axes for path in axis.values if path not in COMPOUND):
        part, _, name = path.partition(".")
        if part not in PARTS:
            continue
        if not cases.acts(path) & ~UNSEEN:
            told.append(f"{path} changes no map: maps are of time 0, in water, and before any readout")
        elif name in (chosen := chosen_by(PARTS[part])):
            choice, uses = chosen[name]
            if not set(_taken(cases, f"{part}.{choice}")) & set(uses):
                told.append(f"{path} changes no map: it counts where {part}.{choice} is {' or '.join(uses)}")
    return told


def warn_of_idle(cases: Cases) -> None:
    """Warn of paths that do nothing in any case of a sweep."""
    for line in idle(cases):
        warnings.warn(line, SceneWarning, stacklevel=5)  # of who called the library's function


def _taken(cases: Cases, path: str) -> list[str]:
    """What a choice is in the cases."""
    varied = [value for axis in cases.axes for value in axis.values.get(path, ())]
    return [value for value in varied or [cases.scene.get(path)] if isinstance(value, str)]
