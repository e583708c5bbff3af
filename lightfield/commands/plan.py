"""`lightfield plan`: what a measurement layout can detect and tell apart, before measuring."""

from __future__ import annotations

import argparse
from pathlib import Path

from lightfield.commands.shared.answer import answered, outputs_of
from lightfield.commands.shared.options import add_option, assignment, effects_asked
from lightfield.commands.shared.progress import progress_of
from lightfield.errors import UsageError
from lightfield.readings import read_table
from lightfield.readings.columns import LAYOUT
from lightfield.scene import Scene
from lightfield.scene.effects_file import with_effects


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "layout", type=Path, metavar="LAYOUT", help="reading table; its values may be left out"
    )
    add_option(parser, "--scene", required=True)
    parser.add_argument(
        "--effects",
        metavar="A,B,...",
        help="which of these, all acting at once, would be certain? (effect, effect:form, or a curve)",
    )
    parser.add_argument(
        "--size",
        action="append",
        default=[],
        metavar="PATH=VALUE",
        help="with --effects: a size of one of them; else twice the typical one",
    )
    add_option(parser, "--report", help="with --effects: write a page")
    add_option(parser, "--effects-file")
    add_option(parser, "--json")
    add_option(parser, "--no-trace")


def run(args: argparse.Namespace) -> int:
    """Plan and print."""
    from lightfield.api.diagnosis import plan

    scene = with_effects(Scene.load(args.scene), args.effects_file)
    layout = read_table(args.layout, scene, LAYOUT)
    outputs_of(args, args.layout, args.scene, args.effects_file, *scene.tables)
    if args.effects is None and (args.size or args.report):
        asked = [name for name in ("size", "report") if getattr(args, name)]
        where = " and ".join(f"--{name}" for name in asked)
        raise UsageError("no effect is named", where=where, rule="with --effects A,B,...")
    names = None if args.effects is None else effects_asked(args)
    sizes = dict(map(assignment, args.size))
    with progress_of("plan"):
        answer = plan(layout, scene, effects=names, size=sizes, trace=not args.no_trace)
    return answered(args, answer, layout.warnings)
