"""The command line: find the sub-command, read its options, call it."""

from __future__ import annotations

import argparse
import importlib
import keyword
import os
import re
from collections.abc import Callable, Collection, Sequence
from functools import partial
from typing import Any, NoReturn

from lightfield.commands.shared.options import add_option
from lightfield.commands.shared.told import run_told
from lightfield.errors import UsageError, did_you_mean
from lightfield.version import __version__
from lightfield.wording import capital

#: From this likeness on a word is taken for another one misspelt.
_ALIKE = 0.7
# Name and help of every sub-command.
COMMANDS = {
    "new": "begin with a tank of your own: a scene and an empty reading table",
    "render": "trace a scene and write its maps",
    "scene": "check a scene file, read or change its values, convert it",
    "picture": "a camera view of the lit tank",
    "compare": "the closed-form model against the render, or against readings",
    "regime": "where the closed-form model can be trusted",
    "import": "turn instrument files into one reading table",
    "hide": "make readings with an effect hidden in them, to test a diagnosis",
    "explore": "switch effects and drag parameters in the browser, and see the error fall",
    "diagnose": "find the physical effect that readings show and the model lacks",
    "attenuation": "what readings in water against air tell of the water",
    "range": "how far the lamp can be used, and how wide its spot is",
    "band": "which band of wavelengths serves best",
    "link": "how far the lamp carries data, and is seen, in clear and turbid water",
    "plan": "what a measurement layout can detect and tell apart, before measuring",
    "array": "what a follower's detectors can know of its pose",
    "pose": "where a follower is by its readings, and where it would be by the formula",
    "follow": "a follower in the closed loop: how it keeps its distance, or docks",
    "field": "a scene's light on a grid, for simulators",
    "ros": "a ROS 2 node: readings of an array in, the pose of the lamp out",
    "sweep": "vary parameters of a scene over a grid",
    "show": "figures of a sweep",
    "export": "write cases of a sweep as spectral EXR",
    "demo": "run the example experiments and write their reports",
    "doctor": "check the installation against a known value",
    "completion": "words of the command line for a shell to complete",
}


def prepared(argv: list[str]) -> Callable[[], int]:
    """What a command line asks for, ready to be called; the command's own modules are imported by then.

    Raises
    ------
    UsageError
        A wrong command or option.
    """
    for word in argv:
        if re.fullmatch(r"-[^=]*=--", word):  # Python before 3.13 takes this for no value at all
            raise UsageError("expected one argument", where=word.removesuffix("=--"), found="--")
    argv = _with_negative_lists(argv)
    general = _general_options(argparse.SUPPRESS)
    words = [word for word in general.parse_known_args(argv)[1] if not word.startswith("-")]
    chosen = words[0] if words else None
    if chosen is not None and chosen not in COMMANDS:
        near = did_you_mean(chosen, COMMANDS, cutoff=_ALIKE)
        rule = None if near else f"choose from {', '.join(COMMANDS)}"
        raise UsageError(f"there is no command {chosen!r}", rule=rule, remedy=near or "lightfield --help")
    parser, runs = _parser([chosen] if chosen else [])
    _check_options(argv, parser, chosen)
    args = parser.parse_args(argv)
    if args.command is None or args.command not in runs:
        parser.print_help()
        return lambda: 2 if argv else 0
    for option, variable in (("backend", "LIGHTFIELD_BACKEND"), ("threads", "LIGHTFIELD_THREADS")):
        if getattr(args, option) is not None:
            # The environment, not a global: worker processes must follow.
            os.environ[variable] = str(getattr(args, option))
    return partial(run_told, runs[args.command], args, _options_of(parser, {chosen}))


def _with_negative_lists(argv: Sequence[str]) -> list[str]:
    """`--water -0.1,0.4` as `--water=-0.1,0.4`: a list that begins with a minus is no option."""
    found: list[str] = []
    for word in argv:
        if found and re.match(r"-[\d.]+[,:]", word) and re.fullmatch(r"--[^=]+", found[-1]):
            found[-1] = f"{found[-1]}={word}"
        else:
            found.append(word)
    return found


def _check_options(argv: Sequence[str], parser: _Parser, chosen: str | None) -> None:
    """Refuse options that do not exist, with the nearest that does."""
    known = _options_of(parser, {chosen})
    for word in argv[: argv.index("--") if "--" in argv else None]:
        option = word.partition("=")[0]
        if option.startswith("--") and option not in known:
            remedy = (
                did_you_mean(option, known, cutoff=_ALIKE)
                or f"{' '.join(filter(None, ('lightfield', chosen)))} --help"
            )
            raise UsageError("there is no such option", found=word, remedy=remedy)


def _options_of(parser: argparse.ArgumentParser, commands: Collection[str | None] | None = None) -> set[str]:
    """What the options of a parser are called, with those of its sub-commands, or of some of them."""
    found = {name for action in parser._actions for name in action.option_strings}
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, child in action.choices.items():
                if commands is None or name in commands:
                    found |= _options_of(child)
    return found


def whole_parser() -> argparse.ArgumentParser:
    """The parser with the options of every sub-command; all of their modules are imported."""
    return _parser(list(COMMANDS))[0]


def _parser(declared: Sequence[str]) -> tuple[_Parser, dict[str, Callable[[argparse.Namespace], int]]]:
    """The parser of all sub-commands, with the options of some, and what runs these."""
    general = _general_options(argparse.SUPPRESS)
    parser = _Parser(
        prog="lightfield",
        description="The light field of an underwater lamp.",
        parents=[_general_options(None)],
    )
    parser.add_argument("--version", action="version", version=f"lightfield {__version__}")
    choices = parser.add_subparsers(dest="command", metavar="COMMAND", parser_class=_Parser)
    runs = {}
    for name, text in COMMANDS.items():
        command = choices.add_parser(name, help=text, description=f"{capital(text)}.", parents=[general])
        if name in declared:
            module = importlib.import_module(_module(name))
            module.add_arguments(command)
            runs[name] = module.run
    return parser, runs


def _general_options(default: str | None) -> _Parser:
    """Options allowed before and after the sub-command; SUPPRESS keeps the second from undoing the first."""
    options = _Parser(prog="lightfield", add_help=False, argument_default=default)
    group = options.add_argument_group("computing")
    group.add_argument(
        "--backend", choices=("auto", "llvm", "cuda"), help="what to compute on (default: auto)"
    )
    add_option(group, "--threads", "all")
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
