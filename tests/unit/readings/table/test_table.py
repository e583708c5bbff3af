"""The reading table: what is read, what is refused, and that writing and reading loses not a bit."""

from __future__ import annotations

import math
from datetime import date, datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lightfield.errors import MeasurementError, OutputError
from lightfield.readings import ErrorBudget, Readings, read_table, write_table
from lightfield.readings.columns import COLUMNS, LAYOUT
from lightfield.readings.table.write import dumps
from lightfield.scene import Scene

FULL = """\
# quantity = "irradiance"
# scale = "relative"
# plane_gain_percent = 0.2        # repositioning
# position_mm = 1.0
# saturation_level = 65535
# operator = "A. B."
# [lamp]
# age_h = 12
medium,x_m,y_m,z_m,wavelength_nm,value,stderr,time_s,colour
water,0.0,0.0,4.5,525,1.000,0.004,0,green
air,-0.1,0.2,4.5,525,0.5,,20,"a, b"
"""


@pytest.fixture
def load(tmp_path: Path):
    def load(content: str | bytes, scene: object = None) -> Readings:
        path = tmp_path / "readings.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_table(path, scene)

    return load


def problems(load, content: str | bytes) -> list[str]:
    with pytest.raises(MeasurementError) as caught:
        load(content)
    assert all("\n" not in str(one) for one in caught.value.problems)
    return [*map(str, caught.value.problems)]


def canonical(tree: object) -> str:
    """Text of a tree of values that does not depend on the order of keys, of which TOML keeps no account."""
    if isinstance(tree, dict):
        return "{" + ", ".join(sorted(f"{key!r}: {canonical(value)}" for key, value in tree.items())) + "}"
    return f"[{', '.join(map(canonical, tree))}]" if isinstance(tree, list) else repr(tree)


def same(one: Readings, other: Readings) -> None:
    for name in COLUMNS:
        a, b = getattr(one, name), getattr(other, name)
        if a.dtype == np.float64:
            # Bits, so that -0.0 is told from 0.0.
            known = ~np.isnan(a)
            assert (known == ~np.isnan(b)).all()
            assert (a[known].view(np.int64) == b[known].view(np.int64)).all(), name
        else:
            assert a.tolist() == b.tolist(), name
    for name in ("budget", "quantity", "scale", "units"):
        assert getattr(one, name) == getattr(other, name), name
    assert canonical(one.metadata) == canonical(other.metadata)
    assert {k: v.tolist() for k, v in one.extra.items()} == {k: v.tolist() for k, v in other.extra.items()}


def test_every_part_of_the_format_arrives(load):
    readings = load(FULL)
    assert len(readings) == 2
    assert readings.quantity == "irradiance" and readings.scale == "relative"
    assert readings.budget == ErrorBudget(plane_gain_percent=0.2, position_mm=1.0, saturation_level=65535)
    assert (readings.budget.tolerance_percent, readings.budget.outlier_percent) == (None, None)
    assert readings.metadata == {"operator": "A. B.", "lamp": {"age_h": 12}}
    assert readings.medium.tolist() == ["water", "air"]
    assert readings.stderr[0] == 0.004 and np.isnan(readings.stderr[1])
    assert readings.extra["colour"].tolist() == ["green", "a, b"]
    assert readings.line.tolist() == [10, 11]


def test_defaults_are_water_on_axis_the_scenes_band_unknown_noise_no_time(load):
    readings = load("value,z_m\n1,4.5\n0.5,5.5\n")
    assert readings.medium.tolist() == ["water"] * 2
    assert readings.x_m.tolist() == readings.y_m.tolist() == [0, 0]
    for name in ("wavelength_nm", "stderr", "time_s", "integration_time_s", "repeat", "visit"):
        assert np.isnan(getattr(readings, name)).all()
    assert readings.scale == "relative" and readings.role.tolist() == ["signal"] * 2


