"""A fit report as text, after lmfit's, and as data."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from lightfield.studies.compare.readings import FitReport


def as_text(report: FitReport) -> str:
    """The report for people.

    Parameters
    ----------
    report : FitReport
    """
    kept = int(report.problem.keep.sum())
    lines = [
        "[[Model]]",
        f"    {' + '.join(['base', *(f'{c.name} ({c.form.name})' for c in report.explanation)])}, "
        f"{report.solver} solver",
        "[[Statistics]]",
        f"    readings used     = {kept} of {report.problem.layout.size}",
        f"    free parameters   = {len(report.fit.u)}",
        f"    model evaluations = {report.fit.evaluations}"
        + ("" if report.fit.converged else " (not converged)"),
        f"    chi-square        = {report.chi2:.4g}",
        f"    chi-square / dof  = {report.chi2_per_dof:.3f}",
        f"    error             = {report.error_percent:.2f} %  (rms, above 5 % of the plane's maximum)",
        f"    held out          = {report.held_out_percent:.2f} %  (each plane from the others)",
        f"    adequacy p        = {report.adequacy_p:.3f}  (is anything missing? small: yes)",
        "[[Parameters]]",
    ]
    width = max(len(path) for path in report.estimates)
    for path, e in report.estimates.items():
        error = f"+/- {e.stderr:.3g}" if e.stderr is not None else f"+/- none: {e.reason}"
        relative = f" ({100 * e.stderr / abs(e.value):.2f} %)" if e.stderr is not None and e.value else ""
        unit = "" if e.unit == "1" else f" {e.unit}"
        lines.append(f"    {path:<{width}} = {e.value:.6g}{unit} {error}{relative}")
    if report.correlations:
        lines.append("[[Correlations]] (below 0.3 not shown)")
        lines += [f"    C({a}, {b}) = {value:+.3f}" for a, b, value in report.correlations]
    for name, rows in report.where.items():
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


def as_data(report: FitReport) -> dict[str, Any]:
    """The report as plain data."""
    return {
        "effects": report.effects,
        "forms": [c.form.name for c in report.explanation],
        "solver": report.solver,
        "parameters": {path: e.model_dump() for path, e in report.estimates.items()},
        "correlations": [{"a": a, "b": b, "value": v} for a, b, v in report.correlations],
        "chi2": report.chi2,
        "dof": report.dof,
        "chi2_per_dof": report.chi2_per_dof,
        "error_percent": report.error_percent,
        "held_out_percent": report.held_out_percent,
        "adequacy_p": report.adequacy_p,
        "where": {name: [asdict(row) for row in rows] for name, rows in report.where.items()},
        "residual_percent": [float(v) for v in report.residual_percent],
        "residual_sigma": [float(v) for v in report.residual_sigma],
        "prediction": [float(v) for v in report.fit.prediction],
        "notes": report.notes,
        "scene": report.scene.to_toml(),
    }
