"""Nothing is lost: a sweep that was stopped in any way goes on, and ends as if it had never been stopped.

Rationale: sweeps run for hours. What stops them is Ctrl-C, a kill -9 (out of memory, a queue's time limit) in
the middle of a write, a worker that dies, a disk that is full. Set-up: three beams times 33 waters in a small
tank, in processes that are really killed. Expected: the same command finishes, and every value is
that of a sweep that ran through, bit by bit (to single precision on a card); what is not the same sweep is
refused.
"""

from __future__ import annotations

import contextlib
import os
import re
import resource
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import psutil
import pytest
import xarray as xr
from sweeping import (
    SCENE,
    blocks_done,
    differences,
    finite_everywhere,
    in_process,
    start,
    sweep,
    wait_for_blocks,
)

BLOCKS = 12
#: What a stopped sweep says first.
GOES_ON = "{}: what is finished is kept; the same command goes on from there"

# Kills its own process, with -9, when half of a chunk of the given block has reached the disk.
DIE_IN_WRITE = """
import os, signal
import lightfield.sweep.zarrfile as z
whole = z.write_chunk
def half(path, name, variable, index, values):
    if name == 'plane_power' and index[:2] == {index}:
        with z.atomic_path(path / name / '.'.join(map(str, index))) as temporary:
            with open(temporary, 'wb') as file:
                file.write(b'half of a chunk'); file.flush(); os.fsync(file.fileno())
                os.kill(os.getpid(), signal.SIGKILL)
    return whole(path, name, variable, index, values)
z.write_chunk = half
"""

# Leaves time to send a signal before the sweep is over.
SLOW = """
import time
import lightfield.sweep.store as s
quick = s.SweepStore.record
def slow(self, **entry):
    quick(self, **entry)
    time.sleep(1 if 'block' in entry else 0)
s.SweepStore.record = slow
"""


def said(errors: str) -> list[str]:
    """Lines of the error stream, but for those that tell every ten seconds how far a slow machine is."""
    return [line for line in errors.splitlines() if not line.startswith("sweep: ")]


@pytest.fixture(scope="module")
def uninterrupted(scene: Path) -> Path:
    """A sweep that ran through, in one process."""
    store = scene.parent / "uninterrupted.zarr"
    done = in_process(scene, store)
    assert done.returncode == 0, done.stderr
    # Where there is no terminal, nothing but a line every ten seconds.
    assert all(line.startswith("sweep: ") for line in done.stderr.splitlines())
    assert finite_everywhere(store)
    assert blocks_done(store) == BLOCKS
    return store


def test_kill_9_in_the_middle_of_a_write(scene: Path, uninterrupted: Path, tmp_path: Path) -> None:
    store = tmp_path / "s.zarr"
    killed = sweep(scene, store, before=DIE_IN_WRITE.format(index=(1, 1)))
    assert killed.returncode == -signal.SIGKILL
    assert 0 < blocks_done(store) < BLOCKS
    leftovers = list(store.glob("plane_power/.*.*"))
    assert leftovers, "the kill did not hit a write"
    unfinished = xr.open_zarr(store)  # readable at any moment
    assert unfinished.attrs["complete"] == "no"
    done = in_process(scene, store)
    assert done.returncode == 0, done.stderr
    assert "were there already" in done.stdout
    assert not list(store.glob("plane_power/.*.*"))
    assert differences(store, uninterrupted) == []


def test_a_second_sweep_is_refused_and_the_first_goes_on_after_ctrl_c(
    scene: Path, uninterrupted: Path, tmp_path: Path
) -> None:
    """Two do not write to one store; the signal comes at whatever moment."""
    store = tmp_path / "s.zarr"
    first = start(scene, store, before=SLOW)
    try:
        wait_for_blocks(first, store, 1)
        second = in_process(scene, store)
        first.send_signal(signal.SIGINT)
        _, errors = first.communicate(timeout=60)
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(first.pid, signal.SIGKILL)
    assert second.returncode == 2
    assert "another sweep is writing to this store" in second.stderr
    assert (first.returncode, said(errors)) == (130, [GOES_ON.format(store), "lightfield: interrupted"])
    known = int((xr.open_zarr(store).status == 1).sum())
    assert 6 * blocks_done(store) <= known <= 9 * blocks_done(store) < 99
    assert in_process(scene, store).returncode == 0
    assert differences(store, uninterrupted) == []


