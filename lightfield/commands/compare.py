"""`lightfield compare`: the formula against the render of a scene, or a model against readings."""

from __future__ import annotations

import argparse
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lightfield.api.given import names_in
from lightfield.commands.shared import tracing
from lightfield.commands.shared.answer import write_json
from lightfield.commands.shared.console import console
from lightfield.commands.shared.options import add_option, given
from lightfield.commands.shared.progress import progress_of
from lightfield.diagnosis import ledger
from lightfield.errors import UsageError
from lightfield.formula.closed_form import refuse_pencil
from lightfield.readings import Readings, read_table
from lightfield.render.limits import AT_READINGS
from lightfield.render.maps import render_scene
from lightfield.scene import Scene
from lightfield.scene.effects_file import with_effects
from lightfield.storage.files import locked_folder, output_file, write_text
from lightfield.studies.compare.in_a_sentence import in_a_sentence
from lightfield.studies.defaults import SOLVER

if TYPE_CHECKING:
    from lightfield.studies.compare.readings import FitReport


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
    group = parser.add_argument_group("against readings")
    group.add_argument(
        "--with",
        dest="with_effects",
        metavar="A,B",
        help="set these effects free too, e.g. scattering,lamp_drift:warm-up (`diagnose --list` names them)",
    )
    add_option(group, "--effects-file")
    group.add_argument(
        "--solver",
        choices=("analytic", "render"),
        default=SOLVER,
        help="render: correct the fast model by fresh traces of the fitted scene, as well as --rel-error, "
        f"--max-photons (here {AT_READINGS.rel_error:g} and {AT_READINGS.max_photons:g} if not given) and "
        "--seed say",
    )
    add_option(group, "--no-trace")
    group.add_argument("--fit-json", type=Path, metavar="OUT", help="write fit and residuals as JSON")
    tracing.add_tracing_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Compare whatever was given."""
    kind = args.what.suffix.lower()
    if args.scene is not None or kind == ".csv":
        return _readings(args)
    fitted = args.with_effects or args.effects_file or args.fit_json
    if fitted or args.solver != SOLVER or args.no_trace:
        raise UsageError(
            "nothing is fitted here",
            where=str(args.what),
            rule="--with, --effects-file, --solver, --no-trace and --fit-json belong to readings",
            remedy=f"lightfield compare DATA.csv --scene {args.what if kind == '.toml' else 'SCENE.toml'}",
        )
    if args.what.is_dir():
        raise UsageError(
            "a folder is neither a scene nor maps",
            where=str(args.what),
            rule="SCENE.toml, MAPS.nc, or DATA.csv with --scene",
            remedy=f"of a sweep: lightfield show {args.what}; of a render: its maps.nc",
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
    refuse_pencil(scene.lamp)
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
    from lightfield.studies.compare.maps import compare

    assert isinstance(dataset, xr.Dataset)
    comparison = compare(dataset)
    output = console()
    for wavelength in comparison.wavelengths_nm:
        output.print(terminal_table(comparison, wavelength))
    output.print(in_a_sentence(comparison), highlight=False)
    write_json(comparison.as_data(), folder / "compare.json")
    page, *_ = write_comparison(comparison, dataset.attrs, folder)
    write_layers(comparison, folder)
    print(page)
    return 0


def _readings(args: argparse.Namespace) -> int:
    """Fit, print, store the rung."""
    if args.scene is None:
        raise UsageError(
            "readings need the scene that they belong to",
            where=str(args.what),
            remedy=f"lightfield compare {args.what} --scene SCENE.toml",
        )
    options = given(args)
    if options and args.solver != "render":
        raise UsageError(
            "nothing is traced afresh here",
            found=", ".join("--" + name.replace("_", "-") for name in options),
            rule="these belong to --solver render",
            remedy="add --solver render, or leave them out",
        )
    if args.no_trace and (args.solver == "render" or args.no_cache):
        raise UsageError(
            "nothing is traced",
            where="--no-trace",
            found="--no-cache" if args.no_cache else "--solver render",
            remedy="leave one of them out",
        )
    scene = with_effects(Scene.load(args.scene), args.effects_file)
    readings = read_table(args.what, scene)
    names = names_in(args.with_effects or "")
    if args.fit_json:
        inputs = [file for file in (args.what, args.scene, args.effects_file, *scene.tables) if file]
        output_file(args.fit_json, *inputs)
    with locked_folder(args.output) if args.output else nullcontext():
        return _fit(readings, scene, names, options, args)


def _page(report: FitReport, args: argparse.Namespace) -> Path:
    """The folder's page, with a rung more."""
    from lightfield.report.compare.readings_page import readings_page

    known = ledger.readings_hash(report.model.forward.readings)
    rungs = [entry for entry in ledger.entries(args.output) if entry.get("readings") == known]
    title = f"{args.what.name}, climbed by hand"
    return write_text(args.output / "index.html", readings_page(report, rungs, title))


def _fit(
    readings: Readings, scene: Scene, names: list[str], options: dict[str, Any], args: argparse.Namespace
) -> int:
    from lightfield.api.light.compare import compare

    with progress_of("compare"):
        fit = compare(
            readings, scene, with_=names, solver=args.solver, trace=not args.no_trace,
            cache=not args.no_cache, **options,
        )  # fmt: skip
    report = fit.details
    if args.fit_json:
        write_json(fit.as_data(), args.fit_json)
    if args.output:
        command = f"compare {args.what.name} --scene {args.scene.name}"
        if names:
            command += f" --with {','.join(names)}"
        if args.solver != SOLVER:
            command += f" --solver {args.solver}"
        if args.no_trace:
            command += " --no-trace"
        stored, page = report.save(args.output, command), _page(report, args)
    print(fit.as_text())
    if args.output:
        print(f"stored: {stored}\n{page}")
    return 0
