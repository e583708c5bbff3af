"""Light at places that lag behind the motion of the detector."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lightfield.fitting.forward import SceneForward
from lightfield.fitting.light_source import beyond_table
from lightfield.formula.scattered.scattered_field import ScatteredField
from lightfield.readings import Readings
from lightfield.render.at_readings import rendered_light
from lightfield.scene import Scene

LAG_M = 0.004
CLEAR = Scene.from_dict({"lamp": {"hwhm_deg": 5.0}, "water": {"absorption_per_m": 0.1}})
TURBID = CLEAR.with_values({"water.scattering_per_m": 0.3})


def to_and_fro() -> Readings:
    row = np.linspace(-0.6, 0.6, 9)
    x = np.concatenate([row, row[::-1]])
    z = np.repeat([4.0, 6.0], 9)
    return Readings.from_arrays(
        x_m=x, z_m=z, value=np.ones(18), time_s=10.0 * np.arange(18), quantity="irradiance"
    )


def where_it_reads(table: Readings) -> Readings:
    """The same without times, at the places that are read: each row behind along its own direction."""
    x = table.x_m - LAG_M * np.repeat([1.0, -1.0], 9)
    return replace(table, x_m=x, time_s=np.full(18, np.nan))


class WithoutPhotons:
    """Scattered light at the places that it is asked for, by quadrature; it knows nothing of slopes."""

    def __init__(self, *places: np.ndarray) -> None:
        self.field = ScatteredField(*places)

    def light(self, scene: Scene, wavelengths_nm: Sequence[float | None]) -> np.ndarray:
        return self.field.light(scene, wavelengths_nm)


def predicted(scene: Scene, table: Readings) -> np.ndarray:
    return SceneForward(scene, table, lambda _, *places, **options: WithoutPhotons(*places)).predict({})


@pytest.mark.parametrize("scene", [CLEAR, TURBID])
def test_light_is_that_of_the_places_behind(scene: Scene) -> None:
    """Straight light exactly; scattered light by its slope, to 3 % of what the lag changes at most."""
    table = to_and_fro()
    now = predicted(scene.with_values({"detector.lag_m": LAG_M}), table)
    there, stated = predicted(scene, where_it_reads(table)), predicted(scene, table)
    change = np.abs(there - stated).max()
    assert np.abs(there / stated - 1).max() > 0.01
    assert np.abs(now - there).max() < (1e-9 if scene is CLEAR else 0.03) * change


def test_some_of_the_readings_keep_their_motion() -> None:
    """Every other one: from one of them to the next it would be another, at a row's end."""
    table, few = to_and_fro(), np.arange(18) % 3 != 0
    forward = SceneForward(CLEAR, table)
    values = {"detector.lag_m": LAG_M, "gain": 1.0}
    assert forward.subset(few).predict(values) == pytest.approx(forward.predict(values)[few])


def test_a_fresh_render_reads_the_same_places() -> None:
    table = to_and_fro()
    light, _ = rendered_light(CLEAR.with_values({"detector.lag_m": LAG_M}), table)
    there, _ = rendered_light(CLEAR, where_it_reads(table))
    assert light == pytest.approx(there, rel=1e-9)


@pytest.mark.parametrize(
    ("columns", "rows", "beyond"),
    [
        ("angle_deg,intensity", ["0,1", "5,0.5", "9,0.1"], True),  # ends while it is bright
        ("angle_deg,intensity", ["0,1", "5,0.5", "9,0"], False),
        (
            "angle_deg,intensity,error_1",
            ["0,1,0", "5,0.5,0.01", "9,0.1,0.002", "12,0.06,0.05", "30,0.01,0.01"],
            True,
        ),
        # Off by one factor but on the axis: a gain.
        ("angle_deg,intensity,error_1", ["0,1,0", "1,1,0.3", "9,0.5,0.15", "30,0.1,0.03"], False),
    ],
)
def test_readings_that_the_lamps_table_does_not_reach(
    columns: str, rows: list[str], beyond: bool, tmp_path: Path
) -> None:
    """At 10 degrees and more; those at up to 8 it knows."""
    table = tmp_path / "lamp.csv"
    table.write_text("\n".join([columns, *rows]) + "\n", encoding="utf-8")
    scene = CLEAR.with_values({"lamp.profile": "table", "lamp.intensity_table": str(table)})
    angle = np.array([2.0, 4.0, 6.0, 8.0, 16.0, 20.0])
    readings = Readings.from_arrays(
        x_m=3 * np.tan(np.radians(angle)), z_m=np.full(6, 3.0), value=np.ones(6), quantity="irradiance"
    )
    np.testing.assert_array_equal(beyond_table(scene, readings), beyond & (angle > 10))
