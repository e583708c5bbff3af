"""Water that is more turbid below a height, or above one: it is found, where it lies and how strong it is."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.diagnosis.diagnose import diagnose
from lightfield.readings import Readings
from lightfield.scene import Scene

SCENE = Scene.from_dict({"lamp": {"hwhm_deg": 6.6}, "water": {"absorption_per_m": 0.11}})
HWHM_DEG, ABSORPTION_PER_M, ERROR = 6.0, 0.09, 0.007


def readings(below_per_m: float, top_m: float, seed: int, blend_m: float = 0.0) -> Readings:
    """Of a Gaussian beam, the attenuation summed up in small steps along every ray."""
    rng = np.random.default_rng(seed)
    y, z = (a.ravel() for a in np.meshgrid(np.linspace(-0.8, 0.8, 17), [1.5, 2.5, 3.5, 5.0, 6.5]))
    r = np.hypot(y, z)
    heights = y[:, None] * (np.arange(2000) + 0.5) / 2000
    part = 0.5 - np.clip((heights - top_m) / blend_m, -0.5, 0.5) if blend_m else heights < top_m
    depth = (ABSORPTION_PER_M + below_per_m * part.mean(axis=1)) * r
    beam = np.exp2(-((np.degrees(np.arctan2(np.abs(y), z)) / HWHM_DEG) ** 2))
    value = beam * z / r**3 * np.exp(-depth)
    stderr = np.hypot(ERROR * value, 1e-4 * value.max())
    value = value + stderr * rng.standard_normal(len(y))
    return Readings.from_arrays(x_m=0 * y, y_m=y, z_m=z, value=value, stderr=stderr)


@pytest.mark.parametrize(
    ("below_per_m", "top_m", "blend_m"), [(0.07, -0.25, 0.0), (0.1, -0.3, 0.1), (-0.05, 0.2, 0.0)]
)
def test_a_layer_in_height_is_found(below_per_m: float, top_m: float, blend_m: float) -> None:
    table = readings(below_per_m, top_m, 1, blend_m)
    verdict = diagnose(table, SCENE, diffuse=None, advise=False).verdict
    assert (verdict.verdict, verdict.certain) == ("identified", ["stratification"])
    found = verdict.ladder[-1].parameters
    for path, true in {
        "water.bottom_layer_absorption_per_m": below_per_m,
        "water.bottom_layer_top_m": top_m,
        "water.absorption_per_m": ABSORPTION_PER_M,
    }.items():
        one = found[path]
        assert one.stderr and abs(one.value - true) < 4 * one.stderr < 0.4 * abs(true), path
