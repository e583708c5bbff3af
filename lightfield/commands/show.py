"""`lightfield show`: figures of a sweep, and what is in its store."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from lightfield.commands.shared.options import add_option
from lightfield.errors import OutputError
from lightfield.memory import byte_size
from lightfield.storage.files import locked_folder, write_text
from lightfield.sweep.results import axes_of, chosen_cases, decoded, open_store
from lightfield.sweep.zarrfile import size_on_disk


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("store", type=Path, metavar="STORE", help="what `sweep`, or `follow --vary`, wrote")
    add_option(parser, "--output", help="folder of the figures (default: the store's name + -figures)")
    add_option(parser, "--case")


def run(args: argparse.Namespace) -> int:
    """Say what the store holds and draw it."""
    with decoded(args.store):
        return _show(args)


def _show(args: argparse.Namespace) -> int:
    if args.store.is_file():
        raise OutputError(
            "a file, where a store is a folder",
            where=str(args.store),
            rule="the folder that a sweep wrote",
            remedy=f"`lightfield compare {args.store}` shows the maps of one scene",
        )
    from lightfield.report.follower.follow_figures import sweep_figures
    from lightfield.report.follower.follow_page import follow_sweep_page
    from lightfield.report.style import save_png
    from lightfield.report.sweep import figures_of
    from lightfield.studies.following.sweep import QUANTITY

    draws: Callable[[xr.Dataset], dict[str, Any]] = figures_of
    page: Callable[[xr.Dataset], str] | None = None
    try:
        data = open_store(args.store)
    except OutputError as error:
        if error.found != QUANTITY:
            raise
        data, draws, page = open_store(args.store, QUANTITY).load(), sweep_figures, follow_sweep_page
    print(as_text(data, args.store))
    data = chosen_cases(data, args.case or [])
    figures = draws(data) if (data.status == 1).any() else {}
    if not figures:
        raise OutputError(
            "no case to draw has been computed", where=str(args.store), remedy="run the sweep again"
        )
    with locked_folder(args.output or args.store.with_name(f"{args.store.stem}-figures")) as folder:
        for name, draw in figures.items():
            print(save_png(draw(data), folder / f"{name}.png"))
        if page is not None:
            print(write_text(folder / "index.html", page(data)))
    return 0


def as_text(data: xr.Dataset, path: Path) -> str:
    """Dimensions, cases, traces and size."""
    axes = axes_of(data)
    lines = [f"{path}: {data.attrs['title']}, {byte_size(size_on_disk(path))}"]
    for name in axes:
        steps = data[name].values
        span = f"{steps[0]:g} to {steps[-1]:g}" if steps.dtype.kind in "fi" else ", ".join(map(str, steps))
        unit = {"1": ""}.get(data[name].attrs.get("units", ""), data[name].attrs.get("units", ""))
        lines.append(f"  {name:<34} {data.sizes[name]:>5} steps  {span} {unit}".rstrip())
    status = data.status.values
    lines.append(f"  {status.size} cases from {data.attrs['traces']} traces: {np.sum(status == 1)} computed, "
                 f"{np.sum(status == 2)} failed, {np.sum(status == 0)} to do")  # fmt: skip
    for text in sorted({str(m) for m in data.message.values[status == 2]})[:5]:
        lines.append(f"  failed: {text}")
    return "\n".join(lines)
