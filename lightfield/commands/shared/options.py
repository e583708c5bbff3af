"""Options that several sub-commands take, each declared once, and the kinds of their values."""

from __future__ import annotations

from argparse import ArgumentTypeError
from pathlib import Path

from lightfield.errors import UsageError
from lightfield.render.limits import PHOTONS, SEED, Allowed, Precision

TYPE_CHECKING = False  # as in typing, which takes milliseconds to import
if TYPE_CHECKING:
    from argparse import Namespace, _ActionsContainer
    from typing import Any


def seed_number(text: str) -> int:
    """Seed of random numbers."""
    return int(_number(text, int, SEED))


def photon_count(text: str) -> float:
    """Photons of a trace."""
    return _number(text, float, PHOTONS)


def thread_count(text: str) -> int:
    """Threads of the processor."""
    return int(_number(text, int, Allowed("1", "1024")))


def _number(text: str, kind: type[int] | type[float], allowed: Allowed) -> float:
    try:
        number = kind(text)
    except ValueError:
        number = float("nan")
    if not allowed.holds(number):
        what = "a whole number" if kind is int else "a number"
        raise ArgumentTypeError(f"found {text!r}; rule: {what}, {allowed.rule}")
    return number


def assignment(text: str) -> tuple[str, float]:
    """Path and number of `--size PATH=VALUE`."""
    path, _, value = text.partition("=")
    try:
        return path.strip(), float(value)
    except ValueError:
        raise UsageError("not a number", where="--size", found=text, rule="PATH=NUMBER") from None


#: What is not given is None: each command has defaults of its own, which the help names.
OPTIONS: dict[str, dict[str, Any]] = {
    "scene": {"type": Path, "metavar": "SCENE", "help": "scene file (TOML)"},
    "--scene": {"type": Path, "metavar": "SCENE", "help": "scene file (TOML)"},
    "--with": {
        "dest": "others", "type": Path, "action": "append", "default": [], "metavar": "SCENE",
        "help": "another scene to run; may be repeated",
    },
    "--to": {"type": float, "metavar": "M", "help": "farthest distance, m (default: {})"},
    "--output": {"type": Path, "metavar": "DIR", "help": "folder of the results (default: {})"},
    "--threads": {
        "type": thread_count, "metavar": "N", "help": "threads of the processor (default: {})"
    },
    "--rel-error": {
        "type": float, "metavar": "E",
        "help": "relative standard error asked of a trace, in 95 %% of its lit cells (default {})",
    },
    "--max-photons": {
        "type": photon_count, "metavar": "N",
        "help": "a trace ends about there even if the error is not reached (default {})",
    },
    "--seed": {
        "type": seed_number, "metavar": "N",
        "help": "same seed, same result: to the last bit on one thread, to single precision on several "
        "(default {})",
    },
    "--vary": {
        "action": "append", "metavar": "PATH=RANGE", "help": "one dimension; may be repeated",
    },
    "--workers": {"type": int, "metavar": "N", "help": "local processes (default: {})"},
    "--no-trace": {
        "action": "store_true",
        "help": "leave out what only the renderer knows: scattering, walls, surface",
    },
    "--effects-file": {
        "type": Path, "metavar": "FILE", "help": "effects of your own, beside those of the table (TOML)"
    },
    "--json": {"type": Path, "metavar": "OUT", "help": "write everything as JSON"},
    "--report": {"type": Path, "metavar": "OUT.html", "help": "write a self-contained report"},
    "--case": {
        "action": "append", "metavar": "PATH=VALUE",
        "help": "only cases with this value, a step of the sweep (or rounded to three digits or more); may "
        "be repeated",
    },
}  # fmt: skip
TRACING = ("rel_error", "max_photons", "seed")


#: Those that have a letter, too.
_LETTERS = {"--output": "-o"}


def add_option(parser: _ActionsContainer, name: str, shown: object = None, **other: Any) -> None:
    """Declare one of the options.

    Parameters
    ----------
    shown : number or str, optional
        What the help says that it is by default.
    **other
        What this command has otherwise: its help, a default, ...
    """
    option = OPTIONS[name] | other
    told = option["help"].format(f"{shown:g}" if isinstance(shown, float) else shown)
    parser.add_argument(*filter(None, (_LETTERS.get(name), name)), **option | {"help": told})


def numbers(text: str, separator: str, where: str, rule: str | None = None) -> list[float]:
    """The numbers of an option, with something between them."""
    try:
        return [float(part) for part in text.split(separator)]
    except ValueError:
        rule = rule or f"numbers between {separator!r}"
        raise UsageError("not numbers", where=where, found=text, rule=rule) from None


def effects_asked(args: Namespace) -> list[str]:
    """The names of `--effects`."""
    if names := [one.strip() for one in args.effects.split(",") if one.strip()]:
        return names
    raise UsageError("no effect is named", where="--effects", found=args.effects, rule="A,B,...")


def add_tracing(parser: _ActionsContainer, precision: Precision) -> None:
    """Declare how well to trace; the command's defaults are for the help."""
    for name, default in zip(TRACING, (precision.rel_error, precision.max_photons, 0), strict=True):
        add_option(parser, f"--{name.replace('_', '-')}", default)


def add_answer(parser: _ActionsContainer) -> None:
    """Declare where the answer goes, beside the terminal."""
    add_option(parser, "--json")
    add_option(parser, "--report")


def given(args: Namespace, *names: str) -> dict[str, Any]:
    """Those options that the user gave, by default of `TRACING`."""
    options = {name: getattr(args, name) for name in names or TRACING}
    return {name: value for name, value in options.items() if value is not None}
