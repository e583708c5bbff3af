"""The one place that chooses what Mitsuba computes on: CUDA where it really works, else LLVM.

`LIGHTFIELD_BACKEND` (auto, llvm, cuda) overrides the choice, `LIGHTFIELD_LIBLLVM` names the LLVM library,
`LIGHTFIELD_THREADS` the number of threads, `LIGHTFIELD_CACHE` the cache folder. The options `--backend` and
`--threads` of the command line set the same variables, so that worker processes follow.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from lightfield.errors import BackendError, Complaint, LightfieldError
from lightfield.render.backend import cuda, llvm
from lightfield.storage.cache import cache_dir, with_room

__all__ = ["Backend", "cache_dir", "choose", "limited_threads", "prepare", "use_backend", "with_plugins"]

_KINDS = ("auto", "llvm", "cuda")
_KIND_VARIABLE, THREADS_VARIABLE = "LIGHTFIELD_BACKEND", "LIGHTFIELD_THREADS"
_VARIANTS = {"llvm": "llvm_ad_spectral", "cuda": cuda.VARIANT}


@dataclass(frozen=True)
class Backend:
    """What renders run on.

    Parameters
    ----------
    kind : "llvm" or "cuda"
    variant : str
        Mitsuba's name of it.
    llvm_path, llvm_version : Path and str, or None
        The LLVM library; None on CUDA.
    threads : int
        Threads of the host.
    cache_dir : Path
        Folder of cached responses and compiled kernels.
    """

    kind: str
    variant: str
    llvm_path: Path | None
    llvm_version: str | None
    threads: int
    cache_dir: Path


_NO_LIBRARY = "/nonexistent/libLLVM.so"
_refusal: LightfieldError | None = None
_active: tuple[int, Backend] | None = None  # process id, backend: with the plugins all that is global
_plugins: list[Callable[[], None]] = []


def with_plugins(register: Callable[[], None]) -> None:
    """Register plugins with every variant from now on: Mitsuba forgets those in Python when it changes."""
    _plugins.append(register)


def use_backend() -> Backend:
    """Start the backend, or return the one already started; our Mitsuba plugins are registered with it.

    Call it before anything that touches Mitsuba, as often as you like; it also sets our variant again after
    other code has changed it.

    Raises
    ------
    BackendError
        Nothing usable was found, or what the user names is not usable.
    """
    global _active
    if _active is not None and _active[0] != os.getpid():
        raise BackendError(
            "this process was forked after the backend was started",
            rule="threads do not survive a fork",
            remedy='start worker processes with multiprocessing\'s "spawn" method',
        )
    if _active is None:
        _active = (os.getpid(), _start(choose()))
    backend = _active[1]
    import mitsuba as mi

    if mi.variant() != backend.variant:
        _set_variant(backend.variant)
    return backend


@contextlib.contextmanager
def limited_threads(count: int) -> Iterator[None]:
    """Compute on so many threads of the processor inside the block; no effect on CUDA.

    Parameters
    ----------
    count : int
        One thread adds up in the same order every time: results repeat bit by bit.
    """
    use_backend()
    import drjit as dr

    before = dr.thread_count()
    dr.set_thread_count(count)
    try:
        yield
    finally:
        dr.set_thread_count(before)


def choose() -> Backend:
    """Decide on a backend without starting it.

    Raises
    ------
    BackendError
        Nothing usable was found, or what the user names is not usable.
    """
    kind = os.environ.get(_KIND_VARIABLE, "").strip().lower() or "auto"
    if kind not in _KINDS:
        raise BackendError(
            "unknown backend", where=_KIND_VARIABLE, found=kind, rule=f"one of {', '.join(_KINDS)}"
        )
    threads = _threads()
    if kind == "cuda" and (problem := cuda.cuda_problem()):
        raise BackendError(
            "CUDA cannot be used",
            found=problem,
            remedy=f"ask for llvm, or unset {_KIND_VARIABLE}, to compute on the processor",
        )
    if kind == "cuda" or (kind == "auto" and not cuda.cuda_problem()):
        return Backend("cuda", _VARIANTS["cuda"], None, None, threads, cache_dir())
    library = _llvm_library()
    return Backend("llvm", _VARIANTS["llvm"], library.path, library.version_text, threads, cache_dir())


def _llvm_library() -> llvm.Library:
    if _refusal is not None and os.environ.get("DRJIT_LIBLLVM_PATH") == _NO_LIBRARY:
        raise _refusal
    named = llvm.explicit()
    if named is not None:
        variable, library = named
        if problem := library.problem or llvm.load_problem(library):
            raise BackendError(
                f"the library {problem}",
                where=f"{variable}={library.path}",
                remedy=f"unset {variable}, or name LLVM {llvm.OLDEST} or newer",
            )
        return library
    found = llvm.installed()
    refused = []
    for library in found:
        problem = library.problem or llvm.load_problem(library)
        if not problem:
            return library
        refused.append(Complaint(f"{library.path} {problem}"))
    raise BackendError(
        f"no usable libLLVM ({llvm.OLDEST} or newer)",
        found=None if refused else "none on this machine",
        remedy=llvm.install_command(),
        problems=refused,
    )


def _threads() -> int:
    text = os.environ.get(THREADS_VARIABLE, "").strip()
    if not text:
        available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
        return available or 1
    if not text.isdecimal() or not 1 <= int(text) <= 1024:
        raise BackendError(
            "not a number of threads", where=THREADS_VARIABLE, found=text, rule="a whole number, 1 to 1024"
        )
    return int(text)


def prepare() -> None:
    """Name the right LLVM to Dr.Jit, which loads one as soon as Mitsuba is imported; nothing is started.

    Packages whose modules import Mitsuba call it first. Where no library is usable,
    Dr.Jit is given a name that does not exist, so that it loads none; `use_backend` then says what is wrong.
    """
    global _refusal
    if "drjit" in sys.modules:
        return
    try:
        _name_to_drjit(_llvm_library().path, cache_dir())
    except LightfieldError as error:
        _refusal = error
        os.environ["DRJIT_LIBLLVM_PATH"] = _NO_LIBRARY


def _name_to_drjit(library: Path | None, cache: Path) -> None:
    os.environ.setdefault("DRJIT_CACHE_DIR", str(with_room(cache / "kernels")))
    if library is not None:
        os.environ["DRJIT_LIBLLVM_PATH"] = str(library)


def _start(backend: Backend) -> Backend:
    """Start Dr.Jit on what was chosen and say what it took."""
    _name_to_drjit(backend.llvm_path, backend.cache_dir)
    import drjit as dr

    _set_variant(backend.variant)
    flag = dr.JitBackend.LLVM if backend.kind == "llvm" else dr.JitBackend.CUDA
    if not dr.has_backend(flag):
        raise BackendError(
            f"Dr.Jit could not start {backend.kind}",
            found=str(backend.llvm_path or "the NVIDIA driver"),
            remedy="`lightfield.render.doctor` says what is there",
        )
    dr.set_thread_count(backend.threads)
    if backend.kind != "llvm":
        return backend
    loaded = dr.detail.llvm_version()
    version = ".".join(map(str, loaded))
    if loaded[0] < llvm.OLDEST:
        raise BackendError(
            "another LLVM was loaded before lightfield chose one",
            found=version,
            rule=f"LLVM {llvm.OLDEST} or newer",
            remedy="import lightfield.render.tracer before mitsuba or drjit",
        )
    if version.startswith(backend.llvm_version or ""):
        return backend
    return replace(backend, llvm_path=None, llvm_version=version)  # other code had loaded another good one


def _set_variant(variant: str) -> None:
    import mitsuba as mi

    mi.set_variant(variant)
    for register in _plugins:
        register()
