"""A tank without its water, held against what readings in air see."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from perturbed import changed

from lightfield.errors import SceneError
from lightfield.formula.closed_form import direct_field
from lightfield.formula.in_air import in_air
from lightfield.scene import Scene
from lightfield.scene.acts import Acts
from lightfield.scene.all_parameters import neutral_values, paths_on

TURBID = {
    "tank": {"width_m": 3.0, "length_m": 9.0, "depth_m": 2.0, "surface": "flat", "wall_albedo": 0.1},
    "water": {"base": "pure", "scattering_per_m": 0.2, "chlorophyll_mg_per_m3": 1.0},
    "detector": {"planes_m": [2.0, 4.0]},
}


def scene(**lamp: object) -> Scene:
    return Scene.model_validate(TURBID | {"lamp": {"hwhm_deg": 5.0, **lamp}})


@pytest.mark.parametrize("index", [1.0, 1.34])
def test_its_light_is_that_of_readings_in_air(index: float) -> None:
    """The reading table's own air: no attenuation and I(theta / n) / n^2, its factor left to the gain."""
    wet = scene(window_index=index)
    x, z = np.array([0.0, 0.1, 0.3, 0.0, 0.2]), np.array([2.0, 2.0, 2.0, 4.0, 4.0])
    in_water = direct_field(wet, x, 0 * x, z)
    read = direct_field(wet, x, 0 * x, z, medium=np.repeat("air", 5))
    dry = direct_field(in_air(wet), x, 0 * x, z)
    assert dry == pytest.approx(index**2 * read, rel=1e-12)
    assert (dry > 1.5 * in_water).all()


@pytest.mark.parametrize("path", [p for p in paths_on(Acts.BEAM) if p in neutral_values(Acts.BEAM)])
def test_every_field_of_the_beam_is_as_wide_in_air_or_is_refused(path: str) -> None:
    """The same light as of readings in air, beside the axis: what no width makes wider is not known there."""
    skirt = {"profile": "two-component", "skirt_fraction": 0.1}
    wet = changed(scene(window_index=1.34, **skirt), path)
    at = np.array([0.0, 0.1, 0.3, -0.2]), np.array([0.0, 0.2, -0.1, 0.0]), np.array([2.0, 2.0, 2.0, 4.0])
    try:
        dry = direct_field(in_air(wet), *at)
    except SceneError as error:
        assert error.where == "lamp.window_index"
        assert path == "lamp.apparent_distance_m"
        return
    read = direct_field(wet, *at, medium=np.repeat("air", 4))
    assert dry == pytest.approx(1.34**2 * read, rel=1e-12)


def test_nothing_of_the_water_is_left() -> None:
    wet = scene()
    dry = in_air(wet)
    assert dry.water == type(dry.water)() and not dry.surface_reflects
    assert dry.tank is not None and dry.tank.wall_albedo == 0.1, "walls stay"


def test_tables_and_formulas_of_the_angle_are_as_wide_too(tmp_path: Path) -> None:
    own = {"name": "ring", "stage": "source", "formula": "1 + a*theta"}
    own["parameters"] = {"a": {"range": [0.0, 1.0], "neutral": 0.0, "value": 0.3}}
    table = tmp_path / "beam.csv"
    table.write_text("angle_deg,intensity\n0,1\n4,0.7\n9,0.1\n12,0\n")
    ring = Scene.model_validate(scene(window_index=1.34).model_dump() | {"effect": [own]})
    tabulated = scene(window_index=1.34, profile="table", intensity_table=str(table))
    at = np.array([0.0, 0.1, 0.3, -0.2]), np.array([0.0, 0.2, -0.1, 0.0]), np.array([2.0, 2.0, 2.0, 4.0])
    for wet in (ring, tabulated):
        read = direct_field(wet, *at, medium=np.repeat("air", 4))
        assert direct_field(in_air(wet), *at) == pytest.approx(1.34**2 * read, rel=1e-3)


def test_a_beam_that_a_window_would_bend_unknown() -> None:
    with pytest.raises(SceneError, match="window_index"):
        in_air(scene(window_index=1.34, apparent_distance_m=0.5))
