"""The table of effects is data about the scene: entries name what exists and say all they must."""

from __future__ import annotations

from importlib.metadata import EntryPoint

import numpy as np
import pytest
from repository import ROOT

from lightfield.diagnosis.problem.candidates import Setting
from lightfield.diagnosis.problem.layout import layout_of
from lightfield.errors import UsageError
from lightfield.fitting import effects
from lightfield.fitting.diffuse_light import has_diffuse_light
from lightfield.fitting.effects import Effect, Form, Free, lamp, registry
from lightfield.fitting.parameter import FitParameter
from lightfield.readings import Readings
from lightfield.scene import Scene
from lightfield.scene.acts import Acts
from lightfield.scene.all_parameters import acts_on
from lightfield.scene.lamp.profile import radial_intensity

TABLE = ROOT / "scenes" / "dive_lamp" / "true_lamp.csv"

WITH_TANK = Scene.from_dict({"tank": {}})
REQUIRED = set(
    [
        "apparent_source",
        "beam_offset",
        "beam_tilt",
        "beam_shape",
        "beam_skirt",
        "beam_ellipticity",
        "table_width",
        "beam_asymmetry",
        "lamp_drift",
        "scattering",
        "water_gradient",
        "spectral_hardening",
        "cdom",
        "chlorophyll",
        "sediment",
        "wall_reflection",
        "surface_reflection",
        "floor_reflection",
        "end_reflection",
        "pane_reflection",
        "waves",
        "background",
        "saturation",
        "acceptance",
        "detector_tilt",
        "window_refraction",
        "lamp_power",
        "immersion",
        "water_drift",
        "settling",
        "stratification",
        "lamp_size",
        "cosine_error",
        "stray_light",
        "second_order",
        "wavelength_shift",
    ]
)


@pytest.fixture
def fresh_table():
    effects.table.cache_clear()
    yield
    effects.table.cache_clear()


def third_party(monkeypatch: pytest.MonkeyPatch, value: object) -> None:
    class Fake(EntryPoint):
        def load(self):
            return value

    point = Fake("mine", "mine:EFFECT", effects.ENTRY_POINT_GROUP)
    monkeypatch.setattr(registry, "entry_points", lambda group: [point])


def test_all_effects_are_there() -> None:
    assert set(effects.table()) >= REQUIRED


def test_an_effect_is_found_beside_its_part_of_the_scene() -> None:
    """The module of the effects has the name of the part; what is seen in air alone has its own."""
    for part in registry._PARTS:
        name = part.__name__.rpartition(".")[2]
        for effect in part.EFFECTS:
            in_air = all(acts_on(path) == Acts.AIR for path in effect.paths)
            assert in_air == (name == "air"), effect.name
            assert {path.split(".")[0] for path in effect.paths} == {"lamp" if in_air else name}, effect.name


def test_effects_free_parameters_of_the_scene() -> None:
    water = {"phase": {"type": "fournier-forand"}}  # whose slope is free in a scene that states it
    known = WITH_TANK.parameters() | Scene.from_dict({"water": water}).parameters()
    for effect in effects.table().values():
        for path in effect.paths:
            assert path in known, (effect.name, path)


def test_amplitudes_are_neutral_in_a_plain_scene() -> None:
    """An amplitude starts where the scene's own description says that the effect is off.

    But for the lamp's power, which no value switches off: there the effect is another power than the scene's.
    """
    known = WITH_TANK.parameters()
    assert known["lamp.power_w"].neutral is None
    for effect in effects.table().values():
        if effect.name == "lamp_power":
            continue
        for form in effect.forms:
            for free in form.amplitudes:
                assert known[free.path].neutral == WITH_TANK.get(free.path), (effect.name, free.path)


def test_every_effect_says_how_to_check_it() -> None:
    for effect in effects.table().values():
        for text in (effect.physics, effect.signature, effect.laboratory):
            assert text.endswith(".") and len(text) > 20, effect.name


def test_second_forms_exist_where_nature_has_two() -> None:
    """Linear drift or warm-up, gradient or layer, two kinds of saturation."""
    for name in ("lamp_drift", "water_gradient", "saturation"):
        assert len(effects.get(name).forms) == 2
    ambient = [form.name for form in effects.get("background").forms]
    assert ambient == ["constant", "drifting", "switched", "on for a while"]


def test_a_package_can_add_an_effect(monkeypatch: pytest.MonkeyPatch, fresh_table: None) -> None:
    mine = Effect(
        "power_error", "source", (Form("factor", (Free("lamp.power_w", 1.0, 100.0, 1.0),)),), "P.", "S.", "L."
    )
    third_party(monkeypatch, lambda: [mine])
    assert effects.get("power_error") is mine


def test_a_package_cannot_replace_an_effect(monkeypatch: pytest.MonkeyPatch, fresh_table: None) -> None:
    third_party(monkeypatch, effects.get("background"))
    effects.table.cache_clear()
    with pytest.raises(UsageError, match="gives an effect the name of another"):
        effects.table()


def test_a_package_that_gives_something_else_is_named(
    monkeypatch: pytest.MonkeyPatch, fresh_table: None
) -> None:
    third_party(monkeypatch, [42])
    with pytest.raises(UsageError, match="mine:EFFECT"):
        effects.table()


