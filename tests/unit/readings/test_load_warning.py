"""A warning of a table is a record; its words are made of its values alone."""

from __future__ import annotations

import pytest
from pydantic import TypeAdapter

from lightfield.readings.load_warning import SHOWN, LoadWarning, Remarked, Remarks

VALUES: dict[Remarks, dict[str, Remarked]] = {
    Remarks.SATURATED: {"saturated": 3, "readings": 41},
    Remarks.FAR_PLACES: {"name": "z_m", "far_m": 250.0},
    Remarks.LATE_TIMES: {"first_s": 36000.0, "percent": 4.2},
    Remarks.FAST_TIMES: {"speed": 7.5},
    Remarks.SLOW_TIMES: {"step_s": 20000.0},
    Remarks.TINY_ERRORS: {"part": 7e-7},
    Remarks.EXACT_ZEROS: {"zeros": 5, "readings": 41},
    Remarks.FEW_PLANES: {"planes": 2},
    Remarks.CONSTANT_INTEGRATION_TIME: {"exposure_s": 0.25},
    Remarks.NO_STDERR: {"unknown": 7, "readings": 41},
    Remarks.NO_ERROR_BUDGET: {"terms": ("plane_gain_percent", "position_mm")},
    Remarks.UNUSED_COLUMN: {"unused": "x_cm", "missing": "x_m"},
    Remarks.UNUSED_ENTRY: {"unused": "positon_mm", "missing": "position_mm"},
    Remarks.IGNORED_COLUMNS: {"columns": ("temp", "remark")},
    Remarks.UNKNOWN_COLUMNS: {"columns": ("pos_x_m", "Zeit_s")},
    Remarks.UNIT_TAKEN: {"column": "depth", "meaning": "z_m", "unit": "m"},
    Remarks.TIME_FROM_HEADER: {"start": "2025-05-05 12:00:00"},
    Remarks.NO_DARK: {"files": ("a.txt", "b.txt")},
    Remarks.LIT_DARK: {"percent": 25.0, "lit": "b.txt", "files": ("a.txt",)},
    Remarks.UNLIKE_ZONES: {"zones": ("CST", "PST")},
    Remarks.FLAT_TOP: {"levels": (6000.0,), "files": ("a.txt",)},
    Remarks.NONLINEARITY: {"corrected": "mixed"},
    Remarks.MIXED_SETTINGS: {"setting": "smoothing", "found": ("boxcar 0", "boxcar 5")},
    Remarks.ODD_FILE: {"note": "the file ends within a line", "files": ("a.txt",)},
    Remarks.SINGLE_SPECTRA: {"single": (1, 2, 3), "equal": (9,)},
    Remarks.COMMON_FLICKER: {"percent": 0.17},
    Remarks.RESTLESS: {"readings": (4, 17)},
    Remarks.COPIED: {"files": ("a.txt", "copy_of_a.txt")},
    Remarks.UNDIVIDED: {"shortest_s": 0.1, "longest_s": 0.4},
}
RECORD = TypeAdapter(LoadWarning)


@pytest.mark.parametrize("code", Remarks)
def test_every_warning_says_its_values_and_reads_back(code: Remarks) -> None:
    told = LoadWarning(code, VALUES.get(code, {}))
    for value in VALUES.get(code, {}).values():
        if code not in (Remarks.NONLINEARITY, Remarks.SINGLE_SPECTRA):
            for one in value if isinstance(value, tuple) else (value,):
                assert (one if isinstance(one, str) else f"{one:g}") in str(told)
    assert told.sentence and told.remedy and "{" not in str(told)
    assert RECORD.validate_json(RECORD.dump_json(told)) == told


def test_rows_and_long_lists_are_told_in_few_words() -> None:
    rows = LoadWarning(Remarks.SINGLE_SPECTRA, VALUES[Remarks.SINGLE_SPECTRA]).sentence
    assert rows.startswith("readings 1-3 come from single spectra and readings 9 from identical ones:")
    many = LoadWarning(Remarks.NO_DARK, {"files": tuple(f"{k}.txt" for k in range(SHOWN + 2))}).sentence
    assert many.startswith("no dark spectrum for 0.txt, 1.txt, 2.txt, 3.txt, 4.txt and 2 more:")


def test_no_integration_times_are_no_constant_one() -> None:
    none = LoadWarning(Remarks.CONSTANT_INTEGRATION_TIME, {"exposure_s": None})
    assert none.sentence.startswith("no integration times are given") and "vary" not in none.remedy


@pytest.mark.parametrize(
    ("unused", "remedy"),
    [
        ("stderr_percent", "give stderr in the unit of value: value times 'stderr_percent' / 100"),
        ("Error (%)", "give stderr in the unit of value: value times 'Error (%)' / 100"),
        ("sigma", "rename it to stderr, in the unit of value"),
    ],
)
def test_an_error_in_per_cent_is_not_to_be_renamed(unused: str, remedy: str) -> None:
    """Per cent under the name stderr would be read as errors in the unit of the readings."""
    assert LoadWarning(Remarks.UNUSED_COLUMN, {"unused": unused, "missing": "stderr"}).remedy == remedy
