"""`lightfield export`: write maps, or cases of a sweep, as spectral EXR, one image per plane."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import xarray as xr

from lightfield.commands.shared.options import add_option
from lightfield.errors import OutputError, UsageError
from lightfield.maps.dataset import read_netcdf, write_exr_planes
from lightfield.storage.files import locked_folder
from lightfield.sweep.results import (
    as_rendering,
    axes_of,
    case_label,
    case_values,
    chosen_cases,
    decoded,
    open_store,
)

_MOST_CASES = 64


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "store", type=Path, metavar="STORE|MAPS", help="what `sweep` wrote, or maps of `render` (.nc)"
    )
    parser.add_argument("--exr", type=Path, required=True, metavar="DIR", help="folder of the images")
    add_option(parser, "--case")
    parser.add_argument("--all", action="store_true", help=f"more than {_MOST_CASES} cases are meant")


def run(args: argparse.Namespace) -> int:
    """Write a folder for every case that was computed; 1 when some had failed."""
    if args.store.suffix.lower() == ".nc":
        return _maps(args)
    with decoded(args.store):
        return _chosen(args)


def _maps(args: argparse.Namespace) -> int:
    if args.case or args.all:
        raise UsageError(
            "maps are one case", where=str(args.store), rule="--case and --all belong to a sweep"
        )
    dataset = read_netcdf(args.store)
    if "z_m" not in dataset.dims:
        raise UsageError(
            "these maps are of single positions",
            where=str(args.store),
            rule="images are of planes",
            remedy="render a scene with planes_m",
        )
    with locked_folder(args.exr) as folder:
        for path in write_exr_planes(dataset, folder):
            print(path)
    return 0


def _chosen(args: argparse.Namespace) -> int:
    try:
        data = chosen_cases(open_store(args.store), args.case or [])
    except OutputError as error:
        from lightfield.studies.following.sweep import QUANTITY

        if error.found != QUANTITY:
            raise
        raise UsageError(
            "this store holds runs of a follower",
            where=str(args.store),
            rule="images are of maps",
            remedy="`lightfield show` draws them",
        ) from error
    axes = axes_of(data)
    shape = tuple(data.sizes[name] for name in axes)
    count = int(np.prod(shape))
    if count > _MOST_CASES and not args.all:
        raise UsageError("that many cases are hardly meant", found=count, rule=f"at most {_MOST_CASES}",
                         remedy="choose with --case PATH=VALUE, or say --all")  # fmt: skip
    with locked_folder(args.exr) as folder:
        return _export(data, axes, shape, folder)


def _export(data: xr.Dataset, axes: list[str], shape: tuple[int, ...], folder: Path) -> int:
    missing, count = 0, int(np.prod(shape))
    for at in np.ndindex(*shape):
        steps = dict(zip(axes, map(int, at), strict=True))
        name = case_label(case_values(data, steps))
        if int(data.status.isel(steps)) != 1 and count > 1:
            missing += 1
            print(f"{name}: {str(data.message.isel(steps).values) or 'not computed yet'}")
            continue
        for path in write_exr_planes(as_rendering(data, steps), folder / name):
            print(path)
    return 1 if missing else 0
