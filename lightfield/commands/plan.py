"""`lightfield plan`: what a measurement layout can detect and tell apart, before measuring."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lightfield.commands._json import write_json
from lightfield.commands._options import add_option, assignment
from lightfield.errors import UsageError
from lightfield.readings import Readings, read_table
from lightfield.readings.columns import LAYOUT
from lightfield.scene import Scene
from lightfield.scene.effects_file import with_effects
from lightfield.storage.files import output_file

if TYPE_CHECKING:
    from lightfield.diagnosis.plan import LayoutPlan
    from lightfield.fitting.light_source import DiffuseSource

_SHOWN = 6


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "layout",
        type=Path,
        metavar="LAYOUT",
        help="reading table; the column value may be left out",
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
    parser.add_argument("--json", type=Path, metavar="OUT", help="write everything as JSON")
    add_option(parser, "--no-trace")


def run(args: argparse.Namespace) -> int:
    """Plan and print."""
    from lightfield.diagnosis.plan import plan

    scene = with_effects(Scene.load(args.scene), args.effects_file)
    layout = read_table(args.layout, scene, LAYOUT)
    outputs = [file for file in (args.json, args.report) if file]
    for k, file in enumerate(outputs):
        output_file(file, args.layout, args.scene, *outputs[:k])
    if args.effects is None and (args.size or args.report):
        raise UsageError("no effect is named", where="--size, --report", rule="with --effects A,B,...")
    diffuse = None
    if not args.no_trace:
        from lightfield.render.diffuse.source import response_for

        diffuse = response_for
    if args.effects is not None:
        return _together(layout, scene, diffuse, args)
    made = plan(layout, scene, diffuse)
    print(as_text(made))
    for warning in layout.warnings:
        print(f"warning: {warning}")
    if args.json:
        write_json(as_data(made), args.json)
    return 0


def _together(layout: Readings, scene: Scene, diffuse: DiffuseSource | None, args: argparse.Namespace) -> int:
    """Which of several effects would be certain."""
    from lightfield.diagnosis.together import together

    names = [name.strip() for name in args.effects.split(",") if name.strip()]
    if not names:
        raise UsageError("no effect is named", where="--effects", found=args.effects, rule="A,B,...")
    made = together(layout, scene, names, dict(map(assignment, args.size)), diffuse)
    print(made.as_text())
    for warning in layout.warnings:
        print(f"warning: {warning}")
    if args.json:
        write_json(made.as_data(), args.json)
    if args.report:
        from lightfield.report.together import write_together

        print(f"report: {write_together(made, args.report).resolve()}")
    return 0


def _unit(made: LayoutPlan, path: str) -> str:
    unit = made.units.get(path, "1")
    return "" if unit == "1" else f" {unit}"


def as_text(made: LayoutPlan) -> str:
    from lightfield.diagnosis.search.rivals import DETECTABLE_SIGMA, SAME_CLASS_SIGMA

    lines = [f"{made.readings} readings. Smallest size that would be found with 95 % probability:"]
    for name, limit in sorted(made.limits.items()):
        size = f"{limit.value:.3g}{_unit(made, limit.path)}"
        size = size if limit.reachable else f"not even its largest plausible size ({size})"
        lines.append(f"  {name:<20} {limit.path:<32} {size}")
    for name, reason in made.untestable.items():
        lines.append(f"  {name:<20} not testable: {reason}")
    iso = made.isolability
    lines += [
        "",
        "Distance D in sigma between effects, each at twice its detection limit or its typical size (row "
        f"true, column fitted): below {SAME_CLASS_SIGMA:g} they look alike. Last, the distance from the base "
        f"model: below {DETECTABLE_SIGMA:.1f} an effect is not sure to be seen.",
    ]
    width = 7
    lines.append(" " * 22 + "".join(f"{i + 1:>{width}}" for i in range(len(iso.names))))
    for j, name in enumerate(iso.names):
        row = "".join(f"{'-' if j == k else f'{iso.D[j, k]:.1f}':>{width}}" for k in range(len(iso.names)))
        lines.append(f"{j + 1:>2} {name:<19}{row}{iso.delta[j]:>{width + 3}.1f}")
    classes = iso.classes()
    lines.append("")
    if classes:
        lines += ["Seen but not told apart: " + ", ".join(group) for group in classes]
    else:
        lines.append("Every effect that would be seen would also be told from the others that would be.")
    for extra in made.helpful[:_SHOWN]:
        advice = extra.advice
        spots = "; ".join(
            f"x = {x:.2f}, y = {y:.2f}, z = {z:.2f} m"
            for x, y, z in zip(advice.places.x_m, advice.places.y_m, advice.places.z_m, strict=True)
        )
        lines.append(
            f"Add {advice.repeats} readings each at {spots}: {' and '.join(extra.between)} would part by "
            f"{advice.predicted_sigma:.1f} sigma (now {advice.now_sigma:.1f})."
        )
    lines += [f"assumed: {a}" for a in made.assumed]
    return "\n".join(lines)


def as_data(made: LayoutPlan) -> dict[str, Any]:
    iso = made.isolability
    return {
        "readings": made.readings,
        "detection_limits": {
            name: {
                "parameter": limit.path,
                "value": limit.value,
                "unit": made.units.get(limit.path, "1"),
                "within_range": limit.reachable,
            }
            for name, limit in made.limits.items()
        },
        "untestable": made.untestable,
        "effects": list(iso.names),
        "sizes": [float(s) for s in iso.sizes],
        "delta_sigma": [float(d) for d in iso.delta],
        "D_sigma": np.round(iso.D, 4).tolist(),
        "classes": [list(group) for group in iso.classes()],
        "add": [
            {
                "between": list(extra.between),
                "repeats": extra.advice.repeats,
                "now_sigma": extra.advice.now_sigma,
                "predicted_sigma": extra.advice.predicted_sigma,
                "places_m": np.stack(
                    [extra.advice.places.x_m, extra.advice.places.y_m, extra.advice.places.z_m], axis=1
                ).tolist(),
            }
            for extra in made.helpful
        ],
        "assumed": list(made.assumed),
    }
