"""A fit report as text, after lmfit's, and as data."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from lightfield.arrays import jsonable
from lightfield.diagnosis.adequacy.level import ALPHA
from lightfield.diagnosis.verdict.speech import in_unit
from lightfield.studies.compare.readings import FitReport, correlations

#: Places after the point from which on powers of ten are easier to read. Chosen.
_MOST_PLACES = 7


def as_text(report: FitReport) -> str:
    """The report for people."""
    model, statistics = report.model, report.statistics
    kept = int(model.problem.keep.sum())
    base = f"  (base by the same noise: {statistics.base_chi2_per_dof:.4g})" if model.effects else ""
    missing = "something is missing" if statistics.adequacy_p < ALPHA else "no sign that anything is missing"
    lines = [
        "[[Model]]",
        f"    {' + '.join(['base', *(f'{c.name} ({c.form.name})' for c in model.explanation)])}, "
        f"{report.solver} solver",
        "[[Statistics]]",
        f"    readings used     = {kept} of {model.problem.layout.size}",
        f"    free parameters   = {len(model.fit.u)}",
        f"    model evaluations = {model.fit.evaluations}"
        + ("" if model.fit.converged else " (not converged: see the warning below)"),
        f"    chi-square        = {statistics.chi2:.4g}",
        f"    chi-square / dof  = {statistics.chi2_per_dof:.3f}{base}",
        f"    error             = {_in_percent(statistics.error_percent)}  (rms, above 5 % of the plane's "
        "maximum and five errors)",
        f"    held out          = {_in_percent(statistics.held_out_percent)}  (each plane from the others)",
        f"    adequacy p        = {statistics.adequacy_p:.3f}  ({missing})",
        "[[Parameters]]",
    ]
    width = max(len(path) for path in report.estimates)
    for path, e in report.estimates.items():
        value, error = _to_one_place(e.value, e.stderr)
        error = f"± {error}" if e.stderr is not None else f"± none: {e.reason}"
        relative = f" ({100 * e.stderr / abs(e.value):.2f} %)" if e.stderr is not None and e.value else ""
        lines.append(f"    {path:<{width}} = {in_unit(value, e.unit)} {error}{relative}")
    if found := correlations(model.fit):
        lines.append("[[Correlations]] (below 0.3 not shown)")
        lines += [f"    C({a}, {b}) = {value:+.3f}" for a, b, value in found]
    for name, rows in report.residuals.where.items():
        lines.append(f"[[Residuals by {name}]]")
        lines.append(f"    {'':<24}{'n':>5}{'mean %':>9}{'rms %':>9}{'mean/sigma':>12}{'rms/sigma':>11}")
        for row in rows:
            mark = " <" if abs(row.mean_sigma) > 3 or row.rms_sigma > 2 else ""
            mean, rms = (
                f"{v:9.2f}" if np.isfinite(v) else f"{'-':>9}" for v in (row.mean_percent, row.rms_percent)
            )
            lines.append(
                f"    {row.label:<24}{row.readings:>5}{mean}{rms}"
                f"{row.mean_sigma:>12.1f}{row.rms_sigma:>11.2f}{mark}"
            )
    return "\n".join([*lines, *report.notes])


def _to_one_place(value: float, error: float | None) -> tuple[str, str]:
    """A value and its error, both to the third digit of the error; of a value alone six digits."""
    if not error or not np.isfinite(value + error):
        return f"{value:.6g}", "" if error is None else f"{error:.3g}"
    places = 2 - int(f"{error:.2e}".split("e")[1])
    if 0 <= places <= _MOST_PLACES:
        return f"{value:.{places}f}", f"{error:.{places}f}"
    first = int(f"{max(abs(value), error):e}".split("e")[1])
    return f"{value:.{max(first + places, 0)}e}", f"{error:.2e}"


def _in_percent(value: float) -> str:
    return f"{value:.2f} %" if np.isfinite(value) else "-"


def as_data(report: FitReport) -> dict[str, Any]:
    """The report as plain data."""
    model, statistics = report.model, report.statistics
    data = {
        "effects": model.effects,
        "forms": [c.form.name for c in model.explanation],
        "solver": report.solver,
        "parameters": {path: e.model_dump() for path, e in report.estimates.items()},
        "correlations": [{"a": a, "b": b, "value": v} for a, b, v in correlations(model.fit)],
        "converged": model.fit.converged,
        **asdict(statistics),
        "chi2_per_dof": statistics.chi2_per_dof,
        "where": {name: [asdict(row) for row in rows] for name, rows in report.residuals.where.items()},
        "residual_percent": [float(v) for v in report.residuals.percent],
        "residual_sigma": [float(v) for v in report.residuals.sigma],
        "prediction": [float(v) for v in model.fit.prediction],
        "notes": report.notes,
        "assumptions": [a.as_data() for a in report.assumed],
        "cautions": [c.model_dump(mode="json") for c in report.cautions],
        "scene": model.scene.to_toml(),
    }
    return {name: jsonable(value) for name, value in data.items()}
