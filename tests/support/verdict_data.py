"""Findings of a diagnosis as data, plain but for what a test gives."""

from __future__ import annotations

from typing import Any

from lightfield.diagnosis.certainty import Certainty
from lightfield.diagnosis.verdict.parts import (
    AcceptedExplanation,
    Estimate,
    FoundEffect,
    Reason,
    Rung,
    WaterAndBeam,
)
from lightfield.diagnosis.verdict.verdict_data import VerdictData

LIGHT = WaterAndBeam(
    wavelength_nm=550.0, absorption_per_m=0.1, scattering_per_m=0.0, attenuation_per_m=0.1, hwhm_deg=4.0
)


def verdict_data(kind: str, *explanations: AcceptedExplanation, **given: Any) -> VerdictData:
    """VerdictData of that kind."""
    plain: dict[str, Any] = dict(
        verdict=kind, effects=[], explanations=list(explanations), nearest_rival=None, detection_limits={},
        unexplained_coordinate=None, ladder=[], noise_floor_percent=None, next_measurement=None, base_p=0.5,
        within_tolerance=False, tolerance_percent=1.0, errors_stated=False, errors_on_trust=False,
        determined=True, variance_scale=1.0, serial_correlation=0.0, outliers=[], saturated=[], readings=5,
    )  # fmt: skip
    return VerdictData(**plain | given)


def explanation(*effects: str, reason: Reason | None = None) -> AcceptedExplanation:
    return AcceptedExplanation(
        effects=list(effects), families=["water"] * len(effects), forms=["linear"] * len(effects), weight=0.5,
        parameters={"water.scattering_per_m": Estimate(value=0.1, reason=reason)},
        chi2_per_dof=1.0, error_percent=1.0, held_out_percent=None, adequacy_p=0.5,
    )  # fmt: skip


def effect(name: str, level: str, *alternatives: list[str], hardly_tested: bool = False) -> FoundEffect:
    return FoundEffect(
        effect=name, family="toy", form="linear", level=Certainty(level),
        parameters={f"lamp.{name}": Estimate(value=0.5, stderr=0.01)}, sigma_to_remove=12.0, gap=30.0,
        gap_named=30.0, gap_plus=20.0, rival=[], alternatives=list(alternatives), weight=0.9,
        hardly_tested=hardly_tested, with_it=LIGHT, without_it=LIGHT,
    )  # fmt: skip


def rung(removed: float | None, *effects: str) -> Rung:
    return Rung(
        label="base", effects=list(effects), error_percent=1.0, chi2_per_dof=1.0, held_out_percent=None,
        parameters={}, scene="", removed_percent=removed,
    )  # fmt: skip
