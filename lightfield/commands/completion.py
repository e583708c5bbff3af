"""`lightfield completion SHELL`: print the script with which a shell completes the command line."""

from __future__ import annotations

import argparse
from pathlib import Path

import shtab

from lightfield.commands.shared.line import whole_parser


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("shell", choices=tuple(shtab.SUPPORTED_SHELLS), help="which shell it is for")


def run(args: argparse.Namespace) -> int:
    """Print the script."""
    parser = whole_parser()
    _files(parser)
    print(shtab.complete(parser, shell=args.shell))
    return 0


def _files(parser: argparse.ArgumentParser) -> None:
    """Where a path is asked for, the shell offers files."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for child in action.choices.values():
                _files(child)
        elif action.type is Path:
            vars(action)["complete"] = shtab.FILE  # shtab's own, which argparse does not declare
