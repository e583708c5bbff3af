"""`lightfield follow`: a follower in the closed loop, in one scene or in several, or over many parameters."""

from __future__ import annotations

import argparse
from pathlib import Path

from lightfield.api.given import by_name
from lightfield.commands.shared.answer import answered, outputs_of, write_json
from lightfield.commands.shared.follower import photons_of
from lightfield.commands.shared.options import add_answer, add_option
from lightfield.commands.shared.progress import progress_of
from lightfield.commands.shared.ranges import check_ranges
from lightfield.errors import UsageError
from lightfield.render.limits import FIELD_PHOTONS
from lightfield.scene import Follower, Scene
from lightfield.storage.files import output_folder, write_text
from lightfield.studies.defaults import RUNS
from lightfield.sweep.axes import FORMS, parse_axis


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_option(parser, "scene", help="scene file with an [array]")
    add_option(parser, "--with")
    parser.add_argument(
        "--believe", metavar="B,B,...",
        help="light it believes in: field, fitted, exact, clear, relative (default: as the scene says)",
    )  # fmt: skip
    parser.add_argument(
        "--runs", type=int, default=RUNS, metavar="N",
        help="each with noise, gain, water and lamp's direction of its own, as far as the scene says that "
        "they are not known (default %(default)g)",
    )  # fmt: skip
    unsaid = Follower().mission.duration_s
    parser.add_argument(
        "--duration", type=float, metavar="S",
        help=f"of a run (default: as the scene says, {unsaid:g} s where it does not)",
    )  # fmt: skip
    add_answer(parser)
    parser.add_argument(
        "--track", type=Path, metavar="OUT.nc", help="write the first follower's runs over time"
    )
    add_option(parser, "--vary")
    add_option(parser, "--output", metavar="STORE.zarr", help="store of the runs over what varies")
    add_option(parser, "--workers", "this one")
    add_option(parser, "--max-photons", FIELD_PHOTONS)
    add_option(parser, "--seed", 0)
    add_option(parser, "--no-trace")


def run(args: argparse.Namespace) -> int:
    """Run, print, write."""
    from lightfield.api.following import Following, beliefs_in
    from lightfield.studies.following.study import follow, with_belief

    check_ranges(args, "runs", "duration")
    paths = [args.scene, *args.others]
    every = [with_belief(Scene.load(path), "") for path in paths]
    if args.duration is not None:
        every = [one.with_values({"follower.mission.duration_s": args.duration}) for one in every]
    scenes = by_name((str(path), one.name or path.stem, one) for path, one in zip(paths, every, strict=True))
    read = [table for one in every for table in one.tables]
    outputs_of(args, *paths, *read, also=args.track)
    if args.vary or args.output:
        return _sweep(scenes[next(iter(scenes))], args)
    beliefs = beliefs_in(args.believe or "")
    with progress_of("follow"):
        found = follow(scenes, beliefs, runs=args.runs, seed=args.seed or 0, photons=photons_of(args))
    if args.track:
        from lightfield.maps.dataset import write_netcdf

        write_netcdf(found.cases[0].dataset(), args.track)
    return answered(args, Following(found))


def _sweep(scene: Scene, args: argparse.Namespace) -> int:
    """Runs over parameters, into a store; 1 when cases failed."""
    from lightfield.studies.following.sweep import QUANTITY, as_data, run_follow_sweep
    from lightfield.sweep.results import open_store

    for name, value in (("--with", args.others), ("--believe", args.believe), ("--track", args.track)):
        if value:
            raise UsageError(
                "one scene is varied", where=name, remedy="vary follower.mission.believes, or leave it out"
            )
    if not args.vary or args.output is None:
        raise UsageError(
            "runs over parameters need both", rule="what varies, and a store",
            remedy=f"--vary PATH=RANGE -o STORE.zarr, with RANGE {FORMS}",
        )  # fmt: skip
    output_folder(args.output.parent)
    axes = [parse_axis(text, "--vary") for text in args.vary]
    from lightfield.commands.sweep import cases_bar, failures

    with cases_bar("follow") as report:
        plan, done = run_follow_sweep(
            scene, axes, args.output, runs=args.runs, seed=args.seed or 0, photons=photons_of(args),
            workers=args.workers or 0, report=report,
        )  # fmt: skip
    print(
        f"{args.output}: {plan.cases.count} cases, {done.cases_done} run now, {done.cases_before} were there "
        "already"
    )
    if done.failed:
        print(failures(done, args.output, QUANTITY))
    if args.json or args.report:
        data = open_store(args.output, QUANTITY)
        if args.json:
            write_json(as_data(data), args.json)
        if args.report:
            from lightfield.report.follower.follow_page import follow_sweep_page

            print(f"report: {write_text(args.report, follow_sweep_page(data)).resolve()}")
    return 1 if done.failed else 0
