"""`lightfield demo`, shortened: fewer photons for the tow tank, a quarter of the cells of its maps, no traces
and one effect for the stories.

Figures are made, but not drawn into the pages or beside them, which would take half of the time: the commands
of the README and the tests of each page do that.

Rationale: it is the first thing that a new user runs. Expected: exit code 0, one self-contained page per
experiment, and their paths as the last lines.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from lightfield.cli import main
from lightfield.commands import demo
from lightfield.commands.shared.line import prepared

SCENES = Path(__file__).resolve().parents[2] / "scenes"
SHORTER = dict.fromkeys(("render", "compare"), " --max-photons 1e5")
SHORTER |= {"diagnose": " --no-trace --effects background", "follow": " --no-trace --duration 2"}
SHORTER |= dict.fromkeys(("attenuation", "range"), " --no-trace")


@pytest.mark.parametrize(
    "names",
    [("leader_follower",), pytest.param(tuple(demo.EXPERIMENTS), marks=pytest.mark.slow)],
    ids=["one", "all"],
)
def test_demo_ends_by_naming_its_reports(names, tmp_path, monkeypatch, capsys):
    def shorter(line: str) -> str:
        fits = line.startswith("compare") and "data.csv" in line
        return line if fits else line + SHORTER[line.split()[0]]

    scenes = tmp_path / "scenes"
    shutil.copytree(SCENES, scenes)
    tank = scenes / "unh_tow_tank" / "scene.toml"
    whole = tank.read_text(encoding="utf-8")
    assert "pixels = 65" in whole
    tank.write_text(whole.replace("pixels = 65", "pixels = 33"), encoding="utf-8")
    short = {
        name: tuple(shorter(line) for line in lines)
        for name, lines in demo.EXPERIMENTS.items()
        if name in names
    }
    monkeypatch.setattr(demo, "EXPERIMENTS", short)
    monkeypatch.setattr("lightfield.report.page.to_svg", lambda drawing, name: f"<svg>{name}</svg>")
    monkeypatch.setattr("lightfield.report.compare.page.save_png", lambda drawing, path: path)
    assert main(["demo", "--scenes", str(scenes), "-o", str(tmp_path / "my demo")]) == 0
    printed = capsys.readouterr().out
    reports = [tmp_path / "my demo" / name / "index.html" for name in short]
    assert printed.splitlines()[-len(reports) :] == [f"report: {report}" for report in reports]
    for report in reports:
        page = report.read_text(encoding="utf-8")
        assert "<svg>" in page and "</html>" in page
        assert "<script src" not in page and "http-equiv" not in page
    lines = [line for lines in short.values() for line in lines]
    assert re.findall(r"^\$ lightfield (\w+)", printed, re.MULTILINE) == [line.split()[0] for line in lines]


def test_every_line_of_the_demo_is_understood():
    """The other experiments run in the slow tier: here their options are read."""
    for name, lines in demo.EXPERIMENTS.items():
        for line in lines:
            words = line.format(scene=SCENES / name, out="out").split()
            assert callable(prepared(words)), line


def test_the_storys_page_does_not_give_the_answer_away():
    page = (SCENES / "hidden_effect" / "README.md").read_text(encoding="utf-8").lower()
    hidden = (SCENES / "hidden_effect" / "truth.json").read_text(encoding="utf-8")
    assert '"scattering"' in hidden
    for name in ("scattering", "scattered"):
        assert name not in page


@pytest.mark.parametrize(
    ("name", "line"), [(name, line) for name, lines in demo.EXPERIMENTS.items() for line in lines]
)
def test_files_of_the_demo_are_there(name, line):
    for word in line.split():
        if word.startswith("{scene}/"):
            assert (SCENES / name / word[8:]).is_file()
