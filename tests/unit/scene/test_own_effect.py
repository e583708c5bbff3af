"""Effects of the user's own in a scene: what they are called, where they act, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lightfield.errors import SceneError
from lightfield.fitting.forward import SceneForward
from lightfield.formula.closed_form import direct_field, predict
from lightfield.formula.own_formulas import lit
from lightfield.formula.vector import direct_flux, on_receivers
from lightfield.readings import Readings
from lightfield.scene import Scene
from lightfield.scene.effects_file import with_effects
from lightfield.scene.lamp.profile import relative_intensity

SHADOW: dict[str, Any] = {
    "name": "shadow",
    "family": "obstruction",
    "stage": "path",
    "formula": "1 - depth*exp(-((x - x0)/width)**2)",
    "parameters": {
        "depth": {"unit": "1", "range": [0.0, 0.9], "neutral": 0.0, "typical": 0.05},
        "x0": {"unit": "m", "range": [-0.5, 0.5]},
        "width": {"unit": "m", "range": [0.02, 0.3]},
    },
}
OF_SHADOW = {"effect.shadow.depth": 0.4, "effect.shadow.x0": 0.1, "effect.shadow.width": 0.2}


def own(
    stage: str, formula: str, name: str = "mine", **parameters: tuple[float, float, float | None]
) -> Scene:
    """A scene with one effect whose parameters are lowest, highest, neutral value."""
    given = {
        key: {"range": [low, high]} | ({} if neutral is None else {"neutral": neutral})
        for key, (low, high, neutral) in parameters.items()
    }
    return Scene.from_dict(
        {"effect": [{"name": name, "stage": stage, "formula": formula, "parameters": given}]}
    )


@pytest.fixture
def table() -> Readings:
    x, z = np.tile(np.linspace(-0.6, 0.6, 9), 3), np.repeat([4.5, 6.0, 8.0], 9)
    return Readings.from_arrays(x_m=x, y_m=0.1 * x, z_m=z, value=np.ones(27), time_s=np.arange(27.0) * 60)


def test_its_numbers_are_parameters_of_the_scene() -> None:
    scene = Scene.from_dict({"effect": [SHADOW]})
    known = scene.parameters()
    depth, place = known["effect.shadow.depth"], known["effect.shadow.x0"]
    assert (depth.unit, depth.low, depth.high, depth.neutral, depth.value) == ("1", 0.0, 0.9, 0.0, 0.0)
    assert (place.unit, place.neutral, place.value) == ("m", None, 0.0)
    for validate in (True, False):
        changed = scene.with_values(OF_SHADOW, validate=validate)
        assert {path: changed.get(path) for path in OF_SHADOW} == OF_SHADOW
        assert Scene.from_toml(changed.to_toml()) == changed
        assert changed.digest() != scene.digest()
    with pytest.raises(SceneError, match=r"did you mean effect\.shadow\.depth"):
        scene.with_values({"effect.shadow.dept": 1.0})
    with pytest.raises(SceneError, match=r"found value = 0\.95; rule: within 0 to 0\.9"):
        scene.with_values({"effect.shadow.depth": 0.95})


def test_a_scene_without_them_has_the_key_that_it_had() -> None:
    assert Scene.from_dict({"effect": []}).digest() == Scene().digest()


def test_a_formula_of_the_path_acts_on_light_that_comes_straight(table: Readings) -> None:
    scene = Scene.from_dict({"effect": [SHADOW], "lamp": {"radius_m": 0.03}}).with_values(OF_SHADOW)
    places = table.x_m, table.y_m, table.z_m
    expected = 1 - 0.4 * np.exp(-(((table.x_m - 0.1) / 0.2) ** 2))
    plain = scene.with_values({"effect.shadow.depth": 0.0})
    np.testing.assert_allclose(direct_field(scene, *places) / direct_field(plain, *places), expected)
    np.testing.assert_array_equal(
        direct_field(plain, *places), direct_field(plain.with_values({"effect": []}), *places)
    )


def test_a_formula_of_the_angle_at_the_source_is_a_lamp_of_another_shape() -> None:
    """In the frame of the beam, tilted as it may be, and once: a lamp that has it needs no formula more."""
    scene = own("source", "1 + a*cos(pi*theta/period)", a=(-0.5, 0.5, 0.0), period=(1.0, 9.0, None))
    scene = scene.with_values({"effect.mine.a": 0.2, "effect.mine.period": 5.0, "lamp.tilt_x_deg": 2.0})
    lamp, bare = lit(scene).lamp, scene.lamp
    theta = np.radians(np.linspace(0, 25, 400))
    ratio = relative_intensity(lamp, theta, 0 * theta) / relative_intensity(bare, theta, 0 * theta)
    np.testing.assert_allclose(ratio, 1 + 0.2 * np.cos(np.pi * np.degrees(theta) / 5), rtol=1e-3)
    assert lit(lit(scene)) == lit(scene) and not lit(scene).effect
    x, z = np.linspace(-0.6, 0.6, 7), np.full(7, 5.0)
    off = np.hypot(np.degrees(np.arctan2(x, z)) - 2.0, 0)
    bare_scene = scene.with_values({"effect": []})
    seen = direct_field(scene, x, 0 * x, z) / direct_field(bare_scene, x, 0 * x, z)
    np.testing.assert_allclose(seen, 1 + 0.2 * np.cos(np.pi * off / 5), rtol=1e-3)


@pytest.mark.parametrize("radius_m", [0.0, 0.03])
def test_the_flux_vector_of_direct_light_has_them_as_the_direct_field_has(radius_m: float) -> None:
    """A beam of another shape and a shadow on the way, at the wavelength that is read."""
    ring = {"name": "ring", "stage": "source", "formula": "1 + a*theta"} | {
        "parameters": {"a": {"range": [0.0, 1.0], "neutral": 0.0, "value": 0.3}}
    }
    red = {"name": "red", "stage": "path", "formula": "1 - a*wavelength/600"} | {
        "parameters": {"a": {"range": [0.0, 1.0], "neutral": 0.0, "value": 0.5}}
    }
    scene = Scene.from_dict(
        {
            "effect": [SHADOW, ring, red],
            "lamp": {"radius_m": radius_m},
            "water": {"base": "pure"},
            "detector": {"bands_nm": [[500.0, 560.0]], "wavelength_shift_nm": 20.0},
        }
    ).with_values(OF_SHADOW)
    place = np.array([[0.0, 0.0, 4.0], [0.1, -0.2, 5.0], [-0.4, 0.1, 6.0], [0.1, 0.0, -1.0]])
    read = on_receivers(direct_flux(scene, place), np.tile([0.0, 0.0, -1.0], (4, 1)))
    np.testing.assert_allclose(read, direct_field(scene, *place.T, np.full(4, 550.0)), rtol=1e-12)


CASES = {
    "source": ("1 + a*time/3600", lambda t, s: 1 + 0.1 * t.time_s / 3600),
    "receiver": ("1 + a*x*z", lambda t, s: 1 + 0.1 * t.x_m * t.z_m),
    "readout": ("signal + a*signal*(1 - signal)", lambda t, s: 1 + 0.1 * (1 - s)),
}


@pytest.mark.parametrize("stage", CASES)
def test_other_stages_act_on_all_light_or_on_readings(stage: str, table: Readings) -> None:
    formula, expected = CASES[stage]
    scene = own(stage, formula, a=(-0.5, 0.5, 0.0))
    forward = SceneForward(scene, table, full=1.0)
    gain = {"gain": 1 / forward.predict({}).max()}
    plain = forward.predict(gain)
    changed = forward.predict({**gain, "effect.mine.a": 0.1})
    np.testing.assert_allclose(changed / plain, expected(table, plain), rtol=1e-12)
    there = scene.with_values({"effect.mine.a": 0.1})
    np.testing.assert_allclose(predict(there, table, gain=gain["gain"], full=1.0), changed, rtol=1e-12)


def broken(**changes: Any) -> dict[str, Any]:
    return {**SHADOW, **changes}


BAD = {
    "an unknown name": (broken(formula="1 - depth*exp(-((x - x0)/breadth)**2)"), "found .breadth."),
    "a variable of another stage": (broken(formula=SHADOW["formula"] + " + 0*signal"), "found .signal."),
    "no formula": (broken(formula="1 - depth*exp("), "what is no formula"),
    "a hostile formula": (broken(formula="__import__('os').system('true')"), "a call of"),
    "not neutral": (broken(formula="depth*x0*width"), "with its neutral values it gives 1"),
    "nothing neutral": (
        broken(parameters={k: {"range": [0.1, 1.0]} for k in SHADOW["parameters"]}),
        "some parameter has a neutral value",
    ),
    "an unused parameter": (
        broken(parameters={**SHADOW["parameters"], "idle": {"range": [0.0, 1.0]}}),
        "without idle",
    ),
    "a name that is taken": (
        broken(formula="1 - r*x", parameters={"r": {"range": [0.0, 1.0], "neutral": 0.0}}),
        "names of their own",
    ),
    "an empty range": (
        broken(parameters={**SHADOW["parameters"], "x0": {"range": [0.5, 0.5]}}),
        "a range must rise",
    ),
    "a neutral value out of range": (
        broken(parameters={**SHADOW["parameters"], "depth": {"range": [0.1, 0.5], "neutral": 0.0}}),
        "found neutral = 0.0; rule: within 0.1 to 0.5",
    ),
    "angle and time": (
        broken(
            stage="source",
            formula="1 + a*theta*time",
            parameters={"a": {"range": [0.0, 1.0], "neutral": 0.0}},
        ),
        "make two effects",
    ),
    "an unknown stage": (broken(stage="lamp"), "stage"),
    "a bad name": (broken(name="My effect"), "name"),
    "an unknown key": (broken(colour="red"), "colour"),
    "no parameters": (broken(parameters={}), "parameters"),
}


@pytest.mark.parametrize("case", BAD)
def test_an_effect_that_cannot_be_is_one_clear_error(case: str) -> None:
    given, says = BAD[case]
    with pytest.raises(SceneError, match=says):
        Scene.from_dict({"effect": [given]})


def test_two_of_one_name_are_refused() -> None:
    with pytest.raises(SceneError, match=r"found name = 'shadow', tables = \[1, 2\];.* remedy: rename all"):
        Scene.from_dict({"effect": [SHADOW, SHADOW]})


def test_a_formula_without_a_value_at_a_reading_says_where() -> None:
    scene = own("path", "1 + a*log(x + 0.5)", a=(0.0, 1.0, 0.0)).with_values({"effect.mine.a": 0.5})
    with pytest.raises(SceneError, match="no finite value at every reading"):
        direct_field(scene, np.array([-0.6, 0.3]), np.zeros(2), np.full(2, 5.0))


def test_a_file_of_effects_has_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(Scene.from_dict({"effect": [SHADOW]}).to_toml())
    scene = with_effects(Scene.from_dict({"lamp": {"hwhm_deg": 5.0}}), path)
    assert scene.lamp.hwhm_deg == 5.0 and [effect.name for effect in scene.effect] == ["shadow"]
    assert with_effects(scene, None) is scene
    with pytest.raises(
        SceneError, match=r"own\.toml: the scene has effects of these names itself; found 'shadow'"
    ):
        with_effects(scene, path)
    path.write_text("[lamp]\nhwhm_deg = 3.0\n")
    with pytest.raises(SceneError, match="not a file of effects"):
        with_effects(Scene(), path)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"parameters": {"a": {"range": [0.3], "neutral": 0.0}}}, "more values than these"),
        ({"parameters": {"a": {"range": [0, 1], "neutral": 0.0, "meening": "x"}}}, "did you mean"),
        ({"formula": "2 + a*x"}, "2 instead of 1"),
        ({"formula": "1 + a*x^2"}, "a power is"),
        ({"formula": "1 \N{MINUS SIGN} a*x"}, "U+2212"),
    ],
)
def test_what_is_wrong_in_a_file_is_named(change: dict[str, object], said: str) -> None:
    """A range of one number was told to have no default, a misspelt key the keys of another table."""
    own = {
        "name": "one",
        "stage": "path",
        "formula": "1 + a*x",
        "parameters": {"a": {"range": [0, 1], "neutral": 0.0}},
    }
    with pytest.raises(SceneError) as raised:
        Scene.from_dict({"effect": [{**own, **change}]})
    assert said in str(raised.value)


def test_one_bracket_too_few_is_told() -> None:
    with pytest.raises(SceneError, match=r"\[\[effect\]\]"):
        Scene.from_dict({"effect": {"name": "one", "stage": "path"}})
