"""`lightfield pose`: where a follower is by its readings, and where it would be by the formula."""

from __future__ import annotations

import argparse
from pathlib import Path

from lightfield.commands.shared.answer import answered, outputs_of
from lightfield.commands.shared.follower import add_space, space_asked
from lightfield.commands.shared.options import add_answer, add_option, numbers
from lightfield.commands.shared.progress import progress_of
from lightfield.errors import UsageError
from lightfield.scene import Scene
from lightfield.studies.defaults import SCATTERING_PER_M


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the tasks and their options."""
    tasks = parser.add_subparsers(dest="task_name", metavar="TASK", required=True)
    estimate = tasks.add_parser("estimate", help="poses from the readings of an array")
    estimate.add_argument(
        "readings",
        type=Path,
        metavar="READINGS",
        help="CSV, a column per element: e1, e2, ..., and time_s; over array.gain they are irradiance over "
        "the lamp's intensity on its axis, 1/m2",
    )
    add_option(estimate, "scene", help="scene file with an [array]")
    estimate.add_argument("--filter", action="store_true", help="follow a sequence with a Kalman filter, too")
    bias = tasks.add_parser("bias", help="the error of a follower that believes the formula")
    add_option(bias, "scene", help="scene file with an [array]")
    bias.add_argument(
        "--scattering",
        metavar="B,B,...",
        help=f"waters on the axis, 1/m (default {','.join(f'{b:g}' for b in SCATTERING_PER_M)})",
    )
    for task in (estimate, bias):
        add_answer(task)
        add_space(task)


def run(args: argparse.Namespace) -> int:
    """Answer, print, write."""
    scene = Scene.load(args.scene)
    return _estimate(scene, args) if args.task_name == "estimate" else _bias(scene, args)


def _estimate(scene: Scene, args: argparse.Namespace) -> int:
    from lightfield.api.pose import estimate

    outputs_of(args, args.scene, args.readings, *scene.tables)
    with progress_of("pose"):
        answer = estimate(args.readings, scene, filter=args.filter, **space_asked(args))
    return answered(args, answer)


def _bias(scene: Scene, args: argparse.Namespace) -> int:
    from lightfield.api.pose import bias

    outputs_of(args, args.scene, *scene.tables)
    waters = None if args.scattering is None else _waters(args.scattering)
    if args.medium == "air" and any(waters or ()):
        raise UsageError("air does not scatter", where="--scattering", found=args.scattering, rule="water")
    with progress_of("pose"):
        answer = bias(scene, scattering=waters, **space_asked(args))
    return answered(args, answer)


def _waters(text: str) -> list[float]:
    rule = "numbers, 0 to 10 1/m: B,B,..."
    values = numbers(text, ",", "--scattering", rule)
    if not all(0 <= value <= 10 for value in values):
        raise UsageError("no waters", where="--scattering", found=text, rule=rule)
    return values
