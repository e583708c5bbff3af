"""`lightfield range`: how far the lamp can be used, and how wide its spot is."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from lightfield.commands.shared.answer import answered, outputs_of
from lightfield.commands.shared.options import add_answer, add_option, given
from lightfield.commands.shared.progress import progress_of
from lightfield.errors import UsageError
from lightfield.readings import read_table
from lightfield.render.limits import AXIS_PHOTONS
from lightfield.scene import Scene
from lightfield.studies import defaults

#: Receivers on a side of an array at most, as many as a scene may have.
_MOST_ON_A_SIDE = 50


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_option(parser, "scene")
    parser.add_argument("--readings", type=Path, metavar="DATA", help="reading table to show beside it")
    add = partial(parser.add_argument, type=float)
    add(
        "--share", default=defaults.PAPER_SHARE, metavar="P",
        help="part of the light at the first plane that must be left (default %(default)g, the paper's rule)",
    )  # fmt: skip
    add(
        "--noise", default=defaults.NOISE, metavar="P",
        help="noise of one reading over the reading at the first plane (default %(default)g)",
    )  # fmt: skip
    add("--snr", default=defaults.SNR, metavar="K", help="signal over noise (default %(default)g)")
    add_option(parser, "--to", "twice the last plane or position")
    side = defaults.ARRAY_COUNT
    parser.add_argument(
        "--array", type=int, metavar="N",
        help=f"receivers on a side (default: the scene's [array]; without one {side} x {side} on "
        f"{defaults.ARRAY_SIDE_M:g} m, curved)",
    )  # fmt: skip
    parser.add_argument("--array-side", type=float, metavar="M", help="side of the array, m")
    parser.add_argument("--array-radius", type=float, metavar="M", help="of its curvature, m; 0: flat")
    add_option(parser, "--max-photons", AXIS_PHOTONS)
    add_option(parser, "--no-trace")
    add_answer(parser)


def run(args: argparse.Namespace) -> int:
    """Study, print, write."""
    scene = Scene.load(args.scene)
    if args.array is not None and not 2 <= args.array <= _MOST_ON_A_SIDE:
        raise UsageError(
            "impossible array", where="--array", found=args.array, rule=f"2 to {_MOST_ON_A_SIDE} on a side"
        )
    readings = read_table(args.readings, scene) if args.readings else None
    outputs_of(args, args.scene, args.readings, *scene.tables)
    from lightfield.api.working_range import range as working_range

    options = given(args, "share", "noise", "snr", "to", "array", "array_side", "array_radius", "max_photons")
    with progress_of("range"):
        answer = working_range(scene, readings=readings, trace=not args.no_trace, **options)
    return answered(args, answer)
