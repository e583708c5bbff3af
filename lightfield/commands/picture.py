"""`lightfield picture`: a camera view of the lit tank as PNG and EXR."""

from __future__ import annotations

import argparse
from pathlib import Path

from lightfield.commands.shared.options import add_option
from lightfield.commands.shared.progress import stage_line
from lightfield.errors import UsageError
from lightfield.render.settings import PICTURE_PATHS, PICTURE_PIXELS, PICTURE_SAMPLES, PICTURE_SIZE
from lightfield.scene import Scene
from lightfield.storage.files import output_file


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_option(parser, "scene")
    add_option(
        parser, "--output", "picture.png", default=Path("picture.png"), metavar="PNG",
        help="PNG file; the linear light goes beside it as .exr (default: {})",
    )  # fmt: skip
    size = "x".join(map(str, PICTURE_SIZE))
    parser.add_argument("--size", default=size, metavar="WxH", help="pixels (default %(default)s)")
    parser.add_argument(
        "--samples", type=int, default=PICTURE_PATHS, help="paths per pixel and colour (default %(default)d)"
    )
    add_option(parser, "--seed", 0)
    parser.add_argument(
        "--as-is",
        action="store_true",
        help="lend nothing: black walls stay black, clear water stays clear, and edges undrawn",
    )


def run(args: argparse.Namespace) -> int:
    """Take the picture, write it, say what was lent."""
    width, height = size_of(args.size)
    low, high = PICTURE_SAMPLES
    if not low <= args.samples <= high:
        raise UsageError(
            "impossible number of samples", where="--samples", found=args.samples, rule=f"{low} to {high}"
        )
    if args.output.suffix.lower() != ".png":
        raise UsageError(
            "the picture is a PNG file", where="--output", found=str(args.output), remedy="end it in .png"
        )
    scene = Scene.load(args.scene)
    output_file(args.output, args.scene)
    from lightfield.render.picture import take_picture
    from lightfield.report.light_figures import write_picture

    with stage_line("the picture") as told:
        taken = take_picture(
            scene,
            width=width,
            height=height,
            samples=args.samples,
            seed=args.seed or 0,
            lend=not args.as_is,
            progress=told,
        )
    for note in taken.notes:
        print(f"note: {note}")
    for path in write_picture(taken, args.output):
        print(path)
    return 0


def size_of(text: str) -> tuple[int, int]:
    """Width and height from `720x405`.

    Raises
    ------
    UsageError
        Not two numbers, or not as many pixels as a picture has.
    """
    parts, (low, high) = text.lower().split("x"), PICTURE_PIXELS
    if len(parts) != 2 or not all(part.isdecimal() and low <= int(part) <= high for part in parts):
        raise UsageError("not a size", where="--size", found=text, rule=f"WIDTHxHEIGHT, each {low} to {high}")
    return int(parts[0]), int(parts[1])
