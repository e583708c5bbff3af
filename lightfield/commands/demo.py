"""`lightfield demo`: run the example experiments one after the other and name their reports."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

from lightfield.commands.shared.line import prepared
from lightfield.commands.shared.options import add_option
from lightfield.errors import UsageError
from lightfield.storage.files import locked_folder

# Experiment (a folder of `scenes/`) and the command lines that it shows. {scene} and {out} are its folder
# and the folder of its results; one of them writes {out}/index.html. Both traces of the tow tank have the
# same settings: the second finds the first in the cache. 5 % is coarser than the default, and quick.
EXPERIMENTS: dict[str, tuple[str, ...]] = {
    "unh_tow_tank": (
        "render {scene}/scene.toml --rel-error 0.05 -o {out}",
        "compare {scene}/scene.toml --rel-error 0.05 -o {out}",
        "attenuation {scene}/spectra.csv --scene {scene}/spectra.toml --report {out}/attenuation.html",
        "range {scene}/scene.toml --readings {scene}/measured.csv --report {out}/range.html",
    ),
    "hidden_effect": (
        "compare {scene}/data.csv --scene {scene}/scene.toml -o {out}",
        "diagnose {scene}/data.csv --scene {scene}/scene.toml -o {out} --report {out}/index.html",
    ),
    "leader_follower": (
        "follow {scene}/clear.toml --with {scene}/turbid.toml --believe field,clear --runs 3 --duration 60 "
        "--max-photons 2e6 --report {out}/index.html",
    ),
    "dive_lamp": ("diagnose {scene}/data.csv --scene {scene}/scene.toml -o {out} --report {out}/index.html",),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_option(parser, "--output", "demo-report", default=Path("demo-report"))
    parser.add_argument("--scenes", type=Path, metavar="DIR", help="folder of the example experiments")


def run(args: argparse.Namespace) -> int:
    """Run every experiment; the paths of the reports come last."""
    scenes = _scenes(args.scenes)
    with locked_folder(args.output):
        return _run_experiments(scenes, args.output)


def _run_experiments(scenes: Path, output: Path) -> int:
    reports = []
    for name, lines in EXPERIMENTS.items():
        out = output / name
        for line in lines:
            print(f"$ lightfield {line.format(scene=scenes / name, out=out)}", flush=True)
            code = prepared(list(_words(line, scenes / name, out)))()
            if code:
                return code
        reports.append(out / "index.html")
        print(f"report: {reports[-1].resolve()}\n", flush=True)
    print("The demo's reports:")
    for report in reports:
        print(f"report: {report.resolve()}")
    return 0


def _words(line: str, scene: Path, out: Path) -> Iterator[str]:
    # Split first, fill in later: a path may hold spaces.
    return (word.format(scene=scene, out=out) for word in line.split())


def _scenes(named: Path | None) -> Path:
    """The folder of experiments: as named, in the current folder, in the package, or beside it."""
    package = Path(__file__).resolve().parents[1]
    places = [named] if named else [Path("scenes"), package / "scenes", package.parent / "scenes"]
    for place in places:
        if all((place / name).is_dir() for name in EXPERIMENTS):
            return place
    raise UsageError(
        "the example experiments are not here",
        found=", ".join(map(str, places)),
        rule=f"a folder with {', '.join(EXPERIMENTS)}",
        remedy="name their folder with --scenes",
    )
