"""The closed loop in traced light against a prototype: another Monte Carlo, vehicle, filter and law.

The prototype: 4 degrees of freedom without Coriolis forces, PD and I, 10 Hz, noise 1 % of the brightest, gain
and water known exactly, a leader that sways; mean distance after the first third of 120 s.
"""

from __future__ import annotations

import pytest

from lightfield.scene import Scene
from lightfield.studies.following.study import follow

pytestmark = pytest.mark.slow
#: Of the prototype's light, and standard deviations that a comparison may differ by (as in test_follower).
THEIRS, SIGMAS = 0.0025, 4
SCENE = Scene.from_dict(
    {
        "lamp": {"hwhm_deg": 3.81},
        "water": {"absorption_per_m": 0.05, "phase": {"type": "henyey-greenstein", "g": 0.92}},
        "array": {"size_m": 0.26, "radius_m": 0.19, "gain_drift_percent": 0.0, "gain_mismatch_percent": 0.0},
        "follower": {
            "x_m": 0.2, "y_m": -0.1, "z_m": 7.5, "yaw_deg": 5.73, "water_known_percent": 0.0,
            "mission": {"degrees_of_freedom": 4},
        },
    }
)  # fmt: skip


@pytest.mark.parametrize(
    ("believes", "b", "expected"),
    [
        ("field", 0.15, 6.496),
        ("fitted", 0.15, 6.497),
        ("exact", 0.02, 6.688),
        ("exact", 0.15, 7.825),
        ("exact", 0.30, 8.967),
        ("clear", 0.05, 6.243),
        ("clear", 0.10, 5.881),
    ],
)
def test_where_followers_stand(believes: str, b: float, expected: float) -> None:
    scene = SCENE.with_values({"water.scattering_per_m": b})
    found = follow({"": scene}, [believes], runs=2, photons=3e6, densest=0.3).cases[0].spreads["standoff"]
    z = found.mean
    # What errors of a gain and of the light at the standoff do to a distance, theirs and, as large, ours.
    light = 0.0 if believes == "field" else 2 * THEIRS / (2 / z + 0.05 + 0.5 * b)
    assert abs(z - expected) < SIGMAS * (light**2 + found.error**2) ** 0.5 + 1e-3
