"""Particles that scatter blue more than red, as small ones do: three bands, light by quadrature."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.diagnosis.diagnose import diagnose
from lightfield.formula.closed_form import direct_field
from lightfield.formula.scattered.scattered_field import ScatteredField
from lightfield.readings import Readings
from lightfield.scene import Scene

NM = (470.0, 530.0, 590.0)
SCENE = Scene.from_dict(
    {
        "lamp": {"hwhm_deg": 6.0},
        "water": {"absorption_per_m": 0.1},
        "detector": {"planes_m": [2.0, 4.0, 6.0], "width_m": 2.0, "bands_nm": [[w - 10, w + 10] for w in NM]},
    }
)
TRUTH = SCENE.with_values(
    {"water.scattering_per_m": 0.25, "water.scattering_slope": 1.0, "water.phase.g": 0.9}
)


def test_the_slope_is_found_beside_the_scattering() -> None:
    """Of another simulator's readings "background spectrum" was called certain, and absorption was 5 errors
    off."""
    x, z = (v.ravel() for v in np.meshgrid(np.linspace(0.0, 0.9, 10), [2.0, 3.0, 4.0, 5.0, 6.0]))
    scattered = ScatteredField(x, 0 * x, z).light(TRUTH, list(NM))
    rng, parts = np.random.default_rng(1), []
    for k, nm in enumerate(NM):
        light = direct_field(TRUTH, x, 0 * x, z, np.full(x.size, nm)) + scattered[k]
        error = np.hypot(0.006 * light, 0.0003 * light.max())
        parts.append((x, z, np.full(x.size, nm), light + error * rng.standard_normal(x.size), error))
    columns = (np.concatenate(column) for column in zip(*parts, strict=True))
    readings = Readings.from_arrays(
        **dict(zip(("x_m", "z_m", "wavelength_nm", "value", "stderr"), columns, strict=True)),
        quantity="irradiance",
    )
    asked = ["scattering", "scattering_slope", "background", "beam_skirt"]
    found = diagnose(readings, SCENE, only=asked, advise=False).verdict
    assert set(found.best_set) == {"scattering", "scattering_slope"}
    told = found.explanations[0].parameters["water.scattering_slope"]
    assert told.stderr is not None and told.value == pytest.approx(1.0, abs=3 * told.stderr)
    assert told.stderr < 0.3