@pytest.mark.slow
def test_kill_9_of_a_worker_in_the_middle_of_a_write(
    scene: Path, uninterrupted: Path, tmp_path: Path
) -> None:
    """Two workers; one is killed while it writes. Another takes its block over: the sweep goes on."""
    store, slow = tmp_path / "s.zarr", tmp_path / "slow"
    # Workers import this module first: a write of theirs lasts until the file is gone, or the worker is.
    slow.mkdir()
    (slow / "sitecustomize.py").write_text(
        "import os, sys, time\n"
        "if any('spawn_main' in word or 'forkserver' in word for word in sys.orig_argv):\n"
        "    import lightfield.sweep.zarrfile as z\n"
        "    whole = z.write_chunk\n"
        "    def waiting(path, name, variable, index, values):\n"
        "        mark = path.parent / 'writing'\n"
        "        if name == 'plane_power' and index[:2] == (2, 1) and not mark.exists():\n"
        "            with z.atomic_path(path / name / '.'.join(map(str, index))) as temporary:\n"
        "                temporary.write_bytes(b'half of a chunk')\n"
        "                mark.write_text(str(os.getpid()))\n"
        "                time.sleep(100)\n"
        "        return whole(path, name, variable, index, values)\n"
        "    z.write_chunk = waiting\n"
    )
    environment = {**os.environ, "PYTHONPATH": f"{slow}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}
    running = start(scene, store, "--workers", "2", env=environment)
    mark, deadline = tmp_path / "writing", time.monotonic() + 90
    while not (mark.exists() and mark.read_text()):
        assert running.poll() is None and time.monotonic() < deadline
        time.sleep(0.05)
    worker = int(mark.read_text())
    assert worker in {child.pid for child in psutil.Process(running.pid).children(recursive=True)}
    os.kill(worker, signal.SIGKILL)
    output, errors = running.communicate(timeout=90)
    assert running.returncode == 0, errors
    assert "99 evaluated" in output
    assert not list(store.glob("plane_power/.*.*"))
    assert differences(store, uninterrupted) == []


def _small_files() -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))


#: Python would leave its own compiled modules cut short as well, and without a word.
SMALL_FILES = {"preexec_fn": _small_files, "env": os.environ | {"PYTHONDONTWRITEBYTECODE": "1"}}


def test_ctrl_c_with_workers_ends_them_all(scene: Path, tmp_path: Path) -> None:
    """A terminal sends the signal to every process of the group; one line is printed and nobody is left."""
    store = tmp_path / "s.zarr"
    running = start(scene, store, "--workers", "2", before=SLOW)
    wait_for_blocks(running, store, 1)
    children = psutil.Process(running.pid).children(recursive=True)
    os.killpg(running.pid, signal.SIGINT)
    _, errors = running.communicate(timeout=60)
    assert (running.returncode, said(errors)) == (130, [GOES_ON.format(store), "lightfield: interrupted"])
    assert psutil.wait_procs(children, timeout=20)[1] == []


