"""Whatever the bytes: an error that a user can act on, or a table that fulfils the rules."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lightfield.errors import LightfieldError, MeasurementError
from lightfield.readings import read_table

FULL = """\
# quantity = "irradiance"
# plane_gain_percent = 0.2        # repositioning
# operator = "A. B."
# [lamp]
# age_h = 12
medium,x_m,y_m,z_m,wavelength_nm,value,stderr,time_s,colour
water,0.0,0.0,4.5,525,1.000,0.004,0,green
air,-0.1,0.2,4.5,525,0.5,,20,"a, b"
"""


def check_fuzzed(data: bytes, folder: Path) -> None:
    path = folder / "fuzz.csv"
    path.write_bytes(data)
    try:
        readings = read_table(path)
    except LightfieldError as error:
        assert isinstance(error, MeasurementError) and str(error)
        return
    assert len(readings) > 0
    assert np.isfinite(readings.value).all() and (readings.z_m > 0).all()
    assert not (readings.stderr <= 0).any()
    assert set(readings.medium.tolist()) <= {"water", "air"}


@settings(max_examples=100)
@given(data=st.binary(max_size=300))
def test_any_bytes(data, tmp_path_factory):
    check_fuzzed(data, tmp_path_factory.getbasetemp())


LETTERS = "z_m,value;#=\"[]'\n\r\t .0123456789-+eE\\x"
ENCODINGS = ["utf-8", "utf-16", "utf-8-sig", "latin-1"]


@settings(max_examples=100)
@given(text=st.text(alphabet=LETTERS, max_size=200), encoding=st.sampled_from(ENCODINGS))
def test_any_text_of_the_formats_letters(text, encoding, tmp_path_factory):
    check_fuzzed(("z_m,value\n" + text).encode(encoding), tmp_path_factory.getbasetemp())
    check_fuzzed(("# " + text).encode(encoding), tmp_path_factory.getbasetemp())


@settings(max_examples=200)
@given(
    edits=st.lists(
        st.tuples(st.integers(0, len(FULL)), st.integers(0, 12), st.binary(max_size=6)), max_size=4
    )
)
def test_damaged_tables(edits, tmp_path_factory):
    data = bytearray(FULL.encode())
    for start, length, insert in edits:
        data[start : start + length] = insert
    check_fuzzed(bytes(data), tmp_path_factory.getbasetemp())


def test_a_table_of_too_many_rows_is_refused_before_its_cells_are_read(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("lightfield.readings.table.read.MOST_ROWS", 3)
    head = '# quantity = "irradiance"\nx_m,z_m,value\n# a remark\n\n'
    (tmp_path / "most.csv").write_text(head + "".join(f"0,{z},1\n" for z in (3, 4, 5)))
    assert len(read_table(tmp_path / "most.csv")) == 3
    (tmp_path / "more.csv").write_text(head + "no number,3,1\n" * 4)
    with pytest.raises(
        MeasurementError, match=r"more\.csv: too many readings; found '4 rows'; rule: at most 3"
    ):
        read_table(tmp_path / "more.csv")
