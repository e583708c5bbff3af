"""Maps that a GPU traces, beside those that the processor traces."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from command_line import lightfield

from lightfield.render.backend.cuda import cuda_problem

TANK = """
[lamp]
hwhm_deg = 10
[water]
absorption_per_m = 0.15
scattering_per_m = 0.1
[tank]
width_m = 2.0
depth_m = 1.5
length_m = 4.0
lamp_depth_m = 0.7
wall_albedo = 0.4
[detector]
planes_m = [1.5, 3.0]
width_m = 1.0
pixels = 9
bands_nm = [[500, 550]]
"""


def maps(folder: Path, backend: str, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Irradiance of a scene and its standard error."""
    scene = folder / "tank.toml"
    scene.write_text(TANK)
    out = folder / f"{backend}-{seed}"
    wanted = ("--backend", backend, "--seed", seed, "--max-photons", "4e6", "--no-figures", "--no-exr")
    done = lightfield("render", scene, "-o", out, *wanted, "--no-cache")
    assert done.returncode == 0, done.stderr
    with xr.open_dataset(out / "maps.nc") as told:
        return told["irradiance"].values, told["irradiance_stderr"].values


def scatter(one: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray]) -> float:
    """Mean square of the differences of two maps in units of their errors."""
    return float(np.mean((one[0] - other[0]) ** 2 / (one[1] ** 2 + other[1] ** 2)))


@pytest.mark.gpu
@pytest.mark.skipif(bool(cuda_problem()), reason="no usable CUDA device")
def test_a_gpu_traces_the_maps_that_the_processor_traces(tmp_path: Path) -> None:
    """Of other seeds; as far apart as two of the processor's own, whose neighbouring cells share photons."""
    host = maps(tmp_path, "llvm", 1)
    apart, own = scatter(maps(tmp_path, "cuda", 2), host), scatter(maps(tmp_path, "llvm", 3), host)
    assert apart < 2 * max(own, 1.0)
