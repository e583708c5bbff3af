"""Effects of the user's own are hidden like those of the table."""

from __future__ import annotations

import numpy as np

from lightfield.experiments.hide import draw_effect, true_scene
from lightfield.experiments.layouts import scan
from lightfield.fitting import effects
from lightfield.scene import Scene


def test_an_effect_of_ones_own_is_hidden_by_its_name() -> None:
    rng = np.random.default_rng(0)
    mine = {"name": "rope", "stage": "path", "formula": "1 - a*(x > x0)"}
    numbers = {"a": {"range": [0.0, 0.9], "neutral": 0.0, "typical": 0.05}, "x0": {"range": [-0.2, 0.2]}}
    scene = Scene.from_dict({"effect": [{**mine, "parameters": numbers}]})
    effects.all_of(scene)
    values = draw_effect(scene, scan(scene, "line", "random", rng), "rope", rng)
    assert set(values) == {"effect.rope.a", "effect.rope.x0"}
    truth = true_scene(scene, values, rng)
    assert truth.get("effect.rope.a") == values["effect.rope.a"] > 0
