"""Beam tables in three formats, spectra against their definitions, solid angles against closed forms."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import trapezoid

from lightfield.cli import main
from lightfield.errors import SceneError
from lightfield.scene import Lamp
from lightfield.scene.lamp.photometry import beam_table
from lightfield.scene.lamp.profile import relative_intensity, solid_angle_sr
from lightfield.scene.lamp.spectrum import axial_intensity, spectral_power


def mean_table(path: str) -> tuple[np.ndarray, np.ndarray]:
    """Angle, rad, and the mean intensity about the axis."""
    table = beam_table(path)
    return table.angle_rad, table.mean


IES = """IESNA:LM-63-2002
[TEST] hand-written
[MANUFAC] none
TILT=NONE
1 1000 2.0 5 {planes} 1 2 0.1 0.1 0
1.0 1.0 50
0 5 10 45 90
{angles}
{values}
"""

LDT_HEAD = """maker
1
{symmetry}
{planes}
{step}
5
0
report
spot
1
spot.ldt
2024
100
0
100
50
0
0
0
0
0
100
100
1.0
0
1
1
halogen
1000
2900
100
50
0.5
0.5
0.5
0.5
0.5
0.5
0.5
0.5
0.5
0.5
"""


def write(path: Path, text: str) -> str:
    path.write_text(text)
    return str(path)


def test_csv_table(tmp_path: Path) -> None:
    """Any intensity unit: the table is relative to its axis; dark beyond the last row."""
    file = write(tmp_path / "lamp.csv", "# measured\nintensity,angle_deg\n400,0\n300,5\n100,10\n")
    lamp = Lamp(profile="table", intensity_table=file)
    theta = np.radians([0.0, 5.0, 10.0, 10.01])
    np.testing.assert_allclose(relative_intensity(lamp, theta, 0 * theta), [1, 0.75, 0.25, 0], atol=1e-12)


def test_ies_rotational(tmp_path: Path) -> None:
    """LM-63 type C, one half plane; the multiplier cancels in the relative intensity."""
    file = write(tmp_path / "spot.ies", IES.format(planes=1, angles="0", values="1000 800 300 10 0"))
    angle, intensity = mean_table(file)
    at = np.radians([0, 5, 10, 45])
    np.testing.assert_allclose(np.interp(at, angle, intensity), [1, 0.8, 0.3, 0.01])


@pytest.mark.parametrize("steps", [(0, 15, 360), (0, 15, 345), (0, 90, 270), (0, 22.5, 337.5)])
def test_planes_that_go_round_close(tmp_path: Path, steps: tuple[float, float, float]) -> None:
    """Whether the file repeats the first plane at 360 degrees or leaves it out: the mean over the turn."""
    planes = np.arange(steps[0], steps[2] + 1e-9, steps[1])
    at_5 = 800 + 150 * np.cos(np.radians(planes)) + 40 * (planes % 360 == 0)
    values = "\n".join(f"1000 {v:.12g} 300 10 0" for v in at_5)
    text = IES.format(planes=len(planes), angles=" ".join(f"{p:g}" for p in planes), values=values)
    file = write(tmp_path / "round.ies", text)
    angle, intensity = mean_table(file)
    around = at_5[:-1] if planes[-1] == 360 else at_5
    assert np.interp(math.radians(5), angle, intensity) == pytest.approx(around.mean() / 1000, rel=1e-9)


def test_what_is_not_round_is_kept_and_needs_no_word(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Quadrant symmetry: on either side of the axis the half plane of the file, and nothing to warn of."""
    values = "1000 800 300 10 0\n1000 600 100 10 0"
    file = write(tmp_path / "oval.ies", IES.format(planes=2, angles="0 90", values=values))
    lamp, at_5 = Lamp(profile="table", intensity_table=file), math.radians(5)
    for x, y, value in ((at_5, 0.0, 0.8), (-at_5, 0.0, 0.8), (0.0, at_5, 0.6), (0.0, -at_5, 0.6)):
        assert relative_intensity(lamp, x, y) == pytest.approx(value)
    scene = write(tmp_path / "scene.toml", '[lamp]\nprofile = "table"\nintensity_table = "oval.ies"\n')
    assert main(["scene", scene]) == 0
    assert capsys.readouterr().err == ""


def test_a_round_luminaire_says_nothing(tmp_path: Path) -> None:
    values = "1000 800 300 10 0\n1000 805 300 10 0"
    file = write(tmp_path / "round.ies", IES.format(planes=2, angles="0 90", values=values))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mean_table(file)


def test_ies_half_planes_are_averaged(tmp_path: Path) -> None:
    """Quadrant symmetry: planes 0, 90 count double against their mirror images, that is equally around the
    turn.
    """
    values = "1000 800 300 10 0\n1000 600 100 10 0"
    file = write(tmp_path / "oval.ies", IES.format(planes=2, angles="0 90", values=values))
    angle, intensity = mean_table(file)
    np.testing.assert_allclose(np.interp(np.radians([5, 10]), angle, intensity), [0.7, 0.2], rtol=1e-9)


