"""A lamp that is wider in red than in blue, in water that scatters: three bands of the full render."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.diagnosis.diagnose import diagnose
from lightfield.readings import Readings
from lightfield.render.at_readings import rendered_light
from lightfield.scene import Scene

NM, WIDTH, KAPPA = (460.0, 530.0, 600.0), 6.0, 0.3
WATER = {"water.scattering_per_m": 0.2, "water.phase.g": 0.9}
SCENE = Scene.from_dict(
    {
        "lamp": {"hwhm_deg": 7.0},
        "water": {"absorption_per_m": 0.12},
        "detector": {"planes_m": [2.0, 4.0, 6.0], "width_m": 2.0, "bands_nm": [[w - 10, w + 10] for w in NM]},
    }
)


@pytest.mark.slow
def test_its_slope_is_found_beside_the_scattering() -> None:
    """Of another simulator's readings nothing was certain after minutes, and walls were told to be white.

    The light of each band is that of a plain lamp, whose width is written out.
    """
    x, z = (v.ravel() for v in np.meshgrid(np.linspace(0.0, 0.9, 10), [2.0, 3.0, 4.0, 5.0, 6.0]))
    rng, parts = np.random.default_rng(2), []
    for nm in NM:
        hidden = {"lamp.hwhm_deg": WIDTH * (nm / 550) ** KAPPA, "water.absorption_per_m": 0.1, **WATER}
        places = Readings.from_arrays(
            x_m=x, z_m=z, wavelength_nm=np.full(x.size, nm), value=np.ones(x.size), quantity="irradiance"
        )
        lit = SCENE.with_values(hidden)
        light, noise = rendered_light(lit, places, rel_error=2e-3, max_photons=2e6, seed=int(nm))
        error = np.hypot(np.hypot(0.006 * light, 0.0003 * light.max()), noise)
        value = light + np.hypot(0.006 * light, 0.0003 * light.max()) * rng.standard_normal(x.size)
        parts.append((x, z, places.wavelength_nm, value, error))
    columns = (np.concatenate(column) for column in zip(*parts, strict=True))
    readings = Readings.from_arrays(
        **dict(zip(("x_m", "z_m", "wavelength_nm", "value", "stderr"), columns, strict=True)),
        quantity="irradiance",
    )
    asked = ["scattering", "scattering_slope", "beam_colour", "background_spectrum", "beam_skirt"]
    found = diagnose(readings, SCENE, only=asked, advise=False).verdict
    assert set(found.best_set) == {"scattering", "beam_colour"} == set(found.certain)
    true = {"lamp.hwhm_deg": WIDTH, "lamp.width_slope": KAPPA, **WATER}
    for path, value in true.items():
        told = found.explanations[0].parameters[path]
        assert told.stderr is not None and told.value == pytest.approx(value, abs=3 * told.stderr), path
    assert (found.explanations[0].parameters["lamp.width_slope"].stderr or 1.0) < 0.03


def test_two_bands_tell_it() -> None:
    """In water that does not scatter: the formula of a plain lamp for each band, its width written out."""
    x, z = (v.ravel() for v in np.meshgrid(np.linspace(0.0, 0.9, 10), [2.0, 3.0, 4.0, 5.0, 6.0]))
    rng, parts = np.random.default_rng(3), []
    for nm in NM[::2]:
        width, r = WIDTH * (nm / 550) ** KAPPA, np.hypot(x, z)
        light = np.exp(-np.log(2) * (np.rad2deg(np.arctan2(x, z)) / width) ** 2 - 0.1 * r) / r**2 * z / r
        error = np.hypot(0.006 * light, 0.0003 * light.max())
        parts.append((x, z, np.full(x.size, nm), light + error * rng.standard_normal(x.size), error))
    columns = (np.concatenate(column) for column in zip(*parts, strict=True))
    readings = Readings.from_arrays(
        **dict(zip(("x_m", "z_m", "wavelength_nm", "value", "stderr"), columns, strict=True)),
        quantity="irradiance",
    )
    found = diagnose(readings, SCENE, diffuse=None, advise=False).verdict
    assert found.certain == ["beam_colour"] == found.best_set
    told = found.explanations[0].parameters["lamp.width_slope"]
    assert told.stderr is not None and told.value == pytest.approx(KAPPA, abs=3 * told.stderr)
    assert told.stderr < 0.03
