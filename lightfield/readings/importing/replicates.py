"""Spectra taken one after the other at one place become one reading with a standard error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lightfield.arrays import Array
from lightfield.readings.importing import provenance
from lightfield.readings.importing.reduction import Shot


@dataclass(frozen=True)
class BandValue:
    """What one spectrum gives in one band, before replicates are joined."""

    shot: Shot
    value: float
    dark_error: float
    saturated: bool
    darks: tuple[str, ...]


def _place(shot: Shot) -> tuple[object, ...]:
    entry = shot.entry
    return (entry.role, entry.medium, entry.x_m + 0.0, entry.y_m + 0.0, entry.z_m)


def joined_rows(
    sequence: Sequence[Shot], points: dict[tuple[int, int], BandValue], n_bands: int
) -> list[dict[str, Any]]:
    """One row for each stay at a place, exposure and band; coming back later is another reading.

    Errors of the means are told by the scatter of the repeats, here and at all other places of the band
    (`pooled_variance`).
    """
    stays: list[list[int]] = []
    for k, shot in enumerate(sequence):
        if stays and _place(shot) == _place(sequence[stays[-1][0]]):
            stays[-1].append(k)
        else:
            stays.append([k])
    stood: list[tuple[list[int], dict[str, int]]] = []
    repeats: dict[tuple[object, ...], int] = {}
    visit, plane = -1, None
    for stay in stays:
        here = (sequence[stay[0]].entry.medium, sequence[stay[0]].entry.z_m)
        visit, plane = (visit, plane) if here == plane else (visit + 1, here)
        exposures = dict.fromkeys(f"{sequence[k].exposure_s:.6g}" for k in stay)
        for exposure in exposures:
            members = [k for k in stay if f"{sequence[k].exposure_s:.6g}" == exposure]
            place = _place(sequence[members[0]])[1:]
            repeat = repeats.get(place, 0)
            repeats[place] = repeat + 1
            stood.append((members, {"repeat": repeat, "visit": visit}))
    errors = [_errors([[points[k, b] for k in members] for members, _ in stood]) for b in range(n_bands)]
    return [
        {**_row([points[k, b] for k in members], errors[b][n]), "band": b, **counted}
        for n, (members, counted) in enumerate(stood)
        for b in range(n_bands)
    ]


def _errors(stays: Sequence[Sequence[BandValue]]) -> Array:
    """Standard errors of the means of one band; nan where none can be told."""
    from lightfield.readings.importing.repeat_noise import pooled_variance  # brings SciPy

    own, mean, number = [], [], []
    for points in stays:
        values = np.array([p.value for p in points])
        with np.errstate(over="ignore", invalid="ignore"):
            differ = len(values) > 1 and np.ptp(values) > 0
            own.append(float(values.var(ddof=1)) if differ else np.nan)
            mean.append(float(values.mean()))
        number.append(len(values))
    exposures = np.array([points[0].shot.exposure_s for points in stays])
    variance = pooled_variance(np.array(mean), exposures, np.array(own), np.array(number))
    # The dark's own error is common to the replicates, so averaging does not lessen it.
    dark = [max(p.dark_error for p in points) for points in stays]
    return np.asarray(np.hypot(np.sqrt(variance / np.array(number)), dark))


def _row(points: Sequence[BandValue], stderr: float) -> dict[str, Any]:
    shots = [p.shot for p in points]
    entry = shots[0].entry
    with np.errstate(over="ignore"):
        value = float(np.mean([p.value for p in points]))
        time_s = float(np.mean([shot.time_s for shot in shots]))
    return {
        "x_m": entry.x_m, "y_m": entry.y_m, "z_m": entry.z_m, "medium": entry.medium, "role": entry.role,
        "value": value,
        "stderr": float(stderr),
        "time_s": time_s,
        "integration_time_s": shots[0].exposure_s,
        "saturated": any(p.saturated for p in points),
        "file": " + ".join(shot.entry.called for shot in shots),
        "n_spectra": str(len(points)),
        "dark": " + ".join(dict.fromkeys(name for p in points for name in p.darks)),
        "nonlinearity_corrected": provenance.one_word(s.spectrum.nonlinearity_corrected for s in shots),
        "electric_dark_corrected": provenance.one_word(s.spectrum.electric_dark_corrected for s in shots),
    }  # fmt: skip
