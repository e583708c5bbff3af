"""What users give in place of what functions take."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import pytest
import xarray as xr

import lightfield as lf
from lightfield.api.given import checked, names_in

#: The same without its types, for what they do not allow.
untyped: Any = lf


@pytest.mark.parametrize("given", ["scattering,walls", " scattering , walls,", ["scattering", "walls"]])
def test_names_in_one_string_are_those_of_the_command_line(given) -> None:
    assert names_in(given) == ["scattering", "walls"]


def test_a_name_alone_is_not_taken_letter_by_letter() -> None:
    scene = lf.Scene.model_validate(
        {"water": {"absorption_per_m": 0.1}, "detector": {"planes_m": [1.0, 2.0]}}
    )
    with pytest.raises(lf.LightfieldError, match="no_such_effect"):
        lf.hide(scene, effect="no_such_effect")


@pytest.mark.parametrize("given", [{"rel_error": "5%"}, {"max_photons": "many"}, {"rel_error": True}])
def test_a_number_that_is_none_is_said_to_be_none(given: dict[str, object]) -> None:
    (name,) = given
    with pytest.raises(lf.LightfieldError, match=f"{name}.*a number, 1e"):
        untyped.render(lf.Scene.from_dict({"name": "a pool"}), **given)


POOL = lf.Scene.from_dict({"name": "a pool"})
WRONG = {
    "a seed below 0": (lambda: lf.hide(POOL, seed=-1), "seed.*0 to 2147483647"),
    "an effect that is a number": (lambda: untyped.hide(POOL, effect=3), "effect.*a name"),
    "a scene that is a dict": (lambda: untyped.hide({"name": "x"}), "scene.*a Scene"),
    "noise in words": (lambda: untyped.hide(POOL, noise="1 %"), "noise.*a number"),
    "bare numbers": (lambda: untyped.diagnose(np.ones(4), POOL), "readings.*`load`"),
    "no effect": (lambda: lf.diagnose("x.csv", POOL, effects=[]), "no effect is named"),
    "a list with a number": (lambda: untyped.attenuation(["a.csv", 3], POOL), "readings.*`load`"),
    "a scene for readings": (lambda: untyped.save(POOL, "x.csv"), "readings.*`load`"),
    "alpha in per cent": (lambda: lf.diagnose("x.csv", POOL, alpha=5), "alpha.*0.0005 to 0.5"),
    "half a water": (lambda: untyped.link(POOL, water={"harbour": 3}), "water harbour.*1/m"),
    "waters in a list": (lambda: untyped.link(POOL, water=[(1, 2)]), "water.*names"),
    "no photons": (lambda: lf.follow(POOL, max_photons=-1), "max_photons.*1e3 to 1e12"),
    "a seed that no command takes": (lambda: lf.hide(POOL, seed=2**31), "seed.*0 to 2147483647"),
    "five photons": (lambda: lf.array.show(POOL, max_photons=5), "max_photons.*1e3 to 1e12"),
    "five photons for a study": (lambda: lf.link(POOL, max_photons=5), "max_photons.*1e3 to 1e12"),
    "five photons for a map": (lambda: lf.render(POOL, max_photons=5), "max_photons.*1e3 to 1e12"),
    "five photons for distances": (lambda: lf.range(POOL, max_photons=5), "max_photons.*1e3 to 1e12"),
    "one scene for a list": (lambda: lf.follow(POOL, with_="a.toml"), "with_.*a list"),
    "one scene itself for a list": (lambda: untyped.follow(POOL, with_=POOL), "with_.*a list"),
    "two scenes of one name": (lambda: lf.follow(POOL, with_=[POOL]), "with_.*two scenes of one name"),
    "an array named like the scene's": (
        lambda: lf.array.compare(POOL, {"a pool": POOL}),
        "with_.*two scenes of one name",
    ),
    "a water named like the scene's": (lambda: lf.link(POOL, water={"scene": (0.1, 0.1)}), "another name"),
    "noise of a range in words": (lambda: untyped.range(POOL, noise="x"), "noise.*a number"),
    "a band that is no pair": (lambda: untyped.import_("i.csv", band=(500, 550)), "band.*pairs"),
    "another medium": (lambda: untyped.array.show(POOL, medium="oil"), "medium.*'water' or 'air'"),
    "arrays without names": (lambda: untyped.array.compare(POOL, [POOL]), "with_.*names"),
    "no other array": (lambda: lf.array.compare(POOL, {}), "nothing to compare"),
    "no such task": (lambda: untyped.array.optimise(POOL, task="x"), "task.*'docking'"),
    "a box inside out": (lambda: lf.array.optimise(POOL, box=-1), "box.*0.01 to 10 m"),
    "detectors that look back": (lambda: lf.array.optimise(POOL, tilt_max=200), "tilt_max.*0 to 80"),
    "a number as a folder": (lambda: untyped.Maps.load(3), "path.*path of a file"),
    "no path at all": (lambda: lf.load(""), "path.*found \"''\".*path of a file"),
    "an empty scene": (lambda: untyped.render({}), "scene.*found '{}'"),
    "yes for a switch": (lambda: untyped.render(POOL, cache="yes"), "cache.*True or False"),
    "readings that are no file": (lambda: untyped.pose.estimate(np.ones(3), POOL), "readings.*path"),
    "one water for a list": (lambda: untyped.pose.bias(POOL, scattering=0.1), "scattering.*list"),
    "a size in words": (lambda: untyped.picture(POOL, size="32x18"), "size.*32x18.*2 whole numbers"),
    "half a size": (lambda: untyped.picture(POOL, size=(32,)), "size.*2 whole numbers"),
    "half a pixel": (lambda: untyped.picture(POOL, size=(32.5, 18)), "size.*2 whole numbers"),
    "a range that is a number": (lambda: untyped.band(POOL, between=400), "between.*2 numbers"),
    "a number to compare": (lambda: untyped.compare(3), "what.*int.*Maps or their data set"),
    "a data set of something else": (
        lambda: lf.compare(xr.Dataset({"a": 1})),
        "what: .*no rendering.*`quantity`",
    ),
    "no water": (lambda: lf.pose.bias(POOL, scattering=[]), "scattering.*list"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_an_argument_does_not_take_is_one_error_that_names_it(case: str) -> None:
    call, said = WRONG[case]
    with pytest.raises(lf.LightfieldError, match=said):
        call()


def test_a_scene_where_one_or_several_may_be_given_is_one() -> None:
    def told(scene: lf.Scene | str | Sequence[lf.Scene | str]) -> object:
        return scene

    assert checked(told)(POOL) is POOL
    assert checked(told)([POOL, "a.toml"]) == [POOL, "a.toml"]
    table = lf.Readings.from_arrays(z_m=[1.0, 2.0], value=[1.0, 0.2])
    found = lf.attenuation(table, POOL, trace=False)
    assert found.to_xarray().attenuation.values == pytest.approx([np.log(5.0 / 4.0)])


Tone = Literal["high", "low"]


@checked
def sung(tone: Tone = "low", *, at: Sequence[float] | None = None) -> str:
    """What is checked follows from the type, whatever it is called."""
    return f"{tone} {at}"


def test_a_type_under_another_name_is_checked_too() -> None:
    assert sung("high", at=range(2)) == "high range(0, 2)"
    with pytest.raises(lf.LightfieldError, match=r"tone.*'high' or 'low'"):
        sung("middle")
    with pytest.raises(lf.LightfieldError, match=r"at.*a list of numbers"):
        sung(at=["a"])  # type: ignore[list-item]


@pytest.mark.parametrize("function", [lf.render, lf.compare, lf.band, lf.picture])
@pytest.mark.parametrize("seed", [-1, 1.5, float("nan"), 2**31, True])
def test_a_seed_is_held_to_one_range_everywhere(function: Any, seed: object) -> None:
    with pytest.raises(lf.LightfieldError, match=r"seed: not what this argument takes"):
        function(lf.Scene(), seed=seed)


def test_a_range_that_is_no_list_and_a_column_that_there_is_not() -> None:
    with pytest.raises(lf.LightfieldError, match="not a range"):
        lf.sweep(lf.Scene(), {"water.absorption_per_m": 0.1}, "nowhere.zarr")
    with pytest.raises(lf.LightfieldError, match="no such column; found 'temperature'"):
        lf.Readings.from_arrays(z_m=[1.0, 2.0], value=[2.0, 1.0], temperature=20.0)
