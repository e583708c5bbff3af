"""`lightfield scene`: check a scene file, read or change its values, convert it."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from lightfield.errors import UsageError
from lightfield.scene import Scene
from lightfield.storage import toml
from lightfield.storage.files import output_file


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("file", nargs="?", type=Path, metavar="FILE", help="scene file (TOML)")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="PATH=VALUE",
        help="change a value first, e.g. water.phase.g=0.9; may be repeated",
    )
    output = parser.add_mutually_exclusive_group()
    output.add_argument("--get", metavar="PATH", help="print one value, e.g. water.scattering_per_m")
    output.add_argument(
        "--to-toml",
        action="store_true",
        help="print the scene as TOML: what FILE and --set say, without defaults",
    )
    output.add_argument(
        "--to-xml", type=Path, metavar="OUT", help="write a Mitsuba scene that uses our plugins"
    )
    output.add_argument("--schema", action="store_true", help="print the JSON Schema of scene files")


def run(args: argparse.Namespace) -> int:
    """Do what the options say; without any, list what the scene says."""
    if args.schema:
        print(json.dumps(Scene.json_schema(), indent=2))
        return 0
    if args.file is None:
        raise UsageError("no scene file given", remedy="lightfield scene FILE, or --schema alone")
    scene = Scene.load(args.file)
    if args.set:
        scene = scene.with_values(dict(_assignment(text) for text in args.set))
    if args.get is not None:
        value = scene.get(args.get)
        dump = getattr(value, "model_dump", None)
        print(json.dumps(dump(mode="json") if dump else value) if not isinstance(value, str) else value)
    elif args.to_xml:
        output_file(args.to_xml, args.file)
        from lightfield.render.xml import write_xml

        write_xml(scene, args.to_xml)
        print(args.to_xml)
    elif args.to_toml or args.set:
        print(scene.to_toml(), end="")
    else:
        print(as_text(scene))
    return 0


def _assignment(text: str) -> tuple[str, object]:
    """Split PATH=VALUE; the value is read as TOML, and as plain text where it is not TOML."""
    path, equals, value = text.partition("=")
    if not equals or not path.strip():
        raise UsageError(
            "not an assignment", where="--set", found=text, rule="PATH=VALUE, e.g. water.phase.g=0.9"
        )
    try:
        return path.strip(), toml.value(value)
    except ValueError as error:
        raise UsageError(
            "not a value", where=f"--set {path.strip()}", found=value, rule=str(error)
        ) from error


def as_text(scene: Scene) -> str:
    """Every parameter with value and unit; `*` marks what departs from neutral."""
    lines = [f"{scene.name or 'scene'}: valid, digest {scene.digest()[:16]}", ""]
    for path, parameter in scene.parameters().items():
        value = scene.get(path)
        mark = " " if parameter.neutral is None or value == parameter.neutral else "*"
        shown = f"{parameter.value:g}" if value is None else value
        lines.append(f"{mark} {path:<34} {shown!s:>12} {parameter.unit or '':<8} {parameter.meaning}")
    return "\n".join([*lines, "", "* departs from its neutral value"])
