"""Readers of instrument files meet any bytes, any text, and files that were damaged or cut."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from ocean_files import FORMATS, begin, parse, text_of

from lightfield.errors import MeasurementError
from lightfield.readings import text
from lightfield.readings.instruments.document import take_apart
from lightfield.readings.instruments.formats import spectra_of


def check_fuzzed(data: bytes) -> None:
    try:
        content = text.decode(data, "fuzz.txt")
    except MeasurementError:
        return
    for read in (lambda: spectra_of(data, "f")[0], *(
        lambda m=module: m.read(take_apart(content, "f")) for _, module in FORMATS.values()
    )):  # fmt: skip
        try:
            spectrum = read()
        except MeasurementError as error:
            assert all("\n" not in str(one) for one in error.problems)
            continue
        assert np.isfinite(spectrum.wavelength_nm).all() and (np.diff(spectrum.wavelength_nm) > 0).all()
        assert all(len(column) == len(spectrum) for column in spectrum.columns.values())
        assert np.isnan(spectrum.integration_time_s) or spectrum.integration_time_s > 0


@settings(max_examples=60)
@given(data=st.binary(max_size=300))
def test_any_bytes(data):
    check_fuzzed(data)
    for lines, _ in FORMATS.values():
        head = "\n".join(lines()[:13]).encode()
        check_fuzzed(head + b"\n" + data)


@settings(max_examples=60)
@given(body=st.text(alphabet="WDRSP\t 0123456789.,;+-eENaN\n\r<>:()[]", max_size=200))
def test_any_text_of_the_formats_letters(body):
    for lines, _ in FORMATS.values():
        check_fuzzed("\n".join([*lines()[:5], body, *lines()[5:]]).encode())
        check_fuzzed("\n".join([lines()[0], begin("Processed Spectral"), body]).encode())


@settings(max_examples=120)
@given(
    name=st.sampled_from(list(FORMATS)),
    edits=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 40), st.binary(max_size=8)), max_size=4),
)
def test_damaged_files(name, edits):
    data = bytearray(text_of(name).encode())
    for place, length, insert in edits:
        start = int(place * len(data))
        data[start : start + length] = insert
    check_fuzzed(bytes(data))


@settings(max_examples=120)
@given(name=st.sampled_from(list(FORMATS)), place=st.floats(0, 1))
def test_a_cut_file_is_an_error_or_its_numbers_are_true(name, place):
    whole = text_of(name)
    truth = parse(whole)
    try:
        cut = parse(whole[: int(place * len(whole))])
    except MeasurementError:
        return
    assert cut.wavelength_nm.tolist() == truth.wavelength_nm.tolist()
    for column, values in cut.columns.items():
        known = np.isfinite(values)
        assert known.sum() >= len(values) - 1
        assert values[known].tolist() == truth.columns[column][known].tolist()
