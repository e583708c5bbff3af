"""The house stays habitable: modules that can be read at a sitting, folders that can be taken in at a glance.

Which room may import from which is held by `lint-imports` (see `pyproject.toml` and `docs/architecture.md`).
"""

from __future__ import annotations

import ast
import gc
import re
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "lightfield"
MODULES, TESTS = (sorted(folder.rglob("*.py")) for folder in (PACKAGE, PACKAGE.parent / "tests"))
UNIT, SUPPORT = (PACKAGE.parent / "tests" / name for name in ("unit", "support"))
TOP, LONGEST, MOST = "lightfield", 400, 14
#: Folders of tests/unit of which the package has none: what they test lies beside it.
BESIDE = {"benchmarks"}
#: Libraries that only one room may import, the others must do without.
OWNED = {
    "mitsuba": "render",
    "drjit": "render",
    "dask": "sweep",
    "distributed": "sweep",
    "matplotlib": "report",
    "tornado": "explorer",
}
#: Libraries that take a tenth of a second or more to import, or start a compiler.
HEAVY = {"mitsuba", "drjit", "dask", "distributed", "matplotlib", "pandas", "scipy", "xarray", "skimage"}
#: What a library loads of these whether one wants it or not.
BRINGS = {"xarray": {"pandas"}, "mitsuba": {"drjit"}}
#: Rooms whose modules are each loaded first of all: by a command line, and by a question from Python; and two
#: public names that need no more than their own rooms.
DOORS, OPEN = ("commands", "api"), {"lightfield.scene", "lightfield.readings"}
#: It answers Ctrl-C from its first line on, and so imports next to nothing before.
BARE = PACKAGE / "cli.py"
#: Classes of plugins are made for a variant of Mitsuba, which is chosen first.
OF_A_VARIANT = {"render/plugins/registration.py", "render/xml.py"}
OPTION = re.compile(r"(?<![-\w])--?[a-z]")


@pytest.fixture(scope="module", autouse=True)
def trees_are_no_garbage() -> Iterator[None]:
    """Python would search them over and over: half of the time."""
    gc.disable()
    yield
    gc.enable()
    tree.cache_clear()
    nodes.cache_clear()


@cache
def tree(module: Path) -> ast.Module:
    """A module as Python reads it."""
    return ast.parse(module.read_text(encoding="utf-8"))


@cache
def nodes(module: Path) -> list[ast.AST]:
    """All of its nodes."""
    return list(ast.walk(tree(module)))


def test_a_module_can_be_read_at_a_sitting() -> None:
    lines = {m: len(m.read_text(encoding="utf-8").splitlines()) for m in (*MODULES, *TESTS)}
    assert {str(module): count for module, count in lines.items() if count > LONGEST} == {}


def test_a_folder_can_be_taken_in_at_a_glance() -> None:
    beside = Counter(module.parent for module in MODULES if module.name != "__init__.py")
    beside.pop(PACKAGE / "commands")  # one module per sub-command
    assert max(beside.values()) <= MOST, beside.most_common(1)


def test_tests_lie_as_what_they_test() -> None:
    """A folder of tests has a twin in the package, and every folder that holds code a twin with tests."""
    rooms = {m.parent.relative_to(PACKAGE) for m in MODULES if m.name != "__init__.py"}
    lying = {m.parent.relative_to(UNIT) for m in UNIT.rglob("test_*.py")}
    assert {place.as_posix() for place in lying - rooms} == BESIDE
    assert {place.as_posix() for place in rooms - lying} == set()
    beside = Counter(module.parent for module in UNIT.rglob("*.py"))
    assert max(beside.values()) <= MOST, beside.most_common(1)


def test_a_test_lies_where_what_it_asks_lies() -> None:
    """It imports from there, if only by a module of `tests/support`, and not from one folder below alone.

    One that has a module's name may ask it by the whole of its room.
    """
    away = []
    for module in UNIT.rglob("test_*.py"):
        place = module.relative_to(UNIT).parent
        if place.parts and place.as_posix() not in BESIDE:
            named = (PACKAGE / place / module.name.removeprefix("test_")).is_file()
            room = place.parts[:1] if named else place.parts
            at = len(room) + 1
            within = {(*name, "__init__")[at] for name in asked(module) if name[:at] == (TOP, *room)}
            deeper = not named and all((PACKAGE / place / name).is_dir() for name in within)
            if not within or (deeper and len(within) == 1):
                away.append(module.relative_to(UNIT).as_posix())
    assert away == []


