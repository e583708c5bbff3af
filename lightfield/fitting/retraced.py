"""Light traced again in the water that a fit has found."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from lightfield.fitting.diffuse_light import DiffuseSource, remembered
from lightfield.fitting.forward import SceneForward
from lightfield.readings import Readings
from lightfield.scene import Scene

#: Diffuse light is traced in the water that a fit asks for, until it asks for no other or so often. Chosen.
TRACES = 3


class Retraced:
    """Forward models of readings, the next traced in the water that the fit with the one before has found.

    `for forward in retraced:` a fit, which sets `asked` where it ends in water that is too dense for the
    trace. Without that, or with no trace left, it was the last.

    Parameters
    ----------
    scene, readings, diffuse
        As `SceneForward` takes them.

    Attributes
    ----------
    asked : float, optional, m^-1
        Scattering coefficient to trace next, see `DiffuseLight.to_trace`.
    left : int
        Traces that may still be asked for.
    """

    def __init__(self, scene: Scene, readings: Readings, diffuse: DiffuseSource | None) -> None:
        self._forward = partial(SceneForward, scene, readings, remembered(diffuse))
        self.asked: float | None = None
        self.left = TRACES

    def __iter__(self) -> Iterator[SceneForward]:
        for self.left in reversed(range(TRACES)):
            dense, self.asked = self.asked, None
            yield self._forward(dense_per_m=dense)
            if self.asked is None:
                return
