"""Peaks over wavelength: spectra of LEDs, windows of filters, and the response that weighs a band."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import colour
import numpy as np
import pytest
from scipy.integrate import quad

from lightfield.errors import SceneError
from lightfield.scene import Lamp, Scene
from lightfield.scene.bands import over_band, over_bands
from lightfield.scene.lamp.lamp import SpectrumName
from lightfield.scene.lamp.profile import solid_angle_sr
from lightfield.scene.lamp.spectrum import spectral_power
from lightfield.scene.spectral.peaks import LEDS

GREEN = {"peak_nm": 525.0, "fwhm_nm": 35.0}


def scene(spectrum: object, **detector: object) -> Scene:
    return Scene.from_dict({"lamp": {"spectrum": spectrum, "power_w": 10.0}, "detector": detector})


def power_between(lamp: Lamp, low: float, high: float, *points: float) -> float:
    """W, by an adaptive quadrature that is told where to look."""
    return float(
        quad(lambda w: float(spectral_power(lamp, w)), low, high, points=points or None, limit=400)[0]
    )


def test_a_peak_has_its_power_its_place_and_its_width() -> None:
    lamp = scene(GREEN).lamp
    assert power_between(lamp, 300, 800, 525) == pytest.approx(10, rel=1e-9)
    at = np.linspace(450, 600, 15001)
    power = spectral_power(lamp, at)
    assert at[power.argmax()] == pytest.approx(525, abs=0.01)
    bright = at[power >= 0.5 * power.max()]
    assert bright[-1] - bright[0] == pytest.approx(35, abs=0.02)


def test_several_peaks_have_the_heights_that_are_given() -> None:
    lamp = scene([{"peak_nm": 450, "fwhm_nm": 20}, {"peak_nm": 650, "fwhm_nm": 40, "height": 0.25}]).lamp
    blue, red = spectral_power(lamp, [450.0, 650.0])
    assert red / blue == pytest.approx(0.25, rel=1e-6)
    parts = [power_between(lamp, *ends) for ends in ((380, 540), (540, 780))]
    assert sum(parts) == pytest.approx(10, rel=1e-6)
    assert parts[1] / parts[0] == pytest.approx(0.25 * 40 / 20, rel=1e-6)  # height times width


@pytest.mark.parametrize("fwhm", [0.05, 2.0, 35.0, 200.0])
def test_a_band_has_all_the_light_of_a_peak_however_narrow(fwhm: float) -> None:
    lamp = scene({"peak_nm": 523.4, "fwhm_nm": fwhm}).lamp
    low, high = 400.0, 650.0
    found = over_band(lamp, low, high).intensity.mean() * (high - low) * solid_angle_sr(lamp)
    spots = [523.4 + k * fwhm for k in (-3, -1, 0, 1, 3) if low < 523.4 + k * fwhm < high]
    wanted = power_between(lamp, low, high, *spots)
    assert found == pytest.approx(wanted, rel=1e-6)


def test_every_led_of_the_table_has_a_name_that_scenes_take() -> None:
    assert {name for name in get_args(SpectrumName) if name.startswith("led-")} == set(LEDS)
    for name in LEDS:
        total = power_between(scene(name).lamp, 200, 1200, LEDS[name][0].peak_nm)
        assert total == pytest.approx(10, rel=1e-6)


@pytest.mark.filterwarnings("ignore")  # colour-science says where it interpolates
@pytest.mark.parametrize(("name", "kelvin"), [("led-white", (6000, 7000)), ("led-warm-white", (2700, 3100))])
def test_white_leds_are_white(name: str, kelvin: tuple[float, float]) -> None:
    """Colour temperature and distance from the black body's locus, by colour-science."""
    at = np.arange(380.0, 781.0, 5.0)
    light = colour.SpectralDistribution(dict(zip(at, spectral_power(scene(name).lamp, at), strict=True)))
    xyz = colour.sd_to_XYZ(light, illuminant=colour.SDS_ILLUMINANTS["E"])
    uv = colour.UCS_to_uv(colour.XYZ_to_UCS(xyz / 100))
    temperature, away = colour.uv_to_CCT(uv, method="Ohno 2013")
    assert kelvin[0] < temperature < kelvin[1]
    assert abs(away) < 0.005


