"""What README and manual say works: commands run as written, files load, the Python example finds the effect.

Traces are cut short, by a photon budget or left out where a trace is not the point; diagnoses ask for few
effects; maps of the tow tank have a fifteenth of their cells; figures of pages are drawn as wide screens show
them, since the tests of each page draw those for telephones; all else is as written.
"""

from __future__ import annotations

import re
import shlex
import shutil
from functools import partial
from pathlib import Path

import pytest

import lightfield
from lightfield import cli
from lightfield.commands.shared.line import COMMANDS as SUB_COMMANDS
from lightfield.commands.shared.line import prepared
from lightfield.readings import read_table
from lightfield.render.diffuse.source import response_for
from lightfield.report.page import to_svg
from lightfield.scene import Scene

ROOT = Path(__file__).resolve().parents[2]
#: In this order: later commands use what earlier ones wrote.
PAGES = [
    ROOT / "README.md",
    *(
        ROOT / "docs" / f"{name}.md"
        for name in ("commands", "files", "sweeps", "follower", "backend", "limits")
    ),
]
README = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
SHORT = {
    "render": "--max-photons 2e4",
    "compare": "--max-photons 2e4",
    "sweep": "--max-photons 2e3",
    "regime": "--max-photons 2e3",
    "hide": "--max-photons 2e4",
    "plan": "--no-trace",
    "diagnose": "--effects scattering",
    "attenuation": "--no-trace",
    "band": "--max-photons 1e4",
    "range": "--no-trace",
    "link": "--max-photons 1e4 --to 20",
    "array": "--no-trace",
    "pose": "--no-trace",
    "follow": "--no-trace --duration 1 --runs 1",
    "field": "--no-trace",
    "picture": "--samples 2 --size 64x36",
}


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.MULTILINE | re.DOTALL)


COMMANDS = [line for block in blocks("sh") for line in block.splitlines() if line.strip()]


