"""`lightfield scene`: check a scene file, read or change its values, convert it."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic_core import to_jsonable_python

from lightfield.errors import UsageError
from lightfield.scene import Scene
from lightfield.scene.all_parameters import unused_words
from lightfield.scene.lamp.photometry import beam_table
from lightfield.scene.tank import Tank
from lightfield.storage import toml
from lightfield.storage.files import output_file

#: Of the light on its axis, above which the end of a lamp's table is told; up to where a table may end dark.
_BRIGHT_END, _ALL_ROUND = 0.01, math.radians(89.0)
#: Letters of a choice that are shown.
_SHORT = 48


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
        "--to-xml", type=Path, metavar="OUT", help="write a Mitsuba scene of the first band, with our plugins"
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
        output_file(args.to_xml, args.file, *scene.tables)
        from lightfield.render.xml import left_out, write_xml

        write_xml(scene, args.to_xml)
        print(args.to_xml)
        for line in left_out(scene):
            print(f"note: {line}")
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
    """Every parameter with value and unit, and every choice; `*` marks what departs from neutral."""
    lines = [f"{scene.name or 'scene'}: valid, digest {scene.digest()[:16]}", ""]
    numbers = scene.parameters()
    choices = {path: (value, meaning) for path, value, meaning in _fields(scene) if value is not None}
    for path in dict.fromkeys([*(path for path, *_ in _fields(scene)), *numbers]):
        if (parameter := numbers.get(path)) is not None:
            value = scene.get(path)
            mark = " " if parameter.neutral is None or value == parameter.neutral else "*"
            shown = f"{parameter.value:g}" if value is None else str(value)
            lines.append(f"{mark} {path:<34} {shown:>12} {parameter.unit or '':<8} {parameter.meaning}")
        elif path in choices:
            value, meaning = choices[path]
            lines.append(f"  {path:<34} {_short(value):>12}".ljust(58) + f" {meaning}")
    lines += ["", "* departs from its neutral value"]
    if unused := unused_words(scene):
        lines.append(unused)
    lines += _of_tank(scene.tank) if scene.tank else []
    if scene.lamp.profile == "table" and (left := _left_at_end(scene)) > _BRIGHT_END:
        lines.append(f"the lamp's table ends at {100 * left:.0f} % of the light on its axis: beyond is none")
    return "\n".join(lines)


def _fields(part: BaseModel, prefix: str = "") -> Iterator[tuple[str, object, str]]:
    """Dotted path, value and meaning of all that a scene's parts hold, in the order of a scene file."""
    for name, field in type(part).model_fields.items():
        value = getattr(part, name)
        if isinstance(value, BaseModel):
            yield from _fields(value, f"{prefix}{name}.")
        elif prefix:
            among = get_args(field.annotation) if get_origin(field.annotation) is Literal else ()
            others = [f"({', '.join(map(str, among))})"] if len(among) > 1 else []
            yield f"{prefix}{name}", value, " ".join([field.description or "kind", *others])


def _short(value: object) -> str:
    """A choice in a few words."""
    text = value if isinstance(value, str) else json.dumps(to_jsonable_python(value))
    return text if len(text) <= _SHORT else f"{text[: _SHORT - 4]} ..."


def _of_tank(tank: Tank) -> list[str]:
    """What is stated of the tank, and counts for less than it says, or for nothing."""
    told = []
    for name, share in (("floor_over_walls", tank.floor_share), ("end_over_walls", tank.end_share)):
        stated = getattr(tank, name)
        if stated != 1.0 and tank.wall_albedo == 0:
            told.append(f"tank.{name} = {stated:g} is of black walls: nothing (0.005 is a nearly black wall)")
        elif share < stated:
            told.append(f"tank.{name} = {stated:g} is more than all light: it counts as {share:.4g}")
    if tank.surface_slope_deg and not tank.slope:
        told.append(f"tank.surface_slope_deg = {tank.surface_slope_deg:g} is of a lid: nothing")
    return told


def _left_at_end(scene: Scene) -> float:
    """Intensity at a lamp table's last angle over that on the axis, 0 where it goes all the way round."""
    table = beam_table(str(scene.lamp.intensity_table))
    return float(table.mean[-1]) if table.angle_rad[-1] < _ALL_ROUND else 0.0
