"""`lightfield attenuation`: what readings in water against readings in air tell of the water."""

from __future__ import annotations

import argparse
from pathlib import Path

from lightfield.commands.shared.answer import answered, outputs_of
from lightfield.commands.shared.options import add_answer, add_option
from lightfield.commands.shared.progress import progress_of
from lightfield.errors import UsageError
from lightfield.readings import read_table
from lightfield.scene import Scene


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "readings", type=Path, nargs="+", metavar="READINGS",
        help="reading table with the media water and air; several tables of one water, one per receiver",
    )  # fmt: skip
    what = "scene file (TOML): lamp, tank, receiver; given again, one for each table"
    add_option(parser, "--scene", action="append", required=True, help=what)
    media = parser.add_mutually_exclusive_group()
    media.add_argument(
        "--air", action="store_true", help="divide by readings in air (default: if there are any)"
    )
    media.add_argument(
        "--no-air", action="store_true", help="divide by what the formula says of lossless water"
    )
    add_option(parser, "--no-trace")
    add_answer(parser)
    add_option(parser, "--output", metavar="OUT.nc", help="write the spectrum of K as NetCDF")


def run(args: argparse.Namespace) -> int:
    """Study, print, write."""
    scenes = [Scene.load(path) for path in args.scene]
    if len(scenes) not in (1, len(args.readings)):
        raise UsageError(
            "tables and scenes do not belong together", where="--scene",
            found=f"{len(args.readings)} tables, {len(scenes)} scenes",
            rule="one scene for each table, in the same order, or one for all",
        )  # fmt: skip
    tables = [read_table(path) for path in args.readings]
    read = [table for scene in scenes for table in scene.tables]
    outputs_of(args, *args.readings, *args.scene, *read, also=args.output)
    from lightfield.api.attenuation import attenuation

    in_air = True if args.air else False if args.no_air else None
    with progress_of("attenuation"):
        answer = attenuation(tables, scenes, air=in_air, trace=not args.no_trace)
    if args.output:
        from lightfield.maps.dataset import write_netcdf

        write_netcdf(answer.to_xarray(), args.output)
    code = answered(args, answer)
    if args.output:
        print(args.output)
    return code
