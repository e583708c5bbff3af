"""What becomes of a command's answer: it is printed, and written where that was asked for."""

from __future__ import annotations

import json
from argparse import Namespace
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lightfield.arrays import jsonable
from lightfield.storage.files import output_file, write_text

if TYPE_CHECKING:
    from lightfield.api.result import Result


def outputs_of(args: Namespace, *inputs: Path | None, also: Path | None = None) -> None:
    """Make sure, before any work, that results can be written and overwrite no input, nor each other."""
    outputs = [file for file in (args.json, args.report, also) if file]
    for k, file in enumerate(outputs):
        output_file(file, *filter(None, inputs), *outputs[:k])


def answered(args: Namespace, answer: Result[Any], warnings: Iterable[object] = ()) -> int:
    """Write to `--json`, print, and write to `--report`; 0, as a command returns that has its answer.

    Whoever reads the text may have heard enough (`| head`): the files are written all the same.
    """
    if args.json:
        write_json(answer.as_data(), args.json)
    try:
        print(answer.as_text())
        for warning in warnings:
            print(f"warning: {warning}")
    except BrokenPipeError:
        _show_page(args, answer)
        raise
    _show_page(args, answer)
    return 0


def _show_page(args: Namespace, answer: Result[Any]) -> None:
    if args.report:
        print(f"report: {answer.report(args.report).resolve()}")


def write_json(data: object, path: Path) -> None:
    """Indented, whole or not at all; what is no finite number is null."""
    write_text(path, json.dumps(jsonable(data), indent=2, allow_nan=False) + "\n")
