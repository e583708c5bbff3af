"""From instrument files and an index to one reading table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import timedelta
from os import PathLike, fspath
from typing import Any

import numpy as np

from lightfield.arrays import Array, Mask
from lightfield.errors import Complaint, MeasurementError
from lightfield.readings import units
from lightfield.readings.columns import COLUMNS, ErrorBudget
from lightfield.readings.importing import places, provenance, reduction, saturation
from lightfield.readings.importing.index import IndexLine, read_index
from lightfield.readings.importing.reduction import Shot
from lightfield.readings.importing.replicates import BandValue, joined_rows, stays_of
from lightfield.readings.importing.request import BandLimits, check_meanings, has_places, settle_request
from lightfield.readings.instruments import labels
from lightfield.readings.instruments.formats import read_spectra
from lightfield.readings.instruments.oddity import Odd
from lightfield.readings.instruments.spectrum import Spectrum
from lightfield.readings.load_warning import LoadWarning, Remarks
from lightfield.readings.problems import Problems
from lightfield.readings.readings import Readings
from lightfield.readings.units import is_absolute

#: So many names are listed in a message.
_SHOWN = 8


def import_index(
    path: str | PathLike[str],
    *,
    quantity: str | None,
    units: str | None,
    bands_nm: BandLimits,
    saturation_level: float | None = None,
    budget: ErrorBudget | None = None,
    columns: Mapping[str, str] | None = None,
) -> Readings:
    """One reading table from the spectra that an index lists.

    Counts are freed of their dark signal and divided by the exposure; every spectrum is averaged over the
    bands; spectra taken in a row at one place and exposure become one reading with the standard error of
    their mean.

    Parameters
    ----------
    path : path-like
        Index CSV: file, medium, x_m, y_m, z_m, time_s, role, integration_time_s.
    quantity : str
        One of QUANTITIES: what the instrument's head receives is not in its files.
    units : str
        Unit of the numbers in the files: "counts", "counts/s", "relative", or of irradiance or radiance.
    bands_nm : sequence of (float, float), nm
    saturation_level : float, unit of the files
        Full scale, when known.
    budget : ErrorBudget, optional
        Goes into the head of the table.
    columns : mapping of str to str, optional
        Which column is what, by its name or number: `wavelength_nm`, `value`, `dark`, `reference` of files
        of plain columns. With `z_m` among them `path` is no index but a table with the places in it.

    Raises
    ------
    MeasurementError
        Something is not stated; or all problems of index and files, with their lines.
    """
    where = fspath(path)
    unit = settle_request(quantity, units, bands_nm, saturation_level)
    problems = Problems(where)
    notes: list[LoadWarning] = []
    unusable = places.UNUSABLE if has_places(columns) else "not a usable index"
    check_meanings(columns or {}, problems)
    problems.raise_any(unusable)
    if columns and has_places(columns):
        shots, notes = places.read_places(where, columns, bands_nm, problems)
    else:
        entries, unknown = read_index(path, problems)
        shots = _read_files(entries, problems, columns)
        notes = [LoadWarning(Remarks.UNKNOWN_COLUMNS, {"columns": unknown})] if unknown else []
    shots = _settle(shots, unit == "counts", problems)
    if not is_absolute(unit):
        _check_one_instrument(shots, problems)
    problems.raise_any(unusable)
    shots, time_note = _times(shots)
    notes += [] if time_note is None else [time_note]
    darks = [shot for shot in shots if shot.entry.role == "dark"]
    sequence = _in_order([shot for shot in shots if shot.entry.role in ("signal", "reference")])
    lit_s = np.sort([shot.time_s for shot in sequence])
    points: dict[tuple[int, int], BandValue] = {}
    flat: dict[str, float] = {}
    for k, shot in enumerate(sequence):
        saturated, top = saturation.saturated_pixels(shot.spectrum, saturation_level)
        if top is not None:
            flat[shot.entry.called] = top
        try:
            found = _in_bands(shot, darks, lit_s, unit, bands_nm, saturated)
        except ValueError as error:
            problems.add(f"{shot.entry.called}: {error}", place=shot.entry.line)
        else:
            points |= {(k, b): one for b, one in enumerate(found)}
    problems.raise_any(unusable)
    notes += provenance.doubts_of_files(sequence, darks, unit, flat)
    stays = stays_of(sequence)
    rows = joined_rows(stays, points, len(bands_nm))
    if flickering := [row["common_percent"] for row in rows if row["common_percent"] > 0]:
        notes.append(LoadWarning(Remarks.COMMON_FLICKER, {"percent": float(np.median(flickering))}))
    restless = tuple(k for k, row in enumerate(rows, 1) if row["restless"])
    notes += [LoadWarning(Remarks.RESTLESS, {"readings": restless})] if restless else []
    single = provenance.single_spectra([row["n_spectra"] for row in rows], [row["stderr"] for row in rows])
    notes += [single] if single else []
    metadata = provenance.metadata_of(sequence, darks, unit, bands_nm, saturation_level, notes)
    return _table(rows, where, str(quantity), unit, bands_nm, budget or ErrorBudget(), metadata, notes)


def _read_files(
    entries: Sequence[IndexLine], problems: Problems, columns: Mapping[str, str] | None
) -> list[Shot]:
    shots = []
    for entry in entries:
        if entry.role == "ignore":
            continue
        try:
            spectra = read_spectra(entry.path, columns)
        except MeasurementError as error:
            for one in error.problems or (Complaint(error.what, error.found, error.rule, error.remedy),):
                problems.found.append(replace(one, what=f"{entry.file}: {one.head}", lines=(entry.line,)))
            continue
        chosen = _chosen(entry, spectra, problems)
        for number, spectrum in enumerate(chosen, 1):
            named = entry if len(chosen) == 1 else replace(entry, number=number)
            wet = _immersed(spectrum) if entry.medium == "water" else spectrum
            shots.append(Shot(named, wet, spectrum.integration_time_s, entry.time_s))
    return shots


def _chosen(entry: IndexLine, spectra: Sequence[Spectrum], problems: Problems) -> list[Spectrum]:
    """Those of a file's spectra that the index means: repetitions at one place, never unlike ones."""
    names = list(dict.fromkeys(spectrum.label for spectrum in spectra))
    if entry.spectrum:
        chosen = [s for s in spectra if s.label == entry.spectrum]
        if not chosen and len(spectra) == 1 and not spectra[0].label:
            chosen = list(spectra)
        if not chosen:
            told = ", ".join(filter(None, names[:_SHOWN]))
            problems.add(
                f"{entry.file}: no such spectrum", place=entry.line, found=entry.spectrum,
                rule=f"one of {told}" if told else "its spectra have no names",
                remedy=f"{'correct the' if told else 'leave out this'} spectrum in the index",
            )  # fmt: skip
        return chosen
    if len(names) > 1:
        problems.add(
            f"{entry.file}: it holds unlike spectra", place=entry.line, found=", ".join(names[:_SHOWN]),
            rule="a line of the index for each", remedy="name one in a column spectrum of the index",
        )  # fmt: skip
        return []
    return list(spectra)


