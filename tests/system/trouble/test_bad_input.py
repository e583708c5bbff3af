"""Wrong files, options and places: each gives one line that says what, where and what to do, and exit code 2.

The table calls the program in this process; what depends on the process (environment, rights, disks) runs it
for real. No case may trace: all of this is found before any work.
"""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest
from wrong_inputs import FILES, WRONG

from lightfield import cli
from lightfield.commands.shared.line import COMMANDS


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wrong")
    (folder / "folder").mkdir()
    for name, content in FILES.items():
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder


@pytest.fixture
def no_trace(monkeypatch: pytest.MonkeyPatch) -> None:
    """A wrong input that is found only after light was traced is found too late."""

    def started() -> None:
        pytest.fail("the backend was started")

    monkeypatch.setattr("lightfield.render.backend.choice._start", lambda backend: started())
    monkeypatch.setattr("lightfield.render.backend.choice._active", None)


def one_clear_line(message: str, words: list[str]) -> None:
    assert len(message.splitlines()) == 1, message
    assert message.startswith("lightfield: ") and "Traceback" not in message
    assert "defect of the program" not in message
    assert "remedy: " in message or "rule: " in message, message
    for word in words:
        assert word in message


@pytest.mark.parametrize(("line", "words"), WRONG, ids=[line for line, _ in WRONG])
def test_one_line_and_exit_code_2(made, no_trace, monkeypatch, capsys, line, words):
    monkeypatch.chdir(made)
    before = sorted(path for path in made.rglob("*") if path.is_file())
    assert cli.main(shlex.split(line)) == 2
    captured = capsys.readouterr()
    one_clear_line(captured.err, words)
    assert captured.out == ""
    assert sorted(path for path in made.rglob("*") if path.is_file()) == before, "a wrong input left a file"


def test_every_command_has_its_wrong_inputs():
    """The table above covers the whole program."""
    assert {line.split()[0] for line, _ in WRONG} >= set(COMMANDS)
    assert len({line for line, _ in WRONG}) == len(WRONG)
