"""The ladder that is climbed by hand: a page that grows by a rung with every comparison."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from lightfield.arrays import finite
from lightfield.diagnosis.adequacy.level import ALPHA
from lightfield.diagnosis.verdict.parts import Rung
from lightfield.report.diagnosis.drawn import drawn_readings
from lightfield.report.diagnosis.figures import data_figure, residual_map
from lightfield.report.diagnosis.ladder import ladder_figure
from lightfield.report.diagnosis.single_places import measured_figure, place_map
from lightfield.report.diagnosis.view import Prediction, ReadingsView
from lightfield.report.page import PageFigure, Section, Table, page_figure, study_page, three_digits
from lightfield.studies.compare.readings import FitReport

#: How to go on where something is missing.
_WHAT_NEXT = (
    " A diagnosis (`diagnose`) of the same readings and scene looks for what it is. Another comparison "
    "(`compare`) into the same folder, with an effect of your choice, adds a rung to this page."
)


def readings_page(report: FitReport, entries: Sequence[Mapping[str, Any]], title: str) -> str:
    """Page of a comparison with readings.

    Parameters
    ----------
    report : FitReport
        The newest rung.
    entries : sequence of mapping
        The ledger's entries for these readings, oldest first.
    """
    rungs = [_rung(entry) for entry in entries]
    model, newest, floor = report.model, rungs[-1], finite(report.statistics.noise_floor_percent)
    predictions = [Prediction("base", report.base_prediction)]
    if model.effects:
        predictions.append(Prediction(newest.label, model.fit.prediction, len(model.effects)))
    readings = model.forward.readings
    view = ReadingsView(drawn_readings(readings, report.sigma, model.problem.keep), predictions)
    best = min(rungs, key=lambda rung: math.inf if rung.error_percent is None else rung.error_percent)
    verdict = (
        f"{newest.label}: error {three_digits(newest.error_percent)} %, noise floor {three_digits(floor)} %."
    )
    # Below the floor, which dim readings set, the error tells nothing of which model is better.
    tells = floor is None or newest.error_percent is None or newest.error_percent > floor
    if len(rungs) > 1 and best is not newest and tells:
        verdict += f" The lowest error so far is {three_digits(best.error_percent)} %, {best.label}."
    statistics = report.statistics
    if model.effects:
        verdict += (
            f" χ² per degree of freedom is {three_digits(statistics.chi2_per_dof)}, of the base model by the "
            f"same noise {three_digits(statistics.base_chi2_per_dof)}."
        )
    adequate = statistics.adequacy_p
    lead = [
        f"{len(rungs)} models of these readings so far, in the order in which they were tried."
        if len(rungs) > 1
        else "The first model of these readings.",
        f"Is anything missing beside the newest? p = {adequate:.2g}; small means yes."
        + _WHAT_NEXT * (adequate < ALPHA),
    ]
    parameters = [
        [path, f"{e.value:.5g}", "–" if e.stderr is None else f"{e.stderr:.2g}", e.unit, e.reason or ""]
        for path, e in report.estimates.items()
    ]
    sections = [
        _ladder(rungs, [_known(entry, "base_chi2_per_dof") for entry in entries], floor),
        Section("Readings and model", figures=_drawn(view)),
        Section(
            "What was fitted",
            tables=[
                Table(
                    "The newest rung.", ("parameter", "value", "error", "unit", "note"), parameters, (3, 4)
                )
            ],
        ),
    ]  # fmt: skip
    return study_page(title, verdict, lead, sections, model.scene.to_toml())


def _ladder(rungs: Sequence[Rung], of_base: Sequence[float | None], floor: float | None) -> Section:
    below = [  # what lies below an axis has a line for each effect
        rung.model_copy(update={"label": "\n".join(f"+ {name}" for name in rung.effects) or rung.label})
        for rung in rungs
    ]
    return Section(
        "The error, rung by rung",
        figures=[
            page_figure(
                "ladder",
                "Rms of the residual, over readings above 5 % of their plane's maximum and five errors.",
                "Error of each rung against the noise floor", ladder_figure, below, floor,
            )
        ],
        tables=[
            Table(
                "The models, in the order in which they were tried. Every fit judges the noise anew: χ² per "
                "degree of freedom compares with that of the base model beside it, not with another rung's.",
                ("rung", "error (%)", "χ² / dof", "base by the same noise", "plane held out (%)", "scene"),
                [
                    [rung.label, three_digits(rung.error_percent), three_digits(rung.chi2_per_dof),
                     three_digits(base), three_digits(rung.held_out_percent), rung.scene]
                    for rung, base in zip(rungs, of_base, strict=True)
                ],
                (5,),
            )
        ],
    )  # fmt: skip


def _drawn(view: ReadingsView) -> list[PageFigure]:
    """Readings and models; and what is left by position, where that is not one line."""
    draw, where = (measured_figure, place_map) if view.is_scattered else (data_figure, residual_map)
    seen = [
        page_figure(
            "data", "Readings, the base model and the newest rung.", "Readings and models", draw, view,
        )
    ]  # fmt: skip
    if view.scan_axis != "z_m" or view.is_scattered:
        seen.append(
            page_figure(
                "residuals", "Red: brighter than the model, blue: darker.", "Residuals by position",
                where, view, narrow=not view.is_grid,
            )
        )  # fmt: skip
    return seen


def _known(entry: Mapping[str, Any], name: str) -> float | None:
    value = entry.get(name)
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None


def _rung(entry: Mapping[str, Any]) -> Rung:
    """A rung from the ledger, whose older entries lack what newer ones say."""
    return Rung(
        label=str(entry.get("label", "?")),
        effects=list(entry.get("effects", [])),
        error_percent=_known(entry, "error_percent"),
        chi2_per_dof=float(entry.get("chi2_per_dof", math.nan)),
        held_out_percent=_known(entry, "held_out_percent"),
        parameters={},
        scene=str(entry.get("scene", "")),
        removed_percent=None,
        rendered_error_percent=None,
        rendered_stderr_percent=None,
    )
