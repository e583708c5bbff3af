"""A sweep on an existing Dask scheduler: scheduler and two workers as processes of their own.

Expected: the same store as from one process, bit by bit (to single precision on a card); the workers' memory
is reported; a scheduler that does not answer is one clear error. Without one nothing of a sweep can be
reached from another machine.
"""

from __future__ import annotations

import os
import re
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest
from sweeping import SCENE, differences, in_process

from lightfield.sweep.cluster import connected

#: Two traces, one for each worker.
VARY = ("--vary", "lamp.hwhm_deg=3,4", "--vary", "water.scattering_per_m=0:0.3:4")


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of a scheduler with two workers of one thread each."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    folder, dask = tmp_path_factory.mktemp("dask"), [sys.executable, "-m", "distributed.cli"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder}
    port = address.rpartition(":")[2]
    server = [
        *dask[:2],
        "distributed.cli.dask_scheduler",
        "--host",
        "127.0.0.1",
        "--port",
        port,
        "--no-dashboard",
    ]
    # No nanny beside each, which would start it anew: half of the processes, and none outlives the tests.
    worker = [
        *dask[:2],
        "distributed.cli.dask_worker",
        address,
        "--nthreads",
        "1",
        "--no-dashboard",
        "--no-nanny",
    ]
    processes = [subprocess.Popen(server, **quiet)]
    try:
        deadline = time.monotonic() + 30
        while time.monotonic() < deadline:
            with socket.socket() as probe:
                if probe.connect_ex(("127.0.0.1", int(port))) == 0:
                    break
            time.sleep(0.1)
        processes += [subprocess.Popen(worker, **quiet) for _ in range(2)]
        yield address
    finally:
        for process in reversed(processes):
            process.kill()
        for process in processes:
            process.wait(timeout=30)


def test_two_workers_of_a_scheduler_write_the_same_store(scheduler: str, tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE)
    here, there = tmp_path / "here.zarr", tmp_path / "there.zarr"
    assert in_process(scene, here, vary=VARY).returncode == 0
    done = in_process(scene, there, "--scheduler", scheduler, vary=VARY)
    assert done.returncode == 0, done.stderr
    assert differences(here, there) == []
    found = re.search(r"memory: (\d) process(?:es)?, at most ([\d.]+) MB each", done.stdout)
    assert found and found[1] == "2", done.stdout
    assert 100 < float(found[2]) < 2000


def test_no_scheduler_at_that_address_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE)
    monkeypatch.setattr("lightfield.sweep.cluster.CONNECT_SECONDS", 2)
    refused = in_process(scene, tmp_path / "s.zarr", "--scheduler", "tcp://127.0.0.1:9")
    assert refused.returncode == 2
    assert "no Dask scheduler answers" in refused.stderr
    assert refused.stderr.count("\n") == 1


def listening() -> set[tuple[str, int]]:
    """Address and port of every socket of this process and its children that waits for connections."""
    mine = {os.getpid(), *(child.pid for child in psutil.Process().children(recursive=True))}
    return {
        (found.laddr.ip, found.laddr.port)
        for found in psutil.net_connections("tcp")
        if found.pid in mine and found.status == psutil.CONN_LISTEN
    }


@pytest.mark.parametrize("workers", [0, 1])
def test_no_other_machine_reaches_a_sweep(workers: int, tmp_path: Path) -> None:
    """Dask runs the code of whoever reaches its scheduler or a worker: every socket listens on loopback."""
    (tmp_path / ".lightfield").mkdir()
    before = listening()
    with connected(tmp_path, workers) as client:
        assert client.submit(abs, -1).result() == 1
        opened = listening() - before
    assert len(opened) >= 2, "scheduler and worker say how they are, on a port each"
    assert {ip for ip, _ in opened} <= {"127.0.0.1", "::1"}


def test_tls_without_keys_is_one_line(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE)
    refused = in_process(scene, tmp_path / "s.zarr", "--scheduler", "tls://127.0.0.1:9")
    assert refused.returncode == 2
    assert "no keys for TLS" in refused.stderr
    assert refused.stderr.count("\n") == 1
