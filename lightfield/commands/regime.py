"""`lightfield regime`: where the closed-form model can be trusted."""

from __future__ import annotations

import argparse
from pathlib import Path

from rich.table import Table

from lightfield.commands.shared.console import console
from lightfield.commands.shared.options import add_option, add_tracing, given
from lightfield.render.limits import OF_REGIME
from lightfield.scene import Scene
from lightfield.storage.files import locked_folder


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    what = "lamp and phase function to use (default: the paper's lamp)"
    add_option(parser, "scene", nargs="?", help=what)
    add_option(parser, "--output", "regime", default=Path("regime"))
    add_tracing(parser, OF_REGIME)
    add_option(parser, "--workers", "this one")


def run(args: argparse.Namespace) -> int:
    """Sweep over the grid (or what is left of it), write map, table and figure, print the table."""
    scene = Scene.load(args.scene) if args.scene else Scene.from_dict({"name": "the paper's lamp"})
    with locked_folder(args.output) as folder:
        return _regime(scene, folder, args)


def _regime(scene: Scene, folder: Path, args: argparse.Namespace) -> int:
    from lightfield.commands.sweep import as_text, cases_bar
    from lightfield.maps.dataset import write_netcdf
    from lightfield.report.regime import regime_figure
    from lightfield.report.style import save_png
    from lightfield.studies import regime
    from lightfield.sweep.sweep_plan import SweepSettings

    settings = SweepSettings(**vars(OF_REGIME) | given(args), maps=False)
    store = folder / "regime.zarr"
    with cases_bar("regime") as report:
        plan, done, dataset = regime.run_regime(
            scene, settings, store, workers=args.workers or 0, report=report
        )
    print(as_text(plan, done, store))
    table = Table(title="Optical thickness c z up to which the formula holds", title_justify="left")
    for head in ("receiver", "albedo", "5 %", "10 %", "25 %"):
        table.add_column(head, justify="left" if head == "receiver" else "right")
    for row in regime.rows(dataset):
        table.add_row(*row)
    output = console()
    output.print(table)
    output.print(regime.as_text(dataset), highlight=False)
    for path in (
        write_netcdf(dataset, folder / "regime.nc"),
        save_png(regime_figure(dataset), folder / "regime.png"),
    ):
        print(path)
    return 1 if done.failed else 0
