"""Writing files whole or not at all."""

from __future__ import annotations

import errno
import fcntl
import os
import platform
import re
import shutil
import stat
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from lightfield.errors import OutputError

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_PROBE_BYTES = 1 << 20
MAKE_ROOM = "make room there, or choose another folder"
# A temporary folder says who writes in it (machine, process), so that what a killed process left can be told.
_MACHINE = f"{zlib.crc32(platform.node().encode()):08x}"
_TEMPORARY = re.compile(rf"\..+\.{_MACHINE}-(\d+)-\w+")


def output_folder(path: str | os.PathLike[str]) -> Path:
    """Make sure, before any work, that results can be written to a folder; sweep up after killed runs.

    Raises
    ------
    OutputError
        It cannot be made, is a file, or is not writable.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(
            "cannot write here",
            where=str(path),
            found=error.strerror or str(error),
            remedy="choose a writable folder",
        ) from error
    remove_leftovers(folder)
    return folder


#: How the names of files end that are written into folders.
_OF_FILES = (".nc", ".exr", ".png", ".csv", ".json", ".html", ".toml", ".npz")


@contextmanager
def locked_folder(path: str | os.PathLike[str]) -> Iterator[Path]:
    """An output folder that no other command writes to inside the block: files of one run stay together.

    The kernel holds the lock, on the folder itself: nothing is left behind, whatever ends the process. Where
    a file system knows no such locks (some network disks), there is none.

    Raises
    ------
    OutputError
        As `output_folder`, or it has the name of a file, or another command is writing there.
    """
    made = not Path(path).exists()
    if made and Path(path).suffix in _OF_FILES:
        raise OutputError(
            "this is the name of a file, and a folder is asked for", where=str(path),
            rule="several files are written, into one folder", remedy=f"{Path(path).with_suffix('')}",
        )  # fmt: skip
    folder = output_folder(path)
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise OutputError(
                "another program is writing to this folder",
                where=str(path),
                rule="files of two runs would mix",
                remedy="wait for it, or choose another folder",
            ) from None
        except OSError:
            pass
        yield folder
    except BaseException:
        if made:
            with suppress(OSError):  # what was written stays, with its folder
                folder.rmdir()
        raise
    finally:
        os.close(handle)


def output_file(path: str | os.PathLike[str], *inputs: str | os.PathLike[str]) -> Path:
    """Make sure, before any work, that a file can be written.

    Parameters
    ----------
    inputs : path-like
        Files that are read, or written as well: it must be none of them.

    Raises
    ------
    OutputError
        It is a folder or a device, one of the `inputs`, or its folder cannot be made or written.
    """
    target = Path(path)
    _check_replaceable(target)
    if target.resolve() in {Path(file).resolve() for file in inputs}:
        raise OutputError(
            "this file is in use in the same run",
            where=str(path),
            rule="what is read is not overwritten, and every output has a file of its own",
            remedy="choose another name",
        )
    if target.is_dir():
        raise OutputError("this is a folder", where=str(path), rule="a file", remedy="name a file in it")
    output_folder(target.parent)
    return target


def _check_replaceable(target: Path) -> None:
    """Refuse what is no file: a device (/dev/null) or a pipe would be gone, with a file in its place."""
    try:
        link = os.readlink(target) if target.is_symlink() else ""
        mode = target.stat().st_mode
    except FileNotFoundError:
        return
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise OutputError(
            "cannot write here",
            where=str(target),
            found=getattr(error, "strerror", None) or str(error),
            remedy="choose another name",
        ) from error
    # /dev/stdout is a link to whatever the standard output is.
    if link.startswith("/proc/") or not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise OutputError(
            "this is no file",
            where=str(target),
            found="a device, a pipe or a link to one",
            rule="a regular file, which is replaced as a whole",
            remedy="name a file, or none",
        )


def remove_leftovers(folder: Path) -> None:
    """Remove the half-written files of processes of this machine that were killed."""
    for entry in folder.iterdir():
        owner = _TEMPORARY.fullmatch(entry.name)
        if owner and not _alive(int(owner[1])):
            shutil.rmtree(entry, ignore_errors=True)


def _alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:  # it belongs to somebody else
        return True
    return True


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Temporary path that replaces `path` when the block ends well and vanishes when it does not.

    Parameters
    ----------
    path : path-like
        Final place; its folder is made when missing. The temporary name keeps the suffix.

    Raises
    ------
    OutputError
        The folder cannot be made or written, the disk is full, or it is a device.
    """
    target = Path(path)
    _check_replaceable(target)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        folder = Path(tempfile.mkdtemp(prefix=f".{target.name}.{_MACHINE}-{os.getpid()}-", dir=target.parent))
    except OSError as error:
        raise OutputError(
            "cannot write here", where=str(target), found=error.strerror, remedy="choose a writable folder"
        ) from error
    temporary = folder / target.name
    try:
        yield temporary
        if temporary.is_file():
            with temporary.open("rb") as written:
                os.fsync(written.fileno())
        try:
            os.replace(temporary, target)
        except OSError as error:
            raise OutputError(
                "cannot replace the file", where=str(target), found=error.strerror, remedy="move it away"
            ) from error
    except (OSError, RuntimeError) as error:
        full = _no_room(error, temporary)
        if full is None:
            raise
        raise OutputError(
            "cannot write the file", where=str(target), found=full.strerror, remedy=MAKE_ROOM
        ) from full
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def write_text(path: str | os.PathLike[str], text: str) -> Path:
    """Write a text in UTF-8, whole or not at all; its path.

    Raises
    ------
    OutputError
        As `atomic_path`.
    """
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="")
    return Path(path)


def _no_room(error: OSError | RuntimeError, file: Path) -> OSError | None:
    """The error of a full disk, quota or size limit behind an error, if that is what it is.

    Libraries give it other names: HDF5 says "Permission denied". So the disk itself is asked, with the file
    that is lost anyway.
    """
    if isinstance(error, OSError) and error.errno in NO_ROOM:
        return error
    try:
        with file.open("ab") as lost:
            lost.write(bytes(_PROBE_BYTES))
            lost.flush()
            os.fsync(lost.fileno())
    except OSError as found:
        return found if found.errno in NO_ROOM else None
    return None
