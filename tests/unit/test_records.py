"""What results remark are records: every kind has words, and they are made of its numbers alone."""

from __future__ import annotations

import pytest

from lightfield.readings.instruments.oddity import Odd, Oddity
from lightfield.render.shown_as import Shown, ShownAs
from lightfield.studies.attenuation.remark import Remark, Studied

RECORDS = [
    *(Oddity(odd, 7, 9, "Integration Time", "holds no number") for odd in Odd),
    *(ShownAs(what, 0.01, 0.25) for what in Shown),
    *(Remark(studied, 7, 9, 12.0, 0.5, "z = 2 m", "no light") for studied in Studied),
]


@pytest.mark.parametrize("record", RECORDS, ids=lambda r: next(v for v in vars(r).values()).name)
def test_every_kind_has_words_without_gaps(record: Oddity | ShownAs | Remark) -> None:
    assert str(record) and "None" not in str(record) and "{" not in str(record)


def test_kinds_are_told_apart_by_their_words() -> None:
    assert len({str(record) for record in RECORDS}) == len(RECORDS)


@pytest.mark.parametrize(
    ("record", "words"),
    [
        (Remark(Studied.STDERR_FROM_REPEATS, 4, percent=0.4567), "4 readings without stderr: 0.46 % from"),
        (Remark(Studied.FEW_DISTANCES, 3, limit=2), "3 wavelengths were not read at 2 distances: left out"),
        (ShownAs(Shown.SCATTERING, 0.001234, 0.02), "scattering shown as 0.02 1/m instead of 0.0012 1/m"),
        (Oddity(Odd.EXPOSURE_UNKNOWN, label="Zeit", why="is empty"), "the exposure is not known: 'Zeit' is"),
    ],
)
def test_words_hold_the_numbers(record: Oddity | ShownAs | Remark, words: str) -> None:
    assert str(record).startswith(words)