def test_eulumdat(tmp_path: Path) -> None:
    """EULUMDAT with rotational symmetry (Isym = 1), in cd per kilolumen."""
    rows = ["0", "0", "5", "10", "45", "90", "1000", "800", "300", "10", "0", ""]
    head = LDT_HEAD.format(symmetry=1, planes=1, step=0)
    angle, intensity = mean_table(write(tmp_path / "spot.ldt", head + "\n".join(rows)))
    np.testing.assert_allclose(np.interp(np.radians([0, 5, 10, 45]), angle, intensity), [1, 0.8, 0.3, 0.01])


def test_eulumdat_without_symmetry(tmp_path: Path) -> None:
    """Four planes all around (Isym = 0), C360 left out as usual: the plain mean; Isym = 4: half weight at C0
    and C90.
    """
    angles = ["0", "5", "10", "45", "90"]
    values = [["1000", str(v), "300", "10", "0"] for v in (800, 600, 400, 200)]
    head = LDT_HEAD.format(symmetry=0, planes=4, step=90)
    rows = ["0", "90", "180", "270", *angles, *(v for plane in values for v in plane), ""]
    angle, intensity = mean_table(write(tmp_path / "free.ldt", head + "\n".join(rows)))
    assert np.interp(math.radians(5), angle, intensity) == pytest.approx(0.5)
    head = LDT_HEAD.format(symmetry=4, planes=8, step=45)
    rows = [*(str(45 * k) for k in range(8)), *angles, *(v for plane in values[:3] for v in plane), ""]
    angle, intensity = mean_table(write(tmp_path / "quadrant.ldt", head + "\n".join(rows)))
    assert np.interp(math.radians(5), angle, intensity) == pytest.approx((0.5 * 0.8 + 0.6 + 0.5 * 0.4) / 2)


@pytest.mark.parametrize(
    ("symmetry", "stored"),
    [(0, range(0, 360, 15)), (2, range(0, 181, 15)), (3, [*range(270, 360, 15), *range(0, 91, 15)]),
     (4, range(0, 91, 15))],
)  # fmt: skip
def test_each_half_plane_of_a_luminaire_is_where_its_format_says(
    tmp_path: Path, symmetry: int, stored: Sequence[int]
) -> None:
    """Planes from Mc1 to Mc2 of the format (Isym = 2: C0 to C180, 3: from C270 over C0 to C90, 4: C0 to C90)
    of beams that have that symmetry; C0 is towards +x, C90 towards -y of the beam."""

    def light(c_deg: float) -> float:
        c = math.radians(c_deg)
        sideways = 0.3 * math.cos(c) * (symmetry in (0, 2)) + 0.2 * math.sin(c) * (symmetry in (0, 3))
        return 1 + sideways + 0.1 * math.cos(2 * c)

    angles, planes = [0, 10, 45, 90], range(0, 360, 15)
    values = [v for c in stored for v in (500.0, 250.0 * light(c), 10.0, 0.0)]
    rows = [*map(str, planes), *map(str, angles), *map(str, values), ""]
    head = LDT_HEAD.format(symmetry=symmetry, planes=24, step=15).splitlines()
    head[5] = str(len(angles))
    file = write(tmp_path / "half.ldt", "\n".join([*head, *rows]))
    table = beam_table(str(file))
    for c_deg in planes:
        assert table.at(math.radians(10), math.radians(-c_deg)) == pytest.approx(0.5 * light(c_deg), rel=1e-9)


def test_cut_ies_file(tmp_path: Path) -> None:
    """One value missing at the end is not filled up."""
    file = write(tmp_path / "cut.ies", IES.format(planes=1, angles="0", values="1000 800 300 10"))
    with pytest.raises(SceneError, match="cut short: 5 numbers expected, 4 left"):
        mean_table(file)


@pytest.mark.parametrize("word", ["nan", "inf", "1e308"])
def test_what_is_no_number_of_a_lamp_is_named(tmp_path: Path, word: str) -> None:
    """Two of 1e308 in one mean are infinite, and an infinite lamp is dark on its axis."""
    values = f"{word} 800 300 10 0\n{word} 600 100 10 0"
    file = write(tmp_path / "bright.ies", IES.format(planes=2, angles="0 90", values=values))
    with pytest.raises(SceneError, match=f"{word} is no number that a lamp can have"):
        mean_table(file)


@pytest.mark.parametrize("suffix", [".ies", ".ldt"])
@pytest.mark.parametrize("content", ["", "IESNA:LM-63-2002\nTILT=NONE\n1 2 3\n", "a\nb\nc\n"])
def test_broken_photometric_files(tmp_path: Path, suffix: str, content: str) -> None:
    """A cut or foreign file is an error that says what to do, whatever the reading library runs into."""
    file = write(tmp_path / f"broken{suffix}", content)
    with pytest.raises(SceneError, match=r"not readable as .*remedy"):
        mean_table(file)


