"""A check of the installation: what is there, and whether a render gives a number known beforehand."""

from __future__ import annotations

import importlib.metadata
import json
import math
import platform
import subprocess
import sys
from dataclasses import asdict, dataclass

from lightfield import __version__

PACKAGES = (
    "mitsuba",
    "drjit",
    "numpy",
    "scipy",
    "pydantic",
    "xarray",
    "netCDF4",
    "zarr",
    "dask",
    "OpenEXR",
    "scikit-image",
)
CHECK_TIMEOUT_S = 300
RADIUS_M, DISTANCE_M = 1.0, 2.0
RADIANCE = 0.06  # W m^-2 sr^-1 nm^-1
BAND_NM = (500.0, 550.0)
RAYS = 1 << 20
# A right estimate lies outside 5 standard errors once in two million runs.
LARGEST_Z = 5.0


@dataclass(frozen=True)
class Check:
    """A rendered number beside its known value.

    Parameters
    ----------
    value, stderr, known : float, W m^-2
        Rendered irradiance, its standard error, and the exact irradiance.
    problem : str
        Why there is no number; "" when there is one.
    """

    value: float = math.nan
    stderr: float = math.nan
    known: float = math.nan
    problem: str = ""

    @property
    def z(self) -> float:
        """Difference in standard errors."""
        return (self.value - self.known) / self.stderr

    @property
    def passed(self) -> bool:
        """Whether the number is right within its error, the error being small enough to tell."""
        return not self.problem and abs(self.z) <= LARGEST_Z and self.stderr <= 0.005 * self.known


def versions() -> dict[str, str]:
    """Version of Python, of this package and of what it stands on."""
    found = {"lightfield": __version__, "python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            found[package] = "missing"
    return found


def check() -> Check:
    """Render the known case in a process of its own, so that an abort of the compiler is a finding."""
    try:
        child = subprocess.run(
            [sys.executable, "-m", "lightfield.doctor"],
            capture_output=True,
            text=True,
            timeout=CHECK_TIMEOUT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return Check(problem=f"the render did not end within {CHECK_TIMEOUT_S} s")
    except OSError as error:
        return Check(problem=f"the render could not be started ({error.strerror})")
    try:
        return Check(**json.loads(child.stdout.splitlines()[-1]))
    except (IndexError, TypeError, ValueError):
        lines = child.stderr.strip().splitlines() or ["no message"]
        how = f"signal {-child.returncode}" if child.returncode < 0 else f"exit {child.returncode}"
        return Check(problem=f"the render died ({how}): {lines[-1]}")


def render_known_case(seed: int = 1) -> Check:
    """Irradiance on a small plate that faces a uniformly bright sphere.

    A sphere of radiance L and radius R at distance d gives E = pi L (R/d)^2 on a plane that faces it.
    Of N rays drawn from the plate with cosine weight, each sees the sphere with probability (R/d)^2 = p,
    so the standard error is exactly pi L sqrt(p (1 - p) / N). The plate's size changes E by less than 1e-6.

    Parameters
    ----------
    seed : int
        Of the random rays.
    """
    from lightfield.render.backend import use_backend

    use_backend()
    import mitsuba as mi

    look = mi.ScalarTransform4f().look_at(origin=[0, 0, 0], target=[0, 0, 1], up=[0, 1, 0])
    side = math.isqrt(RAYS)
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 2},
            "lamp": {
                "type": "sphere",
                "center": [0, 0, DISTANCE_M],
                "radius": RADIUS_M,
                "emitter": {"type": "area", "radiance": {"type": "uniform", "value": RADIANCE}},
            },
            "plate": {
                "type": "rectangle",
                "to_world": look @ mi.ScalarTransform4f().scale(1e-4),
                "sensor": {
                    "type": "irradiancemeter",
                    "film": {
                        "type": "specfilm",
                        "width": 1,
                        "height": 1,
                        "component_format": "float32",
                        "rfilter": {"type": "box"},
                        "band": {
                            "type": "regular",
                            "wavelength_min": BAND_NM[0],
                            "wavelength_max": BAND_NM[1],
                            "values": "1, 1",
                        },
                    },
                    "sampler": {"type": "independent", "sample_count": side * side},
                },
            },
        }
    )
    value = float(mi.render(scene, seed=seed).array[0])
    share, full = (RADIUS_M / DISTANCE_M) ** 2, math.pi * RADIANCE * (BAND_NM[1] - BAND_NM[0])
    return Check(
        value=value, stderr=full * math.sqrt(share * (1 - share) / (side * side)), known=full * share
    )


if __name__ == "__main__":
    print(json.dumps(asdict(render_known_case())))
