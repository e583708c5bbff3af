"""The light of a band is the lamp's, however narrow its lines are and wherever they lie."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

import lightfield as lf
from lightfield import cli
from lightfield.errors import SceneError, UsageError
from lightfield.formula.closed_form import direct_field
from lightfield.maps.dataset import to_dataset
from lightfield.render.at_readings import render_positions
from lightfield.render.maps import render_scene
from lightfield.robots.field_file import Asked, field_dataset
from lightfield.scene import Scene
from lightfield.scene.bands import over_band, over_bands, refuse_unlit, refuse_unlit_wavelengths
from lightfield.scene.lamp.profile import solid_angle_sr
from lightfield.scene.lamp.spectrum import spectral_power
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m
from lightfield.studies.follower.array_light import Space
from lightfield.studies.follower.survey import survey
from lightfield.studies.working_range.study import working_range

BAND = (500.0, 550.0)


def lamp_of(folder: Path, rows: list[tuple[float, float]], **more: object) -> Scene:
    """A scene with a lamp of this spectrum."""
    table = folder / "light.csv"
    table.write_text("wavelength_nm,power\n" + "".join(f"{w!r},{p!r}\n" for w, p in rows))
    return Scene.from_dict({"lamp": {"spectrum": "table", "spectrum_table": str(table)}, **more})


def line(at_nm: float, fwhm_nm: float) -> list[tuple[float, float]]:
    """A triangle on nothing: its power between two wavelengths is known in the head."""
    return [(300.0, 0.0), (at_nm - fwhm_nm, 0.0), (at_nm, 1.0), (at_nm + fwhm_nm, 0.0), (900.0, 0.0)]


@pytest.mark.parametrize("at_nm", [505.0, 510.0, 520.0, 525.0, 531.7, 545.0])
@pytest.mark.parametrize("fwhm_nm", [1e-3, 0.5, 3.0])
def test_a_line_within_a_band_brings_all_its_power(tmp_path: Path, at_nm: float, fwhm_nm: float) -> None:
    scene = lamp_of(tmp_path, line(at_nm, fwhm_nm))
    spectrum = over_band(scene.lamp, *BAND)
    power = spectrum.intensity.mean() * (BAND[1] - BAND[0]) * solid_angle_sr(scene.lamp)
    assert power == pytest.approx(scene.lamp.power_w, rel=1e-9)
    centre = (spectrum.intensity * spectrum.wavelength_nm).sum() / spectrum.intensity.sum()
    assert centre == pytest.approx(at_nm, abs=1e-9)


@given(
    st.lists(
        st.tuples(st.floats(320, 880), st.floats(0, 1)), min_size=3, max_size=8, unique_by=lambda p: p[0]
    ),
    st.floats(400, 600),
    st.floats(1, 150),
)
def test_every_table_is_integrated_piece_by_piece(
    tmp_path_factory: pytest.TempPathFactory, rows: list[tuple[float, float]], low: float, width: float
) -> None:
    rows = sorted((round(w, 3), p) for w, p in rows)
    if min(np.diff([w for w, _ in rows])) <= 0 or max(p for _, p in rows) == 0:
        return
    scene = lamp_of(tmp_path_factory.mktemp("light"), [(310.0, 0.0), *rows, (890.0, 0.0)])
    found = over_band(scene.lamp, low, low + width)
    known = np.array([310.0, *(w for w, _ in rows), 890.0])
    power = np.array([0.0, *(p for _, p in rows), 0.0])
    fine = np.unique(
        np.concatenate([np.linspace(low, low + width, 2001), known[(known > low) & (known < low + width)]])
    )
    expected = (
        np.trapezoid(np.interp(fine, known, power), fine)
        if hasattr(np, "trapezoid")
        else np.trapz(np.interp(fine, known, power), fine)
    )
    whole = np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(known))
    told = found.intensity.mean() * width * solid_angle_sr(scene.lamp) / scene.lamp.power_w
    assert told == pytest.approx(expected / whole, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("kelvin", [1800.0, 3000.0, 6500.0])
def test_a_black_body_in_a_broad_band(kelvin: float) -> None:
    scene = Scene.from_dict({"lamp": {"temperature_k": kelvin}, "detector": {"bands_nm": [[400, 700]]}})
    power = over_bands(scene).intensity.mean() * 300 * solid_angle_sr(scene.lamp)
    assert power == pytest.approx(quad(lambda w: float(spectral_power(scene.lamp, w)), 400, 700)[0], rel=1e-7)


@pytest.mark.parametrize(
    ("band", "water"),
    [((400, 700), {}), ((400, 700), {"cdom_440_per_m": 0.5}), ((380, 450), {"cdom_440_per_m": 1.0}),
     ((500, 550), {}), ((700, 900), {})],
)  # fmt: skip
def test_a_wide_band_has_as_many_parts_as_its_water_asks_for(band: tuple[float, float], water: dict) -> None:
    """Transmission of 2 to 10 m, beside its integral over 20001 wavelengths; of five parts it was up to 99 %
    too little."""
    detector = {"bands_nm": [band], "planes_m": [2.0, 5.0, 10.0]}
    scene = Scene.from_dict({"water": {"base": "pure", **water}, "detector": detector})
    fine = np.linspace(*band, 20001)
    power = spectral_power(scene.lamp, fine)
    (at,), (light,) = over_bands(scene)

    def taken(wavelengths: np.ndarray) -> np.ndarray:
        return absorption_per_m(scene.water, wavelengths) + scattering_per_m(scene.water, wavelengths)

    for z in scene.detector.planes_m:
        told = (light * np.exp(-z * taken(at))).mean() / light.mean()
        expected = (power * np.exp(-z * taken(fine))).sum() / power.sum()
        assert told == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize("at_nm", [520.0, 525.0])
def test_a_laser_is_rendered_in_its_own_water(tmp_path: Path, at_nm: float) -> None:
    """At 520 nm, between the pieces of the band, it was black; at 525 nm three times too bright."""
    detector = {"positions_m": [[0, 0, 4.5]], "bands_nm": [BAND]}
    scene = lamp_of(tmp_path, line(at_nm, 0.01), water={"base": "pure"}, detector=detector)
    light = float(to_dataset(render_positions(scene, max_photons=1e3, rel_error=1.0)).irradiance_direct[0, 0])
    alone = direct_field(scene, *np.array([[0.0], [0.0], [4.5]]), np.array([at_nm]))[0]
    expected = scene.lamp.power_w / solid_angle_sr(scene.lamp) / (BAND[1] - BAND[0]) * alone
    assert light == pytest.approx(expected, rel=3e-4)


def test_maps_positions_and_formula_hold_the_same_light(tmp_path: Path) -> None:
    scene = lamp_of(
        tmp_path,
        line(512.0, 3.0),
        water={"base": "pure"},
        detector={"planes_m": [2.0], "width_m": 0.025, "pixels": 5, "bands_nm": [BAND]},  # as good as a place
    )
    plane = render_scene(scene, max_photons=2e5, rel_error=1e-3)
    light, error = (v[0, 0, 2, 2] for v in plane.maps(part="direct"))
    place = scene.with_values({"detector.positions_m": ((0.0, 0.0, 2.0),)})
    at_place = render_positions(place, max_photons=1e3, rel_error=1.0).maps(part="direct")[0][0, 0]
    assert light == pytest.approx(at_place, abs=4 * error + 2e-3 * light)


@pytest.mark.parametrize(
    ("bands", "stray", "dark"),
    [
        ([[600.0, 650.0]], 0.0, True),
        ([[600.0, 650.0]], 0.01, False),  # stray light of its own colours
        ([[600.0, 650.0], [440.0, 460.0]], 0.0, False),  # one of two, as a control
        ([[480.0, 500.0]], 0.0, False),  # its tail: 1e-3 of the peak
    ],
)
def test_a_lamp_that_no_band_sees_is_one_error(bands: list[list[float]], stray: float, dark: bool) -> None:
    """A Gaussian of 20 nm at 450 nm: at 600 nm exp(-156) of it."""
    detector = {"bands_nm": bands, "planes_m": [2.0], "stray_light": stray}
    scene = Scene.from_dict({"lamp": {"spectrum": {"peak_nm": 450.0, "fwhm_nm": 20.0}}, "detector": detector})
    if not dark:
        refuse_unlit(scene)
        return
    says = "no light in the bands.*600-650 nm.*brightest at 450 nm"
    for asked in (refuse_unlit, render_scene, lambda s: working_range(s, None)):
        with pytest.raises(SceneError, match=says):
            asked(scene)


def test_a_lamp_that_no_wavelength_sees_is_one_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its bands do: what is asked is told, before anything is traced, and before a folder is made."""
    lamp = {"spectrum": {"peak_nm": 450.0, "fwhm_nm": 20.0}}
    scene = Scene.from_dict({"lamp": lamp, "detector": {"bands_nm": [[440, 460]], "planes_m": [2.0]}})
    says = "no light at these wavelengths; found '900 nm'; rule: the lamp is brightest at 450 nm"
    with pytest.raises(UsageError, match=f"^wavelengths: the lamp gives {says}"):
        lf.render(scene, wavelengths=[900.0])
    file = tmp_path / "scene.toml"
    file.write_text(scene.to_toml())
    asked = ["render", str(file), "--wavelengths", "900", "-o", str(tmp_path / "out")]
    assert cli.main(asked) == 2
    assert f"--wavelengths: the lamp gives {says}" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
    refuse_unlit_wavelengths(scene, np.array([450.0, 900.0]), "")  # one of two, as a control


