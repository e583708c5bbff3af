"""Particles that scatter blue more than red, as small ones do, or by no power of the wavelength: bands of the
full render."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.diagnosis.diagnose import diagnose
from lightfield.fitting.fitted_curves import fitted_curves
from lightfield.readings import Readings
from lightfield.render.at_readings import rendered_light
from lightfield.scene import Scene

NM = np.array([470.0, 530.0, 590.0])
HIDDEN = {"water.scattering_per_m": 0.25, "water.scattering_slope": 1.0, "water.phase.g": 0.9}
SCENE = Scene.from_dict(
    {
        "lamp": {"hwhm_deg": 6.0},
        "water": {"absorption_per_m": 0.1},
        "detector": {"planes_m": [2.0, 4.0, 6.0], "width_m": 2.0, "bands_nm": [[w - 10, w + 10] for w in NM]},
    }
)


def rendered(scene: Scene, table: Readings, photons: float = 2e6) -> tuple[np.ndarray, np.ndarray]:
    return rendered_light(scene, table, rel_error=3e-4, max_photons=photons, seed=5)


def places() -> Readings:
    grid = np.meshgrid(np.linspace(0.0, 0.9, 10), [2.0, 3.0, 4.0, 5.0, 6.0], NM, indexing="ij")
    x, z, nm = (v.ravel() for v in grid)
    return Readings.from_arrays(x_m=x, z_m=z, wavelength_nm=nm, value=np.ones(x.size), quantity="irradiance")


@pytest.fixture(scope="module")
def light() -> tuple[np.ndarray, np.ndarray]:
    return rendered(SCENE.with_values(HIDDEN), places())


def test_a_band_is_lit_as_by_grey_water_of_its_own(light: tuple[np.ndarray, np.ndarray]) -> None:
    """b (550 nm / wavelength), written out for each band, in a trace of its own; not by that of 550 nm."""
    table = places()
    for nm in NM[[0, 2]].tolist():
        mine = table.wavelength_nm == nm

        def misfit(b: float, mine: np.ndarray = mine) -> float:
            grey = SCENE.with_values({"water.scattering_per_m": b, "water.phase.g": 0.9})
            there, error = rendered(grey, table.subset(mine))
            return float(np.mean(((light[0][mine] - there) / np.hypot(light[1][mine], error)) ** 2))

        assert misfit(0.25 * 550 / nm) < 2 < 5 < misfit(0.25)


#: Of no power: most in the middle band.
PEAKED = np.array([0.15, 0.28, 0.17])
ASKED = ["scattering", "scattering_slope", "background", "background_spectrum", "beam_skirt"]


@pytest.mark.slow
def test_scattering_of_no_power_is_a_curve() -> None:
    """Every band in grey water of its own. Of another simulator's readings "background spectrum" was called
    certain, or nothing explained them."""
    table = places()
    light, error = np.empty((2, len(table.value)))
    for nm, b in zip(NM.tolist(), PEAKED.tolist(), strict=True):
        mine = table.wavelength_nm == nm
        grey = SCENE.with_values({"water.scattering_per_m": b, "water.phase.g": 0.9})
        light[mine], error[mine] = rendered(grey, table.subset(mine), 2e7)
    stderr = np.hypot(np.hypot(0.006 * light, 0.0003 * light.max()), error)
    readings = Readings.from_arrays(
        x_m=table.x_m, z_m=table.z_m, wavelength_nm=table.wavelength_nm, stderr=stderr, quantity="irradiance",
        value=light + stderr * np.random.default_rng(3).standard_normal(len(light)),
    )  # fmt: skip
    answer = diagnose(readings, SCENE, only=[*ASKED, "scattering_spectrum"], advise=False)
    found, last = answer.verdict, answer.steps[-1].fit
    assert set(found.certain) == {"scattering", "scattering_spectrum"} == set(found.best_set)
    assert "scattering_slope" not in found.untestable
    (curve,) = fitted_curves(answer.forward, last, answer.finding.level.phi)
    there = [np.abs(curve.at - w).argmin() for w in NM]
    assert np.abs((curve.value[there] - PEAKED) / curve.stderr[there]).max() < 3
    assert curve.stderr[there].max() < 0.04
    # By so much as a render of grey water, as found at 550 nm, differs from the readings' light.
    b, g = (last.values[path] for path in ("water.scattering_per_m", "water.phase.g"))
    flat, _ = rendered(SCENE.with_values({"water.scattering_per_m": b, "water.phase.g": g}), table, 2e7)
    changed = np.average(((light - flat) / light) ** 2, weights=(light / stderr) ** 2)
    assert curve.rms == pytest.approx(np.sqrt(changed), rel=0.15)


@pytest.fixture(scope="module")
def fine() -> tuple[np.ndarray, np.ndarray]:
    """Known to a third of the readings' noise: bands share photons, and so what is wrong with them."""
    return rendered(SCENE.with_values(HIDDEN), places(), 6e7)


@pytest.mark.slow
@pytest.mark.parametrize("bands", [NM, NM[[0, 2]]])
def test_the_slope_is_found_beside_the_scattering(
    fine: tuple[np.ndarray, np.ndarray], bands: np.ndarray
) -> None:
    """Of another simulator's readings "background spectrum" was called certain, and absorption was 5 errors
    off; in two bands nothing explained them."""
    read = np.isin(places().wavelength_nm, bands)
    rng, table = np.random.default_rng(10), places().subset(read)
    light = (fine[0][read], fine[1][read])
    error = np.hypot(np.hypot(0.006 * light[0], 0.0003 * light[0].max()), light[1])
    readings = Readings.from_arrays(
        x_m=table.x_m, z_m=table.z_m, wavelength_nm=table.wavelength_nm, stderr=error,
        value=light[0] + error * rng.standard_normal(len(error)), quantity="irradiance",
    )  # fmt: skip
    found = diagnose(readings, SCENE, only=[*ASKED, "scattering_spectrum"], advise=False).verdict
    assert set(found.best_set) == {"scattering", "scattering_slope"}
    for path, true in HIDDEN.items():
        told = found.explanations[0].parameters[path]
        assert told.stderr is not None and told.value == pytest.approx(true, abs=3 * told.stderr), path
    assert (found.explanations[0].parameters["water.scattering_slope"].stderr or 1.0) < 0.1