def _immersed(spectrum: Spectrum) -> Spectrum:
    """The numbers as they are with the head in water."""
    if spectrum.immersion is None:
        return spectrum
    return replace(spectrum, columns={"value": spectrum.columns["value"] * spectrum.immersion})


def _settle(shots: Sequence[Shot], needed: bool, problems: Problems) -> list[Shot]:
    """Exposures from header or index, which must not contradict each other."""
    out = []
    for shot in shots:
        stated, header = shot.entry.integration_time_s, shot.exposure_s
        if (
            np.isfinite(stated)
            and np.isfinite(header)
            and abs(stated - header) > reduction.SAME_EXPOSURE * header
        ):
            problems.add(
                "the index and the file state different exposures",
                place=shot.entry.line,
                found=f"{stated:g} s and {header:g} s of {shot.entry.called}",
                remedy="give integration_time_s in seconds, or leave it blank: the file's is taken then",
            )
        exposure = header if np.isfinite(header) else stated
        if needed and not np.isfinite(exposure):
            told = next(
                (note for note in shot.spectrum.notes if note.odd is Odd.EXPOSURE_UNKNOWN),
                "the exposure is not known",
            )
            problems.add(
                f"{shot.entry.called}: {told}",
                place=shot.entry.line,
                rule="counts are divided by it",
                remedy="give integration_time_s in the index",
            )
        out.append(replace(shot, exposure_s=exposure))
    return out


