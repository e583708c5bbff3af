"""What is public is listed here once more: whoever changes it changes this file, and CHANGELOG.md."""

from __future__ import annotations

import argparse
import importlib
import inspect
import keyword
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import lightfield as lf

#: Public functions with their arguments, in order.
FUNCTIONS = {
    "load": "path, scene",
    "save": "readings, path",
    "import_": "index, column, quantity, units, band, saturation_level, plane_gain_percent, position_mm, "
    "tolerance_percent, outlier_percent, calibration_percent",
    "render": "scene, wavelengths, rel_error, max_photons, seed, cache",
    "compare": "what, scene, with_, effects_file, solver, trace, rel_error, max_photons, seed, cache",
    "picture": "scene, size, samples, seed, as_is",
    "hide": "scene, effect, lamp, size, effects_file, strength, seed, layout, noise, plane_gain, position, "
    "plane_order, to_and_fro, max_photons",
    "diagnose": "readings, scene, effects, effects_file, alpha, seed, trace, render",
    "plan": "layout, scene, effects, size, effects_file, trace",
    "sweep": "scene, vary, output, rel_error, max_photons, seed, maps, workers, scheduler, memory",
    "attenuation": "readings, scene, air, trace",
    "band": "scene, distances, width, between, response, electrons, read_noise, mismatch, trace, rel_error, "
    "max_photons, seed",
    "range": "scene, readings, share, noise, snr, to, array, array_side, array_radius, max_photons, trace",
    "follow": "scene, with_, believe, runs, duration, max_photons, seed, trace",
    "link": "scene, area, responsivity, amplifier_noise, background, bit_rate, ber, water, to, rel_error, "
    "max_photons, seed",
    "regime": "output, scene, rel_error, max_photons, seed, workers",
    "array.show": "scene, half_width, medium, max_photons, seed, trace",
    "array.compare": "scene, with_, task, half_width, medium, max_photons, seed, trace",
    "array.optimise": "scene, elements, box, tilt_max, spacing, task, half_width, medium, max_photons, seed, "
    "trace",
    "pose.estimate": "readings, scene, filter, half_width, medium, max_photons, seed, trace",
    "pose.bias": "scene, scattering, half_width, medium, max_photons, seed, trace",
}
#: Answers, and what each can do beside what every `Result` can.
RESULTS = {
    "Maps": {"load", "save", "scene", "quantity"},
    "Comparison": set(),
    "Fit": {"scene"},
    "Picture": {"save"},
    "Riddle": {"readings", "scene", "truth", "save"},
    "Diagnosis": {"verdict", "effects", "scene", "save"},
    "Plan": set(),
    "Together": set(),
    "Following": set(),
    "Sweep": {"load"},
    "Attenuation": set(),
    "Band": set(),
    "Range": set(),
    "Link": set(),
    "Regime": set(),
    "array.Survey": set(),
    "array.Arrays": set(),
    "pose.Poses": set(),
    "pose.Bias": set(),
}
EVERY_RESULT = {
    "as_data", "as_text", "headline", "plot", "report", "summary", "to_pandas", "to_xarray"
}  # fmt: skip
OTHERS = {"Scene", "Readings", "LightfieldError", "Result", "array", "pose"}
#: Options by which a command is told what a Python program asks of the answer instead; and the store of runs
#: of `follow` over parameters, which is the command's alone.
WRITING = {"json", "report", "output", "fit_json", "exr", "figures", "table", "list", "schema", "plan",
           "dry_run", "verify", "help",
           "track", "vary", "workers"}  # fmt: skip


def public(name: str) -> object:
    found: object = lf
    for part in name.split("."):
        found = getattr(found, part)
    return found


def test_the_public_names_are_these():
    listed = {name.partition(".")[0] for name in (*FUNCTIONS, *RESULTS)} | OTHERS
    assert set(lf.PUBLIC) == listed
    assert set(lf.__all__) == listed - {"range"}
    assert listed <= set(dir(lf))
    for module in (lf.array, lf.pose):
        name = module.__name__.rpartition(".")[2]
        assert {f"{name}.{each}" for each in module.__all__} == {
            each for each in (*FUNCTIONS, *RESULTS) if each.startswith(f"{name}.")
        }


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_public_function_has_these_arguments_and_explains_itself(name):
    function = public(name)
    assert ", ".join(inspect.signature(function).parameters) == FUNCTIONS[name]
    text = inspect.getdoc(inspect.unwrap(function))
    assert text and "Parameters" in text and "Raises" in text


