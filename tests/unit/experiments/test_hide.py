"""What is hidden is what was asked for, and the truth is a possible scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lightfield.diagnosis.problem.layout import layout_of
from lightfield.errors import UsageError
from lightfield.experiments.hide import Secret, draw_effect, hide, true_scene
from lightfield.experiments.layouts import scan
from lightfield.experiments.measure import Instrument
from lightfield.experiments.unknowns import draw
from lightfield.readings import Readings
from lightfield.scene import Scene


@pytest.mark.parametrize("x_m", [[0.0, 0.0, 0.0], [-0.02, 0.0, 0.02]])
def test_no_shadow_falls_on_readings_that_are_not_across_the_beam(x_m: list[float]) -> None:
    table = Readings.from_arrays(x_m=x_m, z_m=[1.0, 1.5, 2.0], value=np.ones(3))
    with pytest.raises(UsageError, match=r"unknown:shadow: x from .*layout that goes across"):
        draw("unknown:shadow", layout_of(table), np.random.default_rng(0))


def test_water_clearer_than_its_base_stays_possible() -> None:
    """Pure water absorbs 0.042 /m at 525 nm: a guess of 0.04 /m less must not become less than none."""
    scene = Scene.from_dict(
        {
            "water": {"base": "pure", "absorption_per_m": -0.04},
            "detector": {"planes_m": [4.5], "bands_nm": [[520, 530]]},
        }
    )
    for seed in range(8):
        assert -0.04 < true_scene(scene, {}, np.random.default_rng(seed)).water.absorption_per_m < 0


def test_a_form_of_an_effect_is_hidden_by_its_name() -> None:
    """The first form unless another is named."""
    scene, rng = Scene(), np.random.default_rng(0)
    table = scan(scene, "line", "random", rng)
    assert set(draw_effect(scene, table, "water_gradient", rng)) == {"water.gradient_per_m2"}
    assert "water.layer_absorption_per_m" in draw_effect(scene, table, "water_gradient:layer", rng)


def test_any_number_of_effects_and_another_lamp(tmp_path: Path) -> None:
    """Five at once, and a lamp whose beam is a flat top of 4 degrees: dark beyond it but for the background,
    as no Gaussian is that is bright at 3.5 degrees. The scene that is told knows of none of them."""
    table = tmp_path / "flat.csv"
    rows = [(0, 1), (3.9, 1), (4.1, 0), (90, 0)]
    table.write_text("angle_deg,intensity\n" + "".join(f"{a},{i}\n" for a, i in rows))
    names = ("beam_offset", "lamp_drift", "saturation", "water_gradient", "background")
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 4.0}, "water": {"absorption_per_m": 0.1}})
    secret = Secret(names, values={"lamp.offset_x_m": 0.0, "detector.background": 0.01}, lamp=table)
    made = hide(scene, secret, 1, Instrument(0.005), layout="line", max_photons=1e4)
    assert made.truth["hidden"] == list(names) and made.truth["lamp"] == "flat.csv"
    assert made.believed == scene
    far = made.readings
    angle = np.degrees(np.arctan2(np.abs(far.x_m), far.z_m))
    for z in np.unique(far.z_m):
        plane = far.z_m == z
        bright = far.value[plane & (angle < 3.5)]
        assert bright.min() > 5 * far.value[plane & (angle > 4.5)].max()


def test_it_reads_at_the_places_of_a_table() -> None:
    """In its order where it is read as listed; the colours of one place are one reading."""
    scene = Scene.from_dict({"detector": {"planes_m": [4.5]}})
    table = Readings.from_arrays(
        x_m=[0.3, 0.3, -0.2], z_m=[5.0, 5.0, 4.0], wavelength_nm=[500, 540, 500], value=np.ones(3),
        quantity="irradiance", scale="relative",
    )  # fmt: skip
    made = hide(scene, Secret(), 0, Instrument(0.005), layout=table, order="plane", max_photons=1e3)
    assert made.readings.x_m.tolist() == [0.3, -0.2] and made.readings.z_m.tolist() == [5.0, 4.0]
    assert made.truth["layout"] == "table"


def test_what_can_only_shrink_is_hidden_smaller() -> None:
    """A scene that states a full surface leaves no room above it: what is hidden differs from it still."""
    tank = {"width_m": 2.0, "depth_m": 1.0, "length_m": 6.0, "surface": "flat"}
    scene = Scene.from_dict({"tank": tank, "detector": {"planes_m": [1.5, 2.5, 3.5]}})
    table = scan(scene, "line", "random", np.random.default_rng(0))
    for seed in range(8):
        drawn = draw_effect(scene, table, "surface_reflection", np.random.default_rng(seed))
        assert drawn["tank.surface_reflectance"] < 1


def test_a_lamp_of_a_table_has_no_guess_of_its_width(tmp_path: Path) -> None:
    (tmp_path / "lamp.csv").write_text("angle_deg,intensity\n0,1\n8,0.5\n20,0\n")
    lamp = {"profile": "table", "intensity_table": str(tmp_path / "lamp.csv")}
    scene = Scene.from_dict({"lamp": lamp, "detector": {"planes_m": [2.0, 3.0]}})
    truth = hide(scene, Secret(), 0, Instrument(0.005), max_photons=1e3).truth
    assert "lamp.hwhm_deg" not in truth and "water.absorption_per_m" in truth
