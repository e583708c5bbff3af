"""Numbers that decide in the diagnosis have names, and every name says where its number comes from."""

from __future__ import annotations

import ast
from pathlib import Path

import lightfield.diagnosis

HOUSE = Path(lightfield.diagnosis.__file__).parent
MODULES = sorted(m for m in HOUSE.rglob("*.py") if m.name not in ("__init__.py", "ledger.py"))
TEXTS = {str(module.relative_to(HOUSE)): module.read_text(encoding="utf-8") for module in MODULES}
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


def test_a_number_in_a_function_has_a_name() -> None:
    inside = [
        f"{place}, line {n.lineno}: {n.value}"
        for place, text in TEXTS.items()
        for f in ast.walk(ast.parse(text))
        if isinstance(f, ast.FunctionDef)
        for n in numbers(f)
    ]
    assert inside == []


def test_a_number_with_a_name_is_explained() -> None:
    """In a comment right above it."""
    bare = [
        f"{place}: {name}"
        for place, text in TEXTS.items()
        for node in ast.parse(text).body
        if isinstance(node, (ast.Assign, ast.AnnAssign)) and node.value is not None
        if any(isinstance(n, ast.Constant) and type(n.value) in (int, float) for n in ast.walk(node.value))
        if not text.splitlines()[node.lineno - 2].startswith("#:")
        for name in assigned(node)
    ]
    assert bare == []