@pytest.mark.parametrize("name", RESULTS)
def test_a_public_answer_can_do_this(name):
    kind = public(name)
    assert issubclass(kind, lf.Result) and kind.__doc__
    own = {member for base in kind.__mro__ for member in vars(base) if not member.startswith("_")}
    assert own == EVERY_RESULT | RESULTS[name]


def test_other_names_are_no_part_of_it():
    with pytest.raises(AttributeError, match="no attribute 'difuse'"):
        _ = lf.difuse


def defaults_of(command: str) -> dict[str, Any]:
    """Options of a command as Python would write them, with their defaults: `--no-trace` is `trace`, `--with`
    is `with_`. None: what was left out is decided later."""
    name, _, task = command.partition(".")
    parser = argparse.ArgumentParser()
    importlib.import_module(f"lightfield.commands.{name}").add_arguments(parser)
    if task:
        (tasks,) = (a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
        parser = tasks.choices[task]
    every = ((option, a) for a in parser._actions for option in a.option_strings)
    named = ((option[2:].removeprefix("no-").replace("-", "_"), a) for option, a in every)
    return {f"{word}_" if keyword.iskeyword(word) else word: _default(a) for word, a in named if word}


def _default(option: argparse.Action) -> Any:
    """What an option is when left out; of those that are decided later the number that the help names."""
    told = re.search(r"\(default:? ([-+.e\d]+)[);]", option.help or "")
    return float(told[1]) if option.default is None and told else option.default


@pytest.mark.parametrize("name", [name for name in FUNCTIONS if name not in ("load", "save")])
def test_arguments_are_called_as_the_options_of_the_command(name):
    options, given = defaults_of(name), inspect.signature(public(name)).parameters
    named = {word for word, one in given.items() if one.kind is inspect.Parameter.KEYWORD_ONLY}
    assert named <= set(options)
    assert set(options) - set(given) <= WRITING
    numbers = {word: value for word, value in options.items() if type(value) in (int, float)}
    assert {"rel_error", "max_photons", "seed"} & set(options) <= set(numbers)
    for word in set(numbers) & set(given):  # None: what is compared decides
        assert given[word].default in (numbers[word], None), word


def run_python(code: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr


def test_the_import_costs_nothing():
    run_python(
        "import sys, lightfield\n"
        "heavy = {'numpy', 'pydantic', 'scipy', 'xarray', 'pandas', 'matplotlib', 'mitsuba', 'argparse'}\n"
        "sys.exit(str(heavy & set(sys.modules)) if heavy & set(sys.modules) else 0)\n"
    )


def test_a_room_and_a_function_of_one_name_are_both_there_whichever_comes_first():
    run_python(
        "import lightfield.render.settings as settings\n"
        "import lightfield as lf\n"
        "from lightfield import sweep\n"
        "import lightfield.sweep.axes as axes\n"
        "assert callable(lf.render) and callable(sweep) and lf.sweep is sweep\n"
        "assert settings.Settings and axes.span\n"
        "try:\n    lf.render('/nonexistent.toml')\n"
        "except lf.LightfieldError as error:\n    assert '/nonexistent.toml' in str(error)\n"
        "else:\n    raise AssertionError\n"
    )


def test_python_m_lightfield_is_the_program():
    done = subprocess.run(
        [sys.executable, "-m", "lightfield", "--version"],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (done.returncode, done.stdout) == (0, f"lightfield {lf.__version__}\n")


def test_the_reference_lists_every_function_and_answer() -> None:
    text = (Path(lf.__file__).parents[1] / "docs" / "reference.md").read_text(encoding="utf-8")
    told = set(re.findall(r"auto(?:function|class):: lightfield\.([\w.]+)", text))
    assert set(FUNCTIONS) | set(RESULTS) <= told