def test_a_package_that_fails_or_mistypes_a_path_is_named(
    monkeypatch: pytest.MonkeyPatch, fresh_table: None
) -> None:
    def broken() -> None:
        raise ModuleNotFoundError("No module named 'gone'")

    third_party(monkeypatch, broken)
    with pytest.raises(UsageError, match=r"mine:EFFECT.*No module named"):
        effects.table()
    third_party(
        monkeypatch, Effect("odd", "source", (Form("f", (Free("lamp.hwhm_dge", 1.0, 9.0, 1.0),)),), *"PSL")
    )
    with pytest.raises(UsageError, match=r"odd frees a parameter.*did you mean lamp\.hwhm_deg"):
        effects.table()


def test_an_unknown_name_lists_the_known_ones() -> None:
    with pytest.raises(UsageError, match="beam_tilt"):
        effects.get("beam_tlit")
    with pytest.raises(UsageError, match="linear in z, layer"):
        effects.get_form("water_gradient:lair")


def test_diffuse_light_is_not_combined_with_what_needs_directions() -> None:
    assert not effects.get("acceptance").combines_with(effects.get("scattering"))
    assert effects.get("background").combines_with(effects.get("scattering"))


def test_what_makes_scattered_or_reflected_light_says_so() -> None:
    """Only then is an explanation judged under the errors of that light."""
    for effect in effects.table().values():
        for form in effect.forms:
            lit = {free.path: free.typical for free in form.amplitudes}
            assert has_diffuse_light(WITH_TANK.with_values(lit, validate=False)) == effect.diffuse, (
                effect.name
            )


def test_a_curve_is_never_beside_what_it_contains() -> None:
    """Either way round; named effects contain none."""
    form = (Form("terms", (Free("lamp.shape_exponent", 1.0, 8.0, 0.1),)),)
    curve = Effect("curve", "beam shape", form, "", "", "", contains=("beam_shape", "beam_skirt"))
    shape, tilt = effects.get("beam_shape"), effects.get("beam_tilt")
    assert curve.is_free_form and not shape.is_free_form
    assert not curve.combines_with(shape) and not shape.combines_with(curve)
    assert curve.combines_with(tilt) and tilt.combines_with(curve)


def test_shapes_of_a_gaussian_need_a_beam_that_is_one():
    """With a measured beam the parameters of both change nothing (`radial_intensity`)."""
    needs = {one.name: one.needs for one in lamp.EFFECTS}
    assert all("formula_beam" in needs[name] for name in ("beam_shape", "beam_skirt"))
    named = {"lamp.shape_exponent": 4.0, "lamp.skirt_fraction": 0.3}
    measured = Scene.from_dict({"lamp": {"profile": "table", "intensity_table": str(TABLE)}})
    angles = np.linspace(0, 0.3, 7) ** 2
    same = radial_intensity(measured.with_values(named).lamp, angles)
    np.testing.assert_array_equal(same, radial_intensity(measured.lamp, angles))


@pytest.mark.parametrize("u", [0.0, 1e-12, 1e-8, 1e-5, 3e-3, 25.0])
def test_a_width_that_a_fit_may_reach_is_one_that_a_scene_takes(u: float) -> None:
    """A fit moves (10/value)^2 from 0, infinitely wide: near it every width is an honest one."""
    (free,) = effects.get("acceptance").forms[0].amplitudes
    width = FitParameter(free.path, free.low, free.high, free.low, 1e-3, "inverse-square")
    scene = Scene().with_values({free.path: width.value(u)})
    theta = np.radians(20.0)
    hwhm = np.radians(scene.detector.acceptance_hwhm_deg)
    told = np.exp(-np.log(2) * (theta / hwhm) ** 2) if hwhm else 1.0
    assert told == pytest.approx(np.exp(-np.log(2) * theta**2 * u / np.radians(10.0) ** 2), rel=1e-7)


def test_a_name_of_ones_own_means_what_its_scene_says() -> None:
    """Whatever other scenes were asked about before."""
    one, other = (Scene.from_dict({"effect": [own_effect(physics)]}) for physics in ("A rope.", "A fish."))
    assert effects.all_of(one)["shade"].physics != effects.all_of(other)["shade"].physics
    assert effects.get("shade", one).physics.startswith("A rope.")
    assert effects.get_form("shade", other)[0].physics.startswith("A fish.")
    with pytest.raises(UsageError, match="unknown effect"):
        effects.get("shade")


def own_effect(physics: str) -> dict[str, object]:
    size = {"range": [-0.3, 0.3], "neutral": 0.0, "typical": 0.05}
    formula = {"stage": "path", "formula": "1 - a*(x > 0)", "parameters": {"a": size}}
    return {"name": "shade", "family": "path", "physics": physics, **formula}


def test_a_source_in_front_of_the_window_is_possible_beside_the_planes_of_the_scene() -> None:
    """Which may be nearer than the readings: at the end of what is tried the scene is one."""
    scene = Scene.from_dict({"detector": {"planes_m": [1.0, 2.0]}})
    table = Readings.from_arrays(z_m=[4.0, 6.0, 8.0, 9.0], value=[4.0, 2.0, 1.0, 0.8])
    setting = Setting(scene, layout_of(table), 1.0, 50.0)
    form = effects.get("apparent_source").forms[1]
    (free,) = form.amplitudes
    factor, offset = setting.scale(free.per)
    nearest = scene.with_values({free.path: free.low * factor + offset})
    assert nearest.lamp.apparent_distance_m == pytest.approx(-0.05)
