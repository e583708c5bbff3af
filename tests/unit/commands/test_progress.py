"""Where there is no terminal a long command says now and then how far it is, and how long it may take."""

from __future__ import annotations

import time

import pytest

from lightfield.commands._progress import part_of_trace, status_lines, times


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
