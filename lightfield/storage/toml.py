"""TOML that anybody may have written: what is too deep or too long is refused before it is parsed.

Python's parser recurses into nested values, and takes time like the square of the length of a dotted key.
"""

from __future__ import annotations

import contextlib
import re
import sys
from collections.abc import Mapping
from typing import Any

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

_MOST_NESTED = 8  # brackets and braces within each other
_MOST_NAMES = 16  # in a dotted key
_LONGEST_WORD = 1000  # a bare key, or a number

#: A number that is no part of a list, which a comma may follow.
_DECIMAL_COMMA = re.compile(r"=\s*([+-]?\d+,\d+)")
_WHOLE = re.compile(r"[+-]?(?:\d[\d_]*|0[xob][\da-fA-F_]+)", re.ASCII)
# Strings, closed or not, and comments hold no structure; every alternative takes at least one character, and
# none can be taken in two ways, so that the time is proportional to the length.
_TOKEN = re.compile(
    r'''"""(?:[^\\"]|\\.|"(?!""))*(?:"{3,5}|\\?\Z)'''
    r"""|'''(?:[^']|'(?!''))*(?:'{3,5}|\Z)"""
    r"""|"(?:[^"\\\n]|\\.)*"?|'[^'\n]*'?|\#[^\n]*"""
    r"""|(?P<mark>[\[\]{}=,.\n])|(?P<word>[^\s\[\]{}=,.\#"']+)""",
    re.DOTALL,
)


def loads(text: str) -> dict[str, Any]:
    """The values of a TOML text.

    Raises
    ------
    ValueError
        Not TOML, or beyond the limits; the message ends with the line.
    """
    _check_limits(text)
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        if at := _columns_at(text):
            raise ValueError(
                "these are columns of a table: were a scene and readings taken for each other? "
                f"(at line {at})"
            ) from None
        # Parsers say the line in words alone; a field for it is of Python 3.14.
        line = re.search(r"at line (\d+)", str(error))
        if line and (comma := _DECIMAL_COMMA.search(text.split("\n")[int(line[1]) - 1])):
            raise ValueError(
                f"{comma[1]} has a decimal comma, where TOML has a point: {comma[1].replace(',', '.')} "
                f"(at line {line[1]})"
            ) from None
        raise


def _columns_at(text: str) -> int | None:
    """Line of the names of columns that a table begins with; None of what is no table."""
    told = [(k, line) for k, line in enumerate(text.splitlines(), 1) if line.strip() and line[0] != "#"]
    (at, first), *rows = told or [(0, "")]
    parted = [mark for mark in ",;\t" if mark in first and rows and all(mark in row for _, row in rows)]
    return at if parted and not re.search(r"[=\[\]]", first) else None


def value(text: str) -> Any:
    """One value as TOML reads it, and as plain text where it is not TOML.

    Raises
    ------
    ValueError
        Beyond the limits.
    """
    _check_limits(text)
    try:
        return tomllib.loads(f"value = {text.strip()}")["value"]
    except tomllib.TOMLDecodeError:
        return text.strip()


def _check_limits(text: str) -> None:
    depth = dots = 0
    for token in _TOKEN.finditer(text):
        mark = token["mark"]
        if mark == ".":
            dots += 1
        elif mark:
            dots = 0
            depth += (mark in "[{") - (mark in "]}")
        elif token["word"] and (problem := _problem_of(token, text)):
            raise _beyond(problem, text, token)
        if dots >= _MOST_NAMES:
            raise _beyond(f"more than {_MOST_NAMES} names in a dotted key", text, token)
        if depth > _MOST_NESTED:
            raise _beyond(f"more than {_MOST_NESTED} values within each other", text, token)


def _problem_of(token: re.Match[str], text: str) -> str | None:
    word = token["word"]
    if len(word) > _LONGEST_WORD:
        return f"a word of {len(word)} characters, at most {_LONGEST_WORD}"
    part_of_float = "." in (text[token.start() - 1 : token.start()], text[token.end() : token.end() + 1])
    if len(word) > 18 and not part_of_float and _WHOLE.fullmatch(word):
        digits = word.lstrip("+-").replace("_", "")
        base = {"0x": 16, "0o": 8, "0b": 2}.get(digits[:2], 10)
        with contextlib.suppress(ValueError):  # not a number: the parser says so
            if int(digits, base) >= 1 << 63:
                return "a whole number beyond 64 bits"
    return None


def _beyond(what: str, text: str, token: re.Match[str]) -> ValueError:
    return ValueError(f"{what} (at line {text.count(chr(10), 0, token.start()) + 1})")


def with_notes(text: str, notes: Mapping[str, str]) -> str:
    """A TOML text with comments beside keys, by their dotted names; each stands on a line of its own."""
    lines, table = [], ""
    for line in text.splitlines():
        if line.startswith("["):
            table = line.strip("[]")
        note = notes.get(f"{table}.{line.partition(' = ')[0]}")
        lines.append(f"{line}  # {note}" if note else line)
    return "\n".join(lines) + "\n"
