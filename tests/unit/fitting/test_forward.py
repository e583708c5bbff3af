"""Readings and their errors put together from light in several colours, in water and in air."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from perturbed import changed

from lightfield.fitting.forward import SceneForward
from lightfield.formula.closed_form import predict
from lightfield.formula.readout import time_factor
from lightfield.readings import Readings
from lightfield.scene import Scene

COLOURS = (450.0, 550.0, 650.0)
#: Rows of the table, one of 450 nm before all others.
OF_BLUE_FIRST = np.array([1, 0, 2, 3, 4, 5])


class Glow:
    """Diffuse light of as many m^-2 as its wavelength in nm has hundreds; 1 % and 2 % of it are errors."""

    def light(self, scene: Scene, wavelengths_nm: Sequence[float | None]) -> np.ndarray:
        return np.array([np.full(6, (w or 0.0) / 100) for w in wavelengths_nm])

    def errors(
        self, scene: Scene, wavelengths_nm: Sequence[float | None], channel: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        mine = self.light(scene, wavelengths_nm)[channel, np.arange(6)]
        return np.diag(0.01 * mine), 0.02 * mine

    def with_denser(self, other: Glow) -> Glow:
        return self


def table() -> Readings:
    return Readings.from_arrays(
        x_m=np.zeros(6), y_m=np.zeros(6), z_m=np.full(6, 5.0), value=np.ones(6),
        stderr=np.full(6, 0.01), time_s=60.0 * np.arange(6),
        wavelength_nm=np.array([650.0, 450.0, 550.0, 450.0, 650.0, 550.0]),
        medium=np.array(["water", "water", "air", "air", "water", "water"]), quantity="irradiance",
    )  # fmt: skip


def glowing(asked: list[dict[str, Any]] | None = None, **budget: Any) -> SceneForward:
    def source(scene: Scene, *places: np.ndarray, **options: Any) -> Glow:
        if asked is not None:
            asked.append(options)
        return Glow()

    scene = Scene.from_dict({"water": {"absorption_per_m": 0.1, "scattering_per_m": 0.1}})
    return SceneForward(scene, table(), partial(source, **budget) if budget else source)


def test_every_reading_has_the_light_and_the_error_of_its_own_colour() -> None:
    """Gains 2, 3 and 4 for the three colours; nothing scatters in air."""
    forward = glowing()
    gains = dict(zip(forward.gains.names, (2.0, 3.0, 4.0), strict=True))
    dark = SceneForward(forward.scene, table())
    more = forward.predict(gains) - dark.predict(gains)
    expected = np.array([4 * 6.5, 2 * 4.5, 0.0, 0.0, 4 * 6.5, 3 * 5.5])
    assert more == pytest.approx(expected, rel=1e-9)
    modes, smooth = forward.errors(gains)
    assert np.linalg.norm(modes, axis=1) == pytest.approx(0.01 * expected)
    assert smooth == pytest.approx(0.02 * expected)


def test_what_was_predicted_before_changes_nothing() -> None:
    """Scenes, lamp power and curves are remembered: a model that was never asked gives the same bits."""
    x = np.linspace(-1.0, 1.0, 21)
    readings = Readings.from_arrays(
        x_m=np.tile(x, 3), z_m=np.repeat([3.0, 4.0, 6.0], 21), value=np.exp(-4 * np.tile(x, 3) ** 2),
        stderr=np.full(63, 0.01), time_s=60.0 * np.arange(63),
    )  # fmt: skip
    scene = Scene.from_dict({"water": {"absorption_per_m": 0.1}})
    forward = SceneForward(scene, readings)
    changes = {
        "gain": 2.0, "lamp.hwhm_deg": 5.0, "lamp.drift_per_hour": 0.1, "detector.background": 0.01,
        "lamp.profile_departure.1": 0.2, "lamp.profile_departure.2": -0.1, "lamp.power_departure.1": 0.1,
    }  # fmt: skip
    names = list(changes)
    for order in (names, names[::-1], names[3:] + names[:3]):
        asked: dict[str, float] = {}
        for name in order:
            asked[name] = changes[name]
            assert (forward.predict(asked) == SceneForward(scene, readings).predict(asked)).all()


ABSOLUTE = Scene.from_dict(
    {
        "lamp": {"profile": "two-component", "skirt_fraction": 0.1, "warmup_fraction": 0.1},
        "water": {"absorption_per_m": 0.1, "layer_absorption_per_m": 0.05, "settling_per_m": 0.05},
        "detector": {"background": 0.1},
    }
)


@pytest.mark.parametrize("path", [p for p in ABSOLUTE.parameters() if not p.startswith("detector.p")])
def test_readings_in_a_unit_follow_every_number_of_the_scene(path: str) -> None:
    """What is remembered of a scene is told by what its numbers act on: as in a model of that very scene."""
    readings = replace(table(), scale="absolute", units="W/m^2/nm")
    other = changed(ABSOLUTE, path)
    followed = SceneForward(ABSOLUTE, readings, full=1.0).predict({path: other.get(path)})
    np.testing.assert_allclose(followed, SceneForward(other, readings, full=1.0).predict({}), rtol=1e-12)


def test_readings_of_bands_in_a_unit_are_the_mean_light_of_their_bands() -> None:
    """A blue LED of 10 W in two bands of 50 nm beside its peak, read as `import` writes it: the head states
    the bands. Light at their middles is 1.7 and 0.13 times as much; on the axis, through clear water."""
    lamp = {"spectrum": {"peak_nm": 470.0, "fwhm_nm": 25.0}, "power_w": 10.0, "hwhm_deg": 6.0}
    bands = [[450.0, 500.0], [500.0, 550.0]]
    scene = Scene.from_dict({"lamp": lamp, "detector": {"bands_nm": bands}})
    columns = {"z_m": [2.0, 2.0], "wavelength_nm": [475.0, 525.0], "value": [1.0, 1.0]}
    theta = np.linspace(0, np.pi / 2, 20_001)
    beam_sr = 2 * np.pi * np.trapezoid(0.5 ** (np.degrees(theta) / 6) ** 2 * np.sin(theta), theta)

    def per_nm(nm: np.ndarray) -> np.ndarray:
        return 10 * np.sqrt(4 * np.log(2) / np.pi) / 25 * 0.5 ** (2 * (nm - 470) / 25) ** 2

    whole = [
        np.trapezoid(per_nm(nm := np.linspace(low, high, 5001)), nm) / (high - low) for low, high in bands
    ]
    for head, light in (({"bands_nm": bands}, whole), ({}, per_nm(np.array([475.0, 525.0])))):
        table = Readings.from_arrays(
            **columns, quantity="irradiance", scale="absolute", units="W m^-2 nm^-1", metadata=head
        )
        found = SceneForward(scene, table).predict({})
        assert found == pytest.approx(np.array(light) / beam_sr / 2.0**2, rel=1e-4)


def test_other_places_are_traced_with_the_share_that_was_asked_for() -> None:
    """The share goes to the source, and with a source that has a budget of its own it is a share of that."""
    asked: list[dict[str, Any]] = []
    there = {name: np.zeros(6) for name in ("x_m", "y_m")} | {"z_m": np.full(6, 4.0)}
    for share in (1.0, 0.25):
        glowing(asked).at(share, **there).predict({})
    assert asked == [{}, {"share": 0.25}]
    glowing(asked, photons=1000).at(0.25, **there).predict({})
    assert asked[-1] == {"photons": 1000, "share": 0.25}


def test_light_corrected_by_a_render_is_the_render_there_and_follows_the_model_elsewhere() -> None:
    """A second correction replaces the first; the forward model that it is made from stays as it was."""
    forward, here, there = glowing(), {"water.absorption_per_m": 0.2}, {"water.absorption_per_m": 0.3}
    plain = forward.predict(there)
    render = np.linspace(0.5, 1.0, 6) * forward.predict(here)
    first = forward.light.corrected(3 * render, np.zeros(6), here)
    for light in (forward.light, first):
        corrected = forward.with_light(light.corrected(render, 0.01 * render, here))
        assert corrected.predict(here) == pytest.approx(render)
        factor = render / forward.predict(here)
        assert corrected.predict(there) == pytest.approx(factor * plain)
        modes, smooth = corrected.errors(here)
        own, expected = forward.errors(here)
        more = np.linalg.norm(modes, axis=1) ** 2 - (factor * np.linalg.norm(own, axis=1)) ** 2
        assert np.sqrt(more) == pytest.approx(0.01 * render)
        assert smooth == pytest.approx(factor * expected)
    assert forward.predict(there) == pytest.approx(plain, rel=1e-15)


def test_errors_of_the_lamps_table_are_what_another_table_makes(tmp_path: Path) -> None:
    """Readings by a table that is off by a stated error, less those by the table: a tilted, oval beam whose
    lamp fades, some readings in air behind a window, on the axis too, where a table has no error."""

    def forward(off: float) -> SceneForward:
        angle = np.linspace(0.0, 60.0, 31)
        error = 0.01 * (1 - np.cos(np.radians(6 * angle)))
        lines = [
            f"{a:.6g},{i + off * e:.10g},{e:.10g}"
            for a, i, e in zip(angle, np.exp2(-((angle / 12) ** 2)), error, strict=True)
        ]
        path = tmp_path / f"lamp{off}.csv"
        path.write_text("\n".join(["angle_deg,intensity,error_1", *lines]), encoding="utf-8")
        lamp = {
            "profile": "table", "intensity_table": str(path), "ellipticity": 1.2, "tilt_x_deg": 2.0,
            "window_index": 1.33, "drift_per_hour": -0.3,
        }  # fmt: skip
        z_m = np.repeat([2.0, 4.0], 4)
        table = Readings.from_arrays(
            x_m=[0.0, 0.3, -0.5, 0.2, 0.0, 0.8, -0.6, 0.1], y_m=[0.0, 0.1, 0.3, -0.6, 0.4, 0.0, 0.9, -0.2],
            z_m=z_m, value=np.ones(8), stderr=np.full(8, 0.01), time_s=600.0 * np.arange(8),
            medium=["water", "air"] * 4, quantity="irradiance",
        )  # fmt: skip
        return SceneForward(Scene.from_dict({"lamp": lamp, "water": {"absorption_per_m": 0.1}}), table)

    values, stated = {"gain": 3.0}, forward(0.0)
    change = forward(1.0).predict(values) - stated.predict(values)
    assert np.abs(change / stated.predict(values)).max() > 0.01
    # Between its angles a beam is known to a part in ten thousand.
    off_by = np.abs(stated.lamp_errors(values)[:, 0] - change)
    assert (off_by <= 2e-3 * np.abs(change) + 1e-4 * stated.predict(values)).all()


def test_elsewhere_a_reading_has_the_gain_of_its_colour() -> None:
    """Light of the closed form at 450 nm times 3, the gain of that colour, not 1, that of none."""
    whole = SceneForward(Scene.from_dict({"water": {"absorption_per_m": 0.1}}), table().subset(OF_BLUE_FIRST))
    gains = {"gain.450nm": 3.0, "gain.550nm": 5.0, "gain.650nm": 7.0}
    assert set(whole.gains.names) == set(gains)
    z = np.array([4.0, 6.0])
    there = whole.at(x_m=0 * z, y_m=0 * z, z_m=z, medium=np.array(["water", "water"]), time_s=0 * z)
    assert there.predict(gains) == pytest.approx(3 * np.exp(-0.1 * z) / z**2, rel=1e-12)


#: An effect of the user's own at every stage: what each of them changes is kept for another time.
AT_EVERY_STAGE = {
    "angle": ("source", "1 + a*theta/10", {}),
    "power": ("source", "1 + a*time/600", {}),
    "path": ("path", "1 - a*exp(-((x - x0)/0.2)**2)", {"x0": {"range": [-0.5, 0.5]}}),
    "receiver": ("receiver", "1 + a*theta/20", {}),
    "readout": ("readout", "signal + a*signal**2*cos(theta)", {}),
}


def test_one_model_follows_effects_of_the_user_at_every_stage() -> None:
    """Asked again and again, where the lamp moves too: as of a scene that is new each time."""
    effects = [
        {"name": name, "stage": stage, "formula": formula,
         "parameters": {"a": {"range": [-0.5, 0.5], "neutral": 0.0}} | more}
        for name, (stage, formula, more) in AT_EVERY_STAGE.items()
    ]  # fmt: skip
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 6.0}, "effect": effects})
    there = Readings.from_arrays(
        x_m=np.tile(np.linspace(-0.6, 0.6, 7), 2), z_m=np.repeat([4.5, 7.0], 7), value=np.ones(14),
        time_s=60.0 * np.arange(14), quantity="irradiance",
    )  # fmt: skip
    forward, rng = SceneForward(scene, there, full=1.0), np.random.default_rng(0)
    free = {f"effect.{name}.a": 0.3 for name in AT_EVERY_STAGE} | {
        "effect.path.x0": 0.2,
        "lamp.offset_x_m": 0.1,
    }
    values = dict.fromkeys(free, 0.0)
    for path in rng.permutation(np.repeat(list(free), 3)):
        values[path] = float(rng.uniform(0, free[path]))
        before, found = forward.predict({**values, path: 0.0}), forward.predict(values)
        assert found == pytest.approx(predict(scene.with_values(values), there, full=1.0), rel=1e-12)
        assert path == "effect.path.x0" or np.abs(found / before - 1).max() > 1e-4


def test_an_effect_of_the_user_makes_no_other_lamp_power(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the lamp does in time is worked out once, whatever values their parameters take."""
    effect = {
        "name": "rope", "stage": "path", "formula": "1 - a*exp(-x**2)",
        "parameters": {"a": {"range": [-0.5, 0.5], "neutral": 0.0}},
    }  # fmt: skip
    forward, asked = SceneForward(Scene.from_dict({"effect": [effect]}), table()), list[Scene]()

    def counted(scene: Scene, time_s: Any) -> np.ndarray:
        asked.append(scene)
        return time_factor(scene, time_s)

    monkeypatch.setattr("lightfield.fitting.reader.time_factor", counted)
    dim, bright = (forward.predict({"effect.rope.a": a, "lamp.drift_per_hour": 0.1}) for a in (0.3, -0.3))
    assert (dim < bright).all() and len(asked) == 1
