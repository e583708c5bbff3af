"""What a best set says of the water, with its error where that is known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from analytic_readings import scene
from verdict_data import LIGHT, effect, explanation, verdict_data

from lightfield.diagnosis.verdict.best_set.found_effects import _stderr_of_attenuation, _water_and_beam
from lightfield.diagnosis.verdict.parts import Estimate, Reason
from lightfield.diagnosis.verdict.terminal import as_text
from lightfield.diagnosis.verdict.verdict import Verdict

A, B = "water.absorption_per_m", "water.scattering_per_m"


@pytest.mark.parametrize(
    ("fitted", "stderr"),
    [
        ({A: Estimate(value=0.1, stderr=0.02), "lamp.offset_x_m": Estimate(value=0.01, stderr=0.02)}, 0.02),
        # Of two that make up for each other, of one at its edge, and of what is held.
        ({A: Estimate(value=0.1, stderr=0.02), B: Estimate(value=0.05, stderr=0.02)}, None),
        ({A: Estimate(value=0.1, stderr=0.02), B: Estimate(value=0.0, reason=Reason.AT_BOUNDARY)}, None),
        ({A: Estimate(value=0.1, reason=Reason.UNDETERMINED)}, None),
        ({A: Estimate(value=0.1, stderr=0.02), B: Estimate(value=0.0, reason=Reason.HELD)}, 0.02),
    ],
)
def test_the_error_of_an_attenuation_is_that_of_the_one_value_that_moves_it(
    fitted: dict[str, Estimate], stderr: float | None
) -> None:
    values = {path: one.value for path, one in fitted.items()}
    scenes = SimpleNamespace(at=lambda there, validate: scene().with_values(there))
    light = LIGHT.model_copy(update={"attenuation_per_m": values[A] + values.get(B, 0.0)})
    fit = SimpleNamespace(paths=tuple(fitted), values=values)
    found = _stderr_of_attenuation(SimpleNamespace(scenes=scenes), fit, fitted, light)
    assert found == (None if stderr is None else pytest.approx(stderr))


def test_an_attenuation_is_told_with_its_error() -> None:
    known = LIGHT.model_copy(update={"attenuation_stderr_per_m": 0.0056})
    for light, said in ((known, "K = 0.1 ± 0.0056 1/m at 550 nm"), (LIGHT, "K = 0.1 1/m at 550 nm")):
        found = [effect("background", "certain").model_copy(update={"with_it": light})]
        data = verdict_data("identified", explanation("background"), found=found)
        assert f"\nwith all: a = 0.1, b = 0, {said}" in as_text(Verdict(**dict(data)))


def test_of_an_oval_lamp_both_half_widths_are_worked_out() -> None:
    values = {"lamp.hwhm_deg": 5.2, "lamp.ellipticity": 1.118, "lamp.ellipticity_diagonal": 0.8249}
    scenes = SimpleNamespace(at=lambda there, validate: scene().with_values(there))
    place = np.array([0.0])
    forward = SimpleNamespace(
        scenes=scenes, light=SimpleNamespace(diffuse=SimpleNamespace(wavelengths_nm=[520.0])),
        readings=SimpleNamespace(x_m=place, y_m=place, z_m=place + 3.0, medium=np.array(["water"])),
    )  # fmt: skip
    found = _water_and_beam(forward, SimpleNamespace(values=values))
    assert found.hwhm_deg == pytest.approx(5.2) and found.oval_hwhm_deg == pytest.approx(
        (4.92, 6.15), abs=0.01
    )
    alone = SimpleNamespace(values={"lamp.hwhm_deg": 5.2})
    assert _water_and_beam(forward, alone).oval_hwhm_deg is None
