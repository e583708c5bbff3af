"""What followers do not know exactly, they learn; and their errors say how well."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lightfield.scene import Scene
from lightfield.studies.following.study import follow

SCENES = Path(__file__).resolve().parents[4] / "scenes"
SCENE = Scene.from_dict(
    {
        "lamp": {"hwhm_deg": 3.81},
        "water": {"absorption_per_m": 0.05, "scattering_per_m": 0.05},
        "array": {
            "count": [3, 3], "size_m": 0.26, "radius_m": 0.19, "sample_hz": 5.0, "gain_mismatch_percent": 0.0,
        },
        "follower": {"mission": {"duration_s": 24.0, "leader": "still"}},
    }
)  # fmt: skip


@pytest.mark.parametrize(("gain_percent", "water_percent"), [(5.0, 0.0), (1.0, 20.0)])
def test_what_is_not_known_is_learned_on_the_way(gain_percent: float, water_percent: float) -> None:
    """Gain and water in error move a follower that holds them; one that seeks them errs as it says."""
    unknown = {"array.gain_drift_percent": gain_percent, "follower.water_known_percent": water_percent}
    found = follow({"": SCENE.with_values(unknown)}, runs=24, seed=3, photons=0).cases[0]
    track, one = found.track, found.spreads["standoff"]
    # By the formula: a factor of the light moves it by so much over 2/z + c.
    moved = 0.01 * np.hypot(gain_percent, water_percent * 6.5 * np.hypot(0.05, 0.05)) / (2 / 6.5 + 0.1)
    assert found.runs["standoff_at_end"].std(ddof=1) < 0.5 * moved
    assert one.error == pytest.approx(one.scatter / np.sqrt(24))
    late = track.time_s > 5.0
    error, stated = (track.estimate - track.pose)[late][..., 2], track.sigma[late][..., 2]
    # Of 24 runs of 19 s, each some ten times as long as a filter remembers a place. It holds more motion
    # possible than there is, behind a leader that sways too: errors are 0.7 to 0.9 of those stated.
    assert 0.5 < np.sqrt(np.mean((error / stated) ** 2)) < 1.0
    # What is left of the bias of single readings, told in the manual: 0.04 m too far.
    assert 0.02 < error.mean() < 0.06


def test_elements_that_are_unlike_draw_no_follower_to_one_side() -> None:
    """A gain known to 5 % is learned no better than they let it: a filter that asks how well readings tell
    where their noise has put it is 0.2 m too near then, more than two of its errors."""
    clear = Scene.load(SCENES / "leader_follower" / "clear.toml")  # elements unlike by 0.8 %
    known = clear.with_values({"follower.water_known_percent": 0.0, "follower.mission.duration_s": 24.0})
    track = follow({"": known}, runs=16, seed=5, photons=0).cases[0].track
    late = track.time_s > 14.0
    error, stated = (track.estimate - track.pose)[late][..., 2], track.sigma[late][..., 2]
    of_runs = error.mean(axis=0)
    assert abs(of_runs.mean()) < 3.5 * of_runs.std(ddof=1) / np.sqrt(16)
    assert 0.7 < np.sqrt(np.mean((error / stated) ** 2)) < 1.3


def test_a_lamp_that_may_point_elsewhere_is_in_the_errors() -> None:
    """Known to 2 degrees it moves the follower by 0.23 m each way; a filter that knew nothing of it was 20 of
    its errors off, one that sought it 5, and elements unlike by 0.8 % make no false knowledge of it."""
    unknown = {
        "follower.lamp_tilt_known_deg": 2.0, "array.gain_mismatch_percent": 0.8, "array.count": (5, 5),
    }  # fmt: skip
    track = follow({"": SCENE.with_values(unknown)}, runs=24, seed=3, photons=0).cases[0].track
    error, stated = (track.estimate - track.pose)[-1, :, :2], track.sigma[-1, :, :2]
    assert np.median(stated) > 0.5 * 6.5 * np.radians(2.0)
    # Two numbers of each of 24 runs: within four standard deviations of one.
    assert np.sqrt(np.mean((error / stated) ** 2)) == pytest.approx(1.0, abs=4 / np.sqrt(2 * 48))


def test_a_lamp_that_points_far_elsewhere_ends_no_follower() -> None:
    """By 5 degrees and more elements read several times what a pose explains; as part of their variance that
    was more than there is, and a filter ended with less than none, after 6 s at the latest."""
    scene = Scene.load(SCENES / "leader_follower" / "clear.toml").with_values(
        {"follower.lamp_tilt_known_deg": 5.0, "follower.mission.duration_s": 8.0}
    )
    track = follow({"": scene}, runs=8, seed=1, photons=0).cases[0].track
    last = track.sigma[-1, :, :5]
    assert np.isfinite(last).all() and (last > 0).all()
