"""What becomes of a command's answer: it is printed, and written where that was asked for."""

from __future__ import annotations

import json
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path

from lightfield.arrays import jsonable
from lightfield.storage.files import atomic_path, output_file


def outputs_of(args: Namespace, *inputs: Path | None, also: Path | None = None) -> None:
    """Make sure, before any work, that results can be written and overwrite no input, nor each other."""
    outputs = [file for file in (args.json, args.report, also) if file]
    for k, file in enumerate(outputs):
        output_file(file, *filter(None, inputs), *outputs[:k])


def show_answer(args: Namespace, text: str, data: Callable[[], object]) -> None:
    """Print what it says to people, and write what it says to programs, for `--json`."""
    print(text)
    if args.json:
        write_json(data(), args.json)


def show_page(page: str, path: Path) -> None:
    """Write the page of `--report`, and print where it lies."""
    from lightfield.report.page import write_page

    print(f"report: {write_page(page, path).resolve()}")


def write_json(data: object, path: Path) -> None:
    """Indented, whole or not at all; what is no finite number is null."""
    with atomic_path(path) as temporary:
        text = json.dumps(jsonable(data), indent=2, allow_nan=False)
        temporary.write_text(text + "\n", encoding="utf-8")
