"""Numbers of the diagnosis that were chosen: which they are, where they act, and others in their place."""

from __future__ import annotations

import ast
import importlib
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import CodeType, FrameType, ModuleType
from typing import Any

import lightfield

HOUSE = Path(lightfield.__file__).parent
ROOMS = ("diagnosis", "fitting")
#: As `tests/unit/test_constants.py` asks of every number there.
_CHOSEN = re.compile(r"\bchosen\b", re.IGNORECASE)
#: Of every number; of what lies between `_TO_ONE` and one, a probability near one, what is left to it.
FACTORS = (0.5, 2.0)
_TO_ONE = 0.5


@dataclass(frozen=True)
class Chosen:
    """One name for one number, or for several that go together.

    Parameters
    ----------
    module : str
        Dotted, where it is defined.
    """

    module: str
    name: str
    value: Any

    @property
    def label(self) -> str:
        return f"{self.module.removeprefix('lightfield.')}.{self.name}"


def chosen() -> list[Chosen]:
    """Every number that its comment calls chosen, and that is more than a count below two."""
    out = []
    for room in ROOMS:
        for path in sorted((HOUSE / room).rglob("*.py")):
            text = path.read_text(encoding="utf-8")
            lines, module = text.splitlines(), _dotted(path)
            stated = (n for n in ast.parse(text).body if isinstance(n, (ast.Assign, ast.AnnAssign)))
            for node in stated:
                if _CHOSEN.search(_above(lines, node.lineno - 1)):
                    held = vars(importlib.import_module(module))
                    out += [Chosen(module, name, held[name]) for name in _assigned(node)]
    return [one for one in out if any(other(one.value, factor) is not None for factor in FACTORS)]


def other(value: Any, factor: float) -> Any:
    """Half or double a number, or numbers, in its place; None where that is none, or the same."""
    if isinstance(value, bool) or value is None or isinstance(value, str):
        return None
    if isinstance(value, (int, float)):
        if isinstance(value, int):
            changed: float = max(round(value * factor), 1)
        else:
            changed = 1 - (1 - value) * factor if _TO_ONE < value < 1 else value * factor
        return None if changed == value else changed
    if isinstance(value, tuple):
        each = [other(v, factor) for v in value]
        kept = tuple(v if new is None else new for v, new in zip(value, each, strict=True))
        return None if all(new is None for new in each) else kept
    if isinstance(value, dict):
        changed_values = other(tuple(value.values()), factor)
        return None if changed_values is None else dict(zip(value, changed_values, strict=True))
    return None


@contextmanager
def instead(one: Chosen, value: Any) -> Iterator[None]:
    """Another value wherever the name is used: in its module, where it is imported, and in defaults.

    What was computed from it when a module was imported keeps the value that it had.
    """
    holders = _holders(one)
    before = [(f, f.__defaults__) for f in _with_default(one)]
    for module in holders:
        setattr(module, one.name, value)
    for function, defaults in before:
        function.__defaults__ = tuple(value if d is one.value else d for d in defaults)
    try:
        yield
    finally:
        for module in holders:
            setattr(module, one.name, one.value)
        for function, defaults in before:
            function.__defaults__ = defaults


class Used:
    """Which names the functions that ran look up, by module: what did not run, no number of it can change."""

    def __init__(self) -> None:
        self._seen: set[CodeType] = set()

    def __enter__(self) -> Used:
        sys.setprofile(self._note)
        return self

    def __exit__(self, *_: object) -> None:
        sys.setprofile(None)

    def _note(self, frame: FrameType, event: str, arg: object) -> None:
        if event == "call":
            self._seen.add(frame.f_code)

    @property
    def names(self) -> set[tuple[str, str]]:
        """(file, name) of every name that a function which ran may look up."""
        return {(code.co_filename, name) for code in self._seen for name in code.co_names}

    def by(self, one: Chosen) -> bool:
        """Did a function run that looks this number up?"""
        files = {m.__file__ for m in _holders(one)}
        looked_up = any((file, one.name) in self.names for file in files)
        return looked_up or any(f.__code__ in self._seen for f in _with_default(one))


def _holders(one: Chosen) -> list[ModuleType]:
    """Modules where the name stands for it: its own, and, of a public one, those that import it."""
    private = one.name.startswith("_")
    named = [m for m in _modules() if vars(m).get(one.name) is one.value]
    return [m for m in named if m.__name__ == one.module or not private]


def _modules() -> list[ModuleType]:
    return [m for name, m in sys.modules.items() if name.startswith("lightfield") and m is not None]


def _functions(module: ModuleType) -> Iterator[Any]:
    for thing in vars(module).values():
        if getattr(thing, "__module__", None) == module.__name__:
            for function in [thing, *(vars(thing).values() if isinstance(thing, type) else ())]:
                if isinstance(getattr(function, "__defaults__", None), tuple):
                    yield function


def _with_default(one: Chosen) -> list[Any]:
    """Functions that take the number unless told otherwise; small counts cannot be told from others."""
    if not isinstance(one.value, (float, tuple, dict)):
        return []
    return [f for m in _modules() for f in _functions(m) if any(d is one.value for d in f.__defaults__)]


def _dotted(path: Path) -> str:
    parts = path.relative_to(HOUSE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _assigned(node: ast.Assign | ast.AnnAssign) -> list[str]:
    targets = node.targets if isinstance(node, ast.Assign) else [node.target]
    return [n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name)]


def _above(lines: list[str], at: int) -> str:
    """The comment above a line."""
    first = at
    while first and lines[first - 1].startswith("#:"):
        first -= 1
    return " ".join(lines[first:at])