@pytest.mark.parametrize(
    "variant",
    [
        FULL.replace("\n", "\r\n").encode(),
        FULL.replace("\n", "\r").encode(),
        FULL.encode("utf-8-sig"),
        FULL.encode("utf-16"),
        FULL.encode("utf-16-le"),
        FULL.rstrip("\n").encode(),
        FULL.replace("water,0", "\n\n# a comment\nwater,0").encode(),
    ],
    ids=["CRLF", "lone CR", "BOM", "UTF-16", "UTF-16 without mark", "no last line end", "blank lines"],
)
def test_line_ends_and_encodings_do_not_matter(load, variant):
    same(load(FULL), load(variant))


def test_latin_1_is_read_and_said(load):
    readings = load('# operator = "Müller"\nz_m,value\n1,2\n'.encode("latin-1"))
    assert readings.metadata == {"operator": "Müller"}
    assert "encoding" in [w.code for w in readings.warnings]


def test_decimal_comma_with_semicolons_or_quotes(load):
    point = load("z_m,x_m,value\n4.5,-0.25,1e-3\n5.5,1,2\n")
    same(point, load("z_m;x_m;value\n4,5;-0,25;1e-3\n5,5;1;2\n"))
    same(point, load("z_m\tx_m\tvalue\n4,5\t-0,25\t1e-3\n5,5\t1\t2\n"))
    same(point, load('z_m,x_m,value\n"4,5","-0,25",1e-3\n"5,5",1,2\n'))


@pytest.mark.parametrize("cells", ["4.5;1,5", "4,5;1.5", "1.234,5;2"])
def test_two_decimal_marks_are_refused(load, cells):
    assert any("decimal" in line for line in problems(load, f"z_m;value\n{cells}\n"))


