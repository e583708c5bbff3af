"""The program: runs one command line, and says in one line and by its exit code how that ended.

Ctrl-C and SIGTERM end it quietly from the first line of `main` on. Before that Python answers a Ctrl-C with a
traceback: so this module imports next to nothing, and `main` imports everything else.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
import warnings

TYPE_CHECKING = False  # as in typing, which takes milliseconds to import
if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from types import FrameType
    from typing import Any

_EXIT_OK, _EXIT_DEFECT, _EXIT_ERROR, EXIT_INTERRUPTED, EXIT_TERMINATED = 0, 1, 2, 130, 143
TRACEBACK_VARIABLE = "LIGHTFIELD_TRACEBACK"


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command line.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments without the program's name. By default those of the process: then this is the program, and a
        signal while there is nothing to clean up ends it there and then.

    Returns
    -------
    int
        0 done; 1 a check failed or a defect of the program; 2 an error the user can act on; 130 interrupted.
    """
    program = argv is None
    _stops.clear()
    _on_signals(_leave if program else _raise)
    if program:
        sys.unraisablehook = _not_swallowed
        # Called last: while Python takes itself apart, the work is done and its code stands.
        atexit.register(_at_rest)
    try:
        from lightfield.commands.shared.terminal import plain_output

        with plain_output(), warnings.catch_warnings():
            warnings.showwarning = _say
            return _run(list(sys.argv[1:] if argv is None else argv))
    except KeyboardInterrupt:
        return _ended_by(signal.SIGINT)
    except SystemExit:
        if not _stops:
            raise  # --help, --version
        return _ended_by(_stops[0])
    finally:
        if program:
            _on_signals(_leave)


def _say(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    """What does nothing in a scene, in one line; other libraries' warnings are for developers."""
    from lightfield.errors import SceneWarning

    if issubclass(category, SceneWarning):
        print(f"warning: {message}", file=sys.stderr)


def _run(argv: list[str]) -> int:
    from lightfield.commands.shared.line import prepared

    try:
        command = prepared(argv)
        _on_signals(_raise)
        code = int(command() or _EXIT_OK)
        sys.stdout.flush()
        return code
    except Exception as error:
        if _stops:  # modules in C and C++ make errors of their own of what a signal raises within them
            return _ended_by(_stops[0])
        return _code_of(error)


def _code_of(error: Exception) -> int:
    """Say in one line what went wrong; the exit code for it."""
    from lightfield.errors import LightfieldError

    if isinstance(error, BrokenPipeError):
        # The reader of our output has gone (`lightfield ... | head`): nothing to report.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return _EXIT_OK
    if os.environ.get(TRACEBACK_VARIABLE):
        raise error
    code = _EXIT_ERROR
    if isinstance(error, LightfieldError):
        text = str(error)
    elif isinstance(error, OSError):
        text = f"{error.filename}: " if error.filename else ""
        text += f"{error.strerror or error}"
    elif isinstance(error, MemoryError):
        text = "out of memory; remedy: fewer pixels, planes or photons"
    else:
        text = f"unexpected {type(error).__name__}: {error}; a defect of the program, not of your input"
        text, code = f"{text}; set {TRACEBACK_VARIABLE}=1 to see where", _EXIT_DEFECT
    print(f"lightfield: {text}", file=sys.stderr)
    return code


def _ended_by(number: int) -> int:
    word, code = _ENDS[number]
    print(f"lightfield: {word}", file=sys.stderr)
    return code


def _on_signals(handler: Callable[[int, FrameType | None], Any] | signal.Handlers) -> None:
    """Answer Ctrl-C and SIGTERM; outside the main thread that is left to the embedding program."""
    try:
        signal.signal(signal.SIGINT, handler)
        signal.signal(signal.SIGTERM, handler)
    except ValueError:
        pass


def _at_rest() -> None:
    """No stop any more, not even one that was put off: at its end Python forgets who answers to alarms."""
    _on_signals(signal.SIG_IGN)
    signal.setitimer(signal.ITIMER_REAL, 0)


def _leave(number: int, frame: FrameType | None) -> None:
    """There and then: an exception within an import may be swallowed, or abort the process."""
    word, code = _ENDS[number]
    os.write(2, f"lightfield: {word}\n".encode())
    os._exit(code)


def _raise(number: int, frame: FrameType | None) -> None:
    """An exception, so that half-written files are removed on the way out."""
    if _importing(frame):
        # A module in C++ would make an ImportError of it, and importlib may swallow it.
        _again_soon(number)
        return
    _stops.append(number)
    from lightfield.progress import stopped  # known to every command that works

    stopped.set()
    raise KeyboardInterrupt if number == signal.SIGINT else SystemExit(_ENDS[number][1])


def _importing(frame: FrameType | None) -> bool:
    """Was the program within an import when it was stopped?"""
    while frame is not None and frame.f_code is not main.__code__:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


def _again_soon(number: int) -> None:
    signal.signal(signal.SIGALRM, lambda *_: os.kill(os.getpid(), number))
    signal.setitimer(signal.ITIMER_REAL, 0.02)


def _not_swallowed(ignored: Any) -> None:
    """A stop that was raised where Python ignores exceptions, such as in `__del__`, comes again.

    After a stop, what half-made objects complain of as they go is not printed.
    """
    if not _stops:
        sys.__unraisablehook__(ignored)
    elif issubclass(ignored.exc_type, KeyboardInterrupt | SystemExit):
        _again_soon(_stops[0])


_stops: list[int] = []  # signals that have been raised as exceptions
_ENDS: dict[int, tuple[str, int]] = {
    signal.SIGINT: ("interrupted", EXIT_INTERRUPTED),
    signal.SIGTERM: ("terminated", EXIT_TERMINATED),
}

if __name__ == "__main__":
    sys.exit(main())
