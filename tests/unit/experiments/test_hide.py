"""What is hidden is what was asked for, and the truth is a possible scene."""

from __future__ import annotations

import numpy as np

from lightfield.experiments.hide import draw_effect, true_scene
from lightfield.experiments.layouts import scan
from lightfield.scene import Scene


def test_water_clearer_than_its_base_stays_possible() -> None:
    """Pure water absorbs 0.042 /m at 525 nm: a guess of 0.04 /m less must not become less than none."""
    scene = Scene.from_dict(
        {
            "water": {"base": "pure", "absorption_per_m": -0.04},
            "detector": {"planes_m": [4.5], "bands_nm": [[520, 530]]},
        }
    )
    for seed in range(8):
        assert -0.04 < true_scene(scene, {}, np.random.default_rng(seed)).water.absorption_per_m < 0


def test_a_form_of_an_effect_is_hidden_by_its_name() -> None:
    """The first form unless another is named."""
    scene, rng = Scene(), np.random.default_rng(0)
    table = scan(scene, "line", "random", rng)
    assert set(draw_effect(scene, table, "water_gradient", rng)) == {"water.gradient_per_m2"}
    assert "water.layer_absorption_per_m" in draw_effect(scene, table, "water_gradient:layer", rng)
