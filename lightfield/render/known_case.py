"""A render whose result is known beforehand; run as a program it prints the outcome as JSON."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass

from lightfield.render.backend import use_backend

_RADIUS_M, _DISTANCE_M = 1.0, 2.0
_RADIANCE = 0.06  # W m^-2 sr^-1 nm^-1
_BAND_NM = (500.0, 550.0)
_RAYS = 1 << 20
# A right estimate lies outside 5 standard errors once in two million runs.
_LARGEST_Z = 5.0


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
        return not self.problem and abs(self.z) <= _LARGEST_Z and self.stderr <= 0.005 * self.known


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
    use_backend()
    import mitsuba as mi

    look = mi.ScalarTransform4f().look_at(origin=[0, 0, 0], target=[0, 0, 1], up=[0, 1, 0])
    side = math.isqrt(_RAYS)
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 2},
            "lamp": {
                "type": "sphere",
                "center": [0, 0, _DISTANCE_M],
                "radius": _RADIUS_M,
                "emitter": {"type": "area", "radiance": {"type": "uniform", "value": _RADIANCE}},
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
                            "wavelength_min": _BAND_NM[0],
                            "wavelength_max": _BAND_NM[1],
                            "values": "1, 1",
                        },
                    },
                    "sampler": {"type": "independent", "sample_count": side * side},
                },
            },
        }
    )
    value = float(mi.render(scene, seed=seed).array[0])
    share, full = (_RADIUS_M / _DISTANCE_M) ** 2, math.pi * _RADIANCE * (_BAND_NM[1] - _BAND_NM[0])
    return Check(
        value=value, stderr=full * math.sqrt(share * (1 - share) / (side * side)), known=full * share
    )


if __name__ == "__main__":
    print(json.dumps(asdict(render_known_case())))
