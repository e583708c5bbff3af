"""What a reading table says about the files it was made from: headers, settings, what is doubtful."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from lightfield.readings.importing import reduction
from lightfield.readings.importing.reduction import Shot
from lightfield.readings.instruments import labels
from lightfield.readings.instruments.oddity import Oddity
from lightfield.readings.load_warning import LoadWarning, Remarked, Remarks

# Columns of a table made by import beside those of every reading table.
COLUMNS = ("file", "n_spectra", "dark", "nonlinearity_corrected", "electric_dark_corrected")


def one_word(flags: Iterable[bool | None]) -> str:
    """yes, no, mixed, or unknown."""
    found = set(flags)
    if len(found) != 1:
        return "mixed"
    return {True: "yes", False: "no", None: "unknown"}[found.pop()]


def metadata_of(
    sequence: Sequence[Shot],
    darks: Sequence[Shot],
    unit: str,
    bands_nm: Sequence[tuple[float, float]],
    saturation_level: float | None,
    notes: Sequence[LoadWarning],
) -> dict[str, Any]:
    """The head's entries about the import, with every header line of every file.

    What all files share stands once, under [instrument.common]; the rest under the file's name.
    """
    shots = [*sequence, *darks]
    headers = {shot.entry.file: dict(shot.spectrum.header) for shot in shots}
    common = _common(list(headers.values()))
    about: dict[str, Any] = {"unit_in_files": unit, "notes": [str(note) for note in notes]}
    about["remarks"] = [note.code.value for note in notes]
    if saturation_level is not None:
        about["saturation_level_in_files"] = float(saturation_level)
    return {
        "bands_nm": [[float(low), float(high)] for low, high in bands_nm],
        "imported": about,
        "instrument": {
            "formats": sorted({shot.spectrum.format for shot in shots}),
            "common": common,
            "files": {
                file: {label: text for label, text in header.items() if label not in common}
                for file, header in headers.items()
            },
        },
    }


def _common(headers: Sequence[Mapping[str, str]]) -> dict[str, str]:
    if len(headers) < 2:
        return {}
    first, *others = headers
    return {label: text for label, text in first.items() if all(other.get(label) == text for other in others)}


#: The lamp is seen in a dark whose spectrum is correlated so much with that of the light, and is this part of
#: the brightest or more. Chosen: dark signal slopes by a percent of a bright spectrum, in any direction.
_ALIKE, _SEEN = 0.9, 0.05


def doubts_of_files(
    sequence: Sequence[Shot], darks: Sequence[Shot], unit: str, flat: Mapping[str, float]
) -> list[LoadWarning]:
    """What is doubtful about the files."""
    shots = [*sequence, *darks]
    found = _of_darks(sequence, darks) if unit == "counts" else []
    if flat:
        levels = tuple(sorted(set(flat.values())))
        found.append(LoadWarning(Remarks.FLAT_TOP, {"levels": levels, "files": tuple(sorted(flat))}))
    # A sensor of one band has a calibration of its maker's, and no correction of an array's pixels.
    arrays = [s.spectrum.nonlinearity_corrected for s in shots if s.spectrum.band_nm is None]
    linear = one_word(arrays)
    if arrays and linear != "yes":
        found.append(LoadWarning(Remarks.NONLINEARITY, {"corrected": linear}))
    found += _mixed_settings(sequence, shots)
    if unit != "counts":
        found += _of_exposures(sequence)
    ignored = tuple(dict.fromkeys(name for s in shots for name in s.spectrum.ignored))
    if ignored:
        found.append(LoadWarning(Remarks.IGNORED_COLUMNS, {"columns": ignored}))
    found += [LoadWarning(Remarks.COPIED, {"files": files}) for files in _copied(sequence)]
    odd: dict[Oddity, list[str]] = {}
    for shot in shots:
        for note in shot.spectrum.notes:
            odd.setdefault(note, []).append(shot.entry.called)
    found += [
        LoadWarning(Remarks.ODD_FILE, {"oddity": note.odd.value, "note": str(note), "files": tuple(files)})
        for note, files in odd.items()
    ]
    return found


def _of_darks(sequence: Sequence[Shot], darks: Sequence[Shot]) -> list[LoadWarning]:
    """Counts without a dark signal, or with one that a program took off, or that saw the lamp."""
    without = [s for s in sequence if not reduction.has_dark(s.spectrum)]
    held = [s for s in without if labels.flag(s.spectrum.header, "dark_held")]
    bare = tuple(s.entry.called for s in without if not darks and s not in held)
    found = [LoadWarning(Remarks.NO_DARK, {"files": bare})] if bare else []
    if held:
        found.append(LoadWarning(Remarks.DARK_IN_PROGRAM))
    return found + _lit_darks(sequence, darks)


def _mixed_settings(sequence: Sequence[Shot], shots: Sequence[Shot]) -> list[LoadWarning]:
    """Settings of the instrument that are not the same in all files."""
    settings = {
        "spectrometer": {s.spectrum.spectrometer or "unknown" for s in shots},
        "smoothing": {f"boxcar {s.spectrum.boxcar}" for s in shots},
        # The scatter of repeats tells one noise of all: a dark may be a mean of more.
        "averaging": {f"{n} spectra" for s in sequence if (n := s.spectrum.spectra_averaged) is not None},
        "electric dark correction": {one_word([s.spectrum.electric_dark_corrected]) for s in shots},
    }
    return [
        LoadWarning(Remarks.MIXED_SETTINGS, {"setting": what, "found": tuple(sorted(values))})
        for what, values in settings.items()
        if len(values) > 1
    ]


def _of_exposures(sequence: Sequence[Shot]) -> list[LoadWarning]:
    """Exposures that are not known, or may not have been divided by."""
    exposures = np.array([s.exposure_s for s in sequence])
    found = [] if np.isfinite(exposures).all() else [LoadWarning(Remarks.NO_EXPOSURE)]
    # Such files may hold counts or anything else; those of the other formats say which column is calibrated.
    plain = all("value" in s.spectrum.columns for s in sequence)
    if plain and len(exposures) and np.ptp(exposures) > reduction.SAME_EXPOSURE * exposures.min():
        ends = {"shortest_s": float(exposures.min()), "longest_s": float(exposures.max())}
        found.append(LoadWarning(Remarks.UNDIVIDED, ends))
    return found


#: Spectra of so many pixels are never the same by chance; of a few bands they may be.
_PIXELS = 16


def _copied(sequence: Sequence[Shot]) -> list[tuple[str, ...]]:
    """Files of one and the same spectrum, to the last digit of its noise, that are of several places."""
    alike: dict[bytes, list[Shot]] = {}
    for shot in sequence:
        raw = shot.spectrum.raw
        if len(raw) >= _PIXELS and np.nanmin(raw) < np.nanmax(raw):
            alike.setdefault(raw.tobytes(), []).append(shot)
    return [
        tuple(s.entry.called for s in shots)
        for shots in alike.values()
        if len({(e.medium, e.x_m, e.y_m, e.z_m) for e in (s.entry for s in shots)}) > 1
    ]


def _lit_darks(sequence: Sequence[Shot], darks: Sequence[Shot]) -> list[LoadWarning]:
    """Darks in which the lamp is seen: their spectra go up and down with the light of the brightest one."""
    share: dict[str, float] = {}
    lit = max(sequence, key=lambda s: float(np.nanmax(s.spectrum.raw)), default=None)
    for dark in darks:
        if lit is None or not np.array_equal(dark.spectrum.wavelength_nm, lit.spectrum.wavelength_nm):
            continue
        own, light = (s.spectrum.raw - np.nanmean(s.spectrum.raw) for s in (dark, lit))
        light = light - own
        both = np.isfinite(own) & np.isfinite(light)
        own, light = own[both], light[both]
        size, alike = float(light @ light), float(own @ light)
        if alike**2 > _ALIKE**2 * size * float(own @ own) and size + alike != 0:
            share[dark.entry.called] = alike / (size + alike)
    share = {name: part for name, part in share.items() if part > _SEEN}
    if lit is None or not share:
        return []
    values: dict[str, Remarked] = {
        "percent": 100 * max(share.values()), "lit": lit.entry.called, "files": tuple(sorted(share))
    }  # fmt: skip
    return [LoadWarning(Remarks.LIT_DARK, values)]


def single_spectra(n_spectra: Sequence[str], stderr: Sequence[float]) -> LoadWarning | None:
    """Says why readings have no standard error."""
    without = [(k + 1, n) for k, (n, e) in enumerate(zip(n_spectra, stderr, strict=True)) if np.isnan(e)]
    single = tuple(k for k, n in without if n == "1")
    equal = tuple(k for k, n in without if n != "1")
    if not single and not equal:
        return None
    return LoadWarning(Remarks.SINGLE_SPECTRA, {"single": single, "equal": equal})
