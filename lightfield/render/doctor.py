"""A check of the installation: what is there, and whether a render gives a number known beforehand."""

from __future__ import annotations

import importlib.metadata
import json
import platform
import subprocess
import sys

from lightfield.render.known_case import Check
from lightfield.version import __version__

_PACKAGES = (
    "mitsuba",
    "drjit",
    "numpy",
    "scipy",
    "pydantic",
    "xarray",
    "netCDF4",
    "zarr",
    "dask",
    "OpenEXR",
    "scikit-image",
)
_CHECK_TIMEOUT_S = 300


def versions() -> dict[str, str]:
    """Version of Python, of this package and of what it stands on."""
    found = {"lightfield": __version__, "python": platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            found[package] = "missing"
    return found


def check() -> Check:
    """Render the known case in a process of its own, so that an abort of the compiler is a finding."""
    try:
        child = subprocess.run(
            [sys.executable, "-m", "lightfield.render.known_case"],
            capture_output=True,
            text=True,
            timeout=_CHECK_TIMEOUT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return Check(problem=f"the render did not end within {_CHECK_TIMEOUT_S} s")
    except OSError as error:
        return Check(problem=f"the render could not be started ({error.strerror})")
    try:
        return Check(**json.loads(child.stdout.splitlines()[-1]))
    except (IndexError, TypeError, ValueError):
        lines = child.stderr.strip().splitlines() or ["no message"]
        how = f"signal {-child.returncode}" if child.returncode < 0 else f"exit {child.returncode}"
        return Check(problem=f"the render died ({how}): {lines[-1]}")
