"""`lightfield compare`: the formula against the render of a scene, or a model against readings."""

from __future__ import annotations

import argparse
from pathlib import Path

from lightfield.commands import _compare_readings
from lightfield.commands.shared import tracing
from lightfield.commands.shared.answer import write_json
from lightfield.commands.shared.console import console
from lightfield.commands.shared.options import add_option, given
from lightfield.errors import UsageError
from lightfield.render.maps import render_scene
from lightfield.scene import Scene
from lightfield.storage.files import locked_folder


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "what",
        type=Path,
        metavar="SCENE|MAPS|DATA",
        help="scene file (.toml) to render, maps of `render` (.nc), or readings (.csv, with --scene)",
    )
    add_option(parser, "--scene", help="scene that the readings belong to")
    add_option(parser, "--output", help="folder of page, figures and numbers")
    _compare_readings.add_arguments(parser.add_argument_group("against readings"))
    tracing.add_tracing_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Compare whatever was given."""
    kind = args.what.suffix.lower()
    if args.scene is not None or kind == ".csv":
        return _readings(args)
    fitted = args.with_effects or args.effects_file or args.fit_json
    if fitted or args.solver != "analytic" or args.no_trace:
        raise UsageError(
            "nothing is fitted here",
            where=str(args.what),
            rule="--with, --effects-file, --solver, --no-trace and --fit-json belong to readings",
            remedy=f"lightfield compare DATA.csv --scene {args.what if kind == '.toml' else 'SCENE.toml'}",
        )
    if kind == ".nc":
        return _maps(args)
    return _scene(args)


def _scene(args: argparse.Namespace) -> int:
    scene = Scene.load(args.what)
    if scene.detector.positions_m is not None:
        raise UsageError(
            "this scene has single positions, no planes",
            where=str(args.what),
            rule="render and formula are compared on planes",
            remedy="give planes_m instead of positions_m; `lightfield render` takes positions",
        )
    from lightfield.maps.dataset import to_dataset

    with locked_folder(args.output or Path("compare")) as folder:
        rendering = tracing.traced(scene, args, render_scene)
        print(tracing.as_text(rendering))
        return _report(to_dataset(rendering), folder)


def _maps(args: argparse.Namespace) -> int:
    from lightfield.maps.dataset import read_netcdf

    if given(args) or args.no_cache:
        raise UsageError(
            "maps are compared as they are",
            where=str(args.what),
            rule="options of tracing belong to scenes and to --solver render",
            remedy="leave them out",
        )
    dataset = read_netcdf(args.what)
    with locked_folder(args.output or Path("compare")) as folder:
        return _report(dataset, folder)


def _report(dataset: object, folder: Path) -> int:
    import xarray as xr

    from lightfield.report.compare.exr_layers import write_layers
    from lightfield.report.compare.page import terminal_table, write_comparison
    from lightfield.studies.compare.maps import as_text, compare

    assert isinstance(dataset, xr.Dataset)
    comparison = compare(dataset)
    output = console()
    for wavelength in comparison.wavelengths_nm:
        output.print(terminal_table(comparison, wavelength))
    output.print(as_text(comparison), highlight=False)
    write_json(comparison.as_data(), folder / "compare.json")
    page, *_ = write_comparison(comparison, dataset.attrs, folder)
    write_layers(comparison, folder)
    print(page)
    return 0


def _readings(args: argparse.Namespace) -> int:
    if args.scene is None:
        raise UsageError(
            "readings need the scene that they belong to",
            where=str(args.what),
            remedy=f"lightfield compare {args.what} --scene SCENE.toml",
        )
    return _compare_readings.run(args)
