"""What is released: the number, the source distribution, the wheel, and an installation from it.

Rationale: whoever installs the package has no repository beside it. Expected: the wheel brings the example
experiments, its page on an index names nothing that is not there, `doctor` and `demo` run in an environment
that holds the wheel and its dependencies alone.
"""

from __future__ import annotations

import email
import os
import re
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

import lightfield
from lightfield.storage import toml

ROOT = Path(__file__).resolve().parents[2]
NAME = "lightfield_underwater"


def run(*words: object, **options: object) -> str:
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True, check=False, **options)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return done.stdout


def test_the_number_of_the_version_is_the_same_everywhere():
    major, minor, patch = lightfield.__version__.split(".")  # semantic
    assert major.isdecimal() and minor.isdecimal() and patch.isdecimal()
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.search(r"^version: (.+)$", citation, re.MULTILINE)[1] == lightfield.__version__
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(r"^## (\S+?),? ", changes, re.MULTILINE)[1].rstrip(",") == lightfield.__version__
    project = toml.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["name"].replace("-", "_") == NAME


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the source distribution, and the wheel that is built from it."""
    folder = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "build", "--no-isolation", "--outdir", folder, ROOT)
    return folder


@pytest.mark.slow
def test_the_source_distribution_is_the_repository(built):
    with tarfile.open(next(built.glob("*.tar.gz"))) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    tracked = set(run("git", "ls-files", cwd=ROOT).splitlines())
    assert tracked <= names, sorted(tracked - names)


@pytest.mark.slow
def test_the_wheel_brings_the_experiments_and_no_tests(built):
    with zipfile.ZipFile(next(built.glob("*.whl"))) as archive:
        names = set(archive.namelist())
        for file in (file for file in (ROOT / "scenes").rglob("*") if file.is_file()):
            inside = f"lightfield/scenes/{file.relative_to(ROOT / 'scenes').as_posix()}"
            assert archive.read(inside) == file.read_bytes(), inside
    assert {name.split("/")[0] for name in names} == {
        "lightfield", f"{NAME}-{lightfield.__version__}.dist-info"
    }  # fmt: skip


@pytest.mark.slow
def test_the_page_on_an_index_names_nothing_that_is_not_there(built):
    run(sys.executable, "-m", "twine", "check", "--strict", *built.iterdir())
    with zipfile.ZipFile(next(built.glob("*.whl"))) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        text = email.message_from_bytes(archive.read(name)).get_payload(decode=True).decode()
    assert text.startswith("# lightfield") and len(text) > 1000
    assert "![" not in text
    assert not re.search(r"\]\((?!https?://|#)", text)


@pytest.mark.slow
def test_doctor_and_demo_run_from_the_wheel_alone(built, tmp_path):
    """With all its dependencies, into a clean environment, far from the repository."""
    venv.create(tmp_path / "venv", with_pip=True)
    bin = tmp_path / "venv" / "bin"
    # Without the path of the tests, where pip would find the package in place already.
    clean = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    options = {"cwd": tmp_path, "env": clean}
    run(bin / "python", "-m", "pip", "install", "--quiet", next(built.glob("*.whl")), **options)
    run(bin / "python", "-m", "pip", "check", **options)
    where = run(bin / "python", "-c", "import lightfield as lf; print(lf.__file__)", **options)
    assert Path(where.strip()).is_relative_to(tmp_path / "venv")
    assert "PASS" in run(bin / "lightfield", "doctor", **options)
    printed = run(bin / "lightfield", "demo", "-o", "report", **options)
    reports = [line.removeprefix("report: ") for line in printed.splitlines()[-3:]]
    assert all(Path(report).is_file() for report in reports) and len(set(reports)) == 3
