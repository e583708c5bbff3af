"""What is allowed in a reading table and will limit what it can tell: a record, and its words."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum

from lightfield.errors import line_ranges

#: Names that a warning lists; of more it says how many.
SHOWN = 5
Remarked = int | float | str | None | tuple[int | float | str, ...]


class Remarks(str, Enum):
    """What a warning remarks; stable names, for programs."""

    SATURATED = "saturated"
    FAR_PLACES = "far_places"
    LATE_TIMES = "late_times"
    FAST_TIMES = "fast_times"
    SLOW_TIMES = "slow_times"
    LARGE_ERRORS = "large_errors"
    TINY_ERRORS = "tiny_errors"
    EXACT_ZEROS = "exact_zeros"
    FEW_PLANES = "few_planes"
    ON_AXIS_ONLY = "on_axis_only"
    X_ONE_SIDE = "x_one_side"
    CONSTANT_INTEGRATION_TIME = "constant_integration_time"
    NO_REPEATS = "no_repeats"
    NO_STDERR = "no_stderr"
    NO_ERROR_BUDGET = "no_error_budget"
    NO_TIME = "no_time"
    SCAN_ORDER = "scan_order"
    ENCODING = "encoding"
    UNUSED_COLUMN = "unused_column"
    UNUSED_ENTRY = "unused_entry"
    IGNORED_COLUMNS = "ignored_columns"
    UNKNOWN_COLUMNS = "unknown_columns"
    UNIT_TAKEN = "unit_taken"
    TIME_FROM_HEADER = "time_from_header"
    UNLIKE_ZONES = "unlike_zones"
    NO_DARK = "no_dark"
    LIT_DARK = "lit_dark"
    DARK_IN_PROGRAM = "dark_in_program"
    FLAT_TOP = "flat_top"
    NONLINEARITY = "nonlinearity"
    MIXED_SETTINGS = "mixed_settings"
    NO_EXPOSURE = "no_exposure"
    ODD_FILE = "odd_file"
    SINGLE_SPECTRA = "single_spectra"
    COMMON_FLICKER = "common_flicker"
    RESTLESS = "restless"
    UNDIVIDED = "undivided"
    COPIED = "copied"


@dataclass(frozen=True)
class LoadWarning:
    """Something that is allowed and will limit what the readings can tell.

    Parameters
    ----------
    code : Remarks
    values : mapping
        Numbers and names that it rests on, as its words call them.
    """

    code: Remarks
    values: Mapping[str, Remarked] = field(default_factory=dict)

    @property
    def sentence(self) -> str:
        """What is the matter."""
        words, _ = _WORDS[self.code]
        if callable(words):
            return words(self.values)
        return words.format(
            **{name: _listed(v) if isinstance(v, tuple) else v for name, v in self.values.items()}
        )

    @property
    def remedy(self) -> str:
        """What would help."""
        _, words = _WORDS[self.code]
        return words(self.values) if callable(words) else words.format(**self.values)

    def __str__(self) -> str:
        return f"{self.sentence} ({self.remedy})"


def _listed(names: Sequence[object]) -> str:
    shown = ", ".join(map(str, names[:SHOWN]))
    return shown if len(names) <= SHOWN else f"{shown} and {len(names) - SHOWN} more"


def _several(value: Remarked) -> tuple[int | float | str, ...]:
    return value if isinstance(value, tuple) else ()


def _few_planes(said: Mapping[str, Remarked]) -> str:
    planes = said["planes"]
    return (
        f"only {planes} distance{'' if planes == 1 else 's'} along the tank: the fall with distance "
        "can be explained in many ways"
    )


def _exposure(said: Mapping[str, Remarked]) -> str:
    exposure_s, alike = said["exposure_s"], "dark signal and ambient light look alike"
    if exposure_s is None:
        return f"no integration times are given: {alike}"
    return f"the integration time is {exposure_s:g} s throughout: {alike}"


def _vary_exposure(said: Mapping[str, Remarked]) -> str:
    capped = "read with the detector capped, and subtract that"
    return capped if said["exposure_s"] is None else f"vary it, or {capped}"


def _no_budget(said: Mapping[str, Remarked]) -> str:
    return (
        f"the error budget does not say {' and '.join(map(str, _several(said['terms'])))}: values will be "
        "assumed, the gain estimated where a position is read in three visits"
    )


def _flat_top(said: Mapping[str, Remarked]) -> str:
    levels = ", ".join(f"{level:g}" for level in _several(said["levels"])[:SHOWN])
    return f"saturation: a flat top at {levels} in {_listed(_several(said['files']))}: its bands are marked"


#: Of the correction of non-linearity, by what the files say of it.
_CORRECTION = {
    "no": "is off",
    "mixed": "is on in some files only",
    "unknown": "is not mentioned in the files",
}


def _nonlinearity(said: Mapping[str, Remarked]) -> str:
    how = _CORRECTION[str(said["corrected"])]
    return f"the non-linearity correction {how}: strong readings may be low"


def _restless(said: Mapping[str, Remarked]) -> str:
    rows = line_ranges([int(row) for row in _several(said["readings"])])
    return f"repeats of readings {rows} scatter far more than those elsewhere: a wild spectrum is averaged in"


def _single(said: Mapping[str, Remarked]) -> str:
    single, equal = ([int(row) for row in _several(said[name])] for name in ("single", "equal"))
    parts = [f"readings {line_ranges(single)} come from single spectra"] if single else []
    parts += [f"readings {line_ranges(equal)} from identical ones"] if equal else []
    return f"{' and '.join(parts)}: no standard error (the scatter of pixels does not show lamp and position)"


def _renamed(said: Mapping[str, Remarked]) -> str:
    """A standard error has the unit of the readings, which no name says; a part of them is another number."""
    unused, missing = str(said["unused"]), said["missing"]
    if missing != "stderr":
        return f"rename it to {missing}, in that unit"
    if any(word in unused.lower() for word in ("percent", "pct", "%")):
        return f"give {missing} in the unit of value: value times {unused!r} / 100"
    return f"rename it to {missing}, in the unit of value"


_Words = str | Callable[[Mapping[str, Remarked]], str]
#: What is the matter, and what would help.
_WORDS: dict[Remarks, tuple[_Words, _Words]] = {
    Remarks.SATURATED: (
        "{saturated} of {readings} readings are saturated and left out",
        "shorten the exposure there",
    ),
    Remarks.FAR_PLACES: (
        "{name} reaches {far_m:g} m, where light of a lamp is hardly read: it looks like centimetres or "
        "millimetres",
        "give positions in metres",
    ),
    Remarks.LATE_TIMES: (
        "time_s begins at {first_s:g} s: drifts count from 0, the attenuation is that of 0, and a lamp that "
        "grows brighter by {percent:.2g} % or more while it is read is no drift from 0 on",
        "count time_s from the first reading, or from when the lamp was switched on",
    ),
    Remarks.FAST_TIMES: (
        "by time_s the detector moved at {speed:g} m/s: it looks like minutes or hours",
        "give time_s in seconds",
    ),
    Remarks.SLOW_TIMES: (
        "by time_s it took {step_s:g} s from place to place: it looks like milliseconds",
        "give time_s in seconds",
    ),
    Remarks.LARGE_ERRORS: (
        "the standard errors are larger than the brightest readings: value and stderr look exchanged",
        "exchange them, or state errors in the unit of the readings",
    ),
    Remarks.TINY_ERRORS: (
        "the standard errors are at most {part:.1g} of the brightest readings, less than those of any "
        "instrument: they look like another unit, and a diagnosis goes by errors that it assumes",
        "state them in the unit of the readings, or leave them blank",
    ),
    Remarks.EXACT_ZEROS: (
        "{zeros} of {readings} readings are exactly 0, where noise would scatter: the instrument reads "
        "nothing below some level",
        "leave them out, and those little brighter; switch such a threshold off",
    ),
    Remarks.FEW_PLANES: (_few_planes, "measure at five distances or more"),
    Remarks.ON_AXIS_ONLY: (
        "all readings are on the axis: the beam's shape and direction cannot be told",
        "scan across the beam",
    ),
    Remarks.X_ONE_SIDE: (
        "x is on one side of the axis only: offset, tilt, width and asymmetry look alike",
        "add readings on the other side",
    ),
    Remarks.CONSTANT_INTEGRATION_TIME: (_exposure, _vary_exposure),
    Remarks.NO_REPEATS: (
        "no position is visited twice: drift shows only through the model, repositioning errors do not show",
        "come back to a reference position three times or more",
    ),
    Remarks.NO_STDERR: (
        "{unknown} of {readings} readings have no standard error: the noise has to be estimated from the "
        "misfit",
        "give stderr from repeated spectra",
    ),
    Remarks.NO_ERROR_BUDGET: (_no_budget, "state them in the head of the file"),
    Remarks.NO_TIME: (
        "not all readings have a time: lamp drift cannot be tested",
        "give time_s, seconds since the first reading",
    ),
    Remarks.SCAN_ORDER: (
        "the scan order is the plane order: every drift in time looks like a change with distance",
        "go back to the first plane at the end, or measure in random order",
    ),
    Remarks.ENCODING: ("the file is not UTF-8 and was read as Latin-1", "save it as UTF-8"),
    Remarks.UNUSED_COLUMN: (
        "the column {unused!r} is not used; it looks like {missing}, which is missing",
        _renamed,
    ),
    Remarks.UNUSED_ENTRY: (
        "{unused!r} in the head is not used; it looks like {missing}",
        "rename it to {missing}",
    ),
    Remarks.IGNORED_COLUMNS: (
        "columns that are not used: {columns}",
        "say what one of them is, if it matters: column MEANING=NAME",
    ),
    Remarks.UNKNOWN_COLUMNS: (
        "columns of the index that mean nothing here, and are not used: {columns}",
        "name them x_m, y_m, time_s or integration_time_s, in metres and seconds, if that is what they hold",
    ),
    Remarks.UNIT_TAKEN: (
        "the column {column!r} does not say its unit: {meaning} is taken to be in {unit}",
        "if that is wrong, write the unit in brackets behind the name of the column",
    ),
    Remarks.TIME_FROM_HEADER: (
        "times are taken from the dates in the files, from {start}",
        "give time_s in the index if the instrument's clock was wrong",
    ),
    Remarks.UNLIKE_ZONES: (
        "no times are taken from the dates in the files, which are of different zones: {zones}",
        "give time_s in the index",
    ),
    Remarks.NO_DARK: (
        "no dark spectrum for {files}: the dark signal is still in these readings",
        "add files with the role dark, at the same exposure",
    ),
    Remarks.LIT_DARK: (
        "darks that show the lamp's spectrum, up to {percent:.0f} % of that of {lit}: {files}",
        "correct the roles in the index, or take the dark with the lamp covered",
    ),
    Remarks.DARK_IN_PROGRAM: (
        "the program held a dark spectrum: it may have been subtracted already",
        "make sure that the files hold raw counts (scope mode without dark subtraction)",
    ),
    Remarks.COPIED: (
        "one and the same spectrum, noise and all, stands for several places: {files}",
        "correct the index, or leave out what was copied",
    ),
    Remarks.FLAT_TOP: (_flat_top, "shorten the exposure; state the full scale"),
    Remarks.NONLINEARITY: (_nonlinearity, "switch it on, or expect detector.saturation to be suspected"),
    Remarks.MIXED_SETTINGS: ("the files differ in {setting}: {found}", "keep one setting throughout"),
    Remarks.NO_EXPOSURE: ("some files do not say their exposure", "give integration_time_s"),
    Remarks.ODD_FILE: ("{note}: {files}", "look at the file"),
    Remarks.SINGLE_SPECTRA: (_single, "take three spectra or more at each place"),
    Remarks.COMMON_FLICKER: (
        "the lamp flickers or drifts from repeat to repeat: all bands of a spectrum are off together by "
        "{percent:.2g} % of a reading, as the column common_percent says to every analysis",
        "more repeats or a steadier supply make a flicker less, a longer warm-up a drift",
    ),
    Remarks.RESTLESS: (_restless, "look at their spectra, and leave the wild one out of the index"),
    Remarks.UNDIVIDED: (
        "exposures go from {shortest_s:g} to {longest_s:g} s, and no value is divided by them",
        "if the files hold counts, say so: the unit is counts",
    ),
}
