"""A beam whose width has a colour: lamps of one width, written out, at each wavelength."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from lightfield.formula.closed_form import direct_field
from lightfield.scene import Scene
from lightfield.scene.lamp.colour import colour_by_colour, in_colour
from lightfield.scene.lamp.profile import relative_intensity
from lightfield.scene.lamp.width import half_width_rad

KAPPA, NM = 0.3, 440.0
WIDER = (440.0 / 550.0) ** 0.3
THETA = np.radians(np.linspace(0.0, 20.0, 41))


def lamps(folder: Path) -> list[dict[str, object]]:
    """Each kind of beam, all with a width that has a colour."""
    (folder / "beam.csv").write_text("angle_deg,intensity\n0,1\n4,0.7\n9,0.1\n12,0\n")
    return [
        {"hwhm_deg": 5.0, "ellipticity": 1.3, "tilt_x_deg": 2.0},
        {"profile": "super-gaussian", "shape_exponent": 4.0, "asymmetry_x": 0.2},
        {"profile": "two-component", "skirt_fraction": 0.2, "skirt_hwhm_deg": 11.0,
         "profile_departure": [[0.0, 0.0], [4.0, 0.3], [8.0, -0.2]]},
        {"profile": "table", "intensity_table": str(folder / "beam.csv")},
    ]  # fmt: skip


def test_its_angles_are_so_many_times_as_large(tmp_path: Path) -> None:
    """As the lamp of that colour has them, of every kind of beam; on the axis nothing changes."""
    for given in lamps(tmp_path):
        scene = Scene.from_dict({"lamp": {**given, "width_slope": KAPPA}})
        one = in_colour(scene, NM).lamp
        assert one.width_slope == 0 and one.tilt_x_deg == scene.lamp.tilt_x_deg
        for turn in (0.0, 0.7, 2.0, 4.0):
            x, y = THETA * math.cos(turn), THETA * math.sin(turn)
            plain = relative_intensity(scene.lamp, x, y)
            assert relative_intensity(one, WIDER * x, WIDER * y) == pytest.approx(plain, abs=1e-9)
        assert half_width_rad(one) == pytest.approx(WIDER * half_width_rad(scene.lamp), rel=1e-4)


def test_the_formula_has_the_light_of_that_lamp(tmp_path: Path) -> None:
    """At every reading that of its own wavelength, in water and in air behind a window."""
    x, z = np.array([0.0, 0.2, 0.4, -0.5, 0.3]), np.array([2.0, 3.0, 4.0, 5.0, 1.0])
    nm, medium = np.array([440.0, 550.0, 640.0, 440.0, 640.0]), np.array(["water"] * 3 + ["air"] * 2)
    for given in lamps(tmp_path):
        scene = Scene.from_dict(
            {
                "lamp": {**given, "width_slope": KAPPA, "window_index": 1.33},
                "water": {"absorption_per_m": 0.1},
            }
        )
        found = direct_field(scene, x, 0 * x, z, nm, medium)
        for k, wavelength in enumerate(nm.tolist()):
            alone = direct_field(in_colour(scene, wavelength), x, 0 * x, z, nm, medium)
            assert found[k] == pytest.approx(alone[k], rel=1e-9, abs=1e-12)
    assert found[0] != found[1]


def test_a_reading_without_a_wavelength_has_the_middle_of_the_band() -> None:
    scene = Scene.from_dict({"lamp": {"width_slope": KAPPA}, "detector": {"bands_nm": [[430, 450]]}})
    x, z = np.array([0.2]), np.array([3.0])
    assert direct_field(scene, x, 0 * x, z) == direct_field(scene, x, 0 * x, z, np.array([NM]))
    seen = colour_by_colour(scene, [None, 600.0], lambda one, at: np.array([[one.lamp.hwhm_deg, *at]]))
    width = scene.lamp.hwhm_deg
    assert seen == pytest.approx(np.array([[WIDER * width, NM], [(600 / 550) ** KAPPA * width, 600.0]]))


@pytest.mark.parametrize(("kappa", "off"), [(0.3, 1e-5), (-1.0, 4e-3), (2.0, 0.06)])
def test_light_of_many_wavelengths_is_that_of_each(kappa: float, off: float) -> None:
    """Of six widths, up to three half widths out, on a pedestal; one place is dark, one in narrow beams."""
    scene, asked = Scene.from_dict({"lamp": {"width_slope": kappa}}), []
    theta, nm = np.linspace(0.0, 3 * scene.lamp.hwhm_deg, 31), np.linspace(400.0, 700.0, 24).tolist()

    def light(one: Scene, at: list[float]) -> np.ndarray:
        asked.append(one.lamp.hwhm_deg)
        wide = np.exp(-math.log(2) * (theta / one.lamp.hwhm_deg) ** 2) + 0.01
        edges = [0.0, max(one.lamp.hwhm_deg - scene.lamp.hwhm_deg, 0.0)]
        return np.array([[*(1e-3 * w * wide), *edges] for w in at])

    found = colour_by_colour(scene, nm, light)
    assert len(asked) == 6
    each = np.concatenate([light(in_colour(scene, w), [w]) for w in nm])
    assert found[:, :-2] == pytest.approx(each[:, :-2], rel=off)
    assert not found[:, -2].any() and found[:, -1] == pytest.approx(each[:, -1], abs=0.1 * each[:, -1].max())
