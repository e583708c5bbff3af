"""Errors a user can act on: each says where, what was found, the rule, and the remedy."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

SHOWN = 10  # so many problems of a list are printed
_LONGEST_VALUE, _LONGEST_LINE = 300, 2000
_LONGEST_LISTED = 80  # of a value on a line of a list


@dataclass(frozen=True)
class Complaint:
    """What is wrong with one thing, as data; its line is `str` of it.

    Parameters
    ----------
    what, found, rule, remedy
        As in `LightfieldError`; found where there are several lines is that of the first.
    key : str
        Dotted path of a scene's value; empty for the whole of what was read.
    where : str, optional
        File, where it is another than the error's own.
    lines : tuple of int
        Lines of the file, from 1; none for the whole of it.
    noun : str
        What they are: "reading" in a table made by a program.
    """

    what: str
    found: object = None
    rule: str | None = None
    remedy: str | None = None
    key: str = ""
    where: str | None = None
    lines: tuple[int, ...] = ()
    noun: str = "line"

    @property
    def head(self) -> str:
        """Where it is, and what is wrong."""
        lines = f"{self.noun}{'s' * (len(self.lines) > 1)} {line_ranges(self.lines)}" if self.lines else ""
        return ": ".join(filter(None, (self.key, self.where, lines, self.what)))

    def __str__(self) -> str:
        first = "first " if len(self.lines) > 1 else ""
        return _told(self.head, self.found, self.rule, self.remedy, _LONGEST_LISTED, first)


class LightfieldError(Exception):
    """Base of every error that lightfield raises on purpose.

    Parameters
    ----------
    what : str
        What is wrong, in one clause.
    where : str, optional
        File, and key or line, that the error is about.
    found : object, optional
        The offending value.
    rule : str, optional
        The rule it breaks, with the valid choices or range.
    remedy : str, optional
        What to do about it.
    problems : sequence of Complaint, optional
        All single problems found in one go; one alone stays on the line of `what`, and of many the first ten
        are printed.
    """

    def __init__(
        self,
        what: str,
        *,
        where: str | None = None,
        found: object = None,
        rule: str | None = None,
        remedy: str | None = None,
        problems: Sequence[Complaint] = (),
    ) -> None:
        self.what, self.where, self.found, self.rule, self.remedy = what, where, found, rule, remedy
        self.problems = tuple(problems)
        head = what if where is None else f"{where}: {what}"
        text, lines = _told(head, found, rule, remedy, _LONGEST_VALUE), [str(one) for one in problems]
        if len(lines) == 1:
            super().__init__(f"{text}: {_line(lines[0])}")
        else:
            super().__init__("\n".join([text, *(f"  {_line(line)}" for line in first_ten(lines))]))

    @property
    def complaints(self) -> tuple[Complaint, ...]:
        """Every single problem, each with its file, rule and remedy; without any, the error itself."""
        mine: dict[str, Any] = {"where": self.where, "rule": self.rule, "remedy": self.remedy}
        every = self.problems or (Complaint(self.what, self.found),)
        return tuple(replace(one, **{k: getattr(one, k) or v for k, v in mine.items()}) for one in every)


def _told(
    head: str, found: object, rule: str | None, remedy: str | None, longest: int, first: str = ""
) -> str:
    parts = [head]
    if isinstance(found, Mapping):
        every = (f"{name} = {brief(value, longest)}" for name, value in found.items())
        parts.append(f"found {', '.join(every)}")
    elif found is not None:
        parts.append(f"{first}found {brief(found, longest)}")
    if rule:
        parts.append(f"rule: {rule}")
    if remedy:
        parts.append(f"remedy: {remedy}")
    return "; ".join(map(_line, parts))


def first_ten(lines: Sequence[str]) -> list[str]:
    """The first ten lines of a list, and how many more there are."""
    if len(lines) <= SHOWN:
        return list(lines)
    return [*lines[:SHOWN], f"and {len(lines) - SHOWN} more"]


def line_ranges(lines: Sequence[int]) -> str:
    """Line numbers in few characters: 3-5, 9; beyond ten such entries, how many more there are."""
    out: list[str] = []
    ordered = sorted(set(lines))
    start = 0
    for k, line in enumerate(ordered):
        if len(out) == SHOWN:
            out.append(f"and {len(ordered) - start} more")
            break
        if k + 1 == len(ordered) or ordered[k + 1] != line + 1:
            out.append(str(line) if start == k else f"{ordered[start]}-{line}")
            start = k + 1
    return ", ".join(out)


def did_you_mean(word: str, known: Iterable[str], cutoff: float = 0.6) -> str | None:
    """Remedy for a word that is not known: the nearest that is; None where none is near."""
    near = difflib.get_close_matches(word, list(known), n=1, cutoff=cutoff)
    return f"did you mean {near[0]}?" if near else None


def one_line(error: BaseException) -> str:
    """What an error says, on one line."""
    return " ".join(str(error).split())


def brief(value: object, longest: int = _LONGEST_LISTED) -> str:
    """A value as Python writes it, on one line of so many characters at most."""
    try:
        text = " ".join(repr(value).split())
    except (ValueError, RecursionError):  # thousands of digits or of levels
        text = f"<{type(value).__name__} of a size that cannot be printed>"
    return text if len(text) <= longest else text[: longest - 3] + "..."


def _line(text: str) -> str:
    """Text that may come from a file, as one line."""
    text = re.sub(r"[\r\n]+\s*", " ", text)
    return text if len(text) <= _LONGEST_LINE else text[: _LONGEST_LINE - 3] + "..."


class RuleError(ValueError):
    """A rule that a value breaks, from its validator, which knows neither the file nor the key.

    Parameters
    ----------
    rule : str
        The rule.
    remedy : str, optional
        What to do about it.
    found : object, optional
        The offending value; where the rule is of several, their values by their keys.
    about : tuple of Complaint
        Of something that the value names, such as a table, with rules of their own; in the place of `rule`.
    """

    def __init__(
        self, rule: str, remedy: str | None = None, *, found: object = None, about: tuple[Complaint, ...] = ()
    ) -> None:
        self.rule, self.remedy, self.found, self.about = rule, remedy, found, about
        super().__init__(str(Complaint(rule, found, remedy=remedy)))

    @classmethod
    def of(cls, error: LightfieldError) -> RuleError:
        """The same from an error about something that the value names."""
        return cls(error.what, about=error.complaints)


class SceneWarning(UserWarning):
    """Something that a scene says, or is asked of it, does nothing."""


class SceneError(LightfieldError):
    """A scene, or a value given for one of its parameters, is not usable."""

    @classmethod
    def of(cls, complaints: Sequence[Complaint], where: str) -> SceneError:
        """All that is wrong with a scene: of one complaint the error's own fields, of several `problems`."""
        if len(complaints) > 1:
            return cls(f"{len(complaints)} problems in the scene", where=where, problems=complaints)
        (one,) = complaints
        return cls(one.head, where=where, found=one.found, rule=one.rule, remedy=one.remedy)


class MeasurementError(LightfieldError):
    """A reading table or an instrument file cannot be used as it is."""


class BackendError(LightfieldError):
    """No usable compute backend (LLVM or CUDA) was found."""


class RenderError(LightfieldError):
    """A light transport simulation cannot be run as asked."""


class FitError(LightfieldError):
    """A model cannot be fitted to these readings."""


class OutputError(LightfieldError):
    """A result cannot be written or read back."""


class UsageError(LightfieldError):
    """What is asked for does not make sense."""
