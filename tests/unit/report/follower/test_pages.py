"""Pages of the follower are whole, say the verdict, and hold what is infinite without a crash."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from lightfield.errors import UsageError
from lightfield.report.follower.array_figures import comparison_figure, survey_figure
from lightfield.report.follower.follow_figures import _COLOURS, events_in_words, way_figure
from lightfield.report.follower.follow_page import following_page
from lightfield.report.follower.page import arrays_page, survey_page
from lightfield.report.follower.pose_figures import sequence_figure
from lightfield.report.follower.pose_page import _with_trace, poses_page
from lightfield.report.style import PAPER
from lightfield.scene import DetectorArray, Follower, Scene
from lightfield.scene.follower import Mission
from lightfield.studies.follower.array_light import ArrayModel, FormulaLight, Space
from lightfield.studies.follower.array_noise import SensorNoise
from lightfield.studies.follower.design.compared import JudgedArray, compare_arrays
from lightfield.studies.follower.design.exchange import Mounting, optimise_array
from lightfield.studies.follower.elements import elements_of
from lightfield.studies.follower.estimation.pose import Estimator
from lightfield.studies.follower.estimation.sequence import Poses
from lightfield.studies.follower.estimation.tracking import Tracker
from lightfield.studies.follower.frames import POSE
from lightfield.studies.follower.information import sigma_in_words, with_doubt_in_words
from lightfield.studies.follower.rival_poses import RivalPose
from lightfield.studies.follower.survey import survey
from lightfield.studies.following.loop import Track
from lightfield.studies.following.study import Followed, Following

SCENE = Scene.from_dict(
    {"name": "two <diodes>", "water": {"absorption_per_m": 0.1}, "array": {"count": [2, 1], "size_m": 0.4}}
)
ROUND = {"count": [3, 3], "size_m": 0.26, "radius_m": 0.19}


def test_two_elements_are_blind_and_the_page_says_it(tmp_path: Path) -> None:
    html = survey_page(survey(SCENE, Space.of_scene(SCENE), photons=0))
    assert "2 elements know where they are well enough to dock nowhere" in html and "blind to" in html
    assert "two &lt;diodes&gt;" in html
    # Each of the two figures once more with one panel a row, for a telephone.
    assert html.count('<div class="wide"><svg') == html.count('<div class="narrow"><svg') == 2


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(("yaw_deg", "away"), [(0.0, False), (80.0, False), (100.0, True), (180.0, True)])
def test_an_array_that_looks_away_from_the_lamp_is_told_so(yaw_deg: float, away: bool) -> None:
    """On the axis a flat array reads direct light up to a turn of 90 degrees."""
    scene = SCENE.model_copy(update={"follower": Follower(z_m=5.0, yaw_deg=yaw_deg)})
    found = survey(scene, Space.of_scene(scene), photons=0)
    told = "No element looks at the lamp"
    assert (told in found.as_text()) == (told in survey_page(found)) == found.as_data()["looks_away"] == away


@pytest.mark.usefixtures("undrawn")
def test_a_comparison_names_the_best(tmp_path: Path) -> None:
    good = Scene.from_dict({**SCENE.to_dict(), "name": "good", "array": ROUND})
    html = arrays_page(compare_arrays(good, {"two": SCENE}, Space.of_scene(good), photons=0))
    assert "9 elements (good) know the pose" in html
    with pytest.raises(UsageError, match="at least 5, one for each of x, y, z, yaw, pitch"):
        optimise_array(good, 4, Mounting(0.3), space=Space.of_scene(good), photons=0)
    found = optimise_array(good, 6, Mounting(0.3), space=Space.of_scene(good), photons=0)
    assert found.arrays[0].name == "the best found"
    assert "Elements of the best found" in arrays_page(found)


@pytest.mark.usefixtures("undrawn")
def test_a_way_with_darkness_in_it(tmp_path: Path) -> None:
    scene = Scene.from_dict({**SCENE.to_dict(), "array": {**ROUND, "count": [5, 5]}})
    assert scene.array is not None
    model = ArrayModel(FormulaLight(scene), elements_of(scene.array))
    noise = SensorNoise(brightest=0.01, ampere=1.0, amplifier=1e-9)
    tracker = Tracker(Estimator(model, noise, POSE[:5], {"gain": 0.05}, Space()))
    readings = model.readings(np.array([[0.1, 0, 6, 0, 0, 0.0]]))[0]
    states = [tracker.update(readings * (t != 2), 0.1 * t) for t in range(4)]
    poses = Poses(scene, POSE[:5], 0.1 * np.arange(4), [s.estimate for s in states], states, False)
    html = poses_page(poses)
    assert "1 without light, 0 that do not fit" in html and "light lost" in html
    assert f"At 0.3 s {states[-1].estimate.pose[2]:.2f} ± " in html and "Line and band: the filter" in html
    assert ("Hollow: another pose does as well" in html) == bool(poses.ambiguous)


def test_poses_that_another_does_as_well_as_are_drawn_hollow() -> None:
    """Of three readings the second is such a one."""
    scene = Scene.from_dict({**SCENE.to_dict(), "array": {**ROUND, "count": [5, 5]}})
    assert scene.array is not None
    model = ArrayModel(FormulaLight(scene), elements_of(scene.array))
    estimator = Estimator(
        model, SensorNoise(brightest=0.01, ampere=1.0, amplifier=1e-9), POSE[:5], {"gain": 0.05}, Space()
    )
    one = estimator.estimate(model.readings(np.array([[0.1, 0, 6, 0, 0, 0.0]]))[0])
    two = replace(one, rivals=[RivalPose(one.pose, 1.0, 0.0)])
    assert two.ambiguous and not one.ambiguous
    drawn = sequence_figure(Poses(scene, POSE[:5], 0.1 * np.arange(3), [one, two, one], None, False))
    sure, doubtful = drawn.axes[0].containers
    assert (len(sure[0].get_xdata()), len(doubtful[0].get_xdata())) == (2, 1)
    assert doubtful.get_label() == "ambiguous" and doubtful[0].get_markerfacecolor() == PAPER


@pytest.mark.parametrize(
    ("bias", "trace", "says"),
    [
        (0.44, 0.02, "0.44 ± 0.02 m"),
        (0.44, 0.001, "0.44 ± 0.01 m"),  # no error is printed as none
        (0.44, 0.0, "0.44 m"),  # the formula alone has no photons
        (0.02, 0.03, "less than 0.08 m"),  # nothing that the trace tells
    ],
)
def test_a_bias_below_its_error_is_no_bias(bias: float, trace: float, says: str) -> None:
    assert _with_trace(bias, trace) == says


@pytest.mark.parametrize(
    ("doubt", "says"), [(0.0, "23.3"), (0.0004, "23.30 ± 0.02"), (0.012, "23.3 ± 0.3"), (1.27, "20 ± 30")]
)
def test_an_error_of_the_trace_is_in_the_unit_of_its_bound(doubt: float, says: str) -> None:
    """As "23.3 ± 1.2 %" it could be read as one in per cent; where nothing was traced there is none."""
    assert with_doubt_in_words(23.3, doubt) == says
    assert sigma_in_words("x", 0.0233, doubt) == f"x {says} mm"


@pytest.mark.parametrize(
    ("mission", "says"),
    [
        ({}, ""),
        ({"dark_for_s": 3.0}, " Grey band: dark."),
        (
            {"turbid_factor": 2.0, "current_from_s": 5.0},
            " Green band: the water changes. Dotted line: a current sets in.",
        ),
    ],
)
def test_a_caption_speaks_of_the_bands_that_are_there(mission: dict[str, float], says: str) -> None:
    case = SimpleNamespace(mission=Mission(**mission))
    assert events_in_words([case, case]) == says


def test_an_array_without_a_criterion_has_no_point() -> None:
    """Its A is a ridge, 1e8 and more: the others would be squeezed into a corner."""
    known = JudgedArray("good", elements_of(DetectorArray(**ROUND)), 12.0, {"x": 0.01}, 0.0)
    blind = JudgedArray("blind", known.elements, 5e8, {"x": 1e6}, 0.0)
    below = comparison_figure([known, blind]).axes[-1]
    assert below.collections[0].get_offsets().tolist() == [[12.0, 0.0]]
    assert below.get_xlim()[1] < 100 and below.texts[1].get_text() == "some of the pose unknown"


def test_nothing_covers_what_is_unknown() -> None:
    """What the line of docking is says the legend: a label on it lay over "unknown" in the first bars."""
    bars = survey_figure(survey(SCENE, Space.of_scene(SCENE), photons=0)).axes[1]
    unknown = [text for text in bars.texts if text.get_text() == "unknown"]
    assert unknown and all(bars.get_xlim()[0] < text.xy[0] < bars.get_xlim()[1] for text in unknown)
    assert "what docking allows" not in [text.get_text() for text in bars.texts]
    assert "what docking allows" in [text.get_text() for text in bars.get_legend().get_texts()]


def followed(*lost: float) -> Followed:
    """Runs that stay at 6 m, or that lose their way and end 60 m behind the lamp."""
    time, away, never = np.linspace(0, 60, 61), np.array(lost), np.full((len(lost), 4), np.nan)
    pose = np.zeros((61, len(lost), 6))
    pose[..., 2] = 6 - 1.1 * time[:, None] * away
    flat = np.ones((61, len(lost)))
    track = Track(
        time, np.zeros((61, 3)), pose, pose, 0 * flat, 0 * pose, np.zeros((61, len(lost), 4)), flat,
        lit=flat > 0, doubtful=flat < 0, inside=flat > 0, goal_m=6 * flat, contact=never,
    )  # fmt: skip
    scene = Scene.from_dict({**SCENE.to_dict(), "follower": {}})
    runs = {name: pose.mean(axis=0)[:, 2] for name in ("standoff", "belief_less_truth")}
    runs |= {"outside": 0 * away, "lost": away}
    return Followed("one", scene, track, runs, False)


@pytest.mark.usefixtures("undrawn")
def test_of_runs_that_all_lost_their_way_there_is_no_mean() -> None:
    page = following_page(Following([followed(1.0, 1.0)]))
    assert "no run left" in page and "never" not in page.split("Over time")[1]
    assert "no run is left for a mean" in page and "Thick" not in page
    other = following_page(Following([followed(1.0, 0.0)]))
    assert "Thick: their mean, without those that lost their way." in other and "no run left" not in other


@pytest.mark.parametrize("lost", [(1.0, 1.0), (1.0, 0.0)])
def test_runs_that_lost_their_way_do_not_squeeze_the_others(lost: tuple[float, ...]) -> None:
    far = way_figure([followed(*lost)]).axes[0]
    assert far.get_ylim()[0] > -4 and far.get_ylim()[1] > 6
    (mean,) = (line for line in far.lines if str(line.get_label()).startswith("one:"))
    assert np.isfinite(mean.get_ydata()).any() == (not all(lost))


def test_what_is_next_to_unknown_is_so_in_the_figure_as_in_the_table() -> None:
    """A turn that is known to 179 degrees alone; and no legend lies over the numbers of the bars."""
    found = survey(SCENE, Space.of_scene(SCENE), photons=0)
    sigma = [np.radians(179.0) if name in ("yaw", "pitch") else 0.01 for name in found.here.names]
    here = replace(found.here, covariance=np.diag(np.square(sigma)))
    figure = survey_figure(replace(found, here=here, axis=[]))
    bars = figure.axes[1]
    drawn = [text.get_text() for text in bars.texts]
    assert "179" not in drawn and drawn.count("unknown") == sum(n in ("yaw", "pitch") for n in here.names) > 0
    figure.canvas.draw()
    assert bars.get_legend().get_window_extent().y1 < bars.get_window_extent().y0


@pytest.mark.parametrize(
    ("count", "said"),
    [
        (0, "no other pose looks alike"),
        (1, "another pose looks alike; the nearest"),
        (2, "2 other poses look alike"),
    ],
)
def test_poses_that_look_alike_are_counted(count: int, said: str) -> None:
    found = survey(SCENE, Space.of_scene(SCENE), photons=0)
    alike = replace(found, rivals=[RivalPose(np.zeros(6), 1.0, 0.5)] * count)
    assert said in alike.as_text()


def test_no_belief_is_green() -> None:
    """What is asked for is."""
    assert [name for name, colour in _COLOURS.items() if np.argmax(to_rgb(colour)) == 1] == []
