"""`lightfield doctor`: what renders run on here, and whether a render gives a number known beforehand."""

from __future__ import annotations

import argparse
import os
import platform
import sys

from lightfield.errors import LightfieldError
from lightfield.render.backend import choose
from lightfield.render.doctor import check, versions


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """No options of its own."""


def run(args: argparse.Namespace) -> int:
    """Print the findings; 0 when all is well, 1 when the render is wrong, 2 when no backend can be used."""
    for package, version in versions().items():
        _line(package, version)
    _line("machine", f"{platform.system()} {platform.machine()}, {os.cpu_count()} processors")
    try:
        backend = choose()
    except LightfieldError as error:
        _line("backend", "none")
        print("FAIL: no backend")
        print(f"lightfield: {error}", file=sys.stderr)
        return 2
    _line("backend", f"{backend.kind} ({backend.variant})")
    if backend.llvm_path is not None:
        _line("LLVM", f"{backend.llvm_version}, {backend.llvm_path}")
    _line("threads", str(backend.threads))
    _line("cache", str(backend.cache_dir))
    result = check()
    if result.problem:
        print(f"FAIL: {result.problem}")
        return 1
    _line("known case", "irradiance on a plate that faces a uniformly bright sphere")
    _line("rendered", f"{result.value:.5f} ± {result.stderr:.5f} W m^-2")
    _line("known", f"{result.known:.5f} W m^-2 (difference {result.z:+.2f} standard errors)")
    print("PASS" if result.passed else "FAIL: the rendered value is not the known one")
    return 0 if result.passed else 1


def _line(name: str, value: str) -> None:
    print(f"{name:<14} {value}", flush=True)