def test_what_a_test_asks_is_found_by_its_imports() -> None:
    """Also where a package hands a name on, and where a module of `tests/support` has it."""
    tables, effects = UNIT / "readings" / "table", UNIT / "fitting" / "effects"
    assert (TOP, "readings", "table", "read", "read_table") in asked(tables / "test_damaged.py")
    assert (TOP, "fitting", "effects", "local", "local_unknowns") in asked(effects / "test_shadows.py")
    assert {name[1] for name in asked(UNIT / "test_memory.py") if name[0] == TOP} == {"memory"}


@cache
def asked(module: Path) -> frozenset[tuple[str, ...]]:
    """Names that a test, or what it has of `tests/support`, imports: taken apart, by where they are from."""
    found: set[str] = set()
    for node in nodes(module):
        if isinstance(node, ast.Import):
            found |= {f"{TOP}.api.{TOP}" if alias.name == TOP else alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {_home(f"{node.module}.{alias.name}") for alias in node.names}
    apart = {tuple(name.split(".")) for name in found}
    support = {SUPPORT / f"{name[0]}.py" for name in apart}
    return frozenset(apart).union(*(asked(module) for module in support if module.is_file()))


@cache
def _home(name: str) -> str:
    """Where a name is from that a package of this house hands on."""
    package, _, last = name.rpartition(".")
    if _file(name) is not None or (file := _file(package)) is None:
        return name
    handed = {
        alias.asname or alias.name: f"{node.module}.{alias.name}"
        for node in tree(file).body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    return _home(handed[last]) if last in handed else name


def test_what_lies_in_a_room_is_named_in_the_description_of_the_house() -> None:
    """Rooms, and modules and folders in them, as code; `commands` has one module per sub-command."""
    told = (PACKAGE.parent / "docs" / "architecture.md").read_text(encoding="utf-8")
    named = {name for span in re.findall(r"`([^`]+)`", told) for name in re.findall(r"\w+", span)}
    places = {module.relative_to(PACKAGE).parts[:2] for module in MODULES}
    lying = {name.removesuffix(".py") for place in places if place[0] != "commands" for name in place}
    assert sorted(lying - named - {"__init__"}) == []


def test_a_library_has_one_room() -> None:
    for module in MODULES:
        room = module.relative_to(PACKAGE).parts[0]
        for node in nodes(module):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and node.level == 0:
                names = [node.module or ""]
            for name in names:
                assert OWNED.get(name.split(".")[0], room) == room, f"{module}, line {node.lineno}"


def test_imports_inside_functions_keep_heavy_libraries_out() -> None:
    """What is imported late brings a library that somebody who comes in by a door does without until then."""
    first = sorted(OPEN | {_name(m) for m in MODULES if m.relative_to(PACKAGE).parts[0] in DOORS})
    needless = set()
    for module in MODULES:
        place = module.relative_to(PACKAGE).as_posix()
        entered = [d for d in first if _name(module) in loaded(d)]
        for name in imports(module, inside=True):
            if module != BARE and not any(HEAVY & loaded(name) - loaded(door) for door in entered):
                needless.add((place, name))
    assert {one for one in needless if one[0] not in OF_A_VARIANT} == set()
    assert {place for place, _ in needless} == OF_A_VARIANT, "no exception without need"


def test_no_help_waits_for_a_compiler_a_cluster_or_a_figure() -> None:
    never = {"mitsuba", "drjit", "dask", "distributed", "matplotlib"}
    commands = [_name(m) for m in MODULES if m.relative_to(PACKAGE).parts[0] == "commands"]
    assert {name: both for name in commands if (both := never & loaded(name))} == {}


def test_what_is_loaded_is_found_by_following_imports() -> None:
    """By name, and with the packages that lie above; nothing of what is imported late."""
    assert "skimage" in loaded("lightfield.maps.spot")
    assert "scipy" in loaded("lightfield.studies.compare.maps")
    assert "lightfield.scene.scene" in loaded("lightfield.scene.lamp.frame")
    assert not HEAVY & loaded("lightfield.scene") and "mitsuba" not in loaded("lightfield.render.maps")


#: Promised names of the api (CHANGELOG.md) that mean another thing inside.
PROMISED = {
    "Fit": "api/light/compare.py",  # a model refitted to readings; inside, what least squares found
    "compare": "api/array.py",  # arrays, in `lf.array`; maps with the formula in `lf`
}


def test_a_type_name_means_one_thing() -> None:
    """Of a class or of an alias. An answer of the api may have the name of what it holds, and what stands for
    any type may be called alike in two modules; no other two share one."""
    homes: dict[str, list[str]] = {}
    for module in MODULES:
        place = module.relative_to(PACKAGE).as_posix()
        for name, node in types(module):
            if not (isinstance(node, ast.ClassDef) and holds_its_namesake(module, node)):
                homes.setdefault(name, []).append("any type" if stands_for_any(node) else place)
    beside = {name: {p for p in places if PROMISED.get(name) != p} for name, places in homes.items()}
    assert {name: homes[name] for name, places in beside.items() if len(places) > 1} == {}
    assert {"Array", "Result", "Curve", "Remarked", "Made"} <= homes.keys(), "a class, aliases, a variable"


def types(module: Path) -> Iterator[tuple[str, ast.stmt]]:
    """Classes, and names that are written like them and assigned, as aliases are; on top of a module."""
    for node in tree(module).body:
        if isinstance(node, ast.ClassDef):
            yield node.name, node
        targets = node.targets if isinstance(node, ast.Assign) else []
        targets = [node.target] if isinstance(node, ast.AnnAssign) else targets
        for target in targets:
            if isinstance(target, ast.Name) and re.match(r"_?[A-Z]\w*[a-z]", target.id):
                yield target.id, node


def stands_for_any(node: ast.stmt) -> bool:
    """Is it a type variable, or that of parameters?"""
    made = node.value if isinstance(node, ast.Assign) else None
    return isinstance(made, ast.Call) and ast.unparse(made.func) in ("TypeVar", "ParamSpec")


def holds_its_namesake(module: Path, node: ast.ClassDef) -> bool:
    """Is it an answer of the api, `class Link(Result[study.Link])`?"""
    held = {ast.unparse(base.slice) for base in node.bases if isinstance(base, ast.Subscript)}
    imported = [n for n in nodes(module) if isinstance(n, ast.ImportFrom)]
    called = {a.asname: a.name for n in imported for a in n.names if a.asname}
    names = {called.get(one, one.rpartition(".")[2]) for one in held}
    return module.relative_to(PACKAGE).parts[0] == "api" and node.name in names


#: Names that functions share because they mean the same thing of different things, and where alone.
CONVENTIONS = {
    "add_arguments": "commands",  # the options of a sub-command
    "run": "commands",  # a sub-command
    "claims": "readings/instruments",  # is this file of this format?
    "read": "readings/instruments",  # its spectra
    "as_text": "",  # what a result says to people
    "as_data": "",  # what it says to programs
    "headline": "",  # its one sentence
    "rows": "",  # its table, cells as text
    "do_block": "",  # of a kind of sweep: `sweep.schema.SweepKind`
    "with_molecules": "",  # of a phase function, for NumPy and for Dr.Jit: twins, held together by a test
}


def test_a_function_name_means_one_thing() -> None:
    """A function of the api may have the name of what it calls; no other two modules share one."""
    homes: dict[str, list[str]] = {}
    for module in MODULES:
        place = module.relative_to(PACKAGE).as_posix()
        for node in tree(module).body:
            if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
                homes.setdefault(node.name, []).append(place)
    beside = {
        name: {p for p in places if not p.startswith(CONVENTIONS.get(name, "api/")) or not may(name, p)}
        for name, places in homes.items()
    }
    assert {name: homes[name] for name, places in beside.items() if len(places) > 1} == {}
    assert [name for name in CONVENTIONS if len(homes[name]) < 2] == [], "a convention of one is none"


def may(name: str, place: str) -> bool:
    """Another of its name may be elsewhere: it is a convention, a promise, or what this one calls."""
    if name in CONVENTIONS or PROMISED.get(name) == place:
        return True
    called = [n.func for n in nodes(PACKAGE / place) if isinstance(n, ast.Call)]
    return name in {one.attr for one in called if isinstance(one, ast.Attribute)}


#: Functions below the api that take more than eight things: options that each stand for themselves.
LONG = {
    "scene/parameters.py number",  # declares a parameter, one thing a line
    "render/maps.py render_scene",  # documented, called with two or three of them
    "render/diffuse/source.py response_for",  # likewise
    "studies/band/study.py best_band",  # likewise
}


def test_what_belongs_together_is_handed_over_together() -> None:
    """Nine arguments and more are a record that was not made, but for those listed; the api has options."""
    long = set()
    for module in MODULES:
        place = module.relative_to(PACKAGE).as_posix()
        for node in nodes(module):
            if isinstance(node, ast.FunctionDef) and not place.startswith("api/"):
                a = node.args
                names = [*a.posonlyargs, *a.args, *a.kwonlyargs, *filter(None, (a.vararg, a.kwarg))]
                if sum(one.arg != "self" for one in names) > 8:
                    long.add(f"{place} {node.name}")
    assert long == LONG


@cache
def imports(module: Path, *, inside: bool = False) -> frozenset[str]:
    """Modules that one imports on top, or inside functions; not those for the type checker alone.

    Modules of this package by their full name, of others by the first part of it.
    """
    found: set[str] = set()
    for node, in_function in _imported(module):
        if in_function == inside and isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif in_function == inside and isinstance(node, ast.ImportFrom):
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    ours = {name for name in found if name.startswith(TOP)}
    homes = {name if _file(name) else name.rpartition(".")[0] for name in ours}
    return frozenset(homes | {name.split(".")[0] for name in found - ours})


@cache
def _imported(module: Path) -> list[tuple[ast.AST, bool]]:
    return [found for found in _nodes(tree(module)) if isinstance(found[0], ast.Import | ast.ImportFrom)]


def _nodes(node: ast.AST, inside: bool = False) -> Iterator[tuple[ast.AST, bool]]:
    for child in ast.iter_child_nodes(node):
        if not (isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING"):
            yield child, inside
            yield from _nodes(child, inside or isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef))


def _name(module: Path) -> str:
    """The name that a module of this package is imported by."""
    parts = module.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts).removesuffix(".__init__")


@cache
def _file(name: str) -> Path | None:
    """The file of a module of this package."""
    place = PACKAGE.parent.joinpath(*name.split("."))
    return next((p for p in (place.with_suffix(".py"), place / "__init__.py") if p.is_file()), None)


@cache
def loaded(name: str) -> frozenset[str]:
    """All that is loaded with a module: what it imports on top, and the packages that it lies in."""
    found, ahead = set(), {name}
    while ahead:
        found.add(now := ahead.pop())
        if (file := _file(now)) is not None:
            ahead |= ({now.rpartition(".")[0]} - {""} | imports(file)) - found
        ahead |= BRINGS.get(now, set()) - found
    return frozenset(found)


#: Words that somebody at a command line has, and no caller from Python, nor whoever is sent a page.
COMMAND_LINE = re.compile(
    r"(?<![-\w(])--[a-z]|`lightfield [a-z]|lightfield explore\b|(the same|another) command|command line"
    r"|\bPATH=|the terminal\b"
)
OF_COMMANDS = ("commands", "cli.py", "__main__.py")


def test_the_library_names_no_options_and_no_commands() -> None:
    """In errors no option, however short; in no text at all a long one, or a command."""
    found = []
    for module in MODULES:
        if module.relative_to(PACKAGE).parts[0] not in OF_COMMANDS:
            every = nodes(module)
            raised = [node.exc for node in every if isinstance(node, ast.Raise) and node.exc is not None]
            found += [text for error in raised for text in texts(error) if OPTION.search(text)]
            docstrings = {id(node.value) for node in every if isinstance(node, ast.Expr)}
            told = [node for node in every if id(node) not in docstrings]
            found += [text for node in told for text in text_of(node) if COMMAND_LINE.search(text)]
    pages = [file for end in ("js", "html") for file in PACKAGE.rglob(f"*.{end}")]
    assert pages and found == []
    assert [page.name for page in pages if re.search(r"lightfield explore\b", page.read_text("utf-8"))] == []


def test_no_import_hides_in_a_text() -> None:
    """From the linter, which holds the floors, but for public names and for sub-commands."""
    hidden = {
        module.relative_to(PACKAGE).as_posix()
        for module in MODULES
        if re.search(r"import_module\(|__import__", module.read_text("utf-8"))
        if any(text.startswith(f"{TOP}.") for node in nodes(module) for text in text_of(node))
    }
    assert hidden == {"commands/shared/line.py"}


def texts(error: ast.AST) -> list[str]:
    """Every constant text within."""
    return [text for node in ast.walk(error) for text in text_of(node)]


def text_of(node: ast.AST) -> list[str]:
    """The text that a node is, if it is one."""
    return [node.value] if isinstance(node, ast.Constant) and isinstance(node.value, str) else []
