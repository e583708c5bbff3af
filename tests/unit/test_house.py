"""The house stays habitable: modules that can be read at a sitting, folders that can be taken in at a glance.

Which room may import from which is held by `lint-imports` (see `pyproject.toml` and `docs/architecture.md`).
"""

from __future__ import annotations

import ast
from collections import Counter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "lightfield"
MODULES = sorted(PACKAGE.rglob("*.py"))
LONGEST, MOST = 400, 14
#: Libraries that only one room may import, the others must do without.
OWNED = {
    "mitsuba": "render",
    "drjit": "render",
    "dask": "sweep",
    "distributed": "sweep",
    "matplotlib": "report",
}


@pytest.mark.parametrize("module", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_module_can_be_read_at_a_sitting(module: Path) -> None:
    assert len(module.read_text(encoding="utf-8").splitlines()) <= LONGEST


def test_a_folder_can_be_taken_in_at_a_glance() -> None:
    beside = Counter(module.parent for module in MODULES if module.name != "__init__.py")
    beside.pop(PACKAGE / "commands")  # one module per sub-command
    assert max(beside.values()) <= MOST, beside.most_common(1)


@pytest.mark.parametrize("module", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_library_has_one_room(module: Path) -> None:
    room = module.relative_to(PACKAGE).parts[0]
    for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom) and node.level == 0:
            names = [node.module or ""]
        for name in names:
            assert OWNED.get(name.split(".")[0], room) == room, f"line {node.lineno}"
