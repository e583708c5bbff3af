"""Workers of the benchmarks end with the process that started them, however that one ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

#: Says the worker's number, then keeps the worker busy for ten minutes.
RUN = """
import os, time
from benchmarks import runs

if __name__ == "__main__":
    pool = runs.start(processes=1)
    print(pool.submit(os.getpid).result(), flush=True)
    pool.submit(time.sleep, 600).result()
"""
PATIENCE_S = 60


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_workers_end_with_their_parent(number: signal.Signals, tmp_path: Path) -> None:
    script = tmp_path / "run.py"
    script.write_text(RUN)
    paths = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    parent = subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True, env=paths)
    assert parent.stdout is not None
    worker = int(parent.stdout.readline())
    parent.send_signal(number)
    try:
        parent.communicate(timeout=PATIENCE_S)  # to the end of what they print: the last that could is gone
    except subprocess.TimeoutExpired:
        os.kill(worker, signal.SIGKILL)
        pytest.fail("a worker runs on")
