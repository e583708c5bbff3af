"""What a worker says of itself. Expected: its own memory, whatever the process that started it has held."""

from __future__ import annotations

import subprocess
import sys

import numpy as np

#: More than a worker that has only just begun takes: imports alone come to about 300 MB.
HELD_BY_THE_PARENT = 1500 * 10**6


def test_a_worker_of_a_large_process_reports_its_own_memory() -> None:
    held = np.ones(HELD_BY_THE_PARENT // 8)
    ask = "from lightfield.sweep.work import peak_bytes; print(peak_bytes())"
    said = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, check=True)
    assert 10**7 < int(said.stdout) < HELD_BY_THE_PARENT / 2 < held.nbytes
