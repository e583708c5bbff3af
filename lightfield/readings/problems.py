"""Collects everything that is wrong with a file, so that it is reported in one go with its lines."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, NoReturn

from lightfield.errors import Complaint, MeasurementError

_ALONE = (
    5  # so many problems of one kind are listed one by one; more share a line that names all their places
)


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
    unread : set
        Column and line of the cells that could not be read; line None: the whole column.
    """

    where: str
    noun: str = "line"
    found: list[Complaint] = field(default_factory=list)
    head: dict[str, int] = field(default_factory=dict)
    unread: set[tuple[str, int | None]] = field(default_factory=set)

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
        lines = () if place is None else (place,)
        one = Complaint(what, found, rule, remedy, lines=lines, noun=self.noun)
        if not (self.found and lines and self.found[-1] == one):  # a line read once for every band
            self.found.append(one)
        if column is not None:
            self.unread.add((column, None if whole else place))

    def __bool__(self) -> bool:
        return bool(self.found)

    def by_kind(self) -> list[Complaint]:
        """Each problem; many of one kind are one that has all their lines."""
        kinds: dict[tuple[str, str | None, str | None], list[Complaint]] = {}
        for problem in sorted(self.found, key=lambda p: p.lines):
            kinds.setdefault((problem.what, problem.rule, problem.remedy), []).append(problem)
        out = []
        for group in kinds.values():
            every = tuple(line for one in group for line in one.lines)
            out += [replace(group[0], lines=every)] if len(group) > _ALONE else group
        return out

    def raise_any(self, what: str = "not a usable reading table") -> None:
        """Raise MeasurementError with all of them, when there are any."""
        if self.found:
            problems = self.by_kind()
            counted = f"{what}: {len(self.found)} problems" if len(problems) > 1 else what
            raise MeasurementError(counted, where=self.where, problems=problems)

    def refuse(self, what: str, why: str, **about: Any) -> NoReturn:
        """Note why the whole of it is of no use, as `add` takes it, and raise with all of them."""
        self.add(why, **about)
        self.raise_any(what)
        raise AssertionError  # not reached
