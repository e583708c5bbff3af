"""What all tests share: a cache of their own, a profile for generated cases, the optional reference data."""

from __future__ import annotations

import gc
import os
import sys
import tempfile
from pathlib import Path

import pytest
from hypothesis import settings

os.environ.setdefault("MPLBACKEND", "Agg")
# On many small matrices more BLAS threads only get in each other's way. Set before NumPy is loaded.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
# Of several that share the cores, each process of the renderer gets its part of them.
_WORKERS = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
if _WORKERS > 1:
    os.environ.setdefault("LIGHTFIELD_THREADS", str(max((os.cpu_count() or 1) // _WORKERS, 1)))
# Tests neither trust nor fill the user's cache. Set before any import, inherited by child processes: those
# that share the suite have one folder, so that no kernel is compiled and no light traced twice.
if "PYTEST_XDIST_WORKER" not in os.environ:
    _CACHE = tempfile.TemporaryDirectory(prefix="lightfield-tests-")
    os.environ["LIGHTFIELD_CACHE"] = _CACHE.name
    # Said here too, for tests that import Mitsuba before this package: else kernels go to ~/.drjit.
    os.environ["DRJIT_CACHE_DIR"] = str(Path(_CACHE.name) / "kernels")
# Where a machine says no to compiled modules, every command that is started here would compile all of them.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# No deadline: two busy cores make single cases slow. Derandomised: a run repeats.
settings.register_profile("lightfield", deadline=None, derandomize=True)
settings.load_profile("lightfield")


# Until all tests are collected, next to nothing is garbage.
gc.disable()


def pytest_collection_finish() -> None:
    """Thousands of tests stay to the end: Python need not search them for garbage over and over.

    Nor what is new, after every 700 objects: modules that tests bring late stay as well.
    """
    gc.freeze()
    gc.set_threshold(50_000, 10, 10)
    gc.enable()


def pytest_sessionfinish() -> None:
    """At its end Python takes apart what it can see."""
    gc.unfreeze()


@pytest.fixture(scope="session")
def reference() -> Path:
    """Folder of data that is not part of this repository; tests that need it are skipped without it."""
    root = Path(__file__).resolve().parents[1]
    named = os.environ.get("LIGHTFIELD_REFERENCE")
    folder = Path(named) if named else root.parent / "shared"
    if not folder.is_dir():
        pytest.skip(f"no reference data at {folder}; name their folder with LIGHTFIELD_REFERENCE")
    return folder
