"""Water in layers of height is found; beside water that would absorb nothing, though its scene's does, no
effect is certain."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.diagnosis.diagnose import diagnose
from lightfield.readings import Readings
from lightfield.scene import Scene

ASIDE_M, HWHM_DEG = 0.03, 6.0
LAYERED = Scene.from_dict({"lamp": {"hwhm_deg": 6.6}, "water": {"absorption_per_m": 0.11}})
ABSORPTION_PER_M, ERROR = 0.09, 0.007


def read(per_m: float) -> Readings:
    """By formulas of their own: a lamp 3 cm aside, in water of such an attenuation."""
    rng = np.random.default_rng(3)
    places = [(x, 0.0, z) for z in (2.0, 3.0, 4.0, 5.0, 6.0) for x in np.linspace(-0.8, 0.8, 17)]
    x, y, z = np.array(places)[rng.permutation(len(places))].T
    across, far = np.abs(x - ASIDE_M), np.hypot(x - ASIDE_M, z)
    beam = np.exp(-np.log(2) * (np.degrees(np.arctan2(across, z)) / HWHM_DEG) ** 2)
    value = beam * z / far**3 * np.exp(-per_m * far)
    value /= value.max()
    sigma = np.hypot(0.004 * value, 2e-4)
    return Readings.from_arrays(
        x_m=x, y_m=y, z_m=z, value=value + sigma * rng.standard_normal(len(x)), stderr=sigma,
        time_s=20.0 * np.arange(len(x)), plane_gain_percent=0.0, position_mm=0.0,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("per_m", "stated_per_m", "certain"),
    [
        pytest.param(0.08, 0.1, ["beam_offset"], id="water"),
        pytest.param(0.0, 0.1, [], id="none, where the scene has some"),
        pytest.param(0.0, 0.001, ["beam_offset"], id="as clear as the readings can tell"),
    ],
)  # fmt: skip
def test_beside_no_water_nothing_is_certain(per_m: float, stated_per_m: float, certain: list[str]) -> None:
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 7.0}, "water": {"absorption_per_m": stated_per_m}})
    verdict = diagnose(read(per_m), scene, diffuse=None, advise=False).verdict
    assert verdict.best_set == ["beam_offset"] and sorted(verdict.certain) == certain


def read_layered(below_per_m: float, top_m: float, seed: int, blend_m: float = 0.0) -> Readings:
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
    table = read_layered(below_per_m, top_m, 1, blend_m)
    verdict = diagnose(table, LAYERED, diffuse=None, advise=False).verdict
    assert (verdict.verdict, verdict.certain) == ("identified", ["stratification"])
    found = verdict.ladder[-1].parameters
    for path, true in {
        "water.bottom_layer_absorption_per_m": below_per_m,
        "water.bottom_layer_top_m": top_m,
        "water.absorption_per_m": ABSORPTION_PER_M,
    }.items():
        one = found[path]
        assert one.stderr and abs(one.value - true) < 4 * one.stderr < 0.4 * abs(true), path
