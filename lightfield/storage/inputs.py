"""Reading files that anybody may have written: regular ones or standard input, of bounded size."""

from __future__ import annotations

import hashlib
import os
import stat
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache, wraps
from typing import Any, BinaryIO, TypeVar

from lightfield.errors import LightfieldError, MeasurementError, OutputError, SceneError, UsageError

Value = TypeVar("Value")
MEGABYTE = 1_000_000
_STANDARD_INPUT = ("-", "/dev/stdin")


@dataclass(frozen=True)
class FileKind:
    """What a file is to be.

    Parameters
    ----------
    name : str
        As it stands in messages.
    most_bytes : int
        Ten times and more what such a file is, and little enough to be read within seconds.
    error : type
        Raised when it cannot be read.
    """

    name: str
    most_bytes: int
    error: type[LightfieldError]


SCENE = FileKind("scene", MEGABYTE, SceneError)
EFFECTS = FileKind("file of effects", MEGABYTE, SceneError)
PLAN = FileKind("sweep plan", 10 * MEGABYTE, UsageError)
TABLE = FileKind("table of a scene", 10 * MEGABYTE, SceneError)
LUMINAIRE = FileKind("luminaire file", 10 * MEGABYTE, SceneError)
READINGS = FileKind("reading table", 50 * MEGABYTE, MeasurementError)
INDEX = FileKind("index", 10 * MEGABYTE, MeasurementError)
SPECTRUM = FileKind("spectrometer file", 10 * MEGABYTE, MeasurementError)
CALIBRATION = FileKind("instrument calibration", MEGABYTE, MeasurementError)
MOST_ROWS = 500_000  # of a reading table: short rows are read for longer than long ones
MAPS = FileKind("rendering", 1 << 40, OutputError)  # read piece by piece: the memory is the limit


def read_bytes(path: str | os.PathLike[str], kind: FileKind) -> bytes:
    """All bytes of a file; "-" and /dev/stdin are standard input.

    Raises
    ------
    LightfieldError
        Of the `kind`: no such file, a folder, a device or a pipe, or too large.
    """
    where = os.fspath(path)
    try:
        if where in _STANDARD_INPUT:
            data = sys.stdin.buffer.read(kind.most_bytes + 1)
        else:
            with _opened(where) as file:
                _check_regular(file, where, kind)
                data = file.read(kind.most_bytes + 1)
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise _unreadable(where, kind, error) from error
    if len(data) > kind.most_bytes:
        raise kind.error(
            f"too large for a {kind.name}",
            where=where,
            rule=f"at most {kind.most_bytes / MEGABYTE:g} MB",
            remedy="is this the right file? if so, split it",
        )
    return data


def read_utf8(path: str | os.PathLike[str], kind: FileKind, form: str, encoding: str = "utf-8") -> str:
    """The text of a file in UTF-8; `form` is what it is to be, as "TOML".

    Raises
    ------
    LightfieldError
        As `read_bytes`, or it is no text.
    """
    try:
        return read_bytes(path, kind).decode(encoding)
    except UnicodeDecodeError as error:
        raise kind.error(
            "not a text file",
            where=os.fspath(path),
            rule=f"a {form} file in UTF-8",
            remedy=f"save it as UTF-8 {form}",
        ) from error


def check_regular(path: str | os.PathLike[str], kind: FileKind) -> None:
    """Make sure that a library may open a file: a device or a pipe could keep it for ever.

    Raises
    ------
    LightfieldError
        Of the `kind`: no such file, a folder, a device or a pipe.
    """
    where = os.fspath(path)
    try:
        with _opened(where) as file:
            _check_regular(file, where, kind)
    except (OSError, ValueError) as error:
        raise _unreadable(where, kind, error) from error


def _opened(where: str) -> BinaryIO:
    # Opening a pipe waits for a writer, unless told not to.
    return open(where, "rb", opener=lambda name, flags: os.open(name, flags | getattr(os, "O_NONBLOCK", 0)))


def _check_regular(file: BinaryIO, where: str, kind: FileKind) -> None:
    if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        raise kind.error(
            f"cannot read the {kind.name}",
            where=where,
            found="a device or a pipe",
            rule="a regular file, or - for standard input",
            remedy="save it to a file first",
        )


def _unreadable(where: str, kind: FileKind, error: Exception) -> LightfieldError:
    return kind.error(
        f"cannot read the {kind.name}",
        where=where,
        found=getattr(error, "strerror", None) or str(error),
        remedy="check the path and the permissions",
    )


def kept_while(
    most: int, files: Callable[..., Iterable[str]]
) -> Callable[[Callable[..., Value]], Callable[..., Value]]:
    """`functools.lru_cache` of a function that reads files; where one was written anew its value is another.

    Parameters
    ----------
    most : int
        Values that are kept.
    files : callable
        Of the function's arguments: the paths that it reads.
    """

    def of(function: Callable[..., Value]) -> Callable[..., Value]:
        kept = lru_cache(most)(lambda _states, *given: function(*given))

        @wraps(function)
        def asked(*given: Any) -> Value:
            states = [(state.st_mtime_ns, state.st_size) for state in map(os.stat, files(*given))]
            return kept(tuple(states), *given)

        return asked

    return of


def kept_by_file(most: int) -> Callable[[Callable[..., Value]], Callable[..., Value]]:
    """`kept_while` the file that the first argument names is the same."""
    return kept_while(most, lambda path, *_: [path])


@kept_by_file(64)
def content_digest(path: str, kind: FileKind) -> str:
    """SHA-256 of a file, "sha256:" and hex; a file that has not changed since is not read again."""
    return "sha256:" + hashlib.sha256(read_bytes(path, kind)).hexdigest()
