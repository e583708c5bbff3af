"""Names and numbers are written for people in one way."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

import lightfield
from lightfield.diagnosis.verdict.parts import Reason
from lightfield.wording import capital, minus, plain, rounded, with_error


def test_names_are_words() -> None:
    assert plain("beam_tilt") == "beam tilt" and plain("+ cdom") == "+ CDOM"
    assert plain("cdom + stray_light") == "CDOM + stray light" and plain("cdoms") == "cdoms"
    assert capital("what CDOM does") == "What CDOM does" and capital("") == ""
    assert minus("-0.3") == "\N{MINUS SIGN}0.3" and minus("0.3") == "0.3"


def test_they_are_made_in_one_place() -> None:
    """Elsewhere nobody swaps an underscore for a space, nor a hyphen for a minus sign; a search may. Nor does
    anybody else begin a sentence."""
    package = Path(lightfield.__file__).parent
    swaps = re.compile(r"""replace\((["'])_\1, (["']) \2\)|replace\((["'])-\3, (["'])(−|\\N\{MINUS)""")
    raises = re.compile(r"\[:1\]\.upper\(\)|\[0\]\.upper\(\) \+|\.capitalize\(\)")
    texts = {file: file.read_text(encoding="utf-8") for file in package.rglob("*.py")}
    assert {file.name for file, text in texts.items() if swaps.search(text)} == {"wording.py", "par.py"}
    assert {file.name for file, text in texts.items() if raises.search(text)} == {"wording.py"}


def test_a_reason_is_said_shorter_without_its_cause() -> None:
    assert {one: one.short for one in Reason if one.short != one} == {Reason.TOO_WIDE: Reason.UNDETERMINED}
    assert all(str(one).startswith(str(one.short)) for one in Reason)


def test_a_rounded_number_is_written_out() -> None:
    assert [rounded(v) for v in (848.3, 3123.0, 0.01234, 12.0)] == ["850", "3100", "0.012", "12"]
    assert rounded(2.1249, 3) == "2.12"


@pytest.mark.parametrize(
    ("value", "error", "says"),
    [
        (-0.000525, 0.11, "0.00 ± 0.11"),
        (3.9558, 0.0482, "3.956 ± 0.048"),
        (0.0197, 0.000712, "0.0197 ± 0.0007"),
        (4.00083, 0.000011, "4.0008 ± 0.0001"),
        (35.2, 41.0, "35 ± 41"),
        (7.31, 0.0996, "7.31 ± 0.10"),
        (1212.3, 381.0, "1210 ± 380"),
        (0.0, 0.0, "0 ± 0"),
        (4.1234, math.nan, "4.12"),
    ],
)
def test_a_value_has_the_digits_that_its_error_allows(value: float, error: float, says: str) -> None:
    """Of a mean of no size with an error of a tenth "-0.000525 ± 0.11" was told."""
    assert with_error(value, error) == says
