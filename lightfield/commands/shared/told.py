"""Errors of the library in words of the command line: options by their names, scenes by their files."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Collection

from lightfield.errors import LightfieldError, SceneError, UsageError

#: A key of a scene, with its table.
_KEY = re.compile(r"\w+(\.\w+)*")


def run_told(
    run: Callable[[argparse.Namespace], int], args: argparse.Namespace, options: Collection[str]
) -> int:
    """Run a command; its errors name an option of these, not Python's argument, and the scene's file."""
    try:
        return run(args)
    except (UsageError, SceneError) as error:
        where = _option(error.where, options) or _file(error, args)
        if where is None:
            raise
        raise type(error)(
            error.what, where=where, found=error.found, rule=error.rule, remedy=error.remedy,
            problems=error.problems,
        ) from error  # fmt: skip


def _option(where: str | None, options: Collection[str]) -> str | None:
    """The option that an argument of Python is called on the command line."""
    option = f"--{(where or '').strip('_').replace('_', '-').replace(' ', '-')}"
    return option if option in options else None


def _file(error: LightfieldError, args: argparse.Namespace) -> str | None:
    """The file of the one scene that is given, and the key that an error is about; None: it says its own."""
    scene, where = getattr(args, "scene", None), error.where
    if not isinstance(error, SceneError) or scene is None or getattr(args, "others", None):
        return None
    if where is None:
        return str(scene)
    keyed = _KEY.fullmatch(where) and where != str(scene)
    return f"{scene}: {where}" if keyed else None
