"""`lightfield compare DATA --scene SCENE`: refit the model to readings, and say where it fails."""

from __future__ import annotations

import argparse
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lightfield.api.given import names_in
from lightfield.commands.shared.answer import write_json
from lightfield.commands.shared.options import add_option, given
from lightfield.commands.shared.progress import progress_of
from lightfield.diagnosis import ledger
from lightfield.errors import UsageError
from lightfield.readings import Readings, read_table
from lightfield.scene import Scene
from lightfield.scene.effects_file import with_effects
from lightfield.storage.files import locked_folder, output_file

if TYPE_CHECKING:
    from lightfield.studies.compare.readings import FitReport


def add_arguments(group: argparse._ArgumentGroup) -> None:
    """Declare the options."""
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
        default="analytic",
        help="render: correct the fast model by fresh traces of the fitted scene, as well as --rel-error, "
        "--max-photons (here 0.01 and 3e6 if not given) and --seed say",
    )
    add_option(group, "--no-trace")
    group.add_argument("--fit-json", type=Path, metavar="OUT", help="write fit and residuals as JSON")


def run(args: argparse.Namespace) -> int:
    """Fit, print, store the rung."""
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
    from lightfield.report.page import write_page

    known = ledger.readings_hash(report.model.forward.readings)
    rungs = [entry for entry in ledger.entries(args.output) if entry.get("readings") == known]
    title = f"{args.what.name}, climbed by hand"
    return write_page(readings_page(report, rungs, title), args.output / "index.html")


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
        if args.solver != "analytic":
            command += f" --solver {args.solver}"
        if args.no_trace:
            command += " --no-trace"
        stored, page = report.save(args.output, command), _page(report, args)
    print(fit.as_text())
    if args.output:
        print(f"stored: {stored}\n{page}")
    return 0