@pytest.mark.parametrize("asked", ["field", "array"])
def test_who_reads_no_light_is_told_so_by_followers_too(asked: str) -> None:
    """A grid, or an array, of the light of a lamp that its bands do not see."""
    lamp = {"spectrum": {"peak_nm": 450.0, "fwhm_nm": 20.0}}
    detector = {"bands_nm": [[600, 650]], "planes_m": [2.0, 3.0]}
    scene = Scene.from_dict({"lamp": lamp, "detector": detector, "array": {}})
    with pytest.raises(SceneError, match="no light in the bands"):
        if asked == "field":
            field_dataset(scene, Asked(0.2, 2.0, 3.0, 0.1), photons=0)
        else:
            survey(scene, Space.of_scene(scene), photons=0)


def test_a_spectrum_without_power_is_told_as_such(tmp_path: Path) -> None:
    """Not as one whose brightest wavelength is the first that is looked at."""
    (tmp_path / "dark.csv").write_text("wavelength_nm,power\n400,0\n700,0\n")
    lamp = {"spectrum": "table", "spectrum_table": str(tmp_path / "dark.csv")}
    with (
        pytest.raises(SceneError, match=r"no light at all.*no power at any wavelength"),
        np.errstate(all="ignore"),
    ):
        refuse_unlit(Scene.from_dict({"lamp": lamp, "detector": {"planes_m": [2.0]}}))


