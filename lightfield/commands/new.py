"""`lightfield new tank`: a scene and an empty reading table of one's own, from answers or options."""

from __future__ import annotations

import argparse
import sys
from shlex import quote

from lightfield.commands.shared.options import add_option
from lightfield.errors import LightfieldError
from lightfield.experiments.new_tank import (
    LAYOUT,
    OF_TANK,
    READINGS,
    SCENE,
    NewTank,
    is_open,
    new_tank,
    sizes_told,
)
from lightfield.experiments.questions import QUESTIONS, Question
from lightfield.storage.files import output_folder

#: The option that may be given again, as that of an import may.
_SEVERAL = "band"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options: one per question."""
    parser.add_argument("kind", choices=("tank",), metavar="tank", help="what is begun: a tank of your own")
    for question in QUESTIONS:
        default = f"default {question.default}" if question.default else "default: from the rest"
        parser.add_argument(
            f"--{question.name.replace('_', '-')}",
            metavar=question.name.upper().replace("_", "-"),
            action="append" if question.name == _SEVERAL else "store",
            help=f"{question.text[0].lower()}{question.text[1:]}: {question.form} ({default})",
        )
    add_option(parser, "--output", required=True, help="folder: scene.toml, layout.csv, readings.csv")


def run(args: argparse.Namespace) -> int:
    """Ask on a terminal where nothing was given, write the three files, say what comes next."""
    given = {q.name: value for q in QUESTIONS if (value := getattr(args, q.name)) is not None}
    answers = given | ({_SEVERAL: ",".join(given[_SEVERAL])} if _SEVERAL in given else {})
    asking = not answers and sys.stdin.isatty()
    name = args.output.resolve().name
    made = asked(name) if asking else new_tank(answers, name)
    files = made.save(output_folder(args.output))
    scene, readings = quote(str(files[SCENE])), quote(str(files[READINGS]))
    report = quote(str(files[READINGS].with_name("report.html")))
    if not asking:
        left = [q for q in QUESTIONS if q.name not in answers and q.default]
        assumed = [f"{q.name} {q.default}" for q in left if not (is_open(answers) and q.name in OF_TANK)]
        if assumed:
            print(f"assumed: {', '.join(assumed)}")
        print(f"tank: {sizes_told(made.scene)}")
    print(f"scene: {files[SCENE]} (`lightfield scene` lists its defaults)")
    print(f"readings: {files[READINGS]}, {made.rows} places to read")
    print("next, what this layout could tell, and then, with its values filled in, what they tell:")
    print(f"  lightfield plan {quote(str(files[LAYOUT]))} --scene {scene}")
    print(f"  lightfield diagnose {readings} --scene {scene} --report {report}")
    return 0


def asked(name: str) -> NewTank:
    """Answers from the terminal, one by one; an empty line takes what stands in brackets."""
    answers: dict[str, str] = {}
    for question in QUESTIONS:
        if is_open(answers) and question.name in OF_TANK:
            continue
        made = _answer(question, answers, name)
        if question.name == "tank":
            print(f"  {sizes_told(made.scene)}")
    return made


def _answer(question: Question, answers: dict[str, str], name: str) -> NewTank:
    """Ask until the answer fits what was answered before."""
    while True:
        default = f" [{question.default}]" if question.default else ""
        print(f"{question.text} ({question.form}){default}: ", end="", flush=True)
        line = sys.stdin.readline()
        answers[question.name] = line.strip()
        try:
            return new_tank(answers, name)
        except LightfieldError as error:
            if not line:  # the terminal was closed: there will be no other answer
                raise
            print(f"  {error}")
