"""Ctrl-C and SIGTERM before any work has begun: while the program imports, and while it starts its workers.

Rationale: people press Ctrl-C at once when they see a slip in what they typed. Set-up: 200 processes
each, stopped at random moments from the first line of `main` on (before that Python itself answers), as
by a terminal: all processes of the group get the signal. Expected: exit code 130 (143), one line, no
process left. A failure names the seed and the moment.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

MOMENTS = 200
# Tells when the program has begun to listen for signals: from the first line of `main` on.
PROGRAM = """
import os, sys
from lightfield import cli
listen = cli._on_signals
def told(handler):
    listen(handler)
    cli._on_signals = listen
    os.write(1, b".")
cli._on_signals = told
sys.exit(cli.main())
"""
SCENE = "[water]\nabsorption_per_m = 0.1\n[detector]\nplanes_m = [2.0]\npixels = 5\n"
# Command, and the time in which it imports, or starts its workers, on a slow machine.
COMMANDS = {
    "imports": ("scene scene.toml", 0.5),
    "imports and reads": ("diagnose data.csv --scene scene.toml --report r.html", 3.0),
    "workers": ("sweep scene.toml --vary lamp.hwhm_deg=1:4:40 --max-photons 1e5 --workers 2 -o s.zarr", 5.0),
}


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.parametrize("phase", COMMANDS)
def test_an_early_stop_is_quiet_and_leaves_nobody(phase: str, number: int, code: int, tmp_path: Path) -> None:
    words, longest = COMMANDS[phase]
    (tmp_path / "scene.toml").write_text(SCENE)
    rows = "".join(f"{x},{z},{1 / z**2}\n" for x in (0.0, 0.1, 0.2) for z in (2, 3, 4, 5))
    (tmp_path / "data.csv").write_text(f"x_m,z_m,value\n{rows}")
    seed = random.randrange(10**6)
    rng, failed, in_time = random.Random(seed), [], 0
    for _ in range(MOMENTS):
        moment = rng.uniform(0, longest)
        ended = stopped_at(moment, number, words.split(), tmp_path)
        if ended.returncode == 0:  # had done its work
            continue
        in_time += 1
        word = {130: "interrupted", 143: "terminated"}[code]
        if (ended.returncode, ended.stderr) != (code, f"lightfield: {word}\n"):
            failed.append((moment, ended.returncode, ended.stderr[-500:]))
    assert not failed, f"seed {seed}: {len(failed)} of {in_time}, such as {failed[:3]}"
    assert in_time > MOMENTS // 5, "the command is over too soon for this test"


def stopped_at(
    moment: float, number: int, words: list[str], folder: Path
) -> subprocess.CompletedProcess[str]:
    """Run the program in a process group of its own, give the group a signal, and look who is left in it."""
    child = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *words],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        assert child.stdout is not None and os.read(child.stdout.fileno(), 1) == b"."
        try:
            child.wait(moment)
        except subprocess.TimeoutExpired:
            os.killpg(child.pid, number)
        _, message = child.communicate(timeout=60)
        left = still_there(child.pid)
        assert not left, f"left after {moment:.3f} s: {left}"
    finally:
        if child.poll() is None:
            os.killpg(child.pid, signal.SIGKILL)
    return subprocess.CompletedProcess(words, child.returncode, "", message)


def still_there(group: int) -> list[str]:
    """The group's processes that go on after the program's end, for longer than it takes to end."""
    deadline = time.monotonic() + 20
    while found := [process for process in psutil.process_iter() if belongs(process, group)]:
        if time.monotonic() > deadline:
            return [str(process) for process in found]
        time.sleep(0.05)
    return []


def belongs(process: psutil.Process, group: int) -> bool:
    try:
        return os.getpgid(process.pid) == group and process.status() != psutil.STATUS_ZOMBIE
    except (ProcessLookupError, psutil.NoSuchProcess):
        return False
