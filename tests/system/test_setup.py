"""Set-up on machines that are made up: stand-ins for apt, sudo and id decide what the machine has."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from lightfield.render.backend import llvm
from lightfield.storage import toml

ROOT = Path(__file__).resolve().parents[2]
REAL_TOOLS = ("sh", "env", "sed", "cat", "printf", "uname", "ln", "echo", "true")


class Machine:
    """A machine with its own PATH, library folder and checkout (in a folder with a space in its name)."""

    def __init__(self, folder: Path) -> None:
        self.checkout, self.bin, self.libraries = folder / "my checkout", folder / "bin", folder / "lib"
        self.log = folder / "log"
        for place in (
            self.bin,
            self.libraries,
            self.checkout / ".venv/bin",
            self.checkout / "lightfield/render/backend",
        ):
            place.mkdir(parents=True)
        for tool in REAL_TOOLS:
            if found := shutil.which(tool):
                (self.bin / tool).symlink_to(found)
        shutil.copy(ROOT / "lightfield/render/backend/llvm.py", self.checkout / "lightfield/render/backend")
        self.script(self.checkout / ".venv/bin/python", f'exec "{sys.executable}" "$@"')
        self.user(root=False, sudo=False)

    def script(self, path: Path, body: str) -> None:
        path.write_text(f"#!/bin/sh\n{body}\n")
        path.chmod(0o755)

    def user(self, root: bool, sudo: bool) -> None:
        self.script(self.bin / "id", f"echo {0 if root else 1000}")
        self.script(self.bin / "sudo", '[ "$1" = -n ] && shift; exec "$@"' if sudo else "exit 1")

    def apt(self, offers: tuple[str, ...], installs: Path | None = None) -> None:
        """Offer these packages; installing one links `installs` into the library folder."""
        cases = " ".join(f"{name}) echo '  Candidate: 1:1.0' ;;" for name in offers)
        self.script(self.bin / "apt-cache", f"case $2 in {cases} *) echo '  Candidate: (none)' ;; esac")
        link = f"case \"$*\" in *install*) ln -s '{installs}' '{self.libraries}' ;; esac" if installs else ":"
        self.script(self.bin / "apt-get", f"echo apt-get \"$@\" >> '{self.log}'; {link}")

    def setup(self, step: str, **environment: str) -> subprocess.CompletedProcess[str]:
        plain = {
            "PATH": str(self.bin),
            "HOME": "/nonexistent",
            "LIGHTFIELD_LLVM_FOLDERS": str(self.libraries),
        }
        return subprocess.run(
            ["sh", ROOT / "tools/setup.sh", step],
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
            cwd=self.checkout,
            env={**plain, **environment},
        )

    def calls(self) -> list[str]:
        return self.log.read_text().splitlines() if self.log.exists() else []


@pytest.fixture
def machine(tmp_path):
    return Machine(tmp_path)


@pytest.fixture
def real_library() -> Path:
    return next(library.path for library in llvm.installed() if library.usable)


def test_a_library_that_is_there_is_used_as_it_is(machine, real_library):
    (machine.libraries / real_library.name).symlink_to(real_library)
    machine.user(root=True, sudo=False)
    machine.apt(("libllvm22",))
    done = machine.setup("llvm")
    assert done.returncode == 0, done.stderr
    assert str(machine.libraries / real_library.name) in done.stderr
    assert machine.calls() == []


@pytest.mark.parametrize(("root", "sudo"), [(True, False), (False, True)])
def test_the_browser_of_the_tests_is_installed_where_that_can_be_done(machine, root, sudo):
    machine.user(root, sudo)
    machine.apt(("chromium",))
    done = machine.setup("chromium")
    assert done.returncode == 0, done.stderr
    assert [call.split()[-1] for call in machine.calls()] == ["update", "chromium"]


def test_a_browser_that_is_there_is_used(machine):
    machine.user(root=True, sudo=False)
    machine.apt(("chromium",))
    machine.script(machine.bin / "chromium", ":")
    assert machine.setup("chromium").returncode == 0 and machine.calls() == []


@pytest.mark.parametrize("case", ["no rights", "not offered", "apt fails", "no apt"])
def test_set_up_goes_on_without_a_browser(machine, case):
    machine.user(root=case != "no rights", sudo=False)
    if case != "no apt":
        machine.apt(() if case == "not offered" else ("chromium",))
    if case == "apt fails":
        machine.script(machine.bin / "apt-get", "exit 100")
    done = machine.setup("chromium")
    assert done.returncode == 0
    assert done.stderr.splitlines()[-1].endswith("Run: sudo apt-get install chromium")


@pytest.mark.parametrize(("root", "sudo"), [(True, False), (False, True)])
def test_the_newest_that_apt_offers_is_installed(machine, real_library, root, sudo):
    machine.user(root, sudo)
    machine.apt(("libllvm15", "libllvm17t64", "libllvm18", "libllvm20"), installs=real_library)
    done = machine.setup("llvm")
    assert done.returncode == 0, done.stderr
    update, install = machine.calls()
    assert update.endswith("update")
    assert install.endswith("install --no-install-recommends libllvm20")


def test_ubuntu_renamed_its_package(machine, real_library):
    machine.user(root=True, sudo=False)
    machine.apt(("libllvm16t64", "libllvm17t64"), installs=real_library)
    assert machine.setup("llvm").returncode == 0
    assert machine.calls()[-1].endswith(" libllvm17t64")


def test_without_rights_it_stops_with_the_exact_command(machine):
    machine.apt(("libllvm15", "libllvm19"))
    done = machine.setup("llvm")
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].endswith("Run: sudo apt-get install libllvm19")
    assert machine.calls() == []


def test_old_libraries_do_not_count(machine):
    machine.apt(("libllvm19",))
    (machine.libraries / "libLLVM-15.so.1").write_bytes(_elf(b"libLLVM-15.so.1"))
    done = machine.setup("llvm")
    assert done.returncode == 1
    assert "is LLVM 15" in done.stderr
    assert "sudo apt-get install libllvm19" in done.stderr


@pytest.mark.parametrize("variable", llvm.EXPLICIT_VARIABLES)
def test_an_unusable_library_named_by_the_user_stops_it(machine, variable):
    machine.user(root=True, sudo=False)
    machine.apt(("libllvm19",))
    old = machine.checkout / "libLLVM-14.so.1"
    old.write_bytes(_elf(b"libLLVM-14.so.1"))
    done = machine.setup("llvm", **{variable: str(old)})
    assert done.returncode == 1
    assert f"{variable}: {old} is LLVM 14" in done.stderr
    assert machine.calls() == []


def test_apt_without_any_usable_version(machine):
    machine.user(root=True, sudo=False)
    machine.apt(("libllvm13", "libllvm14"))
    done = machine.setup("llvm")
    assert done.returncode == 1
    assert "https://apt.llvm.org" in done.stderr
    assert not any("install" in call for call in machine.calls())


def test_a_system_without_apt(machine):
    done = machine.setup("llvm")
    assert done.returncode == 1
    assert "LIGHTFIELD_LIBLLVM" in done.stderr or "brew install llvm" in done.stderr


def test_cuda_alone_needs_no_llvm(machine):
    assert machine.setup("llvm", LIGHTFIELD_BACKEND="cuda").returncode == 0


def test_an_old_python_is_named(machine):
    (machine.checkout / ".venv/bin/python").unlink()
    machine.script(machine.bin / "python3", '[ "$1" = --version ] && echo "Python 3.9.2"; exit 1')
    done = machine.setup("venv")
    assert done.returncode == 1
    assert "Python 3.10 or newer is needed; found Python 3.9.2" in done.stderr


def test_a_python_without_venv_names_its_package(machine):
    """Debian splits venv off; `python -c 'import ensurepip, venv'` fails there."""
    (machine.checkout / ".venv/bin/python").unlink()
    machine.apt(())
    machine.script(
        machine.bin / "python3", f'case "$2" in *ensurepip*) exit 1 ;; esac; exec "{sys.executable}" "$@"'
    )
    done = machine.setup("venv")
    package = f"python{sys.version_info.major}.{sys.version_info.minor}-venv"
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].endswith(f"sudo apt-get install {package}")


def installs(machine, python: str) -> tuple[list[str], str]:
    """What pip is asked for on a machine with this Python, and what is said."""
    machine.script(
        machine.checkout / ".venv/bin/python",
        f"case \"$*\" in *version_info*) echo {python} ;; *'-m pip'*) echo \"$@\" >> '{machine.log}' ;; esac",
    )
    machine.script(machine.bin / "python3", f'exec "{sys.executable}" "$@"')
    done = machine.setup("venv")
    assert done.returncode == 0, done.stderr
    return machine.calls(), done.stderr


def test_set_up_installs_what_the_lock_names_and_builds_with_it(machine):
    (dependencies, package), said = installs(machine, "3.12")
    assert dependencies.endswith("--require-hashes --only-binary :all: -r tools/lock.txt")
    assert "--no-deps --no-build-isolation" in package and package.endswith("-e .")
    assert "not made for" not in said


def test_a_python_beyond_the_lock_gets_the_ranges_and_a_word(machine):
    (everything,), said = installs(machine, "3.99")
    assert everything.endswith("-e .[dev,docs]") and "--require-hashes" not in everything
    assert "tools/lock.txt is not made for Python 3.99" in said


@pytest.mark.parametrize("python", ["3.10", "3.11", "3.12", "3.13", "3.14"])
def test_the_lock_pins_every_dependency_within_its_range(python):
    """One version of every package for every Python, with hashes, and from no registry in particular."""
    text = (ROOT / "tools/lock.txt").read_text(encoding="utf-8")
    assert "//" not in text
    pinned: dict[str, str] = {}
    here = {"python_version": python, "python_full_version": f"{python}.0"}
    for entry in re.findall(r"^(\S.*?)((?: \\\n    --hash=sha256:[0-9a-f]{64})+)$", text, re.MULTILINE):
        pin = Requirement(entry[0])
        if pin.marker is None or pin.marker.evaluate(here):
            assert pin.name not in pinned
            pinned[pin.name] = str(pin.specifier).removeprefix("==")
    assert len(pinned) > 50
    settings = toml.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    project = settings["project"]
    for line in (
        *settings["build-system"]["requires"],
        *project["dependencies"],
        *project["optional-dependencies"]["dev"],
    ):
        asked = Requirement(line)
        if asked.marker is None or asked.marker.evaluate(here):
            assert asked.specifier.contains(pinned[canonicalize_name(asked.name)]), line


def test_nonsense_step(machine):
    assert machine.setup("nonsense").returncode == 1


def _elf(*strings: bytes) -> bytes:
    machine = {"x86_64": 62, "aarch64": 183}[os.uname().machine]
    head = b"\x7fELF\x02\x01\x01" + bytes(9) + b"\x03\x00" + machine.to_bytes(2, "little")
    return head + bytes(45) + b"\0".join(strings) + b"\0"
