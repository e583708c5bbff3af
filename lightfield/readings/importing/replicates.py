"""Spectra taken one after the other at one place become one reading with a standard error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lightfield.readings.importing import provenance
from lightfield.readings.importing.reduction import Shot


@dataclass(frozen=True)
class BandValue:
    """What one spectrum gives in one band, before replicates are joined.

    Parameters
    ----------
    stated : float
        Standard error that the file states of the value; NaN where it states none.
    """

    shot: Shot
    value: float
    dark_error: float
    stated: float
    saturated: bool
    darks: tuple[str, ...]


def _place(shot: Shot) -> tuple[object, ...]:
    entry = shot.entry
    return (entry.role, entry.medium, entry.x_m + 0.0, entry.y_m + 0.0, entry.z_m)


@dataclass(frozen=True)
class Stay:
    """Spectra taken in a row at one place with one exposure.

    Parameters
    ----------
    members : tuple of int
        Which of the sequence.
    repeat, visit : int
        How often the place was read before; number of the visit to its plane.
    """

    members: tuple[int, ...]
    repeat: int
    visit: int


def stays_of(sequence: Sequence[Shot]) -> list[Stay]:
    """The stays of a sequence; coming back later is another one."""
    stays: list[list[int]] = []
    for k, shot in enumerate(sequence):
        if stays and _place(shot) == _place(sequence[stays[-1][0]]):
            stays[-1].append(k)
        else:
            stays.append([k])
    stood: list[Stay] = []
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
            stood.append(Stay(tuple(members), repeat, visit))
    return stood


def joined_rows(
    stays: Sequence[Stay], points: dict[tuple[int, int], BandValue], n_bands: int
) -> list[dict[str, Any]]:
    """One row for each stay and band.

    Errors of the means are told by the scatter of the repeats, here and at all other places, and so is what
    all bands share of them (`repeat_scatter`); `restless` are those whose repeats are not like the others'.
    """
    from lightfield.readings.importing.flicker import repeat_scatter  # brings SciPy

    values = [np.array([[points[k, b].value for b in range(n_bands)] for k in s.members]) for s in stays]
    exposures = np.array([points[stay.members[0], 0].shot.exposure_s for stay in stays])
    scatter = repeat_scatter(values, exposures)
    return [
        {
            **_row([points[k, b] for k in stay.members], *scatter.of(n, b)),
            "restless": bool(scatter.restless[n, b]), "band": b, "repeat": stay.repeat, "visit": stay.visit,
        }
        for n, stay in enumerate(stays)
        for b in range(n_bands)
    ]  # fmt: skip


def _row(points: Sequence[BandValue], scatter: float, common: float) -> dict[str, Any]:
    """Of one stay and band; `scatter` and `common`: standard deviation of a repeat, and its shared part."""
    shots = [p.shot for p in points]
    entry = shots[0].entry
    with np.errstate(over="ignore"):
        value = float(np.mean([p.value for p in points]))
        time_s = float(np.mean([shot.time_s for shot in shots]))
    stated = np.array([p.stated for p in points])
    if np.isfinite(stated).all():
        scatter = float(np.sqrt(np.mean(stated**2)))
    # The dark's own error is common to the replicates, so averaging does not lessen it.
    stderr = np.hypot(scatter / np.sqrt(len(points)), max(p.dark_error for p in points))
    shared = 100 * common / np.sqrt(len(points)) / abs(value) if common > 0 and value else np.nan
    return {
        "x_m": entry.x_m, "y_m": entry.y_m, "z_m": entry.z_m, "medium": entry.medium, "role": entry.role,
        "value": value,
        "stderr": float(stderr),
        "common_percent": float(shared),
        "time_s": time_s,
        "integration_time_s": shots[0].exposure_s,
        "saturated": any(p.saturated for p in points),
        "file": " + ".join(shot.entry.called for shot in shots),
        "n_spectra": str(len(points)),
        "dark": " + ".join(dict.fromkeys(name for p in points for name in p.darks)),
        "nonlinearity_corrected": provenance.one_word(s.spectrum.nonlinearity_corrected for s in shots),
        "electric_dark_corrected": provenance.one_word(s.spectrum.electric_dark_corrected for s in shots),
    }  # fmt: skip
