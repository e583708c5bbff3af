"""Numbers that decide have names, and every name says where its number comes from."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import lightfield

HOUSE = Path(lightfield.__file__).parent
TESTS = HOUSE.parent / "tests"
ROOMS = (HOUSE / "diagnosis", HOUSE / "fitting")
MODULES = sorted(m for r in ROOMS for m in r.rglob("*.py") if m.name not in ("__init__.py", "ledger.py"))
TEXTS = {str(module.relative_to(HOUSE)): module.read_text(encoding="utf-8") for module in MODULES}
#: Arithmetic: counts, halves, squares, per cent and units of time.
PLAIN = {0, 1, 2, 3, 0.5, 10, 100, 60, 3600, 1000}
#: Where a number comes from: a choice (`benchmarks/chosen` halves and doubles every one), what was measured,
#: a derivation, a test, a benchmark or a paper.
ORIGIN = re.compile(r"\b(chosen|measured|derived)\b|\btest_\w+\.py|\bbenchmarks\b|\bdoi:", re.I)
#: The table of effects says of each what its numbers are.
TABLE = "EFFECTS"


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
    assert not inside, "\n".join(inside)


def test_a_constant_that_one_module_uses_has_an_underscore() -> None:
    """A name without one is looked up from elsewhere, and so means one thing there."""
    top = HOUSE.parent
    texts = {
        m: m.read_text(encoding="utf-8") for d in (HOUSE, TESTS, top / "benchmarks") for m in d.rglob("*.py")
    }
    words = {module: set(re.findall(r"\w+", text)) for module, text in texts.items()}
    idle = [
        f"{module.relative_to(HOUSE)}: {name}"
        for module in HOUSE.rglob("*.py")
        for node in ast.parse(texts[module]).body
        if isinstance(node, (ast.Assign, ast.AnnAssign))
        for name in assigned(node)
        if re.fullmatch(r"[A-Z][A-Z0-9_]+", name)
        if not any({name, *_called(module)} <= known for other, known in words.items() if other != module)
    ]
    assert not idle, "\n".join(idle)


def _called(module: Path) -> set[str]:
    """Its own name; of a package that of its folder."""
    return {module.parent.name if module.name == "__init__.py" else module.stem}


def test_a_number_with_a_name_says_where_it_comes_from() -> None:
    """In a comment right above it."""
    bare = [
        f"{place}: {name}"
        for place, text in TEXTS.items()
        for node in ast.parse(text).body
        if isinstance(node, (ast.Assign, ast.AnnAssign)) and node.value is not None
        if any(isinstance(n, ast.Constant) and type(n.value) in (int, float) for n in ast.walk(node.value))
        if not ORIGIN.search(above(text.splitlines(), node.lineno - 1))
        for name in assigned(node)
        if name != TABLE
    ]
    assert not bare, "\n".join(bare)


def above(lines: list[str], at: int) -> str:
    """The comment above a line."""
    first = at
    while lines[first - 1].startswith("#:"):
        first -= 1
    return " ".join(line.removeprefix("#: ") for line in lines[first:at])


def test_what_a_comment_rests_on_is_there() -> None:
    """Tests and benchmarks by their names, and numbers of other modules as `module.NAME`."""
    comments = "\n".join(line for text in TEXTS.values() for line in text.splitlines() if "#" in line)
    tests = {module.name for module in TESTS.rglob("test_*.py")}
    assert set(re.findall(r"\btest_\w+\.py", comments)) - tests == set()
    benchmarks = set(re.findall(r"\bbenchmarks[./](\w+)", comments))
    assert [one for one in benchmarks if not (TESTS.parent / "benchmarks" / one).exists()] == []
    texts = {Path(place).stem: text for place, text in TEXTS.items()}
    named = re.findall(r"`(\w+)\.(_?[A-Z][A-Z_]+)`", comments)
    assert [f"{module}.{name}" for module, name in named if name not in texts.get(module, "")] == []
