"""`lightfield band`: which band of wavelengths serves best."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from lightfield.commands.shared.answer import answered, outputs_of
from lightfield.commands.shared.options import TRACING, add_answer, add_option, add_tracing, given, numbers
from lightfield.commands.shared.progress import progress_of
from lightfield.errors import UsageError
from lightfield.render.limits import ON_AXIS
from lightfield.scene import Scene
from lightfield.studies import defaults


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_option(parser, "scene")
    parser.add_argument(
        "--distances", metavar="A,B,...", help="in m (default: the scene's first and last plane or position)"
    )
    add = partial(parser.add_argument, type=float)
    low, high = defaults.BETWEEN_NM
    add("--width", default=defaults.WIDTH_NM, metavar="NM", help="of the bands (default %(default)g)")
    parser.add_argument(
        "--between", default=f"{low:g}:{high:g}", metavar="LOW:HIGH", help="in nm (default %(default)s)"
    )
    parser.add_argument(
        "--response", type=Path, metavar="CSV",
        help="detector: columns wavelength_nm, response (default: the scene's, or typical silicon)",
    )  # fmt: skip
    add("--electrons", default=defaults.ELECTRONS, metavar="N",
        help="of the brightest band at the nearest distance (default %(default)g)")  # fmt: skip
    add("--read-noise", default=defaults.READ_NOISE, metavar="N", help="electrons (default %(default)g)")
    add("--mismatch", default=defaults.MISMATCH, metavar="P", help="spread of gains (default %(default)g)")
    add_option(parser, "--no-trace")
    add_tracing(parser, ON_AXIS)
    add_answer(parser)


def run(args: argparse.Namespace) -> int:
    """Study, print, write."""
    scene = Scene.load(args.scene)
    distances = None if args.distances is None else numbers(args.distances, ",", "--distances")
    between = numbers(args.between, ":", "--between")
    if len(between) != 2:
        raise UsageError("not a range", where="--between", found=args.between, rule="LOW:HIGH in nm")
    outputs_of(args, args.scene, args.response, *scene.tables)
    from lightfield.api.band import band

    low, high = between
    options = given(args, *TRACING, "width", "response", "electrons", "read_noise", "mismatch")
    with progress_of("band"):
        answer = band(scene, distances=distances, between=(low, high), trace=not args.no_trace, **options)
    return answered(args, answer)
