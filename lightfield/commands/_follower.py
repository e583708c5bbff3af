"""What the commands of the follower share: where it may be, how its light is traced, where results go."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from lightfield.commands._options import add_option
from lightfield.errors import UsageError
from lightfield.formula.in_air import in_air
from lightfield.scene import Scene

if TYPE_CHECKING:
    from lightfield.studies.follower.array_light import Space

PHOTONS = 1e7


def add_space(parser: argparse.ArgumentParser) -> None:
    """Declare where the follower may be, and how its light is traced."""
    parser.add_argument(
        "--half-width", type=float, metavar="M",
        help="of the formation space in x and y (default 0.4 m); in z from the first to the last plane",
    )  # fmt: skip
    parser.add_argument(
        "--medium", choices=("water", "air"), default="water",
        help="air: the tank empty, as a rehearsal on the bench has it (default water)",
    )  # fmt: skip
    add_option(parser, "--max-photons", PHOTONS)
    add_option(parser, "--seed", 0)
    add_option(parser, "--no-trace")


def scene_asked(args: argparse.Namespace) -> Scene:
    """The scene, without its water where that is asked for."""
    scene = Scene.load(args.scene)
    return in_air(scene) if args.medium == "air" else scene


def space_of(scene: Scene, args: argparse.Namespace) -> Space:
    """The formation space that the options describe."""
    from lightfield.studies.follower.array_light import Space

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
    return PHOTONS if args.max_photons is None else float(args.max_photons)
