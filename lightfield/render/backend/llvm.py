"""Find a libLLVM that Dr.Jit can use, and never load one that it cannot.

With LLVM 14-16 the first render aborts the whole process, which no Python code can catch. So the version is
read from the bytes of the file before anything is loaded. Standard library only: the set-up runs this file as
a script, before the package is installed.
"""

from __future__ import annotations

import ctypes
import mmap
import os
import platform
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

OLDEST, _NEWEST_TRIED = 17, 22
EXPLICIT_VARIABLES = ("LIGHTFIELD_LIBLLVM", "DRJIT_LIBLLVM_PATH")
_FOLDERS_VARIABLE = "LIGHTFIELD_LLVM_FOLDERS"

_FOLDERS = (
    "/usr/lib/llvm*/lib",
    "/usr/lib/*-linux-gnu",
    "/usr/lib64/llvm*/lib*",
    "/usr/lib64",
    "/usr/lib",
    "/usr/local/lib",
    "/opt/homebrew/opt/llvm*/lib",
    "/usr/local/opt/llvm*/lib",
    "/home/linuxbrew/.linuxbrew/opt/llvm*/lib",
    f"{sys.prefix}/lib",
)
# Not libLLVMSPIRVLib, not libLLVMCore, not the library bundled with Rust.
_NAME = re.compile(r"libLLVM(?:[-.]\d+(?:\.\d+)*)?\.(?:so(?:\.\d+)*|dylib)")
_VERSION_TEXT = b"LLVM version "
_VERSION = re.compile(rb"LLVM version (\d+)\.(\d+)(?:\.(\d+))?")
_SONAME = re.compile(rb"\0libLLVM(?:-|\.so\.)(\d+)(?:\.(\d+))?(?:\.so[.\d]*)?\0")
_SONAME_WITHIN = 8 << 20  # the dynamic string table stands near the head of the file
_NAME_VERSION = re.compile(r"libLLVM(?:[-.]|\.so\.)(\d+)(?:\.(\d+))?")
_ELF_MACHINES = {"x86_64": 62, "aarch64": 183, "ppc64le": 21, "riscv64": 243}
_MACH_O = (b"\xcf\xfa\xed\xfe", b"\xca\xfe\xba\xbe")


@dataclass(frozen=True)
class Library:
    """A shared library that may be an LLVM.

    Parameters
    ----------
    path : Path
        The file, as found.
    version : tuple of int
        What the file says of itself, () when it does not tell.
    problem : str
        Why it cannot be used, "" when it can.
    """

    path: Path
    version: tuple[int, ...] = ()
    problem: str = ""

    @property
    def usable(self) -> bool:
        """Whether Dr.Jit can work with it, as far as the file tells."""
        return not self.problem

    @property
    def version_text(self) -> str:
        """The version as people write it."""
        return ".".join(map(str, self.version)) or "unknown"


def inspect(path: str | os.PathLike[str]) -> Library:
    """Judge a library by its bytes alone; it is not loaded."""
    path = Path(path)
    try:
        with path.open("rb") as file:
            if os.fstat(file.fileno()).st_size < 20:
                return Library(path, problem="is not a shared library")
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
                foreign = _foreign(content)
                version = () if foreign else _version_in(content)
    except FileNotFoundError:
        return Library(path, problem="does not exist")
    except (OSError, ValueError) as error:
        return Library(path, problem=f"cannot be read ({getattr(error, 'strerror', None) or error})")
    if foreign:
        return Library(path, problem=foreign)
    version = version or _version_in_name(path)
    if not version:
        return Library(path, problem="does not tell its LLVM version")
    if version[0] < OLDEST:
        text = ".".join(map(str, version))
        return Library(path, version, f"is LLVM {text}, and LLVM before {OLDEST} aborts the process")
    return Library(path, version)


def explicit(environment: Mapping[str, str] = os.environ) -> tuple[str, Library] | None:
    """The library that the user names, with the variable that names it; None when none is named."""
    for variable in EXPLICIT_VARIABLES:
        if environment.get(variable):
            return variable, inspect(environment[variable])
    return None


def installed(folders: Iterable[str | os.PathLike[str]] | None = None) -> list[Library]:
    """Every LLVM on this machine, the best first.

    Parameters
    ----------
    folders : iterable of path-like, optional
        Search these alone. Default: those of LIGHTFIELD_LLVM_FOLDERS (separated like PATH), else the usual.
    """
    seen: dict[Path, Library] = {}
    for path in _files(folders):
        real = path.resolve()
        if real not in seen:
            seen[real] = inspect(path)
    return sorted(seen.values(), key=_merit, reverse=True)


