"""`lightfield hide`: make readings with an effect hidden in them, to test a diagnosis (or a person)."""

from __future__ import annotations

import argparse
from pathlib import Path

from lightfield.commands._console import stage_line
from lightfield.commands._options import add_option, assignment, given
from lightfield.errors import OutputError, UsageError
from lightfield.readings import read_table
from lightfield.readings.columns import LAYOUT
from lightfield.scene import Scene
from lightfield.scene.effects_file import with_effects
from lightfield.storage.files import locked_folder, output_file

#: What is written; the last tells that the others are a riddle.
WRITTEN = ("scene.toml", "data.csv", "truth.json")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add = parser.add_argument
    add(
        "scene",
        type=Path,
        metavar="SCENE",
        help="scene file (TOML): what the experimenter believes; every band is read",
    )
    add(
        "--effect",
        action="append",
        default=[],
        metavar="NAME[:FORM]",
        help="effect to hide, or unknown:ripple|flicker|shadow|kink; repeatable; without it nothing is "
        "hidden but what every measurement has: a guess of width and absorption that is 10 to 25 %% wrong, "
        "and a window of 2 cm radius (0.5 %% of the nearest distance, if less) unless the scene has one",
    )
    add(
        "--lamp",
        type=Path,
        metavar="TABLE",
        help="intensity of the true lamp against the angle (CSV, IES, EULUMDAT), whatever the scene believes",
    )
    add("--size", action="append", default=[], metavar="PATH=VALUE", help="fix a size that would be drawn")
    add_option(parser, "--effects-file")
    add("--strength", type=float, metavar="S", help="size over the effect's typical size, else drawn")
    add_option(parser, "--seed", 0)
    add(
        "--layout",
        help="line, half, grid, fine, column or air, or a table of places, FILE.csv (default: line, or the "
        "positions that the scene lists)",
    )
    add("--noise", type=float, default=0.005, metavar="REL", help="relative noise (default 0.005)")
    add(
        "--plane-gain",
        type=float,
        default=0.0,
        metavar="PERCENT",
        help="error of every stay at a plane, stated in the head of the table (default 0)",
    )
    add(
        "--position",
        type=float,
        default=0.0,
        metavar="MM",
        help="error of every position, stated in the head of the table (default 0)",
    )
    add("--plane-order", action="store_true", help="read plane by plane instead of in random order")
    add_option(parser, "--max-photons", "3e7; what it leaves unknown is stated with the errors")
    add("-o", "--output", type=Path, required=True, metavar="DIR", help="scene.toml, data.csv, truth.json")


def run(args: argparse.Namespace) -> int:
    """Hide, and write scene.toml, data.csv, truth.json."""
    if not 1e-5 <= args.noise <= 0.5:
        raise UsageError(
            "impossible relative noise", where="--noise", found=args.noise, rule="0.00001 to 0.5"
        )
    if args.strength is not None and not args.strength > 0:
        raise UsageError("impossible strength", where="--strength", found=args.strength, rule="above 0")
    for option, size, largest in (("--plane-gain", args.plane_gain, 50), ("--position", args.position, 100)):
        if not 0 <= size <= largest:
            raise UsageError("impossible error", where=option, found=size, rule=f"0 to {largest}")
    doubled = sorted({name for name in args.effect if args.effect.count(name) > 1})
    if doubled:
        raise UsageError(
            "an effect is hidden twice", where="--effect", found=", ".join(doubled), rule="each once"
        )
    scene = with_effects(Scene.load(args.scene), args.effects_file)
    values = dict(map(assignment, args.size))
    with locked_folder(args.output):
        return _hide(scene, values, args)


def _hide(scene: Scene, values: dict[str, float], args: argparse.Namespace) -> int:
    from lightfield.experiments.hide import Secret, hide
    from lightfield.experiments.measure import Instrument

    output_file(args.output / "scene.toml", args.scene)
    layout = args.layout
    if layout is not None and layout.lower().endswith(".csv"):
        layout = read_table(Path(layout), scene, LAYOUT)
    replaced = _replaced(args.output)
    with stage_line("the light with what is hidden in it"):
        made = hide(
            scene,
            Secret(args.effect, args.strength, values, args.lamp),
            args.seed or 0,
            Instrument(args.noise, plane_gain=args.plane_gain / 100, position_m=args.position / 1000),
            layout=layout,
            order="plane" if args.plane_order else "random",
            **given(args, "max_photons"),
        )
    folder = made.save(args.output)
    if replaced:
        print(f"replaced, of a riddle of before: {', '.join(replaced)}")
    print(f"readings: {folder / 'data.csv'}, scene: {folder / 'scene.toml'}")
    light = made.truth["light_error_percent"]
    if light > 50 * args.noise:
        print(f"the light is known to {light:.2g} % only, stated with the errors; more: --max-photons")
    print(f"do not look: {folder / 'truth.json'}")
    return 0


def _replaced(folder: Path) -> list[str]:
    """Files that will be written over; they must be those of a riddle, not somebody's own readings.

    Raises
    ------
    OutputError
        Readings are there, and no truth that they were made from.
    """
    there = [str(folder / name) for name in WRITTEN if (folder / name).exists()]
    if there and not (folder / WRITTEN[-1]).exists():
        raise OutputError(
            "files of an experiment are here already",
            where=str(folder),
            found=", ".join(there),
            rule="only a riddle is replaced by another",
            remedy="choose another folder",
        )
    return there
