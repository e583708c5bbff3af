"""Readings at several wavelengths: what the base model may do with the colour of the water."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.plan import plan
from lightfield.diagnosis.problem.untestable import in_words
from lightfield.experiments.layouts import scan
from lightfield.experiments.measure import Instrument, LightAtReadings, measure
from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
from lightfield.scene import Scene
from lightfield.studies.compare.readings import fit_readings

BANDS = ((440.0, 460.0), (490.0, 510.0), (540.0, 560.0), (590.0, 610.0))


def coloured(water: Mapping[str, Any], hidden: Mapping[str, Any], seed: int = 0) -> tuple[Readings, Scene]:
    """Readings of direct light in the true water, and the scene that its experimenter believes in."""
    believed = Scene.from_dict(
        {
            "lamp": {"hwhm_deg": 4.0},
            "water": dict(water),
            "detector": {"bands_nm": BANDS, "planes_m": [2.5, 4.5, 6.5, 8.5], "width_m": 1.2},
        }
    )
    rng = np.random.default_rng(seed)
    table = scan(believed, "line", "random", rng)
    truth = believed.with_values({"lamp.hwhm_deg": 4.4, **hidden})
    light = direct_field(truth, table.x_m, table.y_m, table.z_m, table.wavelength_nm)
    measured, _ = measure(truth, table, LightAtReadings(light), Instrument(), rng)
    return measured, believed


def test_a_base_fitted_clearer_than_pure_water_is_still_a_scene() -> None:
    """A large background makes far planes too bright; the base model answers with less absorption than the
    base has, which ends where the clearest wavelength of its bands (0.0064 per m at 440 nm) has none left."""
    table, scene = coloured({"base": "pure"}, {"detector.background": 0.05})
    found = diagnose(table, scene, diffuse=None, advise=False, only=["background", "beam_tilt"])
    rung = Scene.from_toml(found.verdict.ladder[0].scene)
    assert -0.0064 < rung.water.absorption_per_m < -0.0055
    assert found.verdict.effects == ["background"]


TRUE = {"water.base": "pure", "water.absorption_per_m": 0.02, "water.cdom_440_per_m": 0.1}
ABSORPTION = {450: 0.116, 500: 0.083, 550: 0.098, 600: 0.253}


def test_the_colour_of_unknown_water_is_no_effect() -> None:
    """Water with CDOM, 0.08 to 0.25 per m; a base model with one absorption for all wavelengths would fail.

    The table: pure water of Pope and Fry (1997), 0.0092, 0.020, 0.057, 0.222 per m, 0.02 grey, and
    0.1 exp(-0.014 (w - 440)).
    """
    table, scene = coloured({"absorption_per_m": 0.1}, TRUE)
    found = diagnose(table, scene, diffuse=None, advise=False)
    assert found.verdict.verdict == "none"
    rung = found.verdict.ladder[0]
    for wavelength, truth in ABSORPTION.items():
        estimate = rung.parameters[f"water.absorption_at.{wavelength}nm"]
        assert estimate.unit == "1/m"
        assert abs(estimate.value - truth) < 4 * estimate.stderr + 0.002, wavelength
    for name in ("cdom", "chlorophyll", "sediment"):
        assert "free at every wavelength" in found.verdict.untestable[name]
    again = fit_readings(table, Scene.from_toml(rung.scene))
    assert again.statistics.error_percent == pytest.approx(rung.error_percent, rel=1e-3)


def test_an_effect_is_found_beside_the_colour() -> None:
    table, scene = coloured({"absorption_per_m": 0.1}, {**TRUE, "lamp.tilt_x_deg": 0.4})
    found = diagnose(table, scene, diffuse=None, advise=False)
    assert found.verdict.effects == ["beam_tilt"]
    assert found.verdict.explanations[0].parameters["lamp.tilt_x_deg"].value == pytest.approx(0.4, abs=0.03)


def test_plan_says_what_unknown_colour_hides() -> None:
    table, scene = coloured({"absorption_per_m": 0.1}, {})
    assert "free at every wavelength" in in_words(plan(table, scene).untestable["cdom"])
    known = scene.with_values({"water.base": "pure"})
    assert plan(table, known).limits["cdom"].reachable
