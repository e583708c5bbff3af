"""`lightfield plan`: what a measurement layout can detect and tell apart, before measuring."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from lightfield.commands._answer import answered, outputs_of
from lightfield.commands._options import add_option, assignment, effects_asked, trace_asked
from lightfield.commands._progress import progress_of
from lightfield.errors import UsageError
from lightfield.readings import Readings, read_table
from lightfield.readings.columns import LAYOUT
from lightfield.scene import Scene
from lightfield.scene.effects_file import with_effects

if TYPE_CHECKING:
    from lightfield.fitting.diffuse_light import DiffuseSource


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "layout",
        type=Path,
        metavar="LAYOUT",
        help="reading table; its values may be left out",
    )
    parser.add_argument("--scene", type=Path, required=True, metavar="SCENE", help="scene file (TOML)")
    parser.add_argument(
        "--effects",
        metavar="A,B,...",
        help="which of these, all acting at once, would be certain? (effect or effect:form)",
    )
    parser.add_argument(
        "--size",
        action="append",
        default=[],
        metavar="PATH=VALUE",
        help="with --effects: a size of one of them; else twice the typical one",
    )
    parser.add_argument("--report", type=Path, metavar="OUT.html", help="with --effects: write a page")
    add_option(parser, "--effects-file")
    add_option(parser, "--json")
    add_option(parser, "--no-trace")


def run(args: argparse.Namespace) -> int:
    """Plan and print."""
    from lightfield.api.diagnosis import Plan
    from lightfield.diagnosis.plan import plan

    scene = with_effects(Scene.load(args.scene), args.effects_file)
    layout = read_table(args.layout, scene, LAYOUT)
    outputs_of(args, args.layout, args.scene, args.effects_file)
    if args.effects is None and (args.size or args.report):
        raise UsageError("no effect is named", where="--size, --report", rule="with --effects A,B,...")
    diffuse = trace_asked(args)
    if args.effects is not None:
        return _together(layout, scene, diffuse, args)
    with progress_of("plan"):
        made = plan(layout, scene, diffuse)
    return answered(args, Plan(made), layout.warnings)


def _together(layout: Readings, scene: Scene, diffuse: DiffuseSource | None, args: argparse.Namespace) -> int:
    """Which of several effects would be certain."""
    from lightfield.api.diagnosis import Together
    from lightfield.diagnosis.together import together

    names = effects_asked(args)
    with progress_of("plan"):
        made = together(layout, scene, names, dict(map(assignment, args.size)), diffuse)
    return answered(args, Together(made), layout.warnings)
