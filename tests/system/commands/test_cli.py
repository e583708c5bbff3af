"""The command line as a user meets it: processes, exit codes, single lines."""

from __future__ import annotations

import importlib.util
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from command_line import ROOT, lightfield

from lightfield import __version__, cli
from lightfield.commands import doctor
from lightfield.commands.shared.line import COMMANDS
from lightfield.errors import SceneError


def test_version():
    done = lightfield("--version")
    assert (done.returncode, done.stdout) == (0, f"lightfield {__version__}\n")


def test_help_lists_the_commands_that_exist_and_no_other():
    done = lightfield("--help")
    listed = {line.split()[0] for line in done.stdout.splitlines() if line.startswith("    ")}
    folder = ROOT / "lightfield" / "commands"
    existing = {
        name for name in COMMANDS if list(folder.glob(f"{name}.py")) + list(folder.glob(f"{name}_.py"))
    }
    assert done.returncode == 0
    assert existing >= {"scene", "doctor", "demo"}
    assert listed & set(COMMANDS) == existing


def test_every_command_module_is_in_the_table():
    folder = ROOT / "lightfield" / "commands"
    modules = {path.stem.rstrip("_") for path in folder.glob("*.py") if not path.stem.startswith("_")}
    assert modules <= set(COMMANDS)


@pytest.mark.parametrize("command", list(COMMANDS))
def test_every_command_explains_itself(command, capsys):
    with pytest.raises(SystemExit) as ended:
        cli.main([command, "--help"])
    assert ended.value.code == 0
    text = capsys.readouterr().out
    assert f"usage: lightfield {command}" in text
    assert "--backend" in text


@pytest.mark.parametrize(
    ("line", "needed"),
    [
        (["--help"], set()),
        (["scene", str(ROOT / "scenes" / "dive_lamp" / "scene.toml")], {"numpy", "pydantic"}),
        (["new", "--help"], {"numpy", "pydantic"}),
    ],
)
def test_quick_commands_load_no_more_than_they_need(line, needed):
    heavy = {"numpy", "pydantic", "scipy", "pandas", "xarray", "matplotlib", "skimage", "mitsuba", "drjit"}
    heavy |= {"dask", "distributed", "zarr", "netCDF4", "OpenEXR", "tornado", "jinja2", "rich"}
    code = (
        "import sys\n"
        "from lightfield import cli\n"
        f"try:\n    cli.main({line})\nexcept SystemExit:\n    pass\n"
        f"found = ({heavy!r} & set(sys.modules)) ^ {needed!r}\n"
        "sys.exit(str(found) if found else 0)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["nonsense"], "choose from"),
        (["--nonsense"], "--nonsense"),
        (["doctor", "--nonsense"], "--nonsense"),
        (["doctor", "surplus"], "surplus"),
        (["--backend", "metal", "doctor"], "metal"),
        (["doctor", "--backend"], "expected one argument"),
        (["doctor", "--threads", "many"], "many"),
        (["doctor", "--threads", "0"], "--threads: found '0'; rule: a whole number, 1 to 1024"),
        (["doctor", "--back", "llvm"], "--back"),  # an abbreviation would break with the next option
        (["scene"], "no scene file"),
        (["scene", "/nonexistent/scene.toml"], "/nonexistent/scene.toml"),
        (["scene", "/nonexistent/scene.toml", "--get", "a", "--to-toml"], "not allowed with"),
        (["demo", "--scenes", "/nonexistent"], "--scenes"),
    ],
)
def test_wrong_command_lines_give_one_line_and_exit_code_2(arguments, text, capsys):
    assert cli.main(arguments) == 2
    error = capsys.readouterr().err
    assert len(error.splitlines()) == 1, error
    assert error.startswith("lightfield: ")
    assert text in error


def test_unknown_command_lists_the_choices():
    done = lightfield("nonsense")
    assert done.returncode == 2
    assert done.stderr.startswith("lightfield: ") and len(done.stderr.splitlines()) == 1
    assert all(name in done.stderr for name in COMMANDS)


def test_no_command_prints_the_help():
    done = lightfield()
    assert done.returncode == 0
    assert "COMMAND" in done.stdout