@pytest.mark.parametrize(("band", "shift_nm"), [([400, 750], 0.0), ([425, 475], -20.0)])
def test_water_amplifies_nowhere_in_a_band_as_it_is_read(band: list[float], shift_nm: float) -> None:
    """Pure water absorbs least at 416 nm, 0.0044 per m: far from the middles of these."""
    detector = {"bands_nm": [band], "wavelength_shift_nm": shift_nm}
    with pytest.raises(SceneError, match=r"at 416 nm .* write at least -0\.0044"):
        Scene.from_dict({"water": {"base": "pure", "absorption_per_m": -0.005}, "detector": detector})
    Scene.from_dict({"water": {"base": "pure", "absorption_per_m": -0.0044}, "detector": detector})


def test_bands_of_one_middle_are_refused() -> None:
    """Maps, images and comparisons are told apart by it: a render of both had no images."""
    with pytest.raises(SceneError, match="told apart by their middles") as caught:
        Scene.from_dict({"detector": {"bands_nm": [[500.0, 550.0], [400.0, 410.0], [520.0, 530.0]]}})
    assert caught.value.found == [[500.0, 550.0], [520.0, 530.0]]
    Scene.from_dict({"detector": {"bands_nm": [[500.0, 550.0], [520.0, 530.01]]}})


def test_a_response_has_to_see_the_band_that_is_read(tmp_path: Path) -> None:
    """A filter from 490 to 560 nm: read 50 nm below 500 to 510 nm it is dark, not the lamp."""
    table = tmp_path / "filter.csv"
    table.write_text("wavelength_nm,response\n490,0\n500,1\n550,1\n560,0\n", encoding="utf-8")
    detector = {"response_table": str(table), "bands_nm": [[500.0, 510.0]]}
    Scene.from_dict({"detector": detector | {"wavelength_shift_nm": -15.0}})
    with pytest.raises(SceneError, match=r"found band = \[500.*shift_nm = -50.*sees something of every band"):
        Scene.from_dict({"detector": detector | {"wavelength_shift_nm": -50.0}})