# What is wrong, in which line, and a word that the message must hold.
BAD = {
    "no z_m": ("x_m,value\n1,2\n", "line 1", "z_m is missing"),
    "no value": ("x_m,z_m\n1,2\n", "line 1", "value is missing"),
    "z without unit": ("z,value\n1,2\n", "line 1", "rename 'z' to z_m"),
    "nan value": ("z_m,value\n1,2\n2,nan\n", "line 3", "not a finite number"),
    "NA value": ("z_m,value\n1,2\n2,NA\n", "line 3", "not a finite number"),
    "infinite": ("z_m,value\n1,2\n2,-inf\n", "line 3", "not a finite number"),
    "huge": ("z_m,value\n1,2\n2,1e999\n", "line 3", "too large"),
    "no light is so large": ("z_m,value\n1,2\n2,1e31\n", "line 3", "too large for light"),
    "nor is its error": ("z_m,value,stderr\n1,2,1e300\n", "line 2", "too large for light"),
    "nan stderr": ("z_m,value,stderr\n1,2,nan\n", "line 2", "leave it blank"),
    "blank value": ("z_m,value,x_m\n1,,3\n", "line 2", "value is missing"),
    "blank place": ("z_m,value,x_m\n1,2,3\n1,2,\n", "line 3", "x_m is missing"),
    "text": ("z_m,value\n1,two\n", "line 2", "not a number"),
    "underscore": ("z_m,value\n1,1_0\n", "line 2", "not a number"),
    "other digits": ("z_m,value\n1,٣\n", "line 2", "not a number"),
    "negative stderr": ("z_m,value,stderr\n1,2,-0.1\n", "line 2", "stderr > 0"),
    "zero stderr": ("z_m,value,stderr\n1,2,0\n", "line 2", "stderr > 0"),
    "zero exposure": ("z_m,value,integration_time_s\n1,2,0\n", "line 2", "integration_time_s > 0"),
    "behind the lamp": ("z_m,value\n-1,2\n", "line 2", "z_m > 0"),
    "at the lamp": ("z_m,value\n0,2\n", "line 2", "z_m > 0"),
    "duplicate": ("z_m,x_m,value,time_s\n1,0,2,5\n1,-0.0,2,5\n", "line 3", "there already; found 'line 2'"),
    "duplicate without time": ("z_m,value\n1,2\n1,2.1\n", "line 3", "there already; found 'line 2'"),
    "a scene": ("[lamp]\nhwhm_deg = 4\n", "line 1", "taken for each other"),
    "a scene with a name": ('# mine\nname = "tank"\n[lamp]\n', "line 2", "taken for each other"),
    "other words": ("distance,irradiance\n1,2\n", "line 1", "rename 'distance' to z_m"),
    "medium": ("z_m,value,medium\n1,2,oil\n", "line 2", "water or air"),
    "dark role": ("z_m,value,role\n1,2,dark\n", "line 2", "as an import does"),
    "repeat": ("z_m,value,repeat\n1,2,1.5\n", "line 2", "0, 1, 2"),
    "saturated": ("z_m,value,saturated\n1,2,maybe\n", "line 2", "neither 0 nor 1"),
    "short row": ("z_m,value\n1,2\n1\n", "line 3", "1 cells"),
    "long row": ("z_m,value\n1,2\n1,2,3\n", "line 3", "semicolons"),
    "a column without a name": ("z_m,value\n1.5,2\n1.5,2,3\n", "line 3", "name every column"),
    "open quote": ('z_m,value\n1,"2\n', "line 2", "not a CSV row"),
    "twice the same column": ("z_m,value,value\n1,2,3\n", "line 1", "occurs 2 times"),
    "nameless column": ("z_m,value,\n1,2,3\n", "line 1", "no name"),
    "head is not TOML": ("# fine = 1\n# what a day\nz_m,value\n1,2\n", "line 2", "free comments with ##"),
    "head without quotes": (
        "# quantity = irradiance\nz_m,value\n1,2\n",
        "line 1",
        'put text in quotes: # quantity = "irradiance"',
    ),
    "head key twice": ("# a = 1\n# a = 2\nz_m,value\n1,2\n", "line 2", "not TOML"),
    "quantity": ('# quantity = "light"\nz_m,value\n1,2\n', "", "unknown quantity"),
    "quantity is a number": ("# quantity = 1\nz_m,value\n1,2\n", "line 1", "not text"),
    "scale": ('# scale = "big"\nz_m,value\n1,2\n', "", "relative or absolute"),
    "absolute without units": ('# scale = "absolute"\nz_m,value\n1,2\n', "", "units are never guessed"),
    "absolute counts": ('# scale = "absolute"\n# units = "counts"\nz_m,value\n1,2\n', "", "unusable units"),
    "budget is text": ('# position_mm = "1"\nz_m,value\n1,2\n', "line 1", "not a number"),
    "negative budget": ("# position_mm = -1\nz_m,value\n1,2\n", "", "position_mm >= 0"),
    "infinite budget": ("# position_mm = inf\nz_m,value\n1,2\n", "line 1", "not a number"),
    "mixed quantity": ("z_m,value,quantity\n1,2,radiance\n2,2,irradiance\n", "line 3", "mixed quantity"),
    "mixed units": ('# units = "counts"\nz_m,value,units\n1,2,lx\n', "line 3", "mixed units"),
    "no rows": ("z_m,value\n", "", "no reading"),
    "no names": ("# a = 1\n", "", "no column names"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_files(load, case):
    content, line, word = BAD[case]
    found = problems(load, content)
    assert any((not line or line in text) and word in text for text in found), found


@pytest.mark.parametrize("content", [b"", b"\xef\xbb\xbf", b" \r\n ", "\ufeff \n".encode("utf-16")])
def test_empty_files(load, content):
    with pytest.raises(MeasurementError, match="empty"):
        load(content)


@pytest.mark.parametrize("content", [b"\x89PNG\r\n\x1a\n\x00\x00", b"z_m,value\n1,\x002\n"])
def test_what_is_not_text(load, content):
    with pytest.raises(MeasurementError, match="not a text file"):
        load(content)


def test_missing_file_and_folder(tmp_path):
    for path in (tmp_path / "none.csv", tmp_path):
        with pytest.raises(MeasurementError, match="cannot read the reading table"):
            read_table(path)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (
            "z_m,value,x_m,stderr\n-4,1,abc,-1\n",
            ["x_m is not", "z_m is an impossible", "stderr is not positive"],
        ),
        (
            "z_m,stderr\n-4,-1\n",
            ["column value is missing", "z_m is an impossible", "stderr is not positive"],
        ),
        (
            '# scale = "relative"\n# scale = "relative"\n# plane_gain_percent = -1\nz_m,value\n1,2\n',
            ["the head is not TOML", "line 3: plane_gain_percent is impossible"],
        ),
        ("z_m,value\nx,1\nx,1\n", ["line 2: z_m is not", "line 3: z_m is not"]),
        ("z_m,value\n4500,1\n", ["z_m is farther than any lamp"]),
    ],
)
def test_one_problem_hides_no_other_and_is_told_once(load, content, expected):
    found = problems(load, content)
    assert len(found) == len(expected), found
    for words in expected:
        assert any(words in text for text in found), found


