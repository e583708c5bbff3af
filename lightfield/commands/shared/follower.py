"""What the commands of the follower share: where it may be, and how its light is traced."""

from __future__ import annotations

import argparse
from typing import Any

from lightfield.commands.shared.options import add_option, given
from lightfield.commands.shared.ranges import check_ranges
from lightfield.render.limits import FIELD_PHOTONS
from lightfield.studies.defaults import HALF_WIDTH_M, MEDIUM


def add_space(parser: argparse.ArgumentParser) -> None:
    """Declare where the follower may be, and how its light is traced."""
    parser.add_argument(
        "--half-width", type=float, default=HALF_WIDTH_M, metavar="M",
        help="of the formation space in x and y (default %(default)g m); in z as far as planes or positions",
    )  # fmt: skip
    parser.add_argument(
        "--medium", choices=("water", "air"), default=MEDIUM,
        help="air: the tank empty, as a rehearsal on the bench has it (default %(default)s)",
    )  # fmt: skip
    add_option(parser, "--max-photons", FIELD_PHOTONS)
    add_option(parser, "--seed", 0)
    add_option(parser, "--no-trace")


def space_asked(args: argparse.Namespace) -> dict[str, Any]:
    """Where the follower may be and how its light is traced, as `api` takes it."""
    check_ranges(args, "half_width")
    return {"trace": not args.no_trace} | given(args, "half_width", "medium", "max_photons", "seed")


def photons_of(args: argparse.Namespace) -> float:
    """How many photons to trace; none where only the formula is asked for."""
    if args.no_trace:
        return 0.0
    return FIELD_PHOTONS if args.max_photons is None else float(args.max_photons)
