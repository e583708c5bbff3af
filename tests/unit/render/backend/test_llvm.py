"""Recognising a libLLVM by its bytes: LLVM 14-16 abort the process in the first render."""

from __future__ import annotations

import platform
import re
from pathlib import Path

import pytest

from lightfield.render.backend import llvm

MACHINE = {"x86_64": 62, "aarch64": 183}.get(platform.machine(), 62)


def elf(*strings: bytes, machine: int = MACHINE, bits: int = 2) -> bytes:
    """Head of an ELF shared library, followed by a string table."""
    head = b"\x7fELF" + bytes([bits, 1, 1]) + bytes(9) + b"\x03\x00" + machine.to_bytes(2, "little")
    return head + bytes(44) + b"\0" + b"\0".join(strings) + b"\0"


def write(folder: Path, name: str, *strings: bytes) -> Path:
    path = folder / name
    path.write_bytes(elf(*strings))
    return path


# Strings as `strings` shows them in the libraries of Debian 12 (14, 15, 19) and Ubuntu 24.04 (17, 18).
@pytest.mark.parametrize(
    ("name", "strings", "version"),
    [
        ("libLLVM-14.so.1", (b"libLLVM-14.so.1", b"LLVM_14", b"LLVM version 14.0.6"), (14, 0, 6)),
        ("libLLVM-15.so.1", (b"libLLVM-15.so.1", b"LLVM_15", b"Debian LLVM version 15.0.6"), (15, 0, 6)),
        ("libLLVM-16.so.1", (b"libLLVM-16.so.1", b"LLVM_16"), (16,)),
        ("libLLVM-17.so.1", (b"libLLVM-17.so.1", b"LLVM_17", b"Ubuntu LLVM version 17.0.6"), (17, 0, 6)),
        ("libLLVM.so.18.1", (b"libLLVM.so.18.1", b"LLVM_18.1"), (18, 1)),
        ("libLLVM.so.19.1", (b"libLLVM.so.19.1", b"LLVM_19.1", b"LLVM version 19.1.7"), (19, 1, 7)),
        ("libLLVM.so.22.0", (), (22, 0)),
        ("libLLVM-17.so", (), (17,)),
    ],
)
def test_version_is_read_without_loading(tmp_path, name, strings, version):
    library = llvm.inspect(write(tmp_path, name, *strings))
    assert library.version == version
    assert library.usable == (version[0] >= 17)


@pytest.mark.parametrize("strings", [(b"LLVM version 15.0.7",), (b"libLLVM-15.so.1",)])
def test_content_outweighs_a_misleading_name(tmp_path, strings):
    library = llvm.inspect(write(tmp_path, "libLLVM.so.19.1", *strings))
    assert library.version[0] == 15
    assert not library.usable


def test_a_mention_without_number_does_not_end_the_search(tmp_path):
    path = write(tmp_path, "libLLVM.so", b"LLVM version mismatch", b"LLVM version 14.0.0")
    assert llvm.inspect(path).version == (14, 0, 0)


def test_version_of_a_link_is_that_of_its_target(tmp_path):
    target = write(tmp_path, "libLLVM-14.so.1")
    link = tmp_path / "libLLVM.so"
    link.symlink_to(target)
    assert not llvm.inspect(link).usable


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", "is not a shared library"),
        (b"INPUT(-lLLVM-19) /* a linker script, padded */", "is not a shared library"),
        (elf(b"LLVM version 19.1.7", machine=8), "another processor"),
        (elf(b"LLVM version 19.1.7", bits=1), "another processor"),
        (elf(b"something else"), "does not tell"),
    ],
)
def test_files_that_are_no_usable_llvm_are_refused(tmp_path, content, problem):
    path = tmp_path / "libLLVM.so"
    path.write_bytes(content)
    library = llvm.inspect(path)
    assert problem in library.problem
    assert not library.usable


def test_missing_file_and_folder_are_refused(tmp_path):
    assert llvm.inspect(tmp_path / "libLLVM.so").problem == "does not exist"
    assert "cannot be read" in llvm.inspect(tmp_path).problem


def test_best_comes_first_and_each_file_once(tmp_path):
    for name in (
        "libLLVM-14.so.1",
        "libLLVM.so.19.1",
        "libLLVM.so.22.1",
        "libLLVM.so.23.1",
        "libLLVM-17.so.1",
    ):
        write(tmp_path, name)
    (tmp_path / "libLLVM-19.so").symlink_to("libLLVM.so.19.1")
    write(tmp_path, "libLLVMSPIRVLib.so.19.1")  # another library of a similar name
    write(tmp_path, "libLLVM-19-rust-1.80.so")
    majors = [library.version[0] for library in llvm.installed([tmp_path])]
    assert majors == [22, 19, 17, 23, 14]  # 23 has not been tried: only where nothing tried is there


def test_folders_can_be_named(tmp_path, monkeypatch):
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    write(tmp_path / "b", "libLLVM.so.20.1")
    monkeypatch.setenv("LIGHTFIELD_LLVM_FOLDERS", f"{tmp_path}/a:{tmp_path}/b:{tmp_path}/none")
    assert [library.version for library in llvm.installed()] == [(20, 1)]


def test_ours_is_heard_before_the_variable_of_drjit(tmp_path):
    ours, theirs = write(tmp_path, "libLLVM.so.20.1"), write(tmp_path, "libLLVM.so.19.1")
    both = {"LIGHTFIELD_LIBLLVM": str(ours), "DRJIT_LIBLLVM_PATH": str(theirs)}
    assert llvm.explicit(both) == ("LIGHTFIELD_LIBLLVM", llvm.Library(ours, (20, 1)))
    assert llvm.explicit({"DRJIT_LIBLLVM_PATH": str(theirs)}) == (
        "DRJIT_LIBLLVM_PATH",
        llvm.Library(theirs, (19, 1)),
    )
    assert llvm.explicit({"LIGHTFIELD_LIBLLVM": ""}) is None


def test_a_file_that_only_looks_right_is_not_accepted(tmp_path):
    library = llvm.inspect(write(tmp_path, "libLLVM.so.19.1"))
    assert library.usable
    assert "cannot be loaded" in llvm.load_problem(library)


def test_libraries_of_this_machine():
    """Bytes against the names that the distribution gave, and the best one loads."""
    found = llvm.installed()
    assert found, "the tests run on a machine that has been set up"
    for library in found:
        named = re.search(r"libLLVM(?:-|\.so\.)(\d+)", library.path.resolve().name)
        assert named is None or library.version[0] == int(named[1])
    assert llvm.load_problem(found[0]) == ""
