"""TOML within limits: what is sound is read as the standard library reads it, what is deep or long is
refused at once.

The limits are checked by one pass over the text: a file of the largest size takes about a second, where
the parser alone needs hours (a dotted key of 10,000 names) or ends in a RecursionError.
"""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lightfield.storage import toml
from lightfield.storage.toml import tomllib

SOUND = {
    "dots in a string": f'a = "{"." * 500}"',
    "dots in a comment": f"a = 1 # {'.' * 500}",
    "brackets in strings": "a = '[[[[[[[[[[[[' # [[[[[[[[[[[[\nb = \"{{{{{{{{{{{{{{\"",
    "strings of several lines": 'a = """x\n"." \\""" ' + "[" * 20 + "\"\"\"\nb = '''[[[[[[[[[[[[''''\n",
    "many flat keys": "\n".join(f"a.b{n} = 1" for n in range(1000)),
    "a long list": f"a = [{'[1.5, 2.5], ' * 2000}]",
    "a float of many digits": "a = 0.12345678901234567890123\nb = 123456789012345678901234.5\nc = 1e300",
    "the largest whole number": f"a = {2**63 - 1}\nb = 0x7fff_ffff_ffff_ffff\nc = {-(2**63) + 1}",
}
BEYOND = {
    "a dotted key of 500 names": ".".join("a" * 500) + " = 1",
    "a dotted key of 10,000 names": ".".join("a" * 10_000) + " = 1",
    "quoted names": "x = 1\n" + " . ".join(['"a"'] * 100) + " = 1",
    "a deep table": f"[{'.'.join('a' * 500)}]",
    "lists within lists": "a = " + "[" * 2000 + "]" * 2000,
    "tables within tables": "a = " + "{a = " * 2000 + "1" + "}" * 2000,
    "5,000 digits": "a = " + "9" * 5000,
    "5,000 hexadecimal digits": "a = 0x" + "f" * 5000,
    "more than 64 bits": f"a = {2**63}",
    "a key of 5,000 letters": "a" * 5000 + " = 1",
}


@pytest.mark.parametrize("case", SOUND)
def test_sound_text_is_read_as_ever(case: str) -> None:
    assert toml.loads(SOUND[case]) == tomllib.loads(SOUND[case])


@pytest.mark.parametrize("case", BEYOND)
def test_beyond_the_limits_is_one_error_with_its_line(case: str) -> None:
    with pytest.raises(ValueError, match=rf"at line {1 + BEYOND[case].count(chr(10))}\)$"):
        toml.loads(BEYOND[case])


@given(st.text(alphabet="ab.[]{}=\"'#\\\n ,1_", max_size=60))
def test_the_limits_refuse_nothing_that_is_small(text: str) -> None:
    """Neither strings nor comments are mistaken for structure: the parser's word stands."""
    try:
        expected = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        expected = str(error)
    try:
        found = toml.loads(text)
    except ValueError as error:
        found = str(error)
    refused = any(
        word in str(found) for word in ("at most", "more than", "columns of a table", "decimal comma")
    )
    assert found == expected or refused


def test_a_table_taken_for_toml_is_told() -> None:
    """With the line of its names; a line of TOML that is wrong stays the parser's."""
    with pytest.raises(ValueError, match=r"columns of a table.*at line 2\)$"):
        toml.loads("# note\nx_m,z_m,value\n0,1,2\n0,2,1\n")
    with pytest.raises(ValueError, match="Unclosed"):
        toml.loads("a = [1, 2\nb = 3, 4\n")


@pytest.mark.parametrize("line", ["a = 0,12 # a guess", "b = { peak_nm = -0,12, fwhm_nm = 25 }"])
def test_a_decimal_comma_is_told(line: str) -> None:
    """With the number as TOML has it; of a list a comma parts the numbers."""
    with pytest.raises(ValueError, match=r"0,12 has a decimal comma.*point: -?0\.12 \(at line 2\)$"):
        toml.loads(f"c = 1\n{line}\n")
    assert toml.loads("a = [0,12]") == {"a": [0, 12]}


@pytest.mark.parametrize(
    "text", ['"""' * 10**5 + "\\", '"\\' * 10**5, '\\"""' * 10**5, "'" * 10**6, "a." * 10**5]
)
def test_hostile_text_takes_one_pass(text: str) -> None:
    """Would take minutes if a string that is never closed were looked at again from every place in it."""
    with pytest.raises(ValueError):
        toml.loads(text)


def test_one_value() -> None:
    assert toml.value(" 0.5 ") == 0.5 and toml.value("flat") == "flat" and toml.value('"flat"') == "flat"
    with pytest.raises(ValueError, match="5000 characters"):
        toml.value("9" * 5000)


def test_notes_stand_beside_their_keys() -> None:
    text = 'name = "a"\n\n[lamp]\nhwhm_deg = 4.0\n\n[water]\nhwhm_deg = 4.0\n\n[water.phase]\ng = 0.9\n'
    noted = toml.with_notes(
        text, {"lamp.hwhm_deg": "± 0.1", "water.phase.g": "(at boundary)", "lamp.no": "x"}
    )
    assert noted.splitlines()[3] == "hwhm_deg = 4.0  # ± 0.1" and noted.splitlines()[6] == "hwhm_deg = 4.0"
    assert noted.splitlines()[-1] == "g = 0.9  # (at boundary)"
    assert toml.loads(noted) == toml.loads(text) and toml.with_notes(text, {}) == text
