"""Output folders and files: one run at a time in a folder, and a full disk by its own name."""

from __future__ import annotations

import errno
import os
import resource
import signal
import stat
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from lightfield.errors import OutputError
from lightfield.maps.dataset import write_netcdf
from lightfield.maps.exr import SpectralImage, write_spectral_exr
from lightfield.storage.files import atomic_path, locked_folder, output_file

HOLD = """
import sys
from lightfield.storage.files import locked_folder
with locked_folder(sys.argv[1]):
    print("held", flush=True)
    sys.stdin.read()
"""


@contextmanager
def held_elsewhere(folder: Path) -> Iterator[subprocess.Popen[str]]:
    """Another process that writes to a folder."""
    pipe = subprocess.PIPE
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, folder], stdin=pipe, stdout=pipe, text=True
    ) as process:
        assert process.stdout is not None and process.stdout.readline() == "held\n"
        yield process
        process.kill()


def test_a_folder_belongs_to_one_run_at_a_time_and_kill_9_gives_it_back(tmp_path: Path) -> None:
    folder = tmp_path / "results"
    with held_elsewhere(folder) as other:
        with (
            pytest.raises(OutputError, match="results: another program is writing to this folder"),
            locked_folder(folder),
        ):
            pass
        with locked_folder(tmp_path / "another"):
            pass
        other.send_signal(signal.SIGKILL)
        other.wait()
        with locked_folder(folder) as mine:
            assert mine == folder
    with locked_folder(folder):
        assert list(folder.iterdir()) == []


def test_a_file_system_without_locks_is_no_obstacle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def no_locks(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr("lightfield.storage.files.fcntl.flock", no_locks)
    with locked_folder(tmp_path) as folder:
        assert folder == tmp_path


@contextmanager
def no_file_beyond_8_kilobytes() -> Iterator[None]:
    """What a quota or a full disk does to a writer, by the system's limit of file sizes.

    Around the writing alone: the limit holds for the whole process, and so for the report of the tests too,
    and for modules that Python compiles when they are first imported.
    """
    before, compiles = resource.getrlimit(resource.RLIMIT_FSIZE), sys.dont_write_bytecode
    sys.dont_write_bytecode = True
    resource.setrlimit(resource.RLIMIT_FSIZE, (8192, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        sys.dont_write_bytecode = compiles


NOISE = np.random.default_rng(1).random((1, 2, 64, 64))  # nothing that could be compressed


def test_no_room_is_called_by_its_name_whatever_the_library_says(tmp_path: Path) -> None:
    """HDF5 says "Permission denied" or "HDF error", OpenEXR a sentence of its own."""
    maps = xr.Dataset({"irradiance": (("wavelength_nm", "z_m", "y_m", "x_m"), NOISE)})
    cells = np.arange(64.0)
    image = SpectralImage(np.array([525.0]), NOISE[:, 0], None, cells, cells, 2.0)
    for write in (
        lambda: write_netcdf(maps, tmp_path / "maps.nc"),
        lambda: write_spectral_exr(tmp_path / "map.exr", image),
    ):
        too_large = "cannot write the file; found 'File too large'; remedy: make room"
        with pytest.raises(OutputError, match=too_large), no_file_beyond_8_kilobytes():
            write()
    assert list(tmp_path.iterdir()) == []


def test_another_error_keeps_its_name_and_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(PermissionError, match="not that"), atomic_path(tmp_path / "a"):
        raise PermissionError(errno.EACCES, "not that")
    with pytest.raises(RuntimeError, match="nor that"), atomic_path(tmp_path / "a"):
        raise RuntimeError("nor that")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can mount a small file system")
@pytest.mark.parametrize("kilobytes", [0, 8, 24, 40])
def test_hdf5_on_a_disk_that_is_really_full(tmp_path: Path, kilobytes: int) -> None:
    mount = ["mount", "-t", "tmpfs", "-o", f"size={kilobytes + 4}k", "tmpfs", str(tmp_path)]
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("this machine lets nobody mount")
    try:
        (tmp_path / "rest").write_bytes(bytes(4096))
        maps = xr.Dataset({"irradiance": (("wavelength_nm", "z_m", "y_m", "x_m"), NOISE)})
        with pytest.raises(OutputError, match="No space left on device"):
            write_netcdf(maps, tmp_path / "maps.nc")
    finally:
        # Lazily: HDF5 keeps the file open that it could not write.
        subprocess.run(["umount", "--lazy", str(tmp_path)], check=True)


@pytest.mark.parametrize("kind", ["device", "pipe", "link to the standard output", "NUL in the name"])
def test_what_is_no_file_is_not_replaced_by_one(kind: str, tmp_path: Path) -> None:
    """Where a user may write in /dev, `-o /dev/null` would leave a file there in place of the device."""
    place = tmp_path / "out.json"
    if kind == "device":
        place = Path(os.devnull)
    elif kind == "pipe":
        os.mkfifo(place)
    elif kind == "NUL in the name":
        place = tmp_path / "a\0b"
    else:
        place.symlink_to("/proc/self/fd/1")
    for write in (output_file, lambda path: atomic_path(path).__enter__()):
        with pytest.raises(OutputError, match=r"no file|cannot write"):
            write(place)
    if kind != "NUL in the name":
        assert not stat.S_ISREG(place.lstat().st_mode)


def test_a_link_to_a_file_and_one_that_leads_nowhere_are_written(tmp_path: Path) -> None:
    (tmp_path / "old").write_text("old")
    for link, to in (("whole", "old"), ("broken", "nothing")):
        (tmp_path / link).symlink_to(tmp_path / to)
        with atomic_path(output_file(tmp_path / link)) as temporary:
            temporary.write_text("new")
        assert (tmp_path / link).read_text() == "new"
    assert (tmp_path / "old").read_text() == "old"


def test_a_folder_is_not_made_with_the_name_of_a_file(tmp_path):
    """`render -o maps.nc` made a folder of that name; one that is there already is taken."""
    with pytest.raises(OutputError, match="name of a file"), locked_folder(tmp_path / "maps.nc"):
        pass
    (tmp_path / "run.csv").mkdir()
    with locked_folder(tmp_path / "run.csv"), locked_folder(tmp_path / "scan.2"):
        pass
    assert not (tmp_path / "maps.nc").exists()
