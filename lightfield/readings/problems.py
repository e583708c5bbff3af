"""Collects everything that is wrong with a file, so that it is reported in one go with its lines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NoReturn

from lightfield.errors import SHOWN, MeasurementError, brief

ALONE = 5  # so many problems of one kind are listed one by one; more share a line that names all their places
LONGEST = 60


@dataclass(frozen=True)
class _Problem:
    place: int | None
    what: str
    found: str | None
    rule: str | None
    remedy: str | None
    column: str | None
    whole: bool


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
        column: str | None = None,
        whole: bool = False,
    ) -> None:
        """Note one problem.

        Parameters
        ----------
        place : int, optional
            Line number (from 1); None for the whole file.
        column : str, optional
            The column whose cell could not be read there; with `whole`, none of its cells could.
        """
        shown = None if found is None else shorten(found)
        self.found.append(_Problem(place, what, shown, rule, remedy, column, whole))

    def unread(self) -> set[tuple[str, int | None]]:
        """Column and line of the cells that could not be read; line None: the whole column."""
        return {(p.column, None if p.whole else p.place) for p in self.found if p.column is not None}

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

    def refuse(self, what: str, why: str, **about: Any) -> NoReturn:
        """Note why the whole of it is of no use, as `add` takes it, and raise with all of them."""
        self.add(why, **about)
        self.raise_any(what)
        raise AssertionError  # not reached

    def _line(self, problem: _Problem, places: Sequence[int]) -> str:
        parts = [problem.what]
        if places:
            plural = "s" if len(places) > 1 else ""
            parts[0] = f"{self.noun}{plural} {line_ranges(places)}: {problem.what}"
        if problem.found is not None:
            parts.append(f"{'first ' if len(places) > 1 else ''}found {problem.found}")
        if problem.rule:
            parts.append(f"rule: {problem.rule}")
        if problem.remedy:
            parts.append(f"remedy: {problem.remedy}")
        return "; ".join(parts)


def line_ranges(places: Sequence[int]) -> str:
    """Line numbers in few characters: 3-5, 9; beyond ten such entries, how many more there are."""
    out: list[str] = []
    ordered = sorted(set(places))
    start = 0
    for k, place in enumerate(ordered):
        if len(out) == SHOWN:
            out.append(f"and {len(ordered) - start} more")
            break
        if k + 1 == len(ordered) or ordered[k + 1] != place + 1:
            out.append(str(place) if start == k else f"{ordered[start]}-{place}")
            start = k + 1
    return ", ".join(out)


def shorten(value: object) -> str:
    """A value as it may stand in a one-line message."""
    return brief(value, LONGEST)
