"""`lightfield new tank` and `lightfield completion` as a user meets them, and what `hide` replaces."""

from __future__ import annotations

import io
import os
import shutil
import subprocess
from functools import partial
from pathlib import Path

import pytest

from lightfield.cli import main
from lightfield.commands.shared import progress
from lightfield.scene import Scene


def test_options_make_a_tank_and_what_was_assumed_is_said(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["new", "tank", "--tank", "1.2x0.8x3", "--lamp", "led-blue", "-o", "pool"]) == 0
    printed = capsys.readouterr().out
    assert "beam 10" in printed and "lightfield diagnose pool/readings.csv" in printed
    assert "tank 2x1x6" not in printed and "1.2 m wide, 0.8 m deep, 3 m along the beam\n" in printed
    scene = Scene.load("pool/scene.toml")
    assert scene.name == "pool" and scene.tank.width_m == 1.2 and scene.lamp.spectrum == "led-blue"
    assert main(["plan", "pool/layout.csv", "--scene", "pool/scene.toml", "--no-trace"]) == 0
    assert main(["new", "tank", "-o", "pool"]) == 2
    assert "choose another folder" in capsys.readouterr().err


def test_sizes_in_another_order_are_seen_at_once(tmp_path, capsys):
    """Length x width x depth makes a tank too, and a useless one: it is told, not refused."""
    assert main(["new", "tank", "--tank", "3x1.2x0.8", "-o", str(tmp_path / "pool")]) == 0
    assert (
        "0.8 m along the beam; the beam goes across the tank: if it does not, begin anew"
        in capsys.readouterr().out
    )


def test_a_band_may_be_given_again(tmp_path):
    """The last one alone was taken."""
    bands = ["--band", "440:460", "--band", "520:560,600:620"]
    assert main(["new", "tank", *bands, "-o", str(tmp_path / "pool")]) == 0
    scene = Scene.load(tmp_path / "pool" / "scene.toml")
    assert scene.detector.bands_nm == ((440, 460), (520, 560), (600, 620))


def test_work_that_takes_long_says_so(tmp_path, monkeypatch, capsys):
    """Minutes of silence look like a program that hangs: a line now and then, apart from the answer."""
    often = partial(progress.status_lines, every_s=1e-3)
    monkeypatch.setattr(progress, "status_lines", often)
    assert main(["new", "tank", "--points", "3", "-o", str(tmp_path / "pool")]) == 0
    layout, scene = str(tmp_path / "pool" / "layout.csv"), str(tmp_path / "pool" / "scene.toml")
    assert main(["plan", layout, "--scene", scene, "--no-trace"]) == 0
    printed = capsys.readouterr()
    assert "plan: " in printed.err and " s so far" in printed.err and "so far" not in printed.out


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_on_a_terminal_it_asks_and_asks_again(tmp_path, monkeypatch, capsys):
    """Answers one by one; an empty line takes the default, a wrong answer is asked for once more."""
    answers = ["a lot", "1x1x4", "", "0.5", "sides", "", "led-cyan", "", "", "", "", "", "", "5"]
    monkeypatch.setattr("sys.stdin", Terminal("\n".join(answers) + "\n"))
    assert main(["new", "tank", "-o", str(tmp_path / "mine")]) == 0
    printed = capsys.readouterr().out
    assert printed.count("Width, depth and length") == 2 and "not understood" in printed
    scene = Scene.load(tmp_path / "mine" / "scene.toml")
    assert scene.tank.length_m == 4 and scene.tank.wall_albedo == 0.5 and scene.tank.panes == "sides"
    assert scene.lamp.spectrum == "led-cyan"


def test_a_terminal_that_closes_takes_the_defaults_of_the_rest(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("sys.stdin", Terminal("none\n"))
    assert main(["new", "tank", "-o", str(tmp_path / "sea")]) == 0
    assert Scene.load(tmp_path / "sea" / "scene.toml").tank is None
    assert "Lamp below" not in capsys.readouterr().out


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_the_completion_script_knows_commands_and_options(shell, capsys):
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    for word in ("diagnose", "--effects-file", "optimise", "--tilt-max", "--scene"):
        assert word in script


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash here")
def test_bash_completes_words(tmp_path, capsys):
    assert main(["completion", "bash"]) == 0
    script = tmp_path / "lightfield.bash"
    script.write_text(capsys.readouterr().out)
    asked = (
        f"source {script}; COMP_WORDS=(lightfield dia); COMP_CWORD=1; "
        "$(complete -p lightfield | sed 's/.*-F \\([^ ]*\\) .*/\\1/') ; echo ${COMPREPLY[@]}"
    )
    clean = {**os.environ, "COMP_WORDBREAKS": " "}
    done = subprocess.run(
        ["bash", "-c", asked], capture_output=True, text=True, env=clean, check=False, timeout=60
    )
    assert done.stdout.split() == ["diagnose"], done.stderr


def hidden(folder: Path, scene: Path) -> int:
    words = f"hide {scene} --effect background --max-photons 1e3 -o {folder}"
    return main(words.split())


def test_hide_says_what_it_replaces_and_leaves_own_readings_alone(tmp_path, capsys):
    scene = tmp_path / "scene.toml"
    scene.write_text("[detector]\npositions_m = [[0.0, 0.0, 1.0], [0.1, 0.0, 1.0], [0.0, 0.0, 1.5]]\n")
    assert hidden(tmp_path / "riddle", scene) == 0
    assert "replaced" not in capsys.readouterr().out
    assert hidden(tmp_path / "riddle", scene) == 0
    assert f"{tmp_path / 'riddle' / 'data.csv'}" in capsys.readouterr().out.partition("replaced")[2]
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "data.csv").write_text("z_m,value\n1,1\n")
    assert hidden(mine, scene) == 2
    assert "data.csv" in capsys.readouterr().err
    assert (mine / "data.csv").read_text() == "z_m,value\n1,1\n"
