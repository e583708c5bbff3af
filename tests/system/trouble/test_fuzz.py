"""Thousands of wrong inputs, none of which may end in anything but success or one clear error.

Rationale: what people and programs hand to the program is wrong in ways that nobody thinks of. Set-up:
sound files of every kind, damaged at random, and options that make no sense, in commands that do not
trace, one after the other in one process; seeds change from run to run. Expected: exit code 0 or 2, one
error and no more, no commands to the terminal, no traceback, no case that takes longer than a minute. A
failure prints the seed and the case, which `python -m fuzz` repeats.
"""

from __future__ import annotations

import importlib
import os
import random
import subprocess
import sys
from pathlib import Path

import pytest

from lightfield.commands.shared.progress import times

CASES = 3000
TESTS = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(
    ("words", "passed_s", "done"), [("", 10.2, 0.0), ("trace 1 of 3; 4e5 photons", 125.0, 0.3), ("x", 6e3, 0)]
)
def test_how_far_work_is_may_be_said_beside_a_success(
    words: str, passed_s: float, done: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(TESTS)
    progress = importlib.import_module("fuzz.__main__").PROGRESS
    line = "; ".join(filter(None, (words, times(passed_s, done))))
    assert progress.fullmatch(f"compare: {line}\n")
    assert not progress.fullmatch("lightfield: something else\n")


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_wrong_input_is_success_or_one_clear_error() -> None:
    seed = random.randrange(10**6)
    path = os.pathsep.join([str(TESTS.parent), str(TESTS), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-m", "fuzz", "--seed", str(seed), "--count", str(CASES)],
        cwd=TESTS,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    # The end of the standard error names the case that ended the process or took too long.
    assert done.returncode == 0, f"seed {seed}\n{done.stdout[-5000:]}\n{done.stderr[-3000:]}"
    assert f"{CASES} cases, 0 wrong" in done.stdout