def test_a_full_disk(scene: Path, uninterrupted: Path, tmp_path: Path) -> None:
    """A small file system of its own where root can mount one; else no file may grow beyond a size."""
    store = tmp_path / "disk" / "s.zarr"
    store.parent.mkdir()
    needed = sum(
        -(-f.stat().st_size // 4096) * 4 for f in uninterrupted.rglob("*") if f.is_file()
    )  # kB of pages
    mount = ["mount", "-t", "tmpfs", "-o", f"size={needed // 2}k", "tmpfs", str(store.parent)]
    mounted = os.geteuid() == 0 and subprocess.run(mount, capture_output=True, check=False).returncode == 0
    try:
        full = in_process(scene, store) if mounted else sweep(scene, store, **SMALL_FILES)
        assert full.returncode == 2
        assert full.stderr.count("\n") == 1
        assert "the disk is full" in full.stderr and "continues" in full.stderr
        assert blocks_done(store) < BLOCKS
        if mounted:
            subprocess.run(["mount", "-o", "remount,size=100m", str(store.parent)], check=True)
        done = in_process(scene, store)
        assert done.returncode == 0, done.stderr
        assert differences(store, uninterrupted) == []
    finally:
        if mounted:
            subprocess.run(["umount", str(store.parent)], check=True)


@pytest.fixture
def again(scene: Path) -> Any:
    """Runs a sweep in this process: (exit code, output, errors)."""

    def run(store: Path, *more: str, scene: Path = scene) -> tuple[int, str, str]:
        done = in_process(scene, store, *more)
        return done.returncode, done.stdout, done.stderr

    return run


def test_a_finished_sweep_has_nothing_left_to_do(again: Any, uninterrupted: Path) -> None:
    before = {f: f.stat().st_mtime_ns for f in (uninterrupted / "irradiance").iterdir()}
    code, output, _ = again(uninterrupted)
    assert code == 0
    assert "nothing was left to do" in output
    assert before == {f: f.stat().st_mtime_ns for f in (uninterrupted / "irradiance").iterdir()}


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (("--seed", "5"), "settings.seed: there 0, asked for 5"),
        (("--vary", "tank.wall_albedo=0,0.5"), "varied tank.wall_albedo: there not, asked for "),
    ],
)
def test_another_sweep_is_refused(again: Any, uninterrupted: Path, more: tuple[str, ...], says: str) -> None:
    code, _, errors = again(uninterrupted, *more)
    assert code == 2
    assert errors.count("\n") == 1
    assert "belongs to another sweep" in errors
    assert re.search(says, errors)


def test_another_version_is_refused(again: Any, uninterrupted: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lightfield.sweep.store.__version__", "9.9")
    code, _, errors = again(uninterrupted)
    assert code == 2
    assert re.search('software.lightfield: there .* asked for "9.9"', errors)


def test_a_changed_scene_is_refused(again: Any, uninterrupted: Path, tmp_path: Path) -> None:
    changed = tmp_path / "scene.toml"
    changed.write_text(SCENE.replace("wall_albedo = 0.2", "wall_albedo = 0.3"))
    code, _, errors = again(uninterrupted, scene=changed)
    assert code == 2
    assert "tank.wall_albedo: there 0.2, asked for 0.3" in errors


def test_a_folder_that_is_no_store_is_left_alone(again: Any, tmp_path: Path) -> None:
    (tmp_path / "precious.txt").write_text("data")
    code, _, errors = again(tmp_path)
    assert code == 2
    assert "something else here" in errors
    assert [f.name for f in tmp_path.iterdir()] == ["precious.txt"]


def test_a_failing_case_is_recorded_and_the_rest_goes_on(scene: Path, tmp_path: Path) -> None:
    """A lamp 3 m deep in a tank of 2.44 m cannot be; the other two depths can."""
    store = tmp_path / "s.zarr"
    vary = ("--vary", "tank.lamp_depth_m=0.8,3,1.22", "--vary", "water.absorption_per_m=0.1,0.2")
    done = in_process(scene, store, vary=vary)
    assert done.returncode == 1
    assert "2 cases failed" in done.stdout
    data = xr.open_zarr(store)
    assert data.status.values.tolist() == [[1, 1], [2, 2], [1, 1]]
    assert "lamp_depth_m must be less than depth_m" in str(data.message.values[1, 0])
    assert data.irradiance[1].isnull().all() and data.irradiance[[0, 2]].notnull().all()
