"""What is hidden is what was asked for, and the truth is a possible scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lightfield.experiments.hide import Secret, draw_effect, hide, true_scene
from lightfield.experiments.layouts import scan
from lightfield.experiments.measure import Instrument
from lightfield.fitting import effects
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


def test_a_true_lamp_is_one_of_a_table(tmp_path: Path) -> None:
    """The experimenter believes in a Gaussian; the readings have a flat top and nothing beyond 6 degrees."""
    table = tmp_path / "lamp.csv"
    table.write_text("angle_deg,intensity\n0,1\n5,1\n6,0\n90,0\n")
    scene = Scene.from_dict({"water": {"absorption_per_m": 0.1}, "detector": {"planes_m": [4.5, 6.0]}})
    secret = Secret(lamp=table)
    hidden = hide(scene, secret, 1, Instrument(0.002), max_photons=1e4)
    found = hidden.readings
    angle = np.degrees(np.arctan2(np.abs(found.x_m), found.z_m))
    spread = found.value * (found.x_m**2 + found.z_m**2) ** 1.5 / found.z_m
    flat, dark = (angle < 4.5) & (found.z_m < 5), angle > 6.5
    assert np.ptp(spread[flat]) < 0.05 * spread[flat].max() and flat.sum() > 5
    assert np.abs(found.value[dark]).max() < 0.01 * found.value.max() and dark.any()
    assert hidden.truth["lamp.intensity_table"] == "lamp.csv" and hidden.believed.lamp.profile == "gaussian"


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