def test_all_problems_come_at_once_with_their_lines(load):
    found = problems(load, "# scale = 1\nz_m,value,stderr\n-1,2,-3\n1,nan,1\n1\n")
    assert len(found) == 5
    assert [line.split(":")[0] for line in found] == ["line 1", "line 3", "line 3", "line 4", "line 5"]


def test_many_problems_of_one_kind_share_a_line_that_names_all_their_places(load):
    found = problems(load, "z_m,value\n" + "1;2\n" * 3 + "1,2\n" + "3;4\n" * 30)
    assert len(found) == 1 and "lines 2-4, 6-35" in found[0]


def test_replicates_at_other_times_or_numbered_are_no_duplicates(load):
    assert len(load("z_m,value,time_s\n1,2,0\n1,2,9\n")) == 2
    assert len(load("z_m,value,repeat\n1,2,0\n1,2,1\n")) == 2


def test_a_column_that_only_looks_like_one_of_ours_is_reported(load):
    codes = [w.code for w in load("# plane_gain_percents = 1\nz_m,value,std_err\n1,2,3\n").warnings]
    assert "unused_column" in codes and "unused_entry" in codes


def test_saturated_readings_are_marked_not_dropped(load):
    readings = load("# saturation_level = 10\nz_m,value,saturated\n1,12,0\n2,5,1\n3,5,0\n")
    assert readings.saturated.tolist() == [True, True, False]
    assert readings.usable().z_m.tolist() == [3]
    assert "saturated" in [w.code for w in readings.warnings]


def test_from_arrays_is_checked_like_a_file():
    readings = Readings.from_arrays(z_m=[1, 2], value=[3, 4], stderr=0.1, plane_gain_percent=0.2)
    assert readings.stderr.tolist() == [0.1, 0.1] and readings.budget.plane_gain_percent == 0.2
    with pytest.raises(MeasurementError, match=r"reading 2: z_m .*impossible"):
        Readings.from_arrays(z_m=[1, -2], value=[3, 4])
    with pytest.raises(MeasurementError, match="shape"):
        Readings.from_arrays(z_m=[1, 2], value=[3, 4], x_m=[1, 2, 3])


def test_readings_cannot_be_changed():
    readings = Readings.from_arrays(z_m=[1, 2], value=[3, 4])
    with pytest.raises(ValueError):
        readings.value[0] = 9


# --- exactness

finite = st.floats(allow_nan=False, allow_infinity=False)
place, light = st.floats(-300, 300), st.floats(-1e30, 1e30)
positive = st.floats(min_value=5e-324, allow_nan=False, allow_infinity=False)
line_text = st.text(st.characters(exclude_categories=("Cs", "Cc")), max_size=8)
names = line_text.filter(lambda s: s and s == s.strip() and s not in (*COLUMNS, "quantity", "scale", "units"))
keys = st.text(max_size=6).filter(lambda s: s not in ("quantity", "scale", "units", "saturation_level"))
plain = st.one_of(
    st.booleans(),
    st.integers(-(2**63), 2**63 - 1),
    finite,
    st.text(st.characters(exclude_categories=("Cs",)), max_size=12),
    st.datetimes(datetime(1970, 1, 1), datetime(2100, 1, 1)).map(lambda d: d.replace(fold=0)),
    st.dates(date(1970, 1, 1), date(2100, 1, 1)),
)
tree = st.recursive(
    plain, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(
        st.characters(exclude_categories=("Cs",)), max_size=6), inner, max_size=3), max_leaves=6,
)  # fmt: skip


