"""`lightfield array`: what a follower's detectors can know of its pose, compared and designed."""

from __future__ import annotations

import argparse
from pathlib import Path

from lightfield.api.given import by_name
from lightfield.commands.shared.answer import answered, outputs_of
from lightfield.commands.shared.follower import add_space, space_asked
from lightfield.commands.shared.options import add_answer, add_option, given
from lightfield.commands.shared.progress import progress_of
from lightfield.commands.shared.ranges import check_ranges
from lightfield.scene import Scene
from lightfield.storage.files import write_text
from lightfield.studies import defaults


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the tasks and their options."""
    tasks = parser.add_subparsers(dest="task_name", metavar="TASK", required=True)
    show = tasks.add_parser(
        "show", help="what the array can know of its pose, here and over the formation space"
    )
    _common(show)
    beside = tasks.add_parser("compare", help="arrays of several scenes in the light of the first")
    _common(beside)
    whose = "scene whose array to compare with; may be repeated"
    add_option(beside, "--with", default=None, required=True, help=whose)
    _task(beside)
    best = tasks.add_parser("optimise", help="the best places and tilts of so many elements")
    _common(best)
    add = best.add_argument
    add("--elements", type=int, default=defaults.ELEMENTS, metavar="N", help="how many (default %(default)g)")
    add(
        "--box", type=float, default=defaults.BOX_M, metavar="M",
        help="side of the square they lie in (default %(default)g m)",
    )  # fmt: skip
    add(
        "--tilt-max", type=float, default=defaults.TILT_MAX_DEG, metavar="DEG",
        help="largest tilt in x and in y, and so more towards a corner (default %(default)g)",
    )  # fmt: skip
    add(
        "--spacing", type=float, default=defaults.SPACING_M, metavar="M",
        help="least distance of two (default %(default)g m)",
    )  # fmt: skip
    best.add_argument("--table", type=Path, metavar="OUT.csv", help="write the best as a table of elements")
    _task(best)


def _task(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--task", choices=("formation", "docking"), default=defaults.TASK,
        help="poses that count, on the beam's axis and aside: over the formation space, or the way home near "
        "the lamp (default %(default)s)",
    )  # fmt: skip


def _common(parser: argparse.ArgumentParser) -> None:
    add_option(parser, "scene", help="scene file with an [array]")
    add_answer(parser)
    add_space(parser)


def run(args: argparse.Namespace) -> int:
    """Answer, print, write."""
    scene = Scene.load(args.scene)
    others = getattr(args, "others", ())
    read = [table for one in (scene, *map(Scene.load, others)) for table in one.tables]
    outputs_of(args, args.scene, *others, *read, also=getattr(args, "table", None))
    tasks = {"show": _show, "compare": _compare, "optimise": _optimise}
    return tasks[args.task_name](scene, args)


def _show(scene: Scene, args: argparse.Namespace) -> int:
    from lightfield.api.array import show

    with progress_of("array"):
        answer = show(scene, **space_asked(args))
    return answered(args, answer)


def _compare(scene: Scene, args: argparse.Namespace) -> int:
    from lightfield.api.array import compare

    loaded = [(path, Scene.load(path)) for path in args.others]
    others = by_name((str(path), other.name or path.stem, other) for path, other in loaded)
    with progress_of("array"):
        answer = compare(scene, others, task=args.task, **space_asked(args))
    return answered(args, answer)


def _optimise(scene: Scene, args: argparse.Namespace) -> int:
    from lightfield.api.array import optimise
    from lightfield.studies.follower.design.exchange import BEST

    check_ranges(args, "elements", "box", "tilt_max", "spacing")
    with progress_of("array"):
        answer = optimise(
            scene, **given(args, "elements", "box", "tilt_max", "spacing", "task"), **space_asked(args)
        )
    if args.table:
        best = next(one for one in answer.details.arrays if one.name == BEST)
        write_text(args.table, best.elements.as_csv())
    return answered(args, answer)
