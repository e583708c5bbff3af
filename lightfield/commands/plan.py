"""`lightfield plan`: what a measurement layout can detect and tell apart, before measuring."""

from __future__ import annotations

import argparse
from pathlib import Path

from lightfield.commands._json import write_json
from lightfield.commands._options import add_option
from lightfield.readings import read_table
from lightfield.readings.columns import LAYOUT
from lightfield.scene import Scene
from lightfield.scene.effects_file import with_effects
from lightfield.storage.files import output_file


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "layout",
        type=Path,
        metavar="LAYOUT",
        help="reading table; its values may be left out",
    )
    parser.add_argument("--scene", type=Path, required=True, metavar="SCENE", help="scene file (TOML)")
    add_option(parser, "--effects-file")
    parser.add_argument("--json", type=Path, metavar="OUT", help="write everything as JSON")
    add_option(parser, "--no-trace")


def run(args: argparse.Namespace) -> int:
    """Plan and print."""
    from lightfield.diagnosis.plan import as_data, as_text, plan

    scene = with_effects(Scene.load(args.scene), args.effects_file)
    layout = read_table(args.layout, scene, LAYOUT)
    if args.json:
        output_file(args.json, args.layout, args.scene)
    diffuse = None
    if not args.no_trace:
        from lightfield.render.diffuse.source import response_for

        diffuse = response_for
    made = plan(layout, scene, diffuse)
    print(as_text(made))
    for warning in layout.warnings:
        print(f"warning: {warning}")
    if args.json:
        write_json(as_data(made), args.json)
    return 0