@st.composite
def tables(draw) -> Readings:
    n = draw(st.integers(1, 5))

    def column(values, blank=False):
        return draw(st.lists(values | st.just(math.nan) if blank else values, min_size=n, max_size=n))

    return Readings.from_arrays(
        z_m=column(st.floats(5e-324, 300)),
        value=column(light),
        x_m=column(place),
        y_m=column(place),
        medium=column(st.sampled_from(["water", "air"])),
        role=column(st.sampled_from(["signal", "reference"])),
        wavelength_nm=column(positive, True),
        stderr=column(st.floats(5e-324, 1e30), True),
        time_s=column(st.floats(-1e5, 1e7), True),
        integration_time_s=column(positive, True),
        repeat=np.arange(n),
        visit=column(st.integers(0, 2**53).map(float), True),
        saturated=column(st.booleans()),
        budget=ErrorBudget(*(draw(st.none() | st.floats(0, 1e9)) for _ in range(3))),
        quantity=draw(st.sampled_from(["", "irradiance", "radiance"])),
        units=draw(st.text(st.characters(exclude_categories=("Cs",)), max_size=12)),
        metadata=draw(st.dictionaries(st.text(st.characters(exclude_categories=("Cs",)), max_size=6).filter(
            lambda s: s not in ("quantity", "scale", "units")), tree, max_size=3)),
        extra={name: column(line_text) for name in draw(st.lists(names, max_size=2, unique=True))},
    )  # fmt: skip


@settings(max_examples=80)
@given(table=tables())
def test_what_is_written_is_read_back_to_the_last_bit(table, tmp_path_factory):
    path = tmp_path_factory.mktemp("trip") / "readings.csv"
    write_table(table, path)
    same(table, read_table(path))


@pytest.mark.parametrize(
    "fields",
    [
        {"extra": {"note": ["two\nlines"]}},
        {"extra": {"z_m": ["1"]}},
        {"extra": {"note": ["\ud800"]}},
        {"metadata": {"f": print}},
        {"metadata": {"quantity": "x"}},
    ],
)
def test_what_cannot_be_written_exactly_is_refused(fields):
    with pytest.raises(OutputError):
        dumps(Readings.from_arrays(z_m=[1], value=[2], **fields))


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_a_layout_is_a_table_whose_values_do_not_exist_yet(tmp_path, delimiter):
    """Whatever delimits a table may delimit a layout, and with values it is the table itself."""
    path = tmp_path / "layout.csv"
    rows = ["# plane_gain_percent = 0.2", "x_m,z_m,medium", "0.1,4.5,water", "-0.1,3,air"]
    path.write_text("\n".join(rows).replace(",", delimiter))
    layout = read_table(path, required=LAYOUT)
    path.write_text(
        "\n".join([*rows[:1], *(f"{r},{v}" for r, v in zip(rows[1:], ("value", 1, 1), strict=True))])
    )
    same(layout, read_table(path))
    same(layout, read_table(path, required=LAYOUT))
    with pytest.raises(MeasurementError, match="the column z_m is missing"):
        path.write_text("x_m\n1\n")
        read_table(path, required=LAYOUT)
    with pytest.raises(MeasurementError, match="line 2: value is missing"):
        path.write_text("z_m,value\n1,\n")  # what is begun is to be filled
        read_table(path, required=LAYOUT)


def test_a_cell_that_could_not_be_read_is_one_problem(load):
    """Its stand-in is not judged a second time, whatever the words of the first complaint."""
    assert len(problems(load, "z_m,value\nx,1\n2,1\n")) == 1
    assert len(problems(load, "x_m,value\n1,2\n1,3\n")) == 1
    assert len(problems(load, "z_m,value\nx,1\n-2,1\n")) == 2


def test_places_without_wavelengths_are_read_in_every_band(tmp_path):
    """A layout says where; a spectrometer reads all bands there. Readings must say which."""
    scene = Scene.from_dict({"detector": {"planes_m": [2.0], "bands_nm": [[440, 460], [500, 520]]}})
    path = tmp_path / "layout.csv"
    path.write_text("x_m,z_m\n0,2\n0.1,2\n")
    layout = read_table(path, scene, LAYOUT)
    assert layout.wavelength_nm.tolist() == [450.0, 510.0, 450.0, 510.0]
    assert layout.x_m.tolist() == [0.0, 0.0, 0.1, 0.1]
    path.write_text("x_m,z_m,value\n0,2,1\n0.1,2,1\n")
    with pytest.raises(MeasurementError, match="no wavelength"):
        read_table(path, scene)
