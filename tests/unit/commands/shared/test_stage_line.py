"""Progress where there is no terminal: a line now and then, none of what is quick."""

from __future__ import annotations

import sys
import time
from contextlib import contextmanager
from functools import partial

from lightfield.commands.shared import progress
from lightfield.progress import step, tell


def test_a_long_stage_is_told_again_and_again(capsys, monkeypatch) -> None:
    often = partial(progress.status_lines, every_s=0.01)
    monkeypatch.setattr(progress, "status_lines", often)
    lines = ""
    with progress.stage_line("reading") as stage:
        stage("12 sets of effects tried")
        until = time.monotonic() + 5
        while lines.count("\n") < 2 and time.monotonic() < until:
            time.sleep(0.01)
            sys.stderr.flush()
            lines += capsys.readouterr().err
    assert lines.count("reading: 12 sets of effects tried; ") >= 2


def test_a_trace_within_a_stage_is_heard_while_it_lasts(monkeypatch) -> None:
    """What traces light lies many calls below, and knows no stage."""
    shown: list[str] = []

    @contextmanager
    def kept(name: str):
        yield lambda words, part: shown.append(words)

    monkeypatch.setattr(progress, "status_lines", kept)
    with progress.stage_line("reading") as stage:
        stage("noise of 90 readings")
        with step(0, 2, "g = 0.8"):
            tell("1e+05 photons", 0.5)
        tell("2e+05 photons", 1.0)
        stage("one effect at a time")
    assert "noise of 90 readings; g = 0.8: 1e+05 photons, 25 %" in shown
    assert shown[-2:] == ["noise of 90 readings", "one effect at a time"]


def test_what_is_quick_is_silent(capsys) -> None:
    with progress.stage_line("reading") as stage:
        stage("done")
    assert capsys.readouterr() == ("", "")
