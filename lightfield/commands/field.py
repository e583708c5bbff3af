"""`lightfield field export`: a scene's light on a grid, for simulators."""

from __future__ import annotations

import argparse

from lightfield.commands.shared.follower import photons_of
from lightfield.commands.shared.options import add_option
from lightfield.commands.shared.progress import progress_of
from lightfield.errors import UsageError
from lightfield.render.limits import FIELD_PHOTONS
from lightfield.scene import Scene
from lightfield.storage.files import output_file
from lightfield.studies.defaults import FIELD_HALF_WIDTH_M, FIELD_STEP_M

#: Part of a distance that is rounding.
_ROUNDING = 1e-6


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the task and its options."""
    tasks = parser.add_subparsers(dest="task_name", metavar="TASK", required=True)
    export = tasks.add_parser("export", help="flux vector and direct light on a grid, as NetCDF (CF)")
    add_option(export, "scene")
    add_option(export, "--output", required=True, metavar="OUT.nc", help="NetCDF file")
    export.add_argument(
        "--half-width",
        type=float,
        default=FIELD_HALF_WIDTH_M,
        metavar="M",
        help="in x and y (default %(default)g m)",
    )
    export.add_argument(
        "--from",
        dest="near",
        type=float,
        metavar="M",
        help="first distance (default: the first plane or position)",
    )
    add_option(export, "--to", dest="far", help="last distance (default: the last plane or position)")
    export.add_argument(
        "--step",
        type=float,
        default=FIELD_STEP_M,
        metavar="M",
        help="across the beam (default %(default)g m)",
    )
    for option in (("--max-photons", FIELD_PHOTONS), ("--seed", 0)):
        add_option(export, *option)
    add_option(export, "--no-trace")


def run(args: argparse.Namespace) -> int:
    """Trace and write."""
    scene = Scene.load(args.scene)
    output_file(args.output, args.scene, *scene.tables)
    if args.output.suffix.lower() != ".nc":
        raise UsageError(
            "the light on a grid is a NetCDF file", where="--output", found=str(args.output),
            remedy="end it in .nc",
        )  # fmt: skip
    photons = photons_of(args)
    from lightfield.maps.dataset import write_netcdf
    from lightfield.robots.field_file import Asked, field_dataset, resolved_from_m

    read = scene.detector.distances_m
    asked = Asked(
        args.half_width,
        read[0] if args.near is None else args.near,
        read[-1] if args.far is None else args.far,
        args.step,
    )
    with progress_of("field"):
        found = field_dataset(scene, asked, photons=photons, seed=args.seed or 0)
    sizes = " x ".join(str(found.sizes[name]) for name in ("x", "y", "z"))
    known_m = resolved_from_m(scene, asked.step_m)
    if photons and asked.near_m < (1 - _ROUNDING) * known_m:
        step_m = asked.step_m * asked.near_m / known_m
        print(
            f"note: nearer than {known_m:.2g} m steps of {asked.step_m:g} m are coarser than the beam, and "
            "scattered light is off by more than its errors say "
            f"(--step {0.95 * step_m:.2g}, or --from {1.05 * known_m:.2g})"
        )
    print(f"{sizes} places, {photons:g} photons: {write_netcdf(found, args.output).resolve()}")
    return 0
