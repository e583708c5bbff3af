"""Numbers that decide in the diagnosis have names, and every name says where its number comes from."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import lightfield.diagnosis

HOUSE = Path(lightfield.diagnosis.__file__).parent
MODULES = sorted(m for m in HOUSE.rglob("*.py") if m.name not in ("__init__.py", "ledger.py"))
#: Arithmetic: counts, halves, squares, per cent and units of time.
PLAIN = {0, 1, 2, 3, 0.5, 10, 100, 60, 3600, 1000}


def assigned(node: ast.stmt) -> list[str]:
    """Names that a statement gives values to."""
    targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
    return [n.id for t in targets if t is not None for n in ast.walk(t) if isinstance(n, ast.Name)]


def numbers(node: ast.AST) -> list[ast.Constant]:
    """Numbers below a node that are more than arithmetic."""
    found = [n for n in ast.walk(node) if isinstance(n, ast.Constant) and type(n.value) in (int, float)]
    return [n for n in found if n.value not in PLAIN]


@pytest.mark.parametrize("module", MODULES, ids=lambda path: str(path.relative_to(HOUSE)))
def test_a_number_in_a_function_has_a_name(module: Path) -> None:
    tree = ast.parse(module.read_text(encoding="utf-8"))
    inside = [n for f in ast.walk(tree) if isinstance(f, ast.FunctionDef) for n in numbers(f)]
    assert [f"line {n.lineno}: {n.value}" for n in inside] == []


@pytest.mark.parametrize("module", MODULES, ids=lambda path: str(path.relative_to(HOUSE)))
def test_a_number_with_a_name_is_explained(module: Path) -> None:
    """In a comment right above it."""
    text = module.read_text(encoding="utf-8")
    lines = text.splitlines()
    bare = [
        name
        for node in ast.parse(text).body
        if isinstance(node, (ast.Assign, ast.AnnAssign)) and node.value is not None
        if any(isinstance(n, ast.Constant) and type(n.value) in (int, float) for n in ast.walk(node.value))
        if not lines[node.lineno - 2].startswith("#:")
        for name in assigned(node)
    ]
    assert bare == []
