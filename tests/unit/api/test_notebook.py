"""A notebook shows how far long work is, in a line that is gone at the end; nothing else does."""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any

import pytest

from lightfield.api import notebook
from lightfield.progress import tell


class Line:
    """What IPython's display gives where it is asked for an identity."""

    def __init__(self) -> None:
        self.texts: list[str] = []

    def display(self, data: dict[str, str], *, raw: bool, display_id: bool) -> Line:
        assert raw and display_id
        return self.update(data)

    def update(self, data: dict[str, str], raw: bool = True) -> Line:
        self.texts.append(data["text/plain"])
        return self


def in_notebook(monkeypatch: pytest.MonkeyPatch, *, kernel: bool) -> Line:
    line, shell = Line(), SimpleNamespace(kernel=object()) if kernel else SimpleNamespace()
    fake: Any = SimpleNamespace(get_ipython=lambda: shell, display=SimpleNamespace(display=line.display))
    monkeypatch.setitem(sys.modules, "IPython", fake)
    return line


def test_a_notebook_shows_stages_and_parts_and_ends_with_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    line = in_notebook(monkeypatch, kernel=True)
    monkeypatch.setattr(notebook, "FIRST_S", 0.0)
    monkeypatch.setattr(notebook, "EVERY_S", 0.0)
    with notebook.told_in_notebook("diagnose") as stage:
        stage("one effect at a time")
        tell("tracing", 0.25)
    first, second, last = line.texts
    assert first.startswith("diagnose: one effect at a time; ")
    assert second.startswith("diagnose: tracing, 25 % done; ")
    assert last == ""


@pytest.mark.parametrize(("kernel", "first_s"), [(False, 0.0), (True, 60.0)])
def test_terminals_and_quick_work_show_nothing(
    monkeypatch: pytest.MonkeyPatch, kernel: bool, first_s: float
) -> None:
    line = in_notebook(monkeypatch, kernel=kernel)
    monkeypatch.setattr(notebook, "FIRST_S", first_s)
    with notebook.told_in_notebook("render") as stage:
        stage("anything")
        tell("anything", 0.5)
    assert line.texts == []