def test_a_filter_leaves_the_light_that_it_lets_through() -> None:
    """Mean over the band of light times response over the mean response, by another quadrature."""
    filtered = scene(GREEN, response={"peak_nm": 515.0, "fwhm_nm": 10.0})
    lamp, seen = filtered.lamp, over_bands(filtered)

    def response(w: float) -> float:
        return float(0.5 ** ((w - 515.0) / 5.0) ** 2)

    points = [505, 515, 525]

    def signal(w: float) -> float:
        return float(spectral_power(lamp, w)) * response(w)

    light = quad(signal, 500, 550, points=points)[0]
    norm = quad(response, 500, 550, points=points)[0]
    assert seen.intensity.mean() * solid_angle_sr(lamp) == pytest.approx(light / norm, rel=1e-6)
    centre = (seen.intensity * seen.wavelength_nm).sum() / seen.intensity.sum()
    moment = quad(lambda w: w * signal(w), 500, 550, points=points)[0]
    assert centre == pytest.approx(moment / light, rel=1e-6)


def test_a_response_that_is_the_same_for_all_changes_nothing(tmp_path: Path) -> None:
    table = tmp_path / "flat.csv"
    table.write_text("wavelength_nm,response\n300,7\n900,7\n")
    plain, flat = scene(GREEN), scene(GREEN, response="table", response_table=str(table))
    for one, other in zip(over_bands(plain), over_bands(flat), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-7)  # the knots of the table divide the band anew
    assert plain.digest() != flat.digest()


def test_scenes_of_before_keep_their_digest() -> None:
    """That of version 0.1.0 before it knew of peaks and responses."""
    old = Scene.from_dict({"lamp": {"hwhm_deg": 4.0}, "tank": {}})
    assert old.digest() == "8e0e93279b96c2d0733fb8b1b54a548e19b23c0919b7b7f1b30c450002711468"


def test_a_scene_keeps_its_curves_on_the_way_through_toml() -> None:
    for spectrum in (GREEN, [GREEN, {"peak_nm": 450.0, "fwhm_nm": 20.0, "height": 0.5}], "led-blue"):
        one = scene(spectrum, response=[GREEN])
        again = Scene.from_toml(one.to_toml())
        assert again == one and again.digest() == one.digest()


def test_a_single_peak_is_reached_by_its_dotted_path() -> None:
    one = scene(GREEN)
    assert one.get("lamp.spectrum.peak_nm") == 525
    moved = one.with_values({"lamp.spectrum.peak_nm": 470.0})
    assert moved.lamp.spectrum.peak_nm == 470 and moved.lamp.spectrum.fwhm_nm == 35
    assert "lamp.spectrum.fwhm_nm" in one.parameters()


@pytest.mark.parametrize(
    ("toml", "words"),
    [
        ('[lamp]\nspectrum = "led-purple"', ["lamp.spectrum", "'led-green'", "'planck'"]),
        ("[lamp]\nspectrum = 525", ["lamp.spectrum", "'led-green'"]),
        ("[lamp]\nspectrum = { peak_nm = 525 }", ["lamp.spectrum.fwhm_nm: missing"]),
        ("[lamp]\nspectrum = { peak_nm = 525, fwhm = 35 }", ["lamp.spectrum.fwhm: unknown key", "fwhm_nm?"]),
        ("[lamp]\nspectrum = { peak_nm = 25, fwhm_nm = 35 }", ["lamp.spectrum.peak_nm", ">= 200", "(nm)"]),
        ("[lamp]\nspectrum = [{ peak_nm = 525, fwhm_nm = -1 }]", ["lamp.spectrum.0.fwhm_nm", ">= 0.01"]),
        ("[lamp]\nspectrum = []", ["lamp.spectrum"]),
        ('[detector]\nresponse = "table"', ["response_table"]),
        ("[detector]\nresponse = { peak_nm = 900, fwhm_nm = 10 }", ["found band = [500.0, 550.0]"]),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_by_its_key(toml: str, words: list[str]) -> None:
    with pytest.raises(SceneError) as raised:
        Scene.from_toml(toml)
    text = str(raised.value)
    assert all(word in text for word in words), text
    assert "peak." not in text.replace("a peak", "") and "a name" not in text.split("rule")[0]
