"""Light is traced in the water that fits ask for, and no more often than need be."""

from __future__ import annotations

from typing import Any

import numpy as np

from lightfield.fitting.retraced import TRACES, Retraced
from lightfield.readings import Readings
from lightfield.scene import Scene


class Glow:
    """Diffuse light, the same everywhere, which denser water leaves as it is."""

    def light(self, scene: Scene, wavelengths_nm: object) -> np.ndarray:
        return np.ones((1, 6))

    def with_denser(self, other: Glow) -> Glow:
        return self


def table() -> Readings:
    return Readings.from_arrays(z_m=np.full(6, 5.0), value=np.ones(6), x_m=np.arange(6.0))


def test_light_is_traced_again_in_the_water_that_was_found() -> None:
    """Once per water: the clear trace is remembered, and each dense one is made for the one who asked."""
    asked: list[dict[str, Any]] = []

    def source(scene: Scene, *places: np.ndarray, **options: Any) -> Glow:
        asked.append(options)
        return Glow()

    scene = Scene.from_dict({"water": {"absorption_per_m": 0.1, "scattering_per_m": 0.1}})
    traces = Retraced(scene, table(), source)
    for number, forward in enumerate(traces):
        assert traces.left == TRACES - 1 - number
        forward.predict({})
        traces.asked = (2.0, None)[number]
    assert asked == [{}, {"dense_per_m": 2.0}]


def test_traces_end_where_every_fit_asks_for_another() -> None:
    """Waters that a fit wanders between are no reason to trace for ever."""
    traces = Retraced(Scene(), table(), None)
    made = []
    for forward in traces:
        made.append(forward.light.diffuse.dense_per_m)
        traces.asked = 1.0 + len(made)
    assert made == [None, *(1.0 + k for k in range(1, TRACES))]
