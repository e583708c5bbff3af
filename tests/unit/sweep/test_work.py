"""What a worker says of itself, and what it takes for damage.

Expected: its own memory, whatever the process that started it has held. A trace on disk is given up where it
is damaged, and nowhere else.
"""

from __future__ import annotations

import errno
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from lightfield.render.response.response import Reference, TransportResponse
from lightfield.sweep import work

#: More than a worker that has only just begun takes: imports alone come to about 120 MB.
HELD_BY_THE_PARENT = 600 * 10**6


@pytest.mark.slow
def test_a_worker_of_a_large_process_reports_its_own_memory() -> None:
    held = np.ones(HELD_BY_THE_PARENT // 8)
    ask = "from lightfield.sweep.work import peak_bytes; print(peak_bytes())"
    said = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, check=True)
    assert 10**7 < int(said.stdout) < HELD_BY_THE_PARENT / 2 < held.nbytes


@pytest.fixture
def trace(tmp_path: Path) -> Path:
    """A trace on disk."""
    rng = np.random.default_rng(1)
    response = TransportResponse(
        rng.random((2, 1, 4)), rng.integers(0, 5, (1, 3)), rng.random(1), rng.random((1, 2, 2)),
        Reference(0.1, 0.2, 0.3), 1000,
    )  # fmt: skip
    work._save(tmp_path / "0.npz", response, 0.1)
    return tmp_path / "0.npz"


@pytest.mark.parametrize("fault", [MemoryError("no room"), OSError(errno.EIO, "a fault of the disk")])
def test_a_fault_of_the_machine_leaves_a_trace(
    fault: Exception, trace: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was traced for hours, and is read when there is room again."""

    def failing(*_: object, **__: object) -> None:
        raise fault

    with monkeypatch.context() as patched, pytest.raises(type(fault), match=str(fault.args[-1])):
        patched.setattr(work.np, "load", failing)
        work._response(trace)
    assert work._response(trace).photons == 1000


def test_any_flipped_bit_of_the_directory_of_a_trace_is_damage(trace: Path) -> None:
    """None or the same: names, sizes, places, flags of the archive, whatever that makes it raise."""
    whole = trace.read_bytes()
    start = whole.index(b"PK\x01\x02")
    for bit in range(8 * start, 8 * len(whole), 29):
        data = bytearray(whole)
        data[bit // 8] ^= 1 << bit % 8
        trace.write_bytes(bytes(data))
        found = work._read(trace)
        assert found is None or found[0].photons == 1000