@pytest.fixture(scope="module")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The root of a clone, as far as the README needs it."""
    folder = tmp_path_factory.mktemp("clone")
    shutil.copytree(ROOT / "scenes", folder / "scenes")
    tank = folder / "scenes" / "unh_tow_tank" / "scene.toml"
    whole = tank.read_text(encoding="utf-8")
    assert "pixels = 65" in whole
    tank.write_text(whole.replace("pixels = 65", "pixels = 17"), encoding="utf-8")
    return folder


@pytest.fixture
def wide_alone(monkeypatch):
    """Figures for telephones are made, and not drawn."""

    def drawn(figure, name):
        return "<svg></svg>" if name.endswith("-narrow") else to_svg(figure, name)

    monkeypatch.setattr("lightfield.report.page.to_svg", drawn)


#: Commands that write nothing for later ones, and run in other quick tests: here in the slow tier.
ALSO_ELSEWHERE = ("compare", "link", "band", "picture", "regime", "follow", "diagnose", "pose")


def shortened(words: list[str]) -> list[str]:
    """A command with the options that cut it short."""
    # A fit traces nothing afresh that could be cut short.
    fits = words[0] == "compare" and words[1].endswith(".csv")
    return words if fits or "--list" in words else [*words, *SHORT.get(words[0], "").split()]


@pytest.mark.parametrize("line", COMMANDS)
def test_every_command_is_understood(line):
    """Its options are read; nothing is done."""
    assert callable(prepared(shlex.split(line, comments=True)[1:]))


@pytest.mark.parametrize(
    "line",
    [pytest.param(line, marks=[pytest.mark.slow] * (line.split()[1] in ALSO_ELSEWHERE)) for line in COMMANDS],
)
def test_every_command_runs_as_written(clone, monkeypatch, capsys, request, line):
    """In the order of the pages: later ones use what earlier ones wrote."""
    program, *words = shlex.split(line, comments=True)
    assert program == "lightfield"
    if words[:2] != ["pose", "bias"]:  # drawn here alone
        request.getfixturevalue("wide_alone")
    monkeypatch.chdir(clone)
    for earlier in COMMANDS[: COMMANDS.index(line)]:  # where this test runs alone
        _, *before = shlex.split(earlier, comments=True)
        if "-o" in before and (made := before[before.index("-o") + 1]) in words and not Path(made).exists():
            assert cli.main(shortened(before)) == 0, capsys.readouterr().err
    assert cli.main(shortened(words)) == 0, capsys.readouterr().err
    for option in ("-o", "--report", "--to-xml", "--exr"):
        if option in words:
            assert Path(words[words.index(option) + 1]).exists()


def test_the_python_example_runs_and_finds_the_effect(clone, monkeypatch, capsys):
    """Cut short as the commands: `physics/found/test_verdicts.py` asks the whole table of these readings, the
    command `diagnose` above renders the explained scene afresh, and its own tests draw its page."""
    few = ["scattering", "beam_tilt", "background"]
    monkeypatch.setattr(lightfield, "diagnose", partial(lightfield.diagnose, effects=few, render=False))
    monkeypatch.setitem(response_for.__kwdefaults__, "photons", 400_000)
    monkeypatch.setattr("lightfield.report.page.to_svg", lambda figure, name: "<svg></svg>")
    (example,) = blocks("python")
    assert len([line for line in example.splitlines() if line]) == 5
    monkeypatch.chdir(clone)
    exec(compile(example, "README.md", "exec"), {})
    assert Path("story.html").is_file()
    text = capsys.readouterr().out
    assert "is missing in the model" in text.splitlines()[0]
    ladder = text.partition("ladder")[2]
    base, *_, last = re.findall(r"^(?:base|\+ \w+) +([\d.]+)", ladder, re.MULTILINE)
    assert float(last) < float(base) / 3


def test_the_scene_and_the_readings_shown_are_whole(tmp_path):
    (toml,), (csv,) = blocks("toml"), blocks("csv")
    scene = Scene.from_toml(toml)
    assert scene.lamp.hwhm_deg == 3.81 and scene.detector.planes_m == (4.5, 6.5, 8.5)
    file = tmp_path / "readings.csv"
    file.write_text(csv, encoding="utf-8")
    readings = read_table(file)
    assert readings.value.tolist() == [1.0] and readings.budget.position_mm == 1.0


def test_files_and_names_that_the_recipes_give_exist():
    """A recipe that names what has moved leads astray."""
    text = (ROOT / "docs" / "how_to_add.md").read_text(encoding="utf-8")
    files = set(re.findall(r"`((?:lightfield|tests|benchmarks|docs)/[\w./]+?)`", text)) - {
        "lightfield/commands/NAME.py"
    }
    assert len(files) > 30
    source = {file: (ROOT / file).read_text(encoding="utf-8") for file in files if (ROOT / file).is_file()}
    assert [file for file in files if not (ROOT / file).exists()] == []
    for name in set(re.findall(r"`([A-Z]{3,}|\w+\.intensity)`", text)):
        assert any(re.search(rf"\b{name.split('.')[-1]}\b", code) for code in source.values()), name


def test_every_option_file_and_variable_that_is_named_exists():
    for page in {*PAGES, *(ROOT / "docs").glob("*.md")}:
        for path in re.findall(r"\]\((?!http|#)([^)#]+)[^)]*\)", page.read_text(encoding="utf-8")):
            assert (page.parent / path).exists(), f"{page.name}: {path}"
    for path in re.findall(r"`((?:lightfield|benchmarks|tools|scenes)/[\w./]+)`", README):
        assert (ROOT / path).exists(), path
    source = "".join(file.read_text(encoding="utf-8") for file in (ROOT / "lightfield").rglob("*.py"))
    for variable in set(re.findall(r"LIGHTFIELD_\w+", README)):
        assert f'"{variable}"' in source, variable
    for command in SUB_COMMANDS:
        assert re.search(rf"(`|lightfield ){command}\b", README), command
