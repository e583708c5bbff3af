"""`lightfield diagnose`: find the physical effect that readings show and the model lacks."""

from __future__ import annotations

import argparse
import json
import sys
from contextlib import nullcontext
from pathlib import Path

from lightfield.commands.shared.answer import outputs_of, write_json
from lightfield.commands.shared.options import add_option, effects_asked
from lightfield.commands.shared.progress import stage_line
from lightfield.commands.shared.ranges import check_ranges
from lightfield.diagnosis.adequacy.level import ALPHA
from lightfield.diagnosis.verdict.parts import Kind
from lightfield.diagnosis.verdict.verdict import json_schema
from lightfield.errors import UsageError
from lightfield.fitting.effects import all_of, curves
from lightfield.readings import Readings, read_table
from lightfield.scene import Scene
from lightfield.scene.effects_file import with_effects
from lightfield.storage.files import locked_folder, output_file, write_text

#: Of a ladder: the base model and eight effects.
_MOST_RUNGS = 9


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("data", type=Path, metavar="DATA", nargs="?", help="reading table (CSV)")
    add_option(parser, "--scene")
    parser.add_argument(
        "--effects", metavar="A,B,...", help="consider these effects only (default: all; --list names them)"
    )
    add_option(parser, "--effects-file")
    parser.add_argument("--list", action="store_true", help="print the table of effects and stop")
    add_option(parser, "--json", help="write the verdict")
    add_option(parser, "--report")
    add_option(parser, "--output", help="write verdict, one scene per rung, and the ledger")
    parser.add_argument("--schema", action="store_true", help="print the JSON Schema of the verdict and stop")
    parser.add_argument(
        "--alpha", type=float, default=ALPHA, help="false-alarm probability (default %(default)g)"
    )
    add_option(parser, "--seed", 0)
    add_option(parser, "--no-trace")
    parser.add_argument(
        "--no-render", action="store_true", help="do not render the explained scene afresh at the end"
    )


def run(args: argparse.Namespace) -> int:
    """Diagnose, print, write."""
    if args.schema:
        print(json.dumps(json_schema(), indent=2))
        return 0
    if args.list:
        print(as_text(with_effects(Scene(), args.effects_file)))
        return 0
    if args.data is None or args.scene is None:
        raise UsageError(
            "diagnose needs readings and a scene", remedy="lightfield diagnose DATA --scene SCENE"
        )
    check_ranges(args, "alpha")
    names = None if args.effects is None else effects_asked(args)
    scene = with_effects(Scene.load(args.scene), args.effects_file)
    readings = read_table(args.data, scene)
    outputs_of(args, args.data, args.scene, args.effects_file, *scene.tables)
    with locked_folder(args.output) if args.output else nullcontext():
        return _diagnose(readings, scene, names, args)


def _diagnose(readings: Readings, scene: Scene, names: list[str] | None, args: argparse.Namespace) -> int:
    from lightfield.diagnosis.diagnose import CURVES, HYPOTHESES, VERDICT, diagnose
    from lightfield.diagnosis.verdict.best_set.so_far import SoFar
    from lightfield.fitting.fitted_curves import LAMP_TABLE, SPECTRUM_TABLE

    if args.output:
        inputs = [file for file in (args.data, args.scene, args.effects_file, *scene.tables) if file]
        rungs = (f"rung{k}.toml" for k in range(_MOST_RUNGS))
        for name in (VERDICT, CURVES, LAMP_TABLE, SPECTRUM_TABLE, *rungs):
            output_file(args.output / name, *inputs)
    found = None
    try:
        with stage_line("reading") as stage:
            so_far = SoFar(stage)
            found = diagnose(
                readings,
                scene,
                diffuse=None if args.no_trace else "trace",
                only=names,
                alpha=args.alpha,
                seed=args.seed or 0,
                progress=so_far,
            )
            if found.steps[1:] and not (args.no_trace or args.no_render):
                stage("rendering the explained scene afresh")
                found = found.rendered()
    except KeyboardInterrupt:
        # What is known is not lost: a long search may have found enough.
        print(f"{found.as_text()}\nnot rendered afresh" if found else so_far.as_text())
        known = found.verdict.model_copy(update={"interrupted": True}) if found else None
        data = so_far.as_data() if known is None else known.model_dump(mode="json")
        if args.json and data:
            write_json(data, args.json)
        raise
    if args.output:
        command = f"diagnose {args.data.name} --scene {args.scene.name}"
        found = found.save(args.output, command, args.effects_file)
    if args.json:
        write_text(args.json, found.verdict.model_dump_json(indent=2) + "\n")
    print(found.as_text())
    if found.older:
        print(f"of earlier runs, not touched: {', '.join(found.older)}")
    if args.output and found.verdict.verdict == Kind.UNEXPLAINED:
        print(f"hypotheses to begin with, for --effects-file: {args.output / HYPOTHESES}")
    if args.report:
        from lightfield.api.diagnosis import Diagnosis

        sys.stdout.flush()  # the verdict first: the page fits its rivals to each other, and may take as long
        with stage_line("the page: how far explanations are apart"):
            page = Diagnosis(found).report(args.report).resolve()
        print(f"report: {page}")
    return 0


def as_text(scene: Scene) -> str:
    """The table of effects for people: named ones, those of the user's own, and curves."""
    lines = []
    for effect in (*all_of(scene).values(), *curves().values()):
        lines.append(f"{effect.name} ({effect.family}): {effect.physics}")
        if effect.is_free_form:
            of = (
                f", of which these are special cases: {', '.join(effect.contains)}" if effect.contains else ""
            )
            lines.append(f"    a curve{of}")
        for form in effect.forms:
            paths = [f.path for f in (*form.amplitudes, *form.shapes)]
            said = f"{paths[0]} to {paths[-1]}" if effect.is_free_form else ", ".join(paths)
            lines.append(f"    {form.name}: {said}")
        lines += [f"    looks like: {effect.signature}", f"    check: {effect.laboratory}"]
    return "\n".join(lines)
