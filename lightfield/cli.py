"""The command line: find the sub-command, call it, print what went wrong in one line."""

from __future__ import annotations

import argparse
import contextlib
import importlib
import importlib.util
import keyword
import os
import signal
import sys
from collections.abc import Sequence
from types import FrameType
from typing import Any, NoReturn

from lightfield import __version__
from lightfield.commands._options import thread_count
from lightfield.errors import LightfieldError, UsageError

# Name and help of every sub-command; one whose module is not there is not offered.
COMMANDS = {
    "render": "trace a scene and write its maps",
    "scene": "check a scene file, read or change its values, convert it",
    "picture": "a camera view of the lit tank",
    "compare": "the closed-form model against the render, or against readings",
    "regime": "where the closed-form model can be trusted",
    "import": "turn instrument files into one reading table",
    "hide": "make readings with an effect hidden in them, to test a diagnosis",
    "diagnose": "find the physical effect that readings show and the model lacks",
    "plan": "what a measurement layout can detect and tell apart, before measuring",
    "sweep": "vary parameters of a scene over a grid",
    "show": "figures of a sweep",
    "export": "write cases of a sweep as spectral EXR",
    "demo": "run the example experiments and write their reports",
    "doctor": "check the installation against a known value",
}
EXIT_OK, EXIT_DEFECT, EXIT_ERROR, EXIT_INTERRUPTED, EXIT_TERMINATED = 0, 1, 2, 130, 143
TRACEBACK_VARIABLE = "LIGHTFIELD_TRACEBACK"


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command line.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments without the program's name; default `sys.argv[1:]`.

    Returns
    -------
    int
        0 done; 1 a check failed or a defect of the program; 2 an error the user can act on; 130 interrupted.
    """
    # Refused outside the main thread: then the embedding program keeps its own handling.
    with contextlib.suppress(ValueError):
        signal.signal(signal.SIGTERM, _terminate)
    try:
        code = _run(list(sys.argv[1:] if argv is None else argv))
        sys.stdout.flush()
        return code
    except LightfieldError as error:
        return _fail(error, str(error))
    except KeyboardInterrupt:
        print("lightfield: interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        # The reader of our output has gone (`lightfield ... | head`): nothing to report.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_OK
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        return _fail(error, f"{place}{error.strerror or error}")
    except MemoryError as error:
        return _fail(error, "out of memory; remedy: fewer pixels, planes or photons")
    except Exception as error:
        text = f"unexpected {type(error).__name__}: {error}; a defect of the program, not of your input"
        _fail(error, f"{text}; set {TRACEBACK_VARIABLE}=1 to see where")
        return EXIT_DEFECT


def available() -> dict[str, str]:
    """Sub-commands whose module exists, with their help."""
    return {
        name: text for name, text in COMMANDS.items() if importlib.util.find_spec(_module(name)) is not None
    }


def _run(argv: list[str]) -> int:
    commands = available()
    general = _general_options(argparse.SUPPRESS)
    chosen = next((word for word in general.parse_known_args(argv)[1] if word in commands), None)
    parser = _Parser(
        prog="lightfield",
        description="The light field of an underwater lamp.",
        parents=[_general_options(None)],
    )
    parser.add_argument("--version", action="version", version=f"lightfield {__version__}")
    choices = parser.add_subparsers(dest="command", metavar="COMMAND", parser_class=_Parser)
    run = None
    for name, text in commands.items():
        command = choices.add_parser(name, help=text, description=_sentence(text), parents=[general])
        if name == chosen:
            module = importlib.import_module(_module(name))
            module.add_arguments(command)
            run = module.run
    args = parser.parse_args(argv)
    if args.command is None or run is None:
        parser.print_help()
        return EXIT_OK if not argv else EXIT_ERROR
    for option, variable in (("backend", "LIGHTFIELD_BACKEND"), ("threads", "LIGHTFIELD_THREADS")):
        if getattr(args, option) is not None:
            # The environment, not a global: worker processes must follow.
            os.environ[variable] = str(getattr(args, option))
    return int(run(args) or EXIT_OK)


def _general_options(default: str | None) -> _Parser:
    """Options allowed before and after the sub-command; SUPPRESS keeps the second from undoing the first."""
    options = _Parser(prog="lightfield", add_help=False, argument_default=default)
    group = options.add_argument_group("computing")
    group.add_argument(
        "--backend", choices=("auto", "llvm", "cuda"), help="what to compute on (default: auto)"
    )
    group.add_argument(
        "--threads", type=thread_count, metavar="N", help="threads of the processor (default: all)"
    )
    return options


class _Parser(argparse.ArgumentParser):
    """Reports a wrong command line like any other error: one line."""

    def __init__(self, **settings: Any) -> None:
        settings.setdefault("allow_abbrev", False)
        super().__init__(**settings)

    def error(self, message: str) -> NoReturn:
        raise UsageError(message, remedy=f"{self.prog} --help")


def _module(name: str) -> str:
    return f"lightfield.commands.{name}_" if keyword.iskeyword(name) else f"lightfield.commands.{name}"


def _sentence(text: str) -> str:
    return text[0].upper() + text[1:] + "."


def _fail(error: BaseException, text: str) -> int:
    if os.environ.get(TRACEBACK_VARIABLE):
        raise error
    print(f"lightfield: {text}", file=sys.stderr)
    return EXIT_ERROR


def _terminate(signum: int, frame: FrameType | None) -> None:
    # An exception, so that half-written files are removed on the way out.
    print("lightfield: terminated", file=sys.stderr)
    raise SystemExit(EXIT_TERMINATED)


if __name__ == "__main__":
    sys.exit(main())