def _check_one_instrument(shots: Sequence[Shot], problems: Problems) -> None:
    """Uncalibrated numbers of two spectrometers have two unknown gains; a relative table has one."""
    first = next((shot for shot in shots if shot.spectrum.spectrometer), None)
    for shot in shots:
        name = shot.spectrum.spectrometer
        if first is not None and name and name != first.spectrum.spectrometer:
            problems.add(
                f"{shot.entry.called}: another spectrometer than in line {first.entry.line}",
                place=shot.entry.line,
                found=name,
                rule=f"{first.spectrum.spectrometer!r} throughout, as the numbers are not calibrated",
                remedy="one table for each spectrometer",
            )


def _times(shots: Sequence[Shot]) -> tuple[list[Shot], LoadWarning | None]:
    """Times from the index; where it gives none at all, from the files' dates if they can be compared."""
    if any(np.isfinite(shot.time_s) for shot in shots):
        return list(shots), None
    moments = [labels.moment(shot.spectrum.date) for shot in shots]
    known = [m for m in moments if m is not None]
    if len(known) < len(moments):
        return list(shots), None
    zones = {zone: labels.ahead_of_utc(zone) for _, zone in known}
    if len(zones) > 1 and None in zones.values():
        return list(shots), LoadWarning(Remarks.UNLIKE_ZONES, {"zones": tuple(sorted(zones))})
    # Where summer time begins or ends in a measurement its clock jumps.
    even = [when - timedelta(hours=zones[zone] or 0.0) for when, zone in known]
    first = min(range(len(even)), key=even.__getitem__)
    timed = [replace(s, time_s=(at - even[first]).total_seconds()) for s, at in zip(shots, even, strict=True)]
    return timed, LoadWarning(Remarks.TIME_FROM_HEADER, {"start": known[first][0].isoformat(" ")})


def _in_order(shots: Sequence[Shot]) -> list[Shot]:
    if all(np.isfinite(shot.time_s) for shot in shots):
        return sorted(shots, key=lambda shot: shot.time_s)
    return list(shots)


def _in_bands(
    shot: Shot, darks: Sequence[Shot], lit_s: Array, unit: str, bands: BandLimits, saturated: Mask
) -> list[BandValue]:
    """What a spectrum gives in every band; a ValueError says why it gives nothing."""
    counts = unit == "counts"
    values = reduction.signal(shot, unit)
    own = "value" not in shot.spectrum.columns and (not counts or reduction.has_dark(shot.spectrum))
    chosen = reduction.choose_darks(shot, darks, counts, lit_s) if darks and not own else []
    names = tuple(d.entry.called for d in chosen) or (("own column",) if own and counts else ())
    wavelength, scale = shot.spectrum.wavelength_nm, shot.exposure_s if counts else 1.0
    out = []
    for low, high in bands:
        value = reduction.band_of(shot.spectrum, values, low, high)
        dark, error = 0.0, 0.0
        if chosen:
            means = [reduction.band_of(d.spectrum, d.spectrum.raw, low, high) for d in chosen]
            dark, spread = reduction.mean_and_error(means)
            error = 0.0 if np.isnan(spread) else spread
        near = (wavelength >= low) & (wavelength <= high)
        lost, stated = bool(saturated[near].any()), shot.stated / scale
        out.append(BandValue(shot, (value - dark) / scale, error / scale, stated, lost, names))
    return out


def _table(
    rows: Sequence[dict[str, Any]],
    where: str,
    quantity: str,
    unit: str,
    bands: BandLimits,
    budget: ErrorBudget,
    metadata: dict[str, Any],
    notes: Sequence[LoadWarning],
) -> Readings:
    absolute = units.is_absolute(unit)
    return Readings.from_arrays(
        **{name: [row[name] for row in rows] for name in COLUMNS if name != "wavelength_nm"},
        wavelength_nm=[sum(bands[row["band"]]) / 2 for row in rows],
        extra={name: [row[name] for row in rows] for name in provenance.COLUMNS},
        budget=budget,
        quantity=quantity,
        scale="absolute" if absolute else "relative",
        units="counts/s" if unit == "counts" else unit,
        source=where,
        metadata=metadata,
        warnings=tuple(notes),
    )
