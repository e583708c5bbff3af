"""What a header line means, by its label, in the languages the instrument programs come in."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from datetime import datetime

from lightfield.readings.instruments.oddity import Odd, Oddity

# Matched against the label in lower case without accents.
_LABELS = {
    "integration": r"(?!.*\bauto)(?=.*(integra|e[xs]pos|belicht))"
    r"(?=.*(\b|_)(time|zeit|temps|tiempo|tempo)|.*zeit|exposure\s*[\[(]).*",
    "averaged": r".*(spectra averaged|scans? to average|mittelung|moyenn|promedi|\bmediat).*",
    "boxcar": r".*(boxcar|alisar|furgon|lissage|glattung).*",
    "electric_dark": r".*(electric(al)? dark|elektrisch\w* dunkel|noir electri|electrica.*obscuridad).*",
    "nonlinearity": r".*(non-? ?linear|nicht-? ?linear|no linealidad).*",
    "dark_held": r"dark spectrum present.*",
    "spectrometer": r"(spectrom|spektrom|espectrom|spettrom).*",
    "date": r"(date|datum|fecha|data)",
    "pixels": r".*(number of|anzahl|nombre de|numero d[ei]|aantal).*pixels?.*",
    "axis": r"x-? ?(axis|achse).*",
}
_YES = {"yes", "true", "ja", "oui", "si", "sim", "on", "enabled", "1"}
_NO = {"no", "false", "nein", "nee", "non", "nao", "off", "disabled", "0"}
_PER_SECOND = {
    **dict.fromkeys(
        ("usec", "us", "µs", "μs", "µseg", "μseg", "microsec", "microseconds", "microsegundos"), 1e6
    ),
    **dict.fromkeys(("msec", "ms", "mseg", "millisec", "milliseconds", "milisegundos"), 1e3),
    **dict.fromkeys(
        ("sec", "s", "seg", "sek", "seconds", "segundos", "sekunden", "secondes", "secondi"), 1.0
    ),
}
_MONTHS = {
    1: "jan ene gen",
    2: "feb fev",
    3: "mar mrz maa",
    4: "apr avr abr",
    5: "may mai mag mei",
    6: "jun jui giu",
    7: "jul juil lug",
    8: "aug aou ago",
    9: "sep set",
    10: "oct okt ott out",
    11: "nov",
    12: "dec dez dic",
}
#: Hours of zones ahead of UTC, by words that mean one zone alone.
_AHEAD = {
    "UTC": 0, "GMT": 0, "WET": 0, "WEST": 1, "CET": 1, "MEZ": 1, "CEST": 2, "MESZ": 2, "EET": 2, "EEST": 3,
    "EST": -5, "EDT": -4, "CDT": -5, "MST": -7, "MDT": -6, "PST": -8, "PDT": -7, "AEST": 10, "AEDT": 11,
}  # fmt: skip
_MONTH_OF = {name: month for month, names in _MONTHS.items() for name in names.split()}


def folded(text: str) -> str:
    """Lower case without accents."""
    parts = unicodedata.normalize("NFKD", text.lower())
    return "".join(c for c in parts if not unicodedata.combining(c)).strip()


def lookup(header: Mapping[str, str], meaning: str) -> tuple[str, str] | None:
    """Label and text of the first header line with this meaning."""
    pattern = re.compile(_LABELS[meaning])
    return next(((label, text) for label, text in header.items() if pattern.fullmatch(folded(label))), None)


def flag(header: Mapping[str, str], meaning: str) -> bool | None:
    """A yes or no, None when the header does not say or says it in an unknown word."""
    found = lookup(header, meaning)
    words = re.findall(r"\w+", folded(found[1])) if found else []
    word = words[0] if words else ""
    return True if word in _YES else False if word in _NO else None


def count(header: Mapping[str, str], meaning: str) -> int | None:
    """A whole number, None when the header does not say."""
    found = lookup(header, meaning)
    match = re.match(r"\s*(\d{1,9})(?![\d.,])", found[1], re.ASCII) if found else None
    return int(match[1]) if match else None


def exposure_said(header: Mapping[str, str]) -> tuple[float, tuple[Oddity, ...]]:
    """Exposure in s, nan where the header does not say; and what is odd about what it says."""
    found = lookup(header, "integration")
    if found is None:
        return float("nan"), ()
    try:
        return seconds(*found), ()
    except ValueError as error:
        return float("nan"), (Oddity(Odd.EXPOSURE_UNKNOWN, label=found[0], why=str(error)),)


def seconds(label: str, text: str) -> float:
    """Exposure in s, from a line like `Integration Time (usec): 70000 (USB2+H11150)`.

    Raises
    ------
    ValueError
        No number, no unit, or a mark of which nobody can say whether it is decimal or thousands.
    """
    match = re.match(r"\s*([+-]?[\d.,]+(?:[eE][+-]?\d+)?)[\s;]*([a-zµμ]*)", text, re.ASCII | re.IGNORECASE)
    if not match:
        raise ValueError("holds no number")
    named = re.search(r"[(\[]\s*([^)\]]*?)\s*[)\]]|_(us|ms|s)$", label)
    unit = (named[1] or named[2] or "" if named else match[2]).lower().rstrip(".")
    if unit not in _PER_SECOND:
        raise ValueError(
            f"has {unit!r} for its unit of time, which is not known" if unit else "has no unit of time"
        )
    digits = match[1]
    grouped = re.fullmatch(r"[1-9]\d{0,2}([.,]\d{3})+", digits, re.ASCII)
    if grouped and ("," in digits or _PER_SECOND[unit] == 1e6):  # microseconds are whole numbers
        raise ValueError("has a mark that may be a decimal or a thousands mark")
    try:
        value = float(digits.replace(",", ".")) / _PER_SECOND[unit]
    except ValueError:
        raise ValueError("holds no number") from None
    if not 1e-7 <= value <= 1e5:
        raise ValueError("is not an exposure")
    return value


def moment(text: str) -> tuple[datetime, str] | None:
    """Date, time and zone name of a header; None when they cannot be told.

    The zone is a word of some language, so only moments with the same word can be compared.
    """
    clock = re.search(r"(\d{1,2}):(\d{2}):(\d{2})", text, re.ASCII)
    if not clock:
        return None
    rest = text[: clock.start()] + " " + text[clock.end() :]
    iso = re.search(r"\b(\d{4})-(\d{2})-(\d{2})\b", rest, re.ASCII)
    year = re.search(r"\b((?:19|20)\d{2})\b", rest, re.ASCII)
    try:
        hour, minute, second = (int(part) for part in clock.groups())
        if iso:
            return datetime(int(iso[1]), int(iso[2]), int(iso[3]), hour, minute, second), rest[
                iso.end() :
            ].strip()
        if not year:
            return None
        rest = rest[: year.start()] + " " + rest[year.end() :]
        day = re.search(r"\b(\d{1,2})\b", rest, re.ASCII)
        words = re.findall(r"[^\W\d]+", rest)
        months = [(w, m) for w in words if (m := _month(w))]
        if not day or not months:
            return None
        # The weekday comes before the month ("mar." is Tuesday in French, March in English): take the last.
        word, month = months[-1] if not _is_zone(months[-1][0]) else months[0]
        zone = " ".join(w for w in words if _is_zone(w) and w != word)
        return datetime(int(year[1]), month, int(day[1]), hour, minute, second), zone
    except ValueError:
        return None


def ahead_of_utc(zone: str) -> float | None:
    """Hours by which a zone's clock is ahead; None of a word that is not known, or means several zones."""
    return _AHEAD.get(zone.upper())


def _month(word: str) -> int | None:
    name = folded(word)
    return _MONTH_OF.get(name[:4]) or _MONTH_OF.get(name[:3])


def _is_zone(word: str) -> bool:
    return len(word) >= 2 and word.isupper()
