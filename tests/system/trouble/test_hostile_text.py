"""Text from files and from the command line that means harm: it is bounded, and it never commands the
terminal.

Rationale: scenes and readings come from other people. A name can hold an escape sequence that clears the
screen or answers a question in the user's place, a file can be endless or deeper than any parser bears, a
list of problems can be longer than anybody reads. Expected: printable text, one error, exit code 2.
"""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path

import pytest

from lightfield import cli
from lightfield.commands.shared.console import console
from lightfield.commands.shared.terminal import printable

ROOT = Path(__file__).resolve().parents[3]
CLEAR = "\x1b[2J\x1b]0;owned\x07\x9b31m\u202e"
SCENE = "[water]\nabsorption_per_m = 0.1\n"
NINES = "9" * 5000


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(SCENE)
    return tmp_path


def harmless(text: str) -> bool:
    return not any((ord(sign) < 32 and sign not in "\n\t") or 127 <= ord(sign) < 160 for sign in text)


IMPORT = "--quantity irradiance --units counts --band 500:550 -o o.csv"
COMPARE = "compare data.csv --scene scene.toml"
NAMED = {
    "a scene's name": ("scene.toml", 'name = "NAME"\n' + SCENE, "scene scene.toml"),
    "a scene's value": ("scene.toml", SCENE + '[lamp]\nprofile = "NAME"\n', "scene scene.toml"),
    "a key": ("scene.toml", SCENE + '"NAME" = 1\n', "scene scene.toml"),
    "a column": ("data.csv", "x_m,NAME\n1,2\n", COMPARE),
    "a cell": ("data.csv", "z_m,value\n1,NAME\n", COMPARE),
    "an entry of the head": ("data.csv", '# units = "NAME"\n# q = \nz_m,value\n1,2\n', COMPARE),
    "a file's name": ("index.csv", "file,z_m\nNAME.txt,4.5\n", f"import index.csv {IMPORT}"),
    "a path of a plan": (
        "plan.toml",
        '[[vary]]\npath = "NAME"\nvalues = [1]\n',
        "sweep scene.toml --plan plan.toml --dry-run",
    ),
}


@pytest.mark.parametrize("escaped", [False, True], ids=["raw", "escaped"])
@pytest.mark.parametrize("case", NAMED)
def test_nothing_that_a_terminal_obeys_is_printed(case, escaped, place, capsys):
    file, text, command = NAMED[case]
    name = "".join(f"\\u{ord(sign):04x}" for sign in CLEAR) if escaped and file.endswith("toml") else CLEAR
    (place / file).write_text(text.replace("NAME", name), encoding="utf-8")
    assert cli.main(command.split()) in (0, 2)
    printed = capsys.readouterr()
    assert printed.out + printed.err
    assert harmless(printed.out) and harmless(printed.err) and "\u202e" not in printed.out + printed.err


def test_a_hostile_name_is_still_told(place, capsys):
    (place / "scene.toml").write_text(f'name = "red \\u001b[31m σ"\n{SCENE}')
    assert cli.main(["scene", "scene.toml"]) == 0
    assert capsys.readouterr().out.startswith("red \\x1b[31m σ: valid")


def test_tables_and_progress_hold_printable_text_in_our_own_colours(monkeypatch):
    """rich writes escape sequences of its own, for colours; what is in the text is written out."""
    screen = io.StringIO()
    monkeypatch.setattr(sys, "stdout", screen)
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    console().print(f"a {CLEAR} name with [bold]brackets[/]", style="red", highlight=False)
    text = screen.getvalue()
    assert text.startswith("\x1b[31m") and text.rstrip().endswith("\x1b[0m")
    inner = text.removeprefix("\x1b[31m").rstrip().removesuffix("\x1b[0m")
    assert printable(inner) == inner and "\\x1b[2J" in inner and "[bold]brackets[/]" in inner


def test_a_terminal_of_another_encoding_gets_what_it_can_show(place):
    (place / "scene.toml").write_text(f'name = "Σ tank"\n{SCENE}', encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "lightfield.cli", "scene", "scene.toml"],
        env={**os.environ, "PYTHONIOENCODING": "latin-1", "PYTHONPATH": str(ROOT)},
        capture_output=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(b"\\u03a3 tank: valid")


WRONG = {
    "an option that is two dashes": "scene scene.toml --set=--",
    "another": "sweep scene.toml --vary=-- --dry-run",
    "a third": "render scene.toml --seed=--",
    "5,000 digits": f"scene scene.toml --set water.absorption_per_m={NINES}",
    "5,000 hexadecimal digits": f"scene scene.toml --set water.absorption_per_m=0x{'f' * 5000}",
    "5,000 digits in a range": f"sweep scene.toml --vary water.absorption_per_m={NINES},0 --dry-run",
    "5,000 digits of a count": f"sweep scene.toml --vary water.absorption_per_m=0:1:{NINES} --dry-run",
    "5,000 digits of a seed": f"render scene.toml --seed {NINES}",
    "a deep value": f"scene scene.toml --set water.phase={'[' * 3000}",
    "a deep path": f"scene scene.toml --get {'.'.join('a' * 3000)}",
    "a deep key": "scene deep.toml",
    "deep lists": "scene nested.toml",
    "a deep key in a plan": "sweep scene.toml --plan deep.toml --dry-run",
    "a deep key in the head of a table": "compare deep.csv --scene scene.toml",
    "an endless file": "scene /dev/zero",
    "endless readings": "compare /dev/zero --scene scene.toml",
    "an endless index": f"import /dev/zero {IMPORT}",
    "endless maps": "export /dev/zero --exr out",
}


@pytest.mark.parametrize("case", WRONG)
def test_it_is_one_short_error(case, place, capsys):
    deep = ".".join("x" * 10_000)
    (place / "deep.toml").write_text(f"{deep} = 1\n")
    (place / "nested.toml").write_text(f"x = {'[' * 10_000}\n")
    (place / "deep.csv").write_text(f"# {deep} = 1\nz_m,value\n1,1\n")
    assert cli.main(WRONG[case].split()) == 2
    message = capsys.readouterr().err
    assert message.startswith("lightfield: ") and message.count("\n") == 1
    assert len(message) < 3000


ROWS = range(500)
MANY = {
    "keys of a scene": (
        "scene.toml",
        "".join(f"k{n} = 1\n" for n in ROWS),
        "scene scene.toml",
        "and 490 more",
    ),
    "places of one problem": (
        "data.csv",
        "z_m,value\n" + "".join(f"{n + 1},{'x' if n % 2 else 1}\n" for n in ROWS),
        COMPARE,
        "and 240 more",
    ),
    "kinds of problems of a table": (
        "data.csv",
        "z_m,value\n" + "".join(f"4.5,1{',1' * (n % 40 + 1)}\n" for n in ROWS),
        COMPARE,
        "and 30 more",
    ),
    "lines of a beam table": (
        "beam.csv",
        "angle_deg,intensity\n" + "".join(f"{n},x\n" for n in ROWS),
        "scene scene.toml --set lamp.intensity_table=beam.csv --set lamp.profile=table",
        "and 490 more",
    ),
}


@pytest.mark.parametrize("case", MANY)
def test_of_many_problems_the_first_ten_and_a_count(case, place, capsys):
    file, text, command, count = MANY[case]
    (place / file).write_text(text)
    assert cli.main(command.split()) == 2
    message = capsys.readouterr().err
    assert count in message
    assert message.count("\n") <= 12 and len(message) < 5000