def test_planck_is_normalised_to_the_power() -> None:
    """The integral over all wavelengths is the radiant power (Stefan-Boltzmann): 50 W, within the
    integration's 1e-5.
    """
    w = np.geomspace(50, 1e6, 200_001)
    power = spectral_power(Lamp(power_w=50, temperature_k=2900), w)
    assert trapezoid(power, w) == pytest.approx(50, rel=1e-5)
    # Wien: the maximum of a 2900 K body lies at 2897.77 um K / 2900 K = 999.2 nm.
    assert w[power.argmax()] == pytest.approx(999.23, rel=1e-3)


def test_planck_fraction_of_a_band() -> None:
    """Band fraction of a black body: 25.0 % lie below lambda T = 2898 um K (standard table)."""
    w = np.linspace(20, 2897.77 / 2.9, 40_001)
    assert trapezoid(spectral_power(Lamp(power_w=1, temperature_k=2900), w), w) == pytest.approx(
        0.2501, abs=2e-4
    )


def test_illuminant_a() -> None:
    """CIE 015 table of illuminant A: 14.71 at 400 nm, 100 at 560 nm, 198.26 at 700 nm (relative, 560 nm =
    100).
    """
    s = spectral_power(Lamp(spectrum="cie-a"), [400.0, 560.0, 700.0])
    np.testing.assert_allclose(100 * s / s[1], [14.71, 100, 198.26], atol=0.005)


def test_spectrum_table(tmp_path: Path) -> None:
    """A table integrates to the power by the trapezoid, and is dark outside."""
    file = write(tmp_path / "s.csv", "wavelength_nm,power\n400,0\n500,2\n600,0\n")
    s = spectral_power(Lamp(spectrum="table", spectrum_table=file, power_w=10), [399.0, 450.0, 500.0, 601.0])
    np.testing.assert_allclose(s, [0, 0.05, 0.1, 0])


def test_solid_angle_of_narrow_and_wide_beams(tmp_path: Path) -> None:
    """Gaussian in theta: pi hwhm^2 / ln2 for small angles, times e for an ellipse; isotropic 4 pi; cone from
    its table.
    """
    h = math.radians(0.5)
    assert solid_angle_sr(Lamp(hwhm_deg=0.5)) == pytest.approx(math.pi * h * h / math.log(2), rel=1e-4)
    ratio = solid_angle_sr(Lamp(hwhm_deg=0.5, ellipticity=1.7)) / solid_angle_sr(Lamp(hwhm_deg=0.5))
    assert ratio == pytest.approx(1.7, rel=1e-4)
    assert solid_angle_sr(Lamp(profile="isotropic")) == 4 * math.pi
    file = write(tmp_path / "cone.csv", "angle_deg,intensity\n0,1\n30,1\n30.000001,0\n90,0\n")
    cone = 2 * math.pi * (1 - math.cos(math.radians(30)))
    assert solid_angle_sr(Lamp(profile="table", intensity_table=file)) == pytest.approx(cone, rel=1e-6)
    with pytest.raises(SceneError, match="pencil"):
        solid_angle_sr(Lamp(profile="pencil"))


def test_profile_formula() -> None:
    """One formula for the family: core exponent, skirt, ellipticity, I(hwhm) = 1/2; nothing behind 90
    degrees.
    """
    h = math.radians(4.0)
    for m in (1.5, 2.0, 6.0):
        lamp = Lamp(profile="super-gaussian", hwhm_deg=4, shape_exponent=m)
        assert relative_intensity(lamp, h, 0.0) == pytest.approx(0.5)
    both = Lamp(profile="two-component", hwhm_deg=4, skirt_fraction=0.25, skirt_hwhm_deg=12)
    at = math.radians(12)
    assert relative_intensity(both, at, 0.0) == pytest.approx((0.5**9 + 0.25 * 0.5) / 1.25)
    oval = Lamp(hwhm_deg=4, ellipticity=2)
    assert relative_intensity(oval, 0.0, 2 * h) == pytest.approx(0.5)
    askew = Lamp(hwhm_deg=4, ellipticity_diagonal=2.25)
    towards, across = 1.5 * h / math.sqrt(2), h / 1.5 / math.sqrt(2)
    assert relative_intensity(askew, [towards, -across], [towards, across]) == pytest.approx(0.5)
    assert relative_intensity(Lamp(hwhm_deg=60), math.radians(91), 0.0) == 0.0


def test_intensity_on_the_axis() -> None:
    """Power over solid angle; all of the power for a pencil beam, which has none."""
    at = np.array([[480.0, 520.0], [600.0, 640.0]])
    for lamp in (Lamp(hwhm_deg=20.0, ellipticity=1.5), Lamp(profile="isotropic")):
        whole = axial_intensity(lamp, at) * solid_angle_sr(lamp)
        np.testing.assert_allclose(whole, spectral_power(lamp, at), rtol=1e-12)
    pencil = Lamp(profile="pencil")
    np.testing.assert_array_equal(axial_intensity(pencil, at), spectral_power(pencil, at))
