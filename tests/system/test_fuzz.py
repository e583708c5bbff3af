"""Thousands of wrong inputs, none of which may end in anything but success or one clear error.

Rationale: what people and programs hand to the program is wrong in ways that nobody thinks of. Set-up:
sound files of every kind, damaged at random, and options that make no sense, in commands that do not
trace, one after the other in one process; seeds change from run to run. Expected: exit code 0 or 2, one
error and no more, no commands to the terminal, no traceback, no case that takes longer than a minute. A
failure prints the seed and the case, which `python -m fuzz` repeats.
"""

from __future__ import annotations

import os
import random
import subprocess
import sys
from pathlib import Path

import pytest

CASES = 3000


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_wrong_input_is_success_or_one_clear_error() -> None:
    seed = random.randrange(10**6)
    tests = Path(__file__).resolve().parents[1]
    path = os.pathsep.join([str(tests.parent), str(tests), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-m", "fuzz", "--seed", str(seed), "--count", str(CASES)],
        cwd=tests,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    # The end of the standard error names the case that ended the process or took too long.
    assert done.returncode == 0, f"seed {seed}\n{done.stdout[-5000:]}\n{done.stderr[-3000:]}"
    assert f"{CASES} cases, 0 wrong" in done.stdout
