"""The tutorial of the first hour, word for word: its commands in their order, on the files that they leave.

Traces and searches are cut short; the table is filled in as a person would, before the diagnosis.
"""

from __future__ import annotations

import csv
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from lightfield import cli
from lightfield.commands.shared.line import prepared
from lightfield.formula.closed_form import direct_field
from lightfield.readings import read_table
from lightfield.scene import Scene

PAGE = Path(__file__).resolve().parents[2] / "docs" / "first_hour.md"
SHORT = {
    "picture": "--samples 2 --size 64x36",
    "compare": "--max-photons 2e4",
    "plan": "--no-trace",
    "hide": "--max-photons 1e3",
    "diagnose": "--no-trace --effects background,beam_offset",
}


def blocks(language: str) -> list[str]:
    text = PAGE.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def filled_in(table: Path, scene: Scene) -> int:
    """Values of the formula for every empty cell of the table; how many there were."""
    lines = table.read_text(encoding="utf-8").splitlines()
    head = [line for line in lines if line.startswith("#")]
    rows = list(csv.DictReader(lines[len(head) :]))
    for k, row in enumerate(rows):
        at = [np.array([float(row[name])]) for name in ("x_m", "y_m", "z_m")]
        light = direct_field(scene, *at, 525.0)[0]
        row.update(
            value=f"{light * (1 + 0.004 * (-1) ** k):.5g}", stderr=f"{0.004 * light:.3g}", time_s=str(20 * k)
        )
    body = [",".join(rows[0]), *(",".join(row.values()) for row in rows)]
    table.write_text("\n".join([*head, *body]) + "\n", encoding="utf-8")
    return len(rows)


def commands() -> list[list[str]]:
    lines = [line for block in blocks("sh") for line in block.splitlines() if line.strip()]
    assert len(lines) > 8 and all(line.startswith("lightfield ") for line in lines)
    return [shlex.split(line, comments=True)[1:] for line in lines]


def run(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    readings = Path("my_tank/readings.csv")
    if words[0] in ("diagnose", "compare") and str(readings) in words and ",,," in readings.read_text():
        assert filled_in(readings, Scene.load("my_tank/scene.toml")) > 50
    fits = words[0] == "compare" and words[1].endswith(".csv")  # traces nothing that could be cut short
    more = [] if fits else SHORT.get(words[0], "").split()
    assert cli.main([*words, *more]) == 0, (words, capsys.readouterr().err)
    for option in ("-o", "--report"):
        if option in words:
            assert Path(words[words.index(option) + 1]).exists(), words


def test_it_begins_as_written_and_no_command_lacks_an_option(tmp_path, monkeypatch, capsys):
    """The first command of the first page that a newcomer reads must not fail."""
    monkeypatch.chdir(tmp_path)
    for words in commands():
        prepared(words)  # refuses what is missing or unknown
        if words[0] in ("new", "plan"):
            run(words, capsys)
    assert Scene.load("basin/scene.toml").detector.planes_m == (3.0, 4.0, 5.0, 6.0, 7.0)


@pytest.mark.slow
def test_every_command_runs_as_written(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for words in commands():
        run(words, capsys)


def test_the_scene_and_the_table_of_the_tutorial_are_whole(tmp_path):
    (toml,), (table,) = blocks("toml"), blocks("csv")
    scene = Scene.from_toml(toml)
    file = tmp_path / "readings.csv"
    file.write_text(table, encoding="utf-8")
    assert scene.tank is not None and len(read_table(file, scene)) == 2
