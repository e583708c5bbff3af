"""An option has one name, one kind of value and one range, whichever sub-command takes it."""

from __future__ import annotations

import argparse
import ast
import importlib
import re
from pathlib import Path

import pytest

from lightfield import api, commands
from lightfield.commands import link, sweep
from lightfield.commands.shared.line import COMMANDS, _module, prepared
from lightfield.commands.shared.options import OPTIONS, photon_count, seed_number
from lightfield.errors import LightfieldError, UsageError
from lightfield.fitting import effects
from lightfield.render.limits import PHOTONS, SEED
from lightfield.render.settings import Settings
from lightfield.sweep.sweep_plan import SweepSettings

#: Shared options that a command names with a default: files, and what is not traced.
_NAMED = {"--output", "--to", "--with"}


@pytest.mark.parametrize("command", COMMANDS)
def test_a_shared_option_is_what_the_help_says_by_default(command: str) -> None:
    parser = argparse.ArgumentParser()
    importlib.import_module(_module(command)).add_arguments(parser)
    for action in parser._actions:
        for name in set(action.option_strings) & (set(OPTIONS) - _NAMED):
            assert action.default in (None, False), f"{name}: the command has its default, argparse none"


def test_a_shared_option_is_nowhere_declared_again() -> None:
    """Only where readings are compared, `--with` names effects, and no scenes."""
    again = []
    for module in sorted(Path(commands.__file__).parent.rglob("*.py")):
        for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.Call) or ast.unparse(node.func).split(".")[-1] != "add_argument":
                continue
            words = [one.value for one in node.args if isinstance(one, ast.Constant)]
            again += [(module.stem, word) for word in words if word in OPTIONS]
    assert again == [("compare", "--with")]


def test_what_a_command_and_python_take_by_default_is_declared_once() -> None:
    """Both read it: neither states a number or a word of its own, not even in the help."""
    stated: dict[str, set[str]] = {}
    for module in sorted(Path(api.__file__).parent.rglob("*.py")):
        for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef):
                given, defaults = node.args.args, node.args.defaults
                pairs = [*zip(given[len(given) - len(defaults) :], defaults, strict=True)]
                for name, default in [*pairs, *zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True)]:
                    stated.setdefault(name.arg, set()).update([module.stem] if chosen(default) else [])
    of_python, twice = set(stated), []
    for module in sorted(Path(commands.__file__).parent.rglob("*.py")):
        for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
            for name in options_of(node) & of_python:
                told = [k.value for k in node.keywords if k.arg == "default"]
                shown = [ast.unparse(k.value) for k in node.keywords if k.arg == "help"]
                shown += [f"(default {ast.unparse(one)}" for one in node.args[2:]]
                number = any(re.search(r"\(default:? '?[-+.\d]*[1-9]", text) for text in shown)
                wrong = number or any(map(chosen, told))
                twice += [(name, where) for where in (*stated[name], *[module.stem] * bool(wrong))]
    assert {"noise", "runs", "box", "samples", "medium", "alpha"} <= of_python
    assert twice == []


def options_of(node: ast.AST) -> set[str]:
    """What Python calls the options that a call declares."""
    if not isinstance(node, ast.Call) or "add" not in ast.unparse(node.func).split(".")[-1]:
        return set()
    words = [one.value for one in node.args if isinstance(one, ast.Constant) and isinstance(one.value, str)]
    return {word[2:].replace("-", "_") for word in words if word.startswith("--")}


def chosen(default: ast.expr | None) -> bool:
    """Is it written out, and more than nothing, none or the first?"""
    try:
        value = ast.literal_eval(ast.unparse(default)) if default is not None else None
    except ValueError:
        return False  # a name, which is declared elsewhere
    return value not in (None, False, True, "", (), [])


@pytest.mark.parametrize("made", [Settings, SweepSettings])
def test_a_trace_of_a_sweep_may_be_what_any_trace_may_be(made: type[Settings | SweepSettings]) -> None:
    for rel_error, max_photons in ((1e-5, 1e12), (1.0, 1e3)):
        made(rel_error=rel_error, max_photons=max_photons)
    for wrong in ({"rel_error": 0.0}, {"rel_error": float("nan")}, {"max_photons": 10.0}):
        with pytest.raises(LightfieldError, match=next(iter(wrong))):
            made(**wrong)


def test_seeds_are_whole_numbers_up_to_the_largest() -> None:
    assert seed_number("2147483647") == SEED.high
    for wrong in ("2147483648", "-1", "1.5", "seed"):
        with pytest.raises(argparse.ArgumentTypeError, match=SEED.rule):
            seed_number(wrong)


def test_photons_are_told_in_numbers_that_a_trace_may_have() -> None:
    assert (photon_count("1e3"), photon_count("1e12")) == (PHOTONS.low, PHOTONS.high)
    for wrong in ("999", "2e12", "nan", "many"):
        with pytest.raises(argparse.ArgumentTypeError, match=PHOTONS.rule):
            photon_count(wrong)


def test_two_waters_of_one_name_are_refused() -> None:
    """The first would be left out of the answer without a word."""
    assert link._waters(["clear=0.05,0", "murky=0.2,0.1"]) == {"clear": (0.05, 0), "murky": (0.2, 0.1)}
    with pytest.raises(UsageError, match="two waters of one name"):
        link._waters(["clear=0.05,0", "clear=0.2,0.1"])


def test_the_help_of_sweeps_names_the_page_that_says_how_to_use_tls() -> None:
    (page,) = re.findall(r"use TLS\s+\(.*?(docs/\w+\.md)", sweep.EPILOG)
    told = (Path(__file__).resolve().parents[3] / page).read_text(encoding="utf-8")
    assert "--tls-cert" in told and "--scheduler tls://" in told


@pytest.mark.parametrize("command", ["render", "sweep"])
def test_the_help_of_a_seed_says_what_threads_leave_equal(command: str) -> None:
    parser = argparse.ArgumentParser()
    importlib.import_module(_module(command)).add_arguments(parser)
    (seed,) = (action for action in parser._actions if "--seed" in action.option_strings)
    assert "last bit on one thread" in seed.help and "single precision on several" in seed.help


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("diagnos data.csv", "no command 'diagnos'; remedy: did you mean diagnose?"),
        ("diagnose data.csv --notrace", "found '--notrace'; remedy: did you mean --no-trace?"),
        ("diagnose data.csv --frobnicate=3", "lightfield diagnose --help"),
    ],
)
def test_a_misspelt_word_is_answered_by_the_nearest(line: str, said: str) -> None:
    with pytest.raises(UsageError, match=re.escape(said)):
        prepared(line.split())


def test_a_misspelt_effect_is_answered_by_the_nearest_alone() -> None:
    """Not by a list of forty with the answer at its end."""
    with pytest.raises(UsageError) as refused:
        effects.get("scatering")
    assert str(refused.value) == "unknown effect; found 'scatering'; remedy: did you mean scattering?"


def test_a_list_that_begins_with_a_minus_is_a_value(tmp_path: Path) -> None:
    """argparse takes `-0.1,0.4` for an option; a real option that follows stays one."""
    with pytest.raises(LightfieldError, match=r"absorption_per_m.*found -0\.1"):
        prepared(["new", "tank", "--water", "-0.1,0.4", "-o", str(tmp_path / "tank")])()
    with pytest.raises(UsageError, match="--water: expected one argument"):
        prepared(["new", "tank", "--water", "-o", str(tmp_path / "tank")])