def load_problem(library: Library) -> str:
    """Load a library that passed `inspect` and ask it for its version; "" when all is well."""
    try:
        major = ctypes.c_uint(0)
        ctypes.CDLL(str(library.path)).LLVMGetVersion(ctypes.byref(major), None, None)
    except (OSError, AttributeError) as error:
        return f"cannot be loaded ({error})"
    return "" if major.value >= OLDEST else f"says it is LLVM {major.value} once loaded"


def install_command() -> str:
    """The one command that most likely puts a usable LLVM on this machine."""
    if sys.platform == "darwin":
        return "brew install llvm"
    for tool, command in (
        ("apt-get", "sudo apt-get install libllvm19"),
        ("dnf", "sudo dnf install llvm-libs"),
        ("pacman", "sudo pacman -S llvm-libs"),
        ("zypper", "sudo zypper install libLLVM19"),
    ):
        if any((Path(folder) / tool).exists() for folder in ("/usr/bin", "/bin", "/usr/local/bin")):
            return command
    return f"install LLVM {OLDEST} or newer and set {EXPLICIT_VARIABLES[0]} to its libLLVM.so"


def _merit(library: Library) -> tuple[bool, bool, tuple[int, ...]]:
    return library.usable, library.version < (_NEWEST_TRIED + 1,), library.version


def _version_in(content: mmap.mmap) -> tuple[int, ...]:
    # mmap.find runs at memory speed over the 100 MB of a libLLVM, a regular expression does not.
    at = content.find(_VERSION_TEXT)
    while at >= 0:
        if match := _VERSION.match(content, at):
            return tuple(int(part) for part in match.groups() if part)
        at = content.find(_VERSION_TEXT, at + 1)
    if match := _SONAME.search(content, 0, min(len(content), _SONAME_WITHIN)):
        return tuple(int(part) for part in match.groups() if part)
    return ()


def _version_in_name(path: Path) -> tuple[int, ...]:
    for name in (path.resolve().name, path.name):
        if match := _NAME_VERSION.match(name):
            return tuple(int(part) for part in match.groups() if part)
    return ()


def _foreign(content: mmap.mmap) -> str:
    head = content[:20]
    if head[:4] in _MACH_O:
        return "" if sys.platform == "darwin" else "is a macOS library"
    if head[:4] != b"\x7fELF":
        return "is not a shared library"
    order: Literal["little", "big"] = "little" if head[5] == 1 else "big"
    machine = int.from_bytes(head[18:20], order)
    expected = _ELF_MACHINES.get(platform.machine())
    if head[4] != 2 or (expected is not None and machine != expected):
        return f"is built for another processor than {platform.machine()}"
    return ""


def _files(folders: Iterable[str | os.PathLike[str]] | None) -> Iterator[Path]:
    if folders is None and os.environ.get(_FOLDERS_VARIABLE):
        folders = os.environ[_FOLDERS_VARIABLE].split(os.pathsep)
    if folders is None:
        yield from _from_linker_cache()
        places = [place for pattern in _FOLDERS for place in sorted(Path("/").glob(pattern.lstrip("/")))]
    else:
        places = [Path(folder) for folder in folders]
    for place in places:
        try:
            yield from (path for path in sorted(place.glob("libLLVM*")) if _NAME.fullmatch(path.name))
        except OSError:
            continue  # a folder we may not read holds no library we may load


def _from_linker_cache() -> Iterator[Path]:
    for tool in ("ldconfig", "/sbin/ldconfig", "/usr/sbin/ldconfig"):
        try:
            listing = subprocess.run(
                [tool, "-p"], capture_output=True, text=True, timeout=20, check=False
            ).stdout
        except (OSError, subprocess.SubprocessError):
            continue
        paths = (Path(line.rpartition("=> ")[2].strip()) for line in listing.splitlines() if "=> " in line)
        yield from (path for path in paths if _NAME.fullmatch(path.name))
        return


def _main() -> int:
    """Print the path of the library to use; on failure say on stderr what was found, exit code 1."""
    named = explicit()
    found = [named[1]] if named else installed()
    for library in found:
        if library.usable and not load_problem(library):
            print(library.path)
            return 0
    prefix = f"{named[0]}: " if named else ""
    for library in found:
        print(f"{prefix}{library.path} {library.problem or load_problem(library)}", file=sys.stderr)
    return 2 if named else 1


if __name__ == "__main__":
    sys.exit(_main())
