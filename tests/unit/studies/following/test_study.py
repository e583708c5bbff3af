"""What is told of a follower, in one sentence."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from lightfield.report.follower.follow_page import following_page
from lightfield.scene import Scene
from lightfield.studies.following.metrics import metrics_of
from lightfield.studies.following.study import Followed, Following, follow, with_belief

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


@cache
def followed(*values: tuple[str, float]) -> Followed:
    return follow({"tank": SCENE.with_values(dict(values))}, runs=2, seed=3, photons=0).cases[0]


def test_a_tilted_lamp_is_followed() -> None:
    found = followed(("lamp.tilt_x_deg", 0.5))
    assert found.spreads["standoff"].mean == pytest.approx(6.5, abs=0.1)
    assert found.spreads["belief_less_truth"].runs == 2 and "stands at" in found.verdict


def test_a_follower_that_learns_no_pose_stands_nowhere() -> None:
    """Beside a beam that is hardly round no reading tells how it leans: it drifts, which is no standoff."""
    found = followed(("lamp.ellipticity", 1 + 1e-9), ("follower.mission.duration_s", 10.0))
    assert not found.spreads["belief_less_truth"].runs
    assert "never learns where it is" in found.verdict and "stands" not in found.verdict


@pytest.mark.usefixtures("undrawn")
def test_a_run_that_lost_its_way_is_counted_and_not_averaged() -> None:
    """One of two drives on behind the lamp: the distance is the other's, and every run's stays listed."""
    found = followed()
    pose = found.track.pose.copy()
    pose[len(pose) // 2 :, 1, 2] = -2.3
    track = replace(found.track, pose=pose)
    astray = replace(found, track=track, runs=metrics_of(track, found.mission))
    assert astray.lost.tolist() == [False, True] and astray.typical == 0
    assert "loses its way in 1 of 2 runs" in astray.verdict
    assert astray.kept.mean == found.runs["standoff"][0] and "too near" not in astray.verdict
    told = astray.as_data()
    assert told["runs_lost"] == 1 and told["metrics"]["lost"]["by_run"] == [0.0, 1.0]
    assert told["metrics"]["standoff"]["by_run"] == astray.runs["standoff"].tolist()
    other = replace(astray, scene=with_belief(found.scene, "exact"))
    together = Following([found, other]).verdict
    assert together.count("loses its way in 1 of 2 runs") == 1 and "Asked for 6.5 m" in together
    assert f"{astray.kept.mean:.3g} m (loses" in together and "tank" not in together
    html = following_page(Following([found, other]))
    assert "1 of 2" in html and "without those that lost their way" in html


@pytest.mark.parametrize(
    ("what", "lost"), [("behind", True), ("away", True), ("blind", True), ("dark", False), ("", False)]
)
def test_who_lost_its_way(what: str, lost: bool) -> None:
    """Darkness is no way lost: who sees nothing in it may find back."""
    found = followed(
        ("follower.mission.dark_from_s", 15.0), ("follower.mission.dark_for_s", 15.5 * (what == "dark"))
    )
    pose, lit = found.track.pose.copy(), found.track.lit.copy()
    late = found.track.time_s >= 20.0
    if what == "behind":
        pose[late, :, 2] = -0.1
    if what == "away":
        pose[late, :, 3] = -np.radians(91)
    if what in ("blind", "dark"):
        lit[late] = False
    runs = metrics_of(replace(found.track, pose=pose, lit=lit), found.mission)
    assert runs["lost"].tolist() == [float(lost)] * 2
    all_lost = replace(found, runs=runs).verdict
    assert ("loses its way in each of 2 runs" in all_lost) == lost
