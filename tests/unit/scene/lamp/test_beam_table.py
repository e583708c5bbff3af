"""Beams that are not round, from tables of two angles: against closed forms, and turns of luminaire files."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from beams import ASIDE_DEG, HWHM_DEG, aside, ies, phi_table

from lightfield.arrays import Array
from lightfield.errors import SceneError
from lightfield.scene import Lamp
from lightfield.scene.lamp.frame import has_round_section, is_mirrored
from lightfield.scene.lamp.luminaire_files import all_around
from lightfield.scene.lamp.photometry import BeamTable, beam_table
from lightfield.scene.lamp.profile import relative_intensity, solid_angle_sr
from lightfield.scene.lamp.tabulated import save_intensity
from lightfield.scene.lamp.width import stated_width_deg

PLACES = np.random.default_rng(2).uniform(-0.35, 0.35, (2, 3000))


def table(path: Path) -> Lamp:
    return Lamp(profile="table", intensity_table=str(path))


def test_a_table_that_is_written_anew_is_another_beam(tmp_path: Path) -> None:
    """Of the same scene, and of the same path: what a notebook keeps is not that of the file before."""
    path, angle = tmp_path / "lamp.csv", np.linspace(0.0, 90.0, 901)
    seen = []
    for hwhm_deg in (5.0, 10.0):
        light = np.exp(-math.log(2) * (angle / hwhm_deg) ** 2)
        rows = (f"{a:g},{i:.8g}" for a, i in zip(angle, light, strict=True))
        path.write_text("\n".join(["angle_deg,intensity", *rows]), encoding="utf-8")
        lamp = table(path)
        assert stated_width_deg(lamp) == pytest.approx(hwhm_deg, rel=1e-3)
        seen.append(solid_angle_sr(lamp))
    right = [solid_angle_sr(Lamp(hwhm_deg=hwhm_deg)) for hwhm_deg in (5.0, 10.0)]
    assert seen == pytest.approx(right, rel=1e-3)


def test_oval_beam_as_a_table_is_the_oval_beam(tmp_path: Path) -> None:
    """A quarter of it, at steps of h = 0.25 and 1.5 degrees: linear interpolation is off by h^2/8 times the
    bending, 3.4e-4 of the axis at most; the solid angle by h^2/12 of it, 1.3e-4."""
    oval = Lamp(hwhm_deg=6.0, ellipticity=1.6)
    quarter = np.arange(0.0, 90.1, 1.5)
    lamp = table(phi_table(tmp_path / "oval.csv", lambda x, y: relative_intensity(oval, x, y), quarter))
    assert is_mirrored(lamp) == (True, True) and not has_round_section(lamp)
    # Stretched once more it is the beam of the product of the two.
    for more in (1.0, 1.25):
        one = lamp.model_copy(update={"ellipticity": more})
        other = oval.model_copy(update={"ellipticity": 1.6 * more})
        assert is_mirrored(one) == (True, True)
        off = relative_intensity(one, *PLACES) - relative_intensity(other, *PLACES)
        assert np.abs(off).max() < 3.4e-4
        assert solid_angle_sr(one) == pytest.approx(solid_angle_sr(other), rel=1.5e-4)


def test_luminaire_goes_round_and_closes(tmp_path: Path) -> None:
    """Half planes 0, 5 ... 355 of a Gaussian beside the axis: its solid angle is pi h^2 / ln2 over the
    intensity on the axis, and C90 is down where C0 is towards +x."""
    lamp = table(ies(tmp_path / "aside.ies", lambda x, y: aside(x, -y), np.arange(0.0, 356.0, 5.0)))
    np.testing.assert_allclose(relative_intensity(lamp, *PLACES), aside(*PLACES), atol=4e-3)
    far = math.radians(math.hypot(*ASIDE_DEG)) / math.radians(HWHM_DEG)
    closed = math.pi * math.radians(HWHM_DEG) ** 2 / math.log(2) * 2.0 ** (far * far)
    assert solid_angle_sr(lamp) == pytest.approx(closed, rel=4e-3)
    assert is_mirrored(lamp) == (False, False)


def test_one_side_stands_for_the_other(tmp_path: Path) -> None:
    """From 0 to 180 degrees: the same at -y, not at -x."""
    half = lambda x, y: aside(x, np.full_like(np.asarray(y), math.radians(ASIDE_DEG[1])))  # noqa: E731
    lamp = table(phi_table(tmp_path / "half.csv", half, np.arange(0.0, 181.0, 10.0)))
    assert is_mirrored(lamp) == (False, True)
    x, y = PLACES
    np.testing.assert_allclose(relative_intensity(lamp, x, y), relative_intensity(lamp, x, -y), atol=1e-12)


def test_planes_about_another_plane() -> None:
    """LM-63 allows 90 to 270 degrees: the image of 100 is 80, of 170 is 10 degrees."""
    planes = np.arange(90.0, 271.0, 10.0)
    turn, value = all_around(planes, planes[:, None])
    assert turn[0] == 0.0 and turn[-1] == 360.0
    for at, image in ((80.0, 100.0), (10.0, 170.0), (350.0, 190.0), (280.0, 260.0), (120.0, 120.0)):
        assert np.interp(at, turn, value[:, 0]) == pytest.approx(image)


def test_what_is_nearly_round_is_round(tmp_path: Path) -> None:
    """Half planes within 0.2 % of the axis of their mean are averaged, others kept."""
    for spread, alike in ((0.001, True), (0.01, False)):
        values = lambda x, y, s=spread: (  # noqa: E731
            np.exp(-40 * (x * x + y * y)) * (1 + s * np.cos(2 * np.arctan2(y, x)))
        )
        file = phi_table(tmp_path / f"{alike}.csv", values, np.arange(0.0, 91.0, 15.0))
        assert beam_table(str(file)).is_round is alike


def test_a_beam_is_written_with_all_its_half_planes(tmp_path: Path) -> None:
    """What a fit leaves as a lamp for the next scene: a departure is in it, an ellipticity stays a number.
    Its angles lie elsewhere, 0.075 degrees apart: the slope of the first table changes by 2 % per degree."""
    first = table(phi_table(tmp_path / "aside.csv", aside, np.arange(0.0, 361.0, 15.0)))
    lamp = first.model_copy(update={"profile_departure": ((0.0, 0.0), (10.0, 0.3)), "ellipticity": 1.2})
    written = table(save_intensity(lamp, 30.0, tmp_path / "lamp.csv"))
    again = written.model_copy(update={"ellipticity": 1.2})
    np.testing.assert_allclose(
        relative_intensity(again, *PLACES), relative_intensity(lamp, *PLACES), atol=4e-4
    )


@pytest.mark.parametrize(
    ("rows", "told"),
    [
        ("0,0,1\n5,0,1\n0,90,1\n", "no intensity at angle_deg 5, phi_deg 90"),
        ("0,0,1\n5,0,1\n0,50,1\n5,50,1\n", "no symmetric part of the turn"),
        ("0,0,1\n5,0,-1\n0,90,1\n5,90,1\n", "negative"),
        ("0,0,1\n5,0,1\n5,0,2\n0,90,1\n5,90,1\n", "given twice"),
        ("5,0,1\n9,0,1\n5,90,1\n9,90,1\n", "starts on the axis"),
        ("0,0,0\n9,0,1\n0,90,0\n9,90,1\n", "no light on the beam axis"),
    ],
)
def test_broken_tables(tmp_path: Path, rows: str, told: str) -> None:
    """One clear error that says what is missing."""
    file = tmp_path / "beam.csv"
    file.write_text("angle_deg,phi_deg,intensity\n" + rows)
    with pytest.raises(SceneError, match=told):
        beam_table(str(file))


def test_errors_of_a_table_are_over_its_axis(tmp_path: Path) -> None:
    """What all of the table is off by together is a gain, and no error of the beam."""
    path = tmp_path / "lamp.csv"
    path.write_text("angle_deg,intensity,stderr,error_1\n0,50,1,5\n5,40,2,4\n10,10,3,-2\n", encoding="utf-8")
    errors = beam_table(str(path)).errors
    own = np.array([[0.02, 0, 0], [0, 0.04, 0], [0, 0, 0.06]])
    own[0] -= 0.02 * np.array([1.0, 0.8, 0.2])
    shared = np.array([0.1, 0.08, -0.04]) - 0.1 * np.array([1.0, 0.8, 0.2])
    np.testing.assert_allclose(errors, [*own, shared], atol=1e-15)


def test_errors_of_a_beam_that_is_not_round_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "lamp.csv"
    path.write_text("angle_deg,phi_deg,intensity,stderr\n0,0,1,0.1\n9,0,1,0.1\n", encoding="utf-8")
    with pytest.raises(SceneError, match=r"not round.*stderr"):
        beam_table(str(path))


def measured(path: Path, shape: Callable[[Array], Array], step_deg: float) -> BeamTable:
    angle = np.arange(0.0, 45.1, step_deg)
    rows = (f"{a:g},{i:.8g}" for a, i in zip(angle, shape(angle), strict=True))
    path.write_text("\n".join(["angle_deg,intensity", *rows]), encoding="utf-8")
    return beam_table(str(path))


def gaussian(angle_deg: Array) -> Array:
    return np.asarray(2.0 ** -((angle_deg / HWHM_DEG) ** 2))


def flat(angle_deg: Array) -> Array:
    """With an edge in which it falls from 0.9 to 0.1 within two degrees."""
    return np.asarray((1 + np.exp(-16)) / (1 + np.exp((angle_deg - 8) / 0.5)))


@pytest.mark.parametrize("step_deg", [0.3, 1.0, 2.5, 5.0])
def test_a_beam_is_smooth_between_its_angles(tmp_path: Path, step_deg: float) -> None:
    """A Gaussian of 6 degrees by its closed form, where straight lines leave out up to 30 % of it."""
    at = np.linspace(0.0, 15.0, 601)
    table = measured(tmp_path / "lamp.csv", gaussian, step_deg)
    np.testing.assert_allclose(table.at(np.radians(at), 0.0), gaussian(at), rtol=1e-3)
    assert len(table.relative_errors(np.radians(at))) == 0


def test_a_steep_edge_has_no_overshoot_and_no_light_beyond(tmp_path: Path) -> None:
    """Never above the angles' own intensities, never below; where the table says dark, dark."""
    path = tmp_path / "lamp.csv"
    path.write_text("angle_deg,intensity\n0,1\n4,1\n8,1\n9,0.5\n10,0.001\n12,0\n20,0\n", encoding="utf-8")
    at = np.linspace(0.0, 20.0, 2001)
    light = beam_table(str(path)).at(np.radians(at), 0.0)
    assert (np.diff(light) <= 1e-12).all()
    assert (light[at <= 8.0] == 1.0).all()
    assert (light[at >= 12.0] == 0.0).all()


@pytest.mark.parametrize("step_deg", [1.0, 1.5, 2.5])
def test_what_a_coarse_table_does_not_tell_is_its_error(tmp_path: Path, step_deg: float) -> None:
    """Of a beam with an edge: between each pair of angles one error, of the size of what is wrong there."""
    at = np.linspace(0.0, 11.0, 441)
    table = measured(tmp_path / "lamp.csv", flat, step_deg)
    wrong = table.at(np.radians(at), 0.0) / flat(at) - 1
    found = table.relative_errors(np.radians(at))
    assert ((found != 0).sum(axis=0) <= 1).all()
    assert np.abs(wrong).max() > 0.01
    assert 0.5 < np.linalg.norm(found) / np.linalg.norm(wrong) < 4.0


def test_a_fine_table_leaves_nothing_out(tmp_path: Path) -> None:
    save_intensity(Lamp(hwhm_deg=6.0), 30.0, tmp_path / "lamp.csv")
    found = beam_table(str(tmp_path / "lamp.csv")).relative_errors(np.radians(np.linspace(0.0, 12.0, 241)))
    assert found.shape == (0, 241)
