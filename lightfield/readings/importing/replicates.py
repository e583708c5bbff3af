"""Spectra taken one after the other at one place become one reading with a standard error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lightfield.arrays import Array, Mask
from lightfield.readings.importing import provenance
from lightfield.readings.importing.reduction import Shot
from lightfield.readings.load_warning import LoadWarning, Remarks

#: So many degrees of freedom tell what bands have in common, and so many errors of it are no chance.
FEWEST, SIGMAS = 8, 3.0


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

    Errors of the means are told by the scatter of the repeats, here and at all other places of the band
    (`pooled_variance`); `restless` are those whose repeats are not like the others'.
    """
    errors = [_errors([[points[k, b] for k in stay.members] for stay in stays]) for b in range(n_bands)]
    return [
        {
            **_row([points[k, b] for k in stay.members], errors[b][0][n]), "restless": bool(errors[b][1][n]),
            "band": b, "repeat": stay.repeat, "visit": stay.visit,
        }
        for n, stay in enumerate(stays)
        for b in range(n_bands)
    ]  # fmt: skip


def alike_in_bands(
    stays: Sequence[Stay], points: dict[tuple[int, int], BandValue], n_bands: int, known_percent: float
) -> LoadWarning | None:
    """Says that repeats scatter alike in all bands, more than is said of a stay.

    A lamp that flickers does so to a whole spectrum; the table has an error for every band by itself.

    Parameters
    ----------
    known_percent : float, %
        What the error budget says of a stay, common to its bands.
    """
    scatter, freedom, count = np.zeros((n_bands, n_bands)), 0, 0
    every = [np.array([[points[k, b].value for b in range(n_bands)] for k in stay.members]) for stay in stays]
    several = [values for values in every if len(values) > 1 and np.isfinite(values).all()]
    if n_bands < 2 or not several:
        return None
    middle = np.median([values.mean() for values in several])
    for values in several:  # the brighter half of them: the rest has other noise, too
        mean = values.mean(axis=0)
        if values.mean() >= middle and (mean > 0).all():
            off = values / mean - 1
            scatter, freedom, count = scatter + off.T @ off, freedom + len(values) - 1, count + 1
    if freedom < FEWEST:
        return None
    alone = float(np.trace(scatter)) / n_bands / freedom
    pairs = n_bands * (n_bands - 1)
    common = float(scatter.sum() - np.trace(scatter)) / pairs / freedom
    per_stay = freedom / count + 1
    percent = 100 * float(np.sqrt(max(common, 0.0) / per_stay))
    if common < SIGMAS * alone / np.sqrt(freedom) or percent <= known_percent:
        return None
    return LoadWarning(Remarks.ALIKE_IN_BANDS, {"percent": percent, "part": 100 * common / alone})


def _errors(stays: Sequence[Sequence[BandValue]]) -> tuple[Array, Mask]:
    """Standard errors of the means of one band, nan where none can be told, and which places are restless."""
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
    variance, restless = pooled_variance(np.array(mean), exposures, np.array(own), np.array(number))
    # The dark's own error is common to the replicates, so averaging does not lessen it.
    dark = [max(p.dark_error for p in points) for points in stays]
    return np.hypot(np.sqrt(variance / np.array(number)), dark), restless


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
