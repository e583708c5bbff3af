"""Readings that are means over bands: constituents against spectral light that is summed in steps of 1 nm."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.errors import MeasurementError
from lightfield.readings import Readings
from lightfield.scene import Scene, Water
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m
from lightfield.studies.attenuation.remark import Studied
from lightfield.studies.attenuation.study import attenuation
from lightfield.studies.attenuation.text import as_text

DISTANCES = np.array([1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 5.8])
#: Of 10 nm, over the steep rise of pure water from 0.09 per m at 580 nm to 0.26 at 610 nm (Pope & Fry 1997).
NARROW = [(float(low), float(low) + 10.0) for low in range(420, 680, 10)]
CDOM = 0.06


def scene(**parts: dict) -> Scene:
    lamp = {"hwhm_deg": 8.0, "temperature_k": 3000.0}
    return Scene.from_dict({"water": {"base": "pure"}, **parts, "lamp": {**lamp, **parts.get("lamp", {})}})


def planck(wavelength_nm: np.ndarray) -> np.ndarray:
    """3000 K in any unit: lambda^-5 / (exp(hc / (lambda k T)) - 1)."""
    return wavelength_nm**-5.0 / np.expm1(1.438776877e7 / (wavelength_nm * 3000.0))


def lost_per_m(wavelength_nm: np.ndarray) -> np.ndarray:
    """Pure water's tables, molecules with them, and CDOM that falls by exp(-0.014 per nm)."""
    pure = Water(base="pure")
    cdom = CDOM * np.exp(-0.014 * (wavelength_nm - 440.0))
    return absorption_per_m(pure, wavelength_nm) + scattering_per_m(pure, wavelength_nm) + cdom


def band_readings(bands, seen=planck, noise: float = 2e-4, head: bool = True) -> Readings:
    """Inverse squares, in air and dimmed at every nanometre; means over bands of what the detector sees.

    Middles of steps of 1 nm: 10 terms a band and more.
    """
    rng, rows = np.random.default_rng(5), []
    for low, high in bands:
        at = np.arange(low + 0.5, high, 1.0)
        for z in DISTANCES:
            for medium, c in (("air", 0.0 * at), ("water", lost_per_m(at))):
                light = float((seen(at) * np.exp(-c * z)).mean() / z**2)
                rows.append((z, 0.5 * (low + high), medium, light * (1 + noise * rng.standard_normal())))
    z, middle, medium, value = (np.array(v) for v in zip(*rows, strict=True))
    metadata = {"bands_nm": [list(b) for b in bands]} if head else {}
    return Readings.from_arrays(
        z_m=z, wavelength_nm=middle, medium=medium, value=value, stderr=noise * value,
        plane_gain_percent=0.0, position_mm=0.0, metadata=metadata,
    )  # fmt: skip


def test_bands_over_the_rise_of_pure_water_hold_no_false_sediment() -> None:
    """There is CDOM alone: 0.06 per m at 440 nm is found, and nothing of anything else."""
    found = attenuation(band_readings(NARROW), scene()).content.beer_lambert
    assert not found.rejected, found.p
    cdom = found.amounts["cdom_440_per_m"]
    assert abs(cdom.value - CDOM) < 3 * cdom.stderr and cdom.stderr < 0.001
    for name in ("chlorophyll_mg_per_m3", "sediment_g_per_m3"):
        assert not found.amounts[name].found, found.amounts[name]


def test_a_band_of_fifty_nanometres_hardens_and_is_followed() -> None:
    """Six bands of 50 nm: in 600 to 650 nm what is dimmed most is gone at 5.8 m, and K falls on the way."""
    wide = [(float(low), float(low) + 50.0) for low in range(400, 700, 50)]
    found = attenuation(band_readings(wide), scene())
    assert found.apparent[0].misfit_p < 1e-6, "K of a wide band is no straight line"
    assert not found.content.beer_lambert.rejected
    cdom = found.content.beer_lambert.amounts["cdom_440_per_m"]
    assert abs(cdom.value - CDOM) < 3 * cdom.stderr
    assert not found.content.beer_lambert.amounts["sediment_g_per_m3"].found


def test_the_detector_weighs_the_wavelengths_of_a_band(tmp_path) -> None:
    """A detector that rises tenfold over 400 to 700 nm, in bands of 50 nm."""

    def rising(at: np.ndarray) -> np.ndarray:
        return np.interp(at, [400.0, 700.0], [0.1, 1.0])

    wide = [(float(low), float(low) + 50.0) for low in range(400, 700, 50)]
    table = band_readings(wide, lambda at: planck(at) * rising(at))
    response = tmp_path / "response.csv"
    response.write_text("wavelength_nm,response\n390,0.07\n400,0.1\n700,1.0\n710,1.03\n")
    told = {"response": "table", "response_table": str(response)}
    right = attenuation(table, scene(detector=told)).content.beer_lambert
    cdom = right.amounts["cdom_440_per_m"]
    assert not right.rejected and abs(cdom.value - CDOM) < 3 * cdom.stderr
    assert attenuation(table, scene()).content.beer_lambert.rejected, "without it the weights are wrong"


def test_without_bands_in_the_head_readings_are_light_at_their_wavelength() -> None:
    """As `docs/files.md` has it: nothing is known of their bands, and bands of 10 nm look like sediment."""
    found = attenuation(band_readings(NARROW, head=False), scene()).content.beer_lambert
    assert found.rejected or found.amounts["sediment_g_per_m3"].found


@pytest.mark.parametrize("wrong", ["500:550", [[550, 500]], [["a", "b"]], [[500]]])
def test_bands_in_the_head_that_make_no_sense_are_one_error(wrong) -> None:
    table = band_readings(NARROW[:4])
    table.metadata["bands_nm"] = wrong
    with pytest.raises(MeasurementError, match="bands_nm"):
        attenuation(table, scene())


def test_it_says_that_constituents_are_sought_through_bands() -> None:
    words = as_text(attenuation(band_readings(NARROW), scene()))
    assert "26 of 26 wavelengths stand for bands (up to 10 nm wide)" in words


def test_it_says_how_far_K_of_a_band_lies_below_its_mean() -> None:
    """Slope of ln of the sum over 1 nm, of pure water, against the mean of its coefficients."""
    pure, off = Water(base="pure"), []
    wide = [(float(low), float(low) + 50.0) for low in range(400, 700, 50)]
    for low, high in wide:
        at = np.arange(low + 0.5, high, 1.0)
        c = absorption_per_m(pure, at) + scattering_per_m(pure, at)
        weight = planck(at) / planck(at).sum()
        ln = np.log([(weight * np.exp(-c * z)).sum() for z in DISTANCES])
        off.append(100 * (1 + np.polyfit(DISTANCES, ln, 1)[0] / (weight * c).sum()))
    found = attenuation(band_readings(wide), scene())
    remark = next(note for note in found.notes if note.studied is Studied.BANDS)
    assert max(off) > 5 and remark.percent == pytest.approx(max(off), rel=0.01)