@pytest.mark.parametrize(
    ("error", "code", "text"),
    [
        (
            SceneError("not a number", where="a.toml: lamp.hwhm_deg", found="x"),
            2,
            "a.toml: lamp.hwhm_deg: not a number",
        ),
        (FileNotFoundError(2, "No such file or directory", "a.csv"), 2, "a.csv: No such file"),
        (OSError(28, "No space left on device"), 2, "No space left on device"),
        (MemoryError(), 2, "out of memory"),
        (KeyboardInterrupt(), 130, "interrupted"),
        (ZeroDivisionError("division by zero"), 1, "ZeroDivisionError: division by zero"),
    ],
)
def test_what_a_command_raises_becomes_one_line(monkeypatch, capsys, error, code, text):
    def run(args):
        raise error

    monkeypatch.setattr(doctor, "run", run)
    assert cli.main(["doctor"]) == code
    message = capsys.readouterr().err
    assert len(message.splitlines()) == 1
    assert text in message
    assert "Traceback" not in message


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_error_that_a_module_makes_of_a_stop_is_the_stop(monkeypatch, capsys, number, code):
    """Modules in C++ turn the exception of a signal into an ImportError or a SystemError."""

    def run(args):
        try:
            os.kill(os.getpid(), number)
        except BaseException as stop:
            raise ImportError("initialization failed") from stop

    monkeypatch.setattr(doctor, "run", run)
    assert cli.main(["doctor"]) == code
    assert capsys.readouterr().err.count("\n") == 1


def test_a_traceback_can_be_had(monkeypatch):
    def run(args):
        raise SceneError("wrong")

    monkeypatch.setattr(doctor, "run", run)
    monkeypatch.setenv("LIGHTFIELD_TRACEBACK", "1")
    with pytest.raises(SceneError):
        cli.main(["doctor"])


@pytest.mark.parametrize(
    "arguments", [["--backend", "llvm", "--threads", "1", "doctor"], ["doctor", "--threads", "1"]]
)
def test_general_options_stand_on_either_side_and_reach_child_processes(monkeypatch, arguments):
    seen = {}
    monkeypatch.setenv("LIGHTFIELD_BACKEND", "auto")
    monkeypatch.setenv("LIGHTFIELD_THREADS", "7")
    monkeypatch.setattr(doctor, "run", lambda args: seen.update(os.environ) or 0)
    assert cli.main(arguments) == 0
    assert seen["LIGHTFIELD_THREADS"] == "1"
    assert seen["LIGHTFIELD_BACKEND"] == ("llvm" if "--backend" in arguments else "auto")


LONG_WRITE = """
import sys, time
from lightfield import cli
from lightfield.commands import doctor
from lightfield.storage.files import atomic_path
def run(args):
    with atomic_path(sys.argv[1] + "/result.nc") as path:
        path.write_bytes(bytes(1000))
        print("writing", flush=True)
        time.sleep(60)
        path.write_bytes(bytes(2000))
doctor.run = run
sys.exit(cli.main(["doctor"]))
"""


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupted_write_leaves_nothing_behind(tmp_path, number, code):
    child = subprocess.Popen(
        [sys.executable, "-c", LONG_WRITE, str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert child.stdout.readline() == "writing\n"
    start = time.monotonic()
    child.send_signal(number)
    _, message = child.communicate(timeout=30)
    assert child.returncode == code
    assert len(message.splitlines()) == 1, message
    assert time.monotonic() - start < 30
    assert list(tmp_path.iterdir()) == []


def test_a_reader_that_leaves_early_is_no_error():
    child = subprocess.Popen(
        [sys.executable, "-m", "lightfield.cli", "scene", "--schema"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    )
    child.stdout.close()
    message = child.stderr.read()
    assert child.wait(60) == 0
    assert message == ""


def test_the_program_is_installed():
    assert importlib.util.find_spec("lightfield") is not None
    program = Path(sys.executable).with_name("lightfield")
    if not program.exists():
        pytest.skip("the package is not installed in this environment")
    done = subprocess.run([program, "--version"], capture_output=True, text=True, timeout=60, check=False)
    assert done.stdout == f"lightfield {__version__}\n"
