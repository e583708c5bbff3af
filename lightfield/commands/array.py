"""`lightfield array`: what a follower's detectors can know of its pose, compared and designed."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from lightfield.commands._options import add_option
from lightfield.errors import UsageError
from lightfield.scene import Scene
from lightfield.storage.files import atomic_path, output_file

if TYPE_CHECKING:
    from lightfield.studies.follower.light import Space

PHOTONS = 4e6


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the tasks and their options."""
    tasks = parser.add_subparsers(dest="task", metavar="TASK", required=True)
    show = tasks.add_parser(
        "show", help="what the array can know of its pose, here and over the formation space"
    )
    _common(show)


def _common(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", type=Path, metavar="SCENE", help="scene file with an [array]")
    parser.add_argument("--json", type=Path, metavar="OUT", help="write everything as JSON")
    parser.add_argument("--report", type=Path, metavar="OUT.html", help="write a self-contained report")
    add_space(parser)


def add_space(parser: argparse.ArgumentParser) -> None:
    """Declare where the follower may be, and how its light is traced."""
    parser.add_argument(
        "--half-width", type=float, metavar="M",
        help="of the formation space in x and y (default 0.4 m); in z from the first to the last plane",
    )  # fmt: skip
    add_option(parser, "--max-photons", PHOTONS)
    add_option(parser, "--seed", 0)
    add_option(parser, "--no-trace")


def space_of(scene: Scene, args: argparse.Namespace) -> Space:
    """The formation space that the options describe."""
    from lightfield.studies.follower.light import Space

    half = args.half_width
    if half is None:
        return Space.of_scene(scene)
    if not 0 < half <= 100:
        raise UsageError("impossible half width", where="--half-width", found=half, rule="above 0 to 100 m")
    return Space.of_scene(scene, half)


def photons_of(args: argparse.Namespace) -> float:
    """How many photons to trace; none where only the formula is asked for."""
    if args.no_trace:
        return 0.0
    photons = PHOTONS if args.max_photons is None else args.max_photons
    if not 1e3 <= photons <= 1e12:
        raise UsageError(
            "impossible number of photons", where="--max-photons", found=photons, rule="1e3 to 1e12"
        )
    return float(photons)


def write_json(data: object, path: Path) -> None:
    """Whole or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(data, indent=2, allow_nan=False) + "\n", encoding="utf-8")


def outputs_of(args: argparse.Namespace, *inputs: Path) -> None:
    """Make sure, before any work, that results can be written and overwrite no input."""
    given = [file for file in (args.json, args.report) if file]
    for k, file in enumerate(given):
        output_file(file, *inputs, *given[:k])


def run(args: argparse.Namespace) -> int:
    """Answer, print, write."""
    return _show(args)


def _show(args: argparse.Namespace) -> int:
    from lightfield.studies.follower.survey import survey

    scene = Scene.load(args.scene)
    outputs_of(args, args.scene)
    found = survey(scene, space_of(scene, args), photons=photons_of(args), seed=args.seed or 0)
    print(found.as_text())
    if args.json:
        write_json(found.as_data(), args.json)
    if args.report:
        from lightfield.report.follower.page import write_survey

        print(f"report: {write_survey(found, args.report).resolve()}")
    return 0
