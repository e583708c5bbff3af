"""`lightfield plan`: what a measurement layout can detect and tell apart, before measuring."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lightfield.commands._json import write_json
from lightfield.commands._options import add_option
from lightfield.readings import read_table
from lightfield.readings.columns import LAYOUT
from lightfield.scene import Scene
from lightfield.scene.effects_file import with_effects
from lightfield.storage.files import output_file

if TYPE_CHECKING:
    from lightfield.diagnosis.plan import LayoutPlan

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
    add_option(parser, "--effects-file")
    parser.add_argument("--json", type=Path, metavar="OUT", help="write everything as JSON")
    add_option(parser, "--no-trace")


def run(args: argparse.Namespace) -> int:
    """Plan and print."""
    from lightfield.diagnosis.plan import plan

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
