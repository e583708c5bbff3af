"""Traces that an experiment has asked for are remembered, so many at most."""

from __future__ import annotations

import numpy as np

from lightfield.arrays import Array
from lightfield.fitting.diffuse_light import _TRACES, remembered
from lightfield.scene import Scene


def test_the_last_traces_are_remembered_and_no_more() -> None:
    asked: list[tuple[float, float]] = []

    def source(scene: Scene, x_m: Array, share: float = 1.0) -> str:
        asked.append((float(x_m[0]), share))
        return f"light {len(asked)}"

    once = remembered(source)  # type: ignore[arg-type]
    assert once is not None
    scene = Scene.from_dict({})
    first = once(scene, np.array([0.0]), share=0.5)
    assert once(scene, np.array([0.0]), share=0.5) == first
    assert once(scene, np.array([0.0]), share=1.0) != first
    for place in range(1, _TRACES - 1):
        once(scene, np.array([float(place)]))
    assert once(scene, np.array([0.0]), share=0.5) == first
    assert len(asked) == _TRACES
    once(scene, np.array([-1.0]))
    assert once(scene, np.array([0.0]), share=0.5) == first  # it was asked for lately, others were not
    assert once(scene, np.array([0.0]), share=1.0) == f"light {_TRACES + 2}"
