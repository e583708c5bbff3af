"""`lightfield picture`: a camera view of the lit tank as PNG and EXR."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import OpenEXR

from lightfield.commands._console import stage_line
from lightfield.commands._options import add_option
from lightfield.errors import OutputError, UsageError
from lightfield.maps.colour import CHROMATICITIES
from lightfield.scene import Scene
from lightfield.storage.files import MAKE_ROOM, atomic_path, output_file

#: What the numbers of the EXR are.
UNITS = "relative radiance x lightfield.exposure; 1 is white"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("scene", type=Path, metavar="SCENE", help="scene file (TOML)")
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("picture.png"), metavar="PNG",
        help="PNG file; the linear light goes beside it as .exr (default: picture.png)",
    )  # fmt: skip
    parser.add_argument("--size", default="720x405", metavar="WxH", help="pixels (default %(default)s)")
    parser.add_argument(
        "--samples", type=int, default=64, help="paths per pixel and colour (default %(default)d)"
    )
    add_option(parser, "--seed", 0)
    parser.add_argument(
        "--as-is", action="store_true", help="lend nothing: black walls stay black, clear water stays clear"
    )


def run(args: argparse.Namespace) -> int:
    """Take the picture, write it, say what was lent."""
    width, height = size_of(args.size)
    if not 2 <= args.samples <= 100_000:
        raise UsageError(
            "impossible number of samples", where="--samples", found=args.samples, rule="2 to 100000"
        )
    if args.output.suffix.lower() != ".png":
        raise UsageError(
            "the picture is a PNG file", where="--output", found=str(args.output), remedy="end it in .png"
        )
    scene = Scene.load(args.scene)
    output_file(args.output, args.scene)
    from lightfield.render.picture import exposure, take_picture, tone_mapped
    from lightfield.report.style import save_pixels

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
    for path in (
        save_pixels(tone_mapped(taken.rgb), args.output),
        write_rgb_exr(taken.rgb, exposure(taken.rgb), args.output, taken.notes),
    ):
        print(path)
    return 0


def size_of(text: str) -> tuple[int, int]:
    """Width and height from `720x405`.

    Raises
    ------
    UsageError
        Not two numbers, or not 16 to 8192.
    """
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.isdecimal() and 16 <= int(part) <= 8192 for part in parts):
        raise UsageError("not a size", where="--size", found=text, rule="WIDTHxHEIGHT, each 16 to 8192")
    return int(parts[0]), int(parts[1])


def write_rgb_exr(rgb: np.ndarray, factor: float, beside: Path, notes: tuple[str, ...]) -> Path:
    """Write linear light, exposed by a factor as the PNG is, next to it, as 32-bit R, G, B."""
    path = beside.with_suffix(".exr")
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "comments": "; ".join(notes),
        "chromaticities": CHROMATICITIES,
        "lightfield.exposure": np.array([factor]),
        "lightfield.units": UNITS,
    }
    try:
        with atomic_path(path) as temporary:
            OpenEXR.File(header, {"RGB": np.ascontiguousarray(rgb * factor, np.float32)}).write(
                str(temporary)
            )
    except RuntimeError as error:
        raise OutputError(
            "cannot write the EXR image", where=str(path), found=str(error), remedy=MAKE_ROOM
        ) from error
    return path
