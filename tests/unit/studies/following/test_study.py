"""What is told of a follower, in one sentence."""

from __future__ import annotations

import pytest

from lightfield.scene import Scene
from lightfield.studies.following.study import Followed, follow

SCENE = Scene.from_dict(
    {
        "lamp": {"hwhm_deg": 3.81},
        "water": {"absorption_per_m": 0.1},
        "array": {
            "count": [3, 3], "size_m": 0.26, "radius_m": 0.19, "sample_hz": 5.0,
            "gain_drift_percent": 0.0, "gain_mismatch_percent": 0.0,
        },
        "follower": {"water_known_percent": 0.0, "mission": {"duration_s": 30.0, "leader": "still"}},
    }
)  # fmt: skip


def followed(values: dict[str, float]) -> Followed:
    return follow({"tank": SCENE.with_values(values)}, runs=2, seed=3, photons=0).cases[0]


def test_a_tilted_lamp_is_followed() -> None:
    found = followed({"lamp.tilt_x_deg": 0.5})
    assert found.spreads["standoff"].mean == pytest.approx(6.5, abs=0.1)
    assert found.spreads["belief_less_truth"].runs == 2 and "stands at" in found.verdict


def test_a_follower_that_learns_no_pose_stands_nowhere() -> None:
    """Beside a beam that is hardly round no reading tells how it leans: it drifts, which is no standoff."""
    found = followed({"lamp.ellipticity": 1 + 1e-9})
    assert not found.spreads["belief_less_truth"].runs
    assert "never learns where it is" in found.verdict and "stands" not in found.verdict
