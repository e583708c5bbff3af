"""Wrong environment, rights and full disks: one clear line, exit code 2, and nothing half written."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import in_process

ROOT = Path(__file__).resolve().parents[3]
TANK = '[water]\nabsorption_per_m = 0.1\n[tank]\nsurface = "none"\n'


#: What is found wrong with each of them is in `unit/render`: here one that is read early, and one late.
SLOW = pytest.mark.slow


@pytest.fixture
def made(tmp_path: Path) -> Path:
    (tmp_path / "scene.toml").write_text(TANK)
    return tmp_path


def one_clear_line(message: str, words: list[str]) -> None:
    assert message.startswith("lightfield: ") and message.count("\n") == 1
    assert all(word in message for word in words), message


def program(folder: Path, *arguments: str, **settings) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "lightfield.cli", *arguments]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **settings.pop("env", {})}
    settings = {"capture_output": True, "text": True, "timeout": 120, "check": False, **settings}
    return subprocess.run(command, cwd=folder, env=environment, **settings)


@pytest.mark.parametrize(
    ("variable", "value", "words"),
    [
        ("LIGHTFIELD_THREADS", "0", ["LIGHTFIELD_THREADS", "1 to 1024"]),
        pytest.param("LIGHTFIELD_BACKEND", "metal", ["LIGHTFIELD_BACKEND", "auto, llvm, cuda"], marks=SLOW),
        pytest.param(
            "LIGHTFIELD_LIBLLVM", "/no/libLLVM.so", ["LIGHTFIELD_LIBLLVM", "does not exist"], marks=SLOW
        ),
        ("LIGHTFIELD_CACHE", "/proc/nowhere", ["LIGHTFIELD_CACHE", "cannot be used"]),
    ],
)
def test_a_wrong_environment_is_named(made, tmp_path, variable, value, words):
    done = program(made, "render", "scene.toml", "-o", str(tmp_path / "out"), env={variable: value})
    assert done.returncode == 2
    one_clear_line(done.stderr, words)
    assert not (tmp_path / "out").exists()


def test_rights_are_respected(made, tmp_path):
    """A file that may not be read, a folder that may not be written."""
    if os.geteuid() == 0:
        pytest.skip("root may read and write everything")
    secret, locked = tmp_path / "secret.toml", tmp_path / "locked"
    secret.write_text(TANK)
    secret.chmod(0)
    locked.mkdir(mode=0o500)
    done = program(made, "render", str(secret))
    assert done.returncode == 2
    one_clear_line(done.stderr, [str(secret), "Permission denied"])
    done = program(made, "render", "scene.toml", "-o", str(locked / "out"))
    assert done.returncode == 2
    one_clear_line(done.stderr, [str(locked), "Permission denied"])


@pytest.mark.parametrize("limit", [pytest.param(200, marks=pytest.mark.slow), 20_000])
def test_a_disk_that_fills_up_leaves_nothing_half_written(made, tmp_path, monkeypatch, limit):
    """A limit on the size of files, met at the first bytes and in the middle, stands in for the full disk."""
    arguments = ("render", "scene.toml", "-o", str(tmp_path / "out"), "--max-photons", "1e4", "--no-figures")
    cache = {"LIGHTFIELD_CACHE": str(tmp_path / "cache")}
    # Python would leave its own compiled modules cut short as well, and without a word.
    limited = cache | {"PYTHONDONTWRITEBYTECODE": "1"}
    full = program(made, *arguments, env=limited, preexec_fn=lambda: _limit_files(limit))
    assert full.returncode == 2, full.stderr
    last = full.stderr.splitlines()[-1]
    assert last.startswith("lightfield: ") and "cannot write" in last and "remedy: make room" in last
    assert not (tmp_path / "out").exists()
    monkeypatch.chdir(made)
    monkeypatch.setenv("LIGHTFIELD_CACHE", cache["LIGHTFIELD_CACHE"])
    assert in_process(*arguments).returncode == 0


def _limit_files(size: int) -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
