"""Where a fitted model fails: residuals by plane, radius, wavelength and time."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from lightfield.arrays import Array, Mask
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.verdict.ladder import bright
from lightfield.readings.columns import LINE_DECIMALS


@dataclass(frozen=True)
class Where:
    """Misfit of one group of readings."""

    label: str
    readings: int
    mean_percent: float
    rms_percent: float
    mean_sigma: float
    rms_sigma: float


#: Residuals of more distances than this are told in bins of them.
MOST_PLANES = 12


@dataclass(frozen=True)
class Residuals:
    """Readings less model.

    Parameters
    ----------
    percent, sigma : array, shape (n,)
        In per cent of the model, NaN where it is dark, and in standard errors; 0 sigma where a reading does
        not count.
    where : dict of lists of Where
        By plane, radius, wavelength and time, as far as the readings have them.
    """

    percent: Array
    sigma: Array
    where: dict[str, list[Where]]

    @classmethod
    def of(cls, problem: Problem, prediction: Array, sigma: Array) -> Residuals:
        """Those of a prediction, for readings with these standard errors, both of shape (n,)."""
        difference = problem.value - prediction
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            percent = 100 * difference / prediction
        percent[~np.isfinite(percent)] = np.nan
        in_sigma = np.where(problem.keep > 0, difference / sigma, 0.0)
        return cls(percent, in_sigma, _where(problem, percent, in_sigma))


def _where(problem: Problem, per_cent: Array, in_sigma: Array) -> dict[str, list[Where]]:
    counted = bright(problem)
    out: dict[str, list[Where]] = {}
    for name, groups in _groups(problem).items():
        rows = []
        for label, members in groups:
            kept, lit = members & (problem.keep > 0), members & counted
            if not kept.any():
                continue
            s = in_sigma[kept]
            p = per_cent[lit] if lit.any() else np.array([np.nan])
            with np.errstate(over="ignore"):  # of next to no light
                rms = float(np.sqrt((p**2).mean()))
            rows.append(
                Where(
                    label,
                    int(kept.sum()),
                    float(p.mean()),
                    rms if np.isfinite(rms) else float("nan"),
                    float(s.sum() / np.sqrt(len(s))),
                    float(np.sqrt((s**2).mean())),
                )
            )
        if len(rows) > 1:
            out[name] = rows
    return out


def _groups(problem: Problem) -> dict[str, list[tuple[str, Mask]]]:
    layout = problem.layout
    out: dict[str, list[tuple[str, Mask]]] = {}
    planes = sorted(set(zip(layout.air, np.round(layout.z_m, LINE_DECIMALS), strict=True)))
    mixed = bool(layout.air.any() and not layout.air.all())
    if len(planes) > MOST_PLANES:  # single places: a table of each would say nothing
        edges = np.unique(np.quantile(layout.z_m, np.linspace(0, 1, 6)))
        out["distance"] = [
            (
                f"z = {a:.2f} to {b:.2f} m",
                (layout.z_m >= a) & ((layout.z_m < b) | (b == edges[-1]) & (layout.z_m <= b)),
            )
            for a, b in pairwise(edges)
        ]
        planes = []
    out["plane"] = [
        (
            f"z = {z:g} m" + ((" air" if air else " water") if mixed else ""),
            (np.round(layout.z_m, LINE_DECIMALS) == z) & (layout.air == air),
        )
        for air, z in planes
    ]
    radius = np.hypot(layout.x_m, layout.y_m)
    if np.ptp(radius) > 1e-6:
        edges = np.unique(np.quantile(radius, np.linspace(0, 1, 6)))
        out["radius"] = [
            (f"r = {a:.2f} to {b:.2f} m", (radius >= a) & ((radius < b) | (b == edges[-1]) & (radius <= b)))
            for a, b in pairwise(edges)
        ]
    if layout.channel.max() > 0:
        out["wavelength"] = [
            (f"{w:g} nm", layout.wavelength_nm == w) for w in np.unique(layout.wavelength_nm)
        ]
    if layout.has_time:
        minutes = (layout.time_s - layout.time_s.min()) / 60
        edges = np.linspace(0, float(minutes.max()), 6)
        out["time"] = [
            (f"t = {a:.0f} to {b:.0f} min", (minutes >= a) & ((minutes < b) | (b == edges[-1])))
            for a, b in pairwise(edges)
        ]
    return out
