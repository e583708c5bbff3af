"""Small damage, of the kinds that people, programs and attackers do to text files."""

from __future__ import annotations

import random
import re

_SHORT = """nan inf -inf -0 -1 0 1e400 1e-320 1e308 -1e30 0x1F 1_000 007 1,5 0.1.2 4.5m 1e-9 true "text" "" ''
[] {} [1,[2,[3]]] ] = # ; , ,,,, %s {0} $x^$ [/red] a.b.c - -- 1979-05-27 07:32:00 1979-05-27T07:32:00Z
[[1,2]] é 日本 ٣ ½ ../../etc/passwd /dev/zero /proc/self/mem"""
NASTY = (
    *_SHORT.split(),
    *(
        "9" * 25,
        "9" * 5000,
        "0x" + "f" * 5000,
        "1e" + "9" * 20,
        str(2**63 - 1),
        "x" * 300,
        ".".join("a" * 3000),
    ),
    *("[" * 600, "{a=" * 300, '"""', " ", "\t", "\r", "\x1b[31m", "\x00", "\x9b", "\ufeff", "\u202e"),
    *('"\\u001b[2J"', "\U0001f4a1"),
)
_WORD = re.compile(r'[A-Za-z_][\w.-]*|"[^"\n]*"|[+-]?\d[\d.eE+-]*')


def mutated(text: str, words: list[str], rng: random.Random) -> bytes:
    """The text with one to four things done to it; `words` take the place of others."""
    for _ in range(rng.choice((1, 1, 1, 2, 2, 4))):
        text = rng.choice(_CHANGES)(text, words, rng)
    return rng.choice(_ENCODINGS)(text) if rng.random() < 0.1 else text.encode("utf-8", "surrogatepass")


def _another_word(text: str, words: list[str], rng: random.Random) -> str:
    found = list(_WORD.finditer(text))
    if not found:
        return text + rng.choice(NASTY)
    place = rng.choice(found)
    word = rng.choice(NASTY) if rng.random() < 0.7 else rng.choice(words)
    return text[: place.start()] + word + text[place.end() :]


def _another_number(text: str, words: list[str], rng: random.Random) -> str:
    found = list(re.finditer(r"[+-]?\d+\.?\d*(?:[eE][+-]?\d+)?", text))
    if not found:
        return text
    place = rng.choice(found)
    number = rng.choice(
        (
            rng.choice((-1, 1)) * 10 ** rng.uniform(-12, 12),
            float(rng.randint(-3, 100)),
            float(place[0]) * rng.lognormvariate(0, 0.7),  # often still possible
            float(place[0]) * rng.lognormvariate(0, 0.7),
        )
    )
    return text[: place.start()] + f"{number:#.7g}" + text[place.end() :]


def _lines(text: str, words: list[str], rng: random.Random) -> str:
    lines = text.splitlines(keepends=True) or [""]
    at, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    change = rng.randrange(6)
    if change == 0:
        del lines[at]
    elif change == 1:
        lines.insert(other, lines[at])
    elif change == 2:
        lines[at], lines[other] = lines[other], lines[at]
    elif change == 3:
        lines[at:at] = [lines[other]] * rng.choice((2, 30, 1000))
    elif change == 4:
        lines.insert(at, f"{rng.choice(words)} = {rng.choice(NASTY)}\n")
    else:
        lines[at] = ",".join(reversed(lines[at].strip().split(","))) + "\n"
    return "".join(lines)


def _characters(text: str, words: list[str], rng: random.Random) -> str:
    start = rng.randrange(len(text) + 1)
    length = rng.choice((0, 1, 5, 40, len(text)))
    insert = rng.choice(("", rng.choice(NASTY), chr(rng.randrange(0x300)), '"', "]", "[", "\n", text[:50]))
    return text[:start] + insert + text[start + length :]


def _everywhere(text: str, words: list[str], rng: random.Random) -> str:
    return text.replace(*rng.choice(_REPLACED))


def _shuffled(text: str, words: list[str], rng: random.Random) -> str:
    lines = text.splitlines()
    rng.shuffle(lines)
    return "\n".join(lines)


_REPLACED = ((",", ";"), (".", ","), ("\n", "\r\n"), ("\n", "\r"), ("_m", "_mm"), ("= ", "= -"), ("0", ""))
_CHANGES = (
    *(4 * [_another_word] + 4 * [_another_number] + 3 * [_lines] + 3 * [_characters]),
    *(_everywhere, _shuffled),
)
_ENCODINGS = (
    lambda text: text.encode("utf-16", "surrogatepass"),
    lambda text: text.encode("utf-16-le", "surrogatepass"),
    lambda text: text.encode("latin-1", "replace"),
    lambda text: b"\xef\xbb\xbf" + text.encode("utf-8", "surrogatepass"),
    lambda text: text.encode("utf-8", "surrogatepass") + b"\xff\xfe\x00",
    lambda text: b"",
)
