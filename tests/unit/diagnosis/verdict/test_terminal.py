"""The verdict at a terminal, and its ladder."""

from __future__ import annotations

from verdict_data import explanation, verdict_data

from lightfield.diagnosis.verdict.parts import Rung, WaterAndBeam
from lightfield.diagnosis.verdict.terminal import _water_and_beam as water_and_beam
from lightfield.diagnosis.verdict.terminal import as_text
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.report.diagnosis.ladder import ladder_figure


def test_a_plane_that_is_predicted_without_any_sense_is_far_off() -> None:
    """A curve beside too few effects is bent for all it misses: of a plane left out it says 170 000 %."""
    rungs = [
        Rung(
            label=label, effects=[], error_percent=100.0, chi2_per_dof=9.0, held_out_percent=held_out,
            parameters={}, scene="",
        )
        for label, held_out in (("base", 120.0), ("+ beam_profile", 1.7e5))
    ]  # fmt: skip
    data = verdict_data("identified", explanation("background")).model_copy(update={"ladder": rungs})
    lines = as_text(Verdict(**dict(data))).splitlines()
    (far,) = (line for line in lines if line.startswith("+ beam_profile"))
    assert far.split()[-2] == "1000" and "> 1000" in far
    assert ladder_figure(rungs, None).axes[0].get_ylim()[1] < 1000


def test_a_rounding_of_none_is_none() -> None:
    """A fit that ends at clear water was said to have b = 1.388e-17."""
    of = WaterAndBeam(
        wavelength_nm=525.0, absorption_per_m=0.1, scattering_per_m=1.388e-17, attenuation_per_m=0.1,
        hwhm_deg=4.0,
    )  # fmt: skip
    assert "a = 0.1, b = 0, K = 0.1 1/m" in water_and_beam(of)
