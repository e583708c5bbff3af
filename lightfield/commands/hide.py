"""`lightfield hide`: make readings with an effect hidden in them, to test a diagnosis (or a person)."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from lightfield.commands.shared.options import add_option, assignment, given
from lightfield.commands.shared.progress import progress_of
from lightfield.render.limits import MADE_PHOTONS
from lightfield.scene import Scene
from lightfield.scene.effects_file import with_effects
from lightfield.storage.files import locked_folder, output_file
from lightfield.studies.defaults import HIDDEN_NOISE


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add = parser.add_argument
    what = "scene file (TOML): what the experimenter believes; every band is read"
    add_option(parser, "scene", help=what)
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
    add(
        "--noise",
        type=float,
        default=HIDDEN_NOISE,
        metavar="REL",
        help="relative noise (default %(default)g)",
    )
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
    add("--to-and-fro", action="store_true", help="so too, every other row along x from its other end")
    add_option(parser, "--max-photons", f"{MADE_PHOTONS:g}; what it leaves unknown is stated with the errors")
    add_option(parser, "--output", required=True, help="scene.toml, data.csv, truth.json")


def run(args: argparse.Namespace) -> int:
    """Hide, and write scene.toml, data.csv, truth.json."""
    from lightfield.experiments.hide import check_request

    check_request(
        args.effect, args.strength, args.noise, args.plane_gain, args.position,
        spelled=lambda word: f"--{word.replace('_', '-')}",
    )  # fmt: skip
    scene = with_effects(Scene.load(args.scene), args.effects_file)
    values = dict(map(assignment, args.size))
    with locked_folder(args.output):
        return _hide(scene, values, args)


def _hide(scene: Scene, values: dict[str, float], args: argparse.Namespace) -> int:
    from lightfield.api.hide import hide
    from lightfield.experiments.hide import WRITTEN, replaced_in

    for name in WRITTEN:
        inputs = [args.scene, *scene.tables, *([args.effects_file] if args.effects_file else [])]
        output_file(args.output / name, *inputs)
    replaced = replaced_in(args.output)
    with progress_of("hide"):
        made = hide(
            scene, size=values,
            **given(
                args, "effect", "lamp", "strength", "seed", "layout", "noise", "plane_gain", "position",
                "plane_order", "to_and_fro", "max_photons",
            ),
        ).details  # fmt: skip
    # A file of effects is given again where one looks for them: the scene tells nothing of what was hidden.
    plain = made.believed.model_copy(update={"effect": Scene.load(args.scene).effect})
    folder = replace(made, believed=plain).save(args.output)
    if replaced:
        print(f"replaced, of a riddle of before: {', '.join(replaced)}")
    print(f"readings: {folder / 'data.csv'}, scene: {folder / 'scene.toml'}")
    if made.in_doubt is not None:
        print(f"warning: {made.in_doubt} (--max-photons)")
    print(f"do not look: {folder / 'truth.json'}")
    return 0
