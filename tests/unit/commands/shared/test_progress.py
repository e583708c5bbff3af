"""Where there is no terminal a long command says now and then how far it is, and how long it may take."""

from __future__ import annotations

import time

import pytest

from lightfield.commands.shared.progress import status_lines, times
from lightfield.commands.sweep import progress_in_words
from lightfield.progress import duration, heard_by, part_of_trace, step, tell
from lightfield.sweep.runner import SweepProgress


def test_nothing_is_said_of_what_is_quickly_done(capsys):
    with status_lines("sweep") as note:
        note("1 of 2 cases", 0.5)
    assert capsys.readouterr().err == ""


def test_lines_come_also_while_the_work_says_nothing(capsys):
    with status_lines("sweep", every_s=0.01) as note:
        note("1 of 2 cases", 0.5)
        for _ in range(500):  # five seconds for a machine that is busy
            time.sleep(0.01)
            if "sweep: 1 of 2 cases; " in (said := capsys.readouterr().err):
                break
    assert "sweep: 1 of 2 cases; " in said and " left" in said


def test_time_left():
    assert times(30, 0.5) == "30 s so far, about 30 s left"
    assert times(30, 0.0) == "30 s so far" and times(30, 1.0) == "30 s so far"


@pytest.mark.parametrize(
    ("photons", "reached", "limit", "part"),
    [
        (1e6, 0.04, 1e9, 0.25),  # half the error takes four times the photons
        (9e6, 0.20, 1e7, 0.90),  # but no more than the limit
        (1e6, float("inf"), 1e7, 0.1),
        (2e7, 0.01, 1e9, 1.0),
    ],
)
def test_the_part_of_a_trace_knows_its_error_and_its_photon_limit(photons, reached, limit, part):
    assert part_of_trace(photons, reached, 0.02, limit) == pytest.approx(part)


def test_steps_within_steps_are_parts_of_the_whole():
    """Two steps, the second of them of four: half way through its third is 0.5 + 0.5 * 2.5 / 4."""
    heard: list[tuple[str, float]] = []
    with heard_by(lambda words, part: heard.append((words, part))):
        with step(0, 2, "light"):
            tell("1e6 photons", 0.3)
        with step(1, 2, "poses"), step(2, 4):
            tell("2e6 photons", 0.5)
    assert ("light: 1e6 photons", pytest.approx(0.15)) in heard
    assert ("poses: 2e6 photons", pytest.approx(0.8125)) in heard
    parts = [part for _, part in heard]
    assert parts == sorted(parts) and parts[-1] == 1.0


def test_where_nobody_listens_nothing_is_told_and_a_listener_leaves_with_its_work():
    heard: list[float] = []
    with heard_by(lambda words, part: heard.append(part)):
        pass
    with step(0, 1, "light"):
        tell("1e6 photons", 0.3)
    assert heard == []


def test_a_sweep_moves_while_a_single_trace_runs():
    """Ten cases of two traces: twelve pieces, of which one case, one trace and a half are done."""
    before = SweepProgress(cases=10, traces=2, cases_done=1, traced=1)
    now = SweepProgress(cases=10, traces=2, cases_done=1, traced=1, underway={1: 0.5})
    assert before.part == pytest.approx(2 / 12) and now.part == pytest.approx(2.5 / 12)
    assert progress_in_words(now) == "1 of 10 cases, 1 of 2 traces and 50 % of the next"
    assert progress_in_words(before) == "1 of 10 cases, 1 of 2 traces"
    continued = SweepProgress(cases=10, traces=0, cases_before=8, cases_done=1, failed=1)
    assert continued.part == pytest.approx(0.5)
    assert progress_in_words(continued) == "9 of 10 cases, 1 failed"


@pytest.mark.parametrize(
    ("seconds", "said"),
    [
        (0.34, "0.34 s"),
        (81, "81 s"),
        (94, "94 s"),
        (119.4, "119 s"),
        (120, "2 min"),
        (5000, "83 min"),
        (5400, "1.5 h"),
    ],
)
def test_a_time_loses_less_than_a_quarter_of_it_to_its_unit(seconds: float, said: str) -> None:
    assert duration(seconds) == said
