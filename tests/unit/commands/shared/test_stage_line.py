"""Progress where there is no terminal: a line now and then, none of what is quick."""

from __future__ import annotations

import sys
import time
from functools import partial

from lightfield.commands.shared import progress


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


def test_what_is_quick_is_silent(capsys) -> None:
    with progress.stage_line("reading") as stage:
        stage("done")
    assert capsys.readouterr() == ("", "")
