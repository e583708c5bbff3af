"""Collects everything that is wrong with a file, so that it is reported in one go with its lines."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from lightfield.errors import MeasurementError

ALONE = 5  # so many problems of one kind are listed one by one; more share a line that names all their places
LONGEST = 60


@dataclass(frozen=True)
class _Problem:
    place: int | None
    what: str
    found: str | None
    rule: str | None
    remedy: str | None


@dataclass
class Problems:
    """What is wrong, in the order in which it was found.

    Parameters
    ----------
    where : str
        File (or object) that is read.
    noun : str
        What a place is: "line" in a file, "reading" in a table made by a program.
    head : mapping
        Line of every entry of the file's head.
    """

    where: str
    noun: str = "line"
    found: list[_Problem] = field(default_factory=list)
    head: dict[str, int] = field(default_factory=dict)

    def add(
        self,
        what: str,
        *,
        place: int | None = None,
        found: object = None,
        rule: str | None = None,
        remedy: str | None = None,
    ) -> None:
        """Note one problem; `place` is a line number (from 1) or None for the whole file."""
        self.found.append(_Problem(place, what, None if found is None else shorten(found), rule, remedy))

    def unread(self) -> dict[str, set[int | None]]:
        """Where cells of a column could not be read, by column; None: the column is missing."""
        out: dict[str, set[int | None]] = {}
        for problem in self.found:
            out.setdefault(problem.what.split(" ", 1)[0], set()).add(problem.place)
            if match := re.fullmatch(r"the column (\w+) is missing", problem.what):
                out.setdefault(match[1], set()).add(None)
        return out

    def __bool__(self) -> bool:
        return bool(self.found)

    def lines(self) -> list[str]:
        """One line per problem; many of one kind share a line that lists all their places."""
        kinds: dict[tuple[str, str | None, str | None], list[_Problem]] = {}
        for problem in sorted(self.found, key=lambda p: p.place or 0):
            kinds.setdefault((problem.what, problem.rule, problem.remedy), []).append(problem)
        out = []
        for group in kinds.values():
            if len(group) > ALONE:
                out.append(self._line(group[0], [p.place for p in group if p.place is not None]))
            else:
                out.extend(self._line(p, [] if p.place is None else [p.place]) for p in group)
        return out

    def raise_any(self, what: str = "not a usable reading table") -> None:
        """Raise MeasurementError with all of them, when there are any."""
        if self.found:
            lines = self.lines()
            counted = f"{what}: {len(self.found)} problems" if len(lines) > 1 else what
            raise MeasurementError(counted, where=self.where, problems=lines)

    def _line(self, problem: _Problem, places: Sequence[int]) -> str:
        parts = [problem.what]
        if places:
            plural = "s" if len(places) > 1 else ""
            parts[0] = f"{self.noun}{plural} {ranges(places)}: {problem.what}"
        if problem.found is not None:
            parts.append(f"{'first ' if len(places) > 1 else ''}found {problem.found}")
        if problem.rule:
            parts.append(f"rule: {problem.rule}")
        if problem.remedy:
            parts.append(f"remedy: {problem.remedy}")
        return "; ".join(parts)


def ranges(places: Sequence[int]) -> str:
    """Line numbers in few characters: 3-5, 9."""
    out: list[str] = []
    ordered = sorted(set(places))
    start = 0
    for k, place in enumerate(ordered):
        if k + 1 == len(ordered) or ordered[k + 1] != place + 1:
            out.append(str(place) if start == k else f"{ordered[start]}-{place}")
            start = k + 1
    return ", ".join(out)


def shorten(value: object) -> str:
    """A value as it may stand in a one-line message."""
    text = repr(value)
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."
