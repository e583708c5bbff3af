"""A still water surface, which mirrors by Fresnel's law, no more and no less: by its image of the lamp."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.diagnosis.diagnose import diagnose
from lightfield.readings import Readings
from lightfield.scene import Scene

HWHM_DEG, PER_M, TOP_M, NOISE, WATER = 9.0, 0.1, 0.6, 0.005, 1.34


def fresnel(cosine: np.ndarray) -> np.ndarray:
    """Reflectance of unpolarised light from below, by the laws of Snell and Fresnel."""
    beyond = WATER * np.sqrt(1 - cosine**2)
    outside = np.sqrt(np.maximum(1 - beyond**2, 0))
    across = (WATER * cosine - outside) / (WATER * cosine + outside)
    along = (cosine - WATER * outside) / (cosine + WATER * outside)
    return np.where(beyond >= 1, 1.0, 0.5 * (across**2 + along**2))


def light(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """The lamp's, and that of its image as high above the surface."""
    total = np.zeros(len(z))
    for height in (0.0, 2 * TOP_M):
        r = np.sqrt(x**2 + (y - height) ** 2 + z**2)
        theta = np.degrees(np.arccos(z / r))
        part = 1.0 if height == 0 else fresnel(np.abs(y - height) / r)
        total += part * np.exp2(-((theta / HWHM_DEG) ** 2)) * np.exp(-PER_M * r) * z / r**3
    return total


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2, 3))])
def test_a_plain_water_surface_is_certain_and_mirrors_all_it_should(seed: int) -> None:
    """Its reflectance is one, the end of what nature has: no end of what a fit may say, and with an error."""
    rng = np.random.default_rng(seed)
    z, y = (v.ravel() for v in np.meshgrid(np.linspace(3.0, 7.0, 6), np.linspace(-0.5, 0.5, 15)))
    x = rng.uniform(-0.3, 0.3, z.size)
    lit = light(x, y, z)
    error = NOISE * np.hypot(lit, 0.05 * lit.max())
    shown = lit + error * rng.standard_normal(z.size)
    table = Readings.from_arrays(x_m=x, y_m=y, z_m=z, value=shown, stderr=error)
    tank = {"width_m": 3.0, "depth_m": 2.0, "length_m": 9.0, "lamp_depth_m": TOP_M, "wall_albedo": 0.0}
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 8.0}, "water": {"absorption_per_m": 0.12}, "tank": tank})
    few = ["surface_reflection", "background", "beam_tilt"]
    verdict = diagnose(table, scene, only=few, advise=False).verdict
    assert (verdict.verdict, verdict.certain) == ("identified", ["surface_reflection"])
    found = verdict.ladder[-1].parameters
    for path, true in (("tank.surface_reflectance", 1.0), ("water.absorption_per_m", PER_M)):
        assert found[path].value == pytest.approx(true, abs=3.5 * found[path].stderr), path
    assert found["tank.surface_reflectance"].stderr < 0.05
