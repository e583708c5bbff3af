"""A spectrometer beside a lamp that flickers: bands of a spectrum are off together, and no table says so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.verdict.cautions.caution import Warns
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.experiments.layouts import scan
from lightfield.experiments.measure import Instrument, LightAtReadings, measure
from lightfield.formula.closed_form import direct_field
from lightfield.scene import Scene

BANDS = tuple((at - 10.0, at + 10.0) for at in (450.0, 500.0, 550.0, 600.0, 650.0))
SCENE = Scene.from_dict(
    {
        "lamp": {"hwhm_deg": 6.0},
        "water": {"absorption_per_m": 0.1},
        "detector": {"planes_m": [2.0, 3.0, 4.0, 5.0], "width_m": 1.2, "bands_nm": BANDS},
    }
)


def verdict(flicker: float, seed: int, **hidden: float) -> Verdict:
    """Of readings with an error of 0.3 % of their own, and a flicker that is in their errors and not told."""
    rng = np.random.default_rng(seed)
    table = scan(SCENE, "half", "random", rng)
    table = replace(table, common_percent=np.full(len(table), 100 * flicker))
    truth = SCENE.with_values(hidden)
    light = direct_field(
        truth, table.x_m, table.y_m, table.z_m, table.wavelength_nm, table.medium, table.time_s
    )
    readings, _ = measure(truth, table, LightAtReadings(light), Instrument(0.003), rng)
    untold = replace(readings, common_percent=np.full(len(table), np.nan))
    return diagnose(untold, SCENE, diffuse=None, advise=False).verdict


@pytest.mark.parametrize("seed", range(3))
def test_a_flicker_that_no_table_states_is_no_effect(seed: int) -> None:
    """0.6 %: of five such campaigns of another simulator five had effects named, one of them certain."""
    found = verdict(0.006, seed)
    assert found.verdict == "none"
    (told,) = (c for c in found.cautions if c.warns is Warns.IN_COMMON)
    assert told.values["percent"] == pytest.approx(0.6, rel=0.35)


def test_an_effect_beside_a_flicker_is_found_with_its_size() -> None:
    found = verdict(0.006, 3, **{"lamp.offset_x_m": 0.03})
    assert found.best_set == ["beam_offset"]
    offset = found.explanations[0].parameters["lamp.offset_x_m"]
    assert offset.stderr is not None and offset.value == pytest.approx(0.03, abs=3 * offset.stderr)


def test_bands_without_one_share_nothing() -> None:
    found = verdict(0.0, 4)
    assert found.verdict == "none" and not [c for c in found.cautions if c.warns is Warns.IN_COMMON]
