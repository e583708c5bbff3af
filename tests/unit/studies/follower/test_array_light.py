"""Information of an array against closed forms, and values of a separate prototype."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lightfield.errors import RenderError, SceneError
from lightfield.scene import DetectorArray, Follower, Scene, Tank
from lightfield.studies.follower import survey as surveys
from lightfield.studies.follower.array_light import ArrayModel, FormulaLight, Space, light_of, pose_names
from lightfield.studies.follower.array_noise import SensorNoise
from lightfield.studies.follower.bias import bias_study
from lightfield.studies.follower.elements import Elements, grid, on_sphere, rings
from lightfield.studies.follower.frames import POSE
from lightfield.studies.follower.information import UNKNOWN, bound, bounds_together, jackknife
from lightfield.studies.follower.survey import array_of

HALF = np.radians(3.81)
C = 0.1
SCENE = Scene.from_dict(
    {"lamp": {"hwhm_deg": 3.81}, "water": {"absorption_per_m": 0.05, "scattering_per_m": 0.05}}
)
FLAT = grid((5, 5), 0.6)
SMALL = grid((5, 5), 0.4)
CURVED = on_sphere(SMALL, 0.32)
HEMISPHERE = on_sphere(grid((5, 5), 0.26), 0.19)
ONE_PERCENT = SensorNoise(mismatch=0.01)
FIVE = POSE[:5]


def on_axis(z: float) -> np.ndarray:
    return np.array([0.0, 0.0, z, 0.0, 0.0, 0.0])


def sigma(
    elements: Elements, z: float, names=FIVE, gain: bool = False, noise: SensorNoise = ONE_PERCENT
) -> dict[str, float]:
    model = ArrayModel(FormulaLight(SCENE), elements)
    return bound(model, on_axis(z), names, noise, {"gain": UNKNOWN} if gain else {}).sigma


def test_a_tank_too_narrow_for_the_steps_of_a_trace_says_so() -> None:
    """Not that light is wanted up to -0.1 m, in smaller steps, which nobody can ask for."""
    narrow = SCENE.model_copy(update={"tank": Tank(width_m=0.8, depth_m=0.6, lamp_depth_m=0.15)})
    with pytest.raises(RenderError, match=r"0\.15 m from its axis to the nearest.*0\.25 m at least.*deeper"):
        light_of(narrow, Space(0.05, 0.4, 1.3), SMALL, photons=1e4)


def test_no_element_stands_in_a_wall_of_the_formation_space() -> None:
    """A tank of 0.9 m: an array of 0.6 m at 0.4 m to the side would reach 0.25 m into its wall."""
    array = {"array": DetectorArray(size_m=0.6)}
    tank = Tank(width_m=0.9, depth_m=0.9, length_m=4.0, behind_lamp_m=0.3)
    narrow = SCENE.model_copy(update={**array, "tank": tank})
    for study in (surveys.survey, bias_study):
        with pytest.raises(
            RenderError, match=r"0\.4 m to either side, .* 0\.3 m across.*0\.45 m.*half width"
        ):
            study(narrow, Space(0.4, 1.0, 2.0), photons=0)
    assert surveys.survey(narrow, Space(0.15, 1.0, 2.0), photons=0).space.x_m.max() == 0.15


def test_light_is_known_where_the_follower_is_though_it_is_not_in_its_space(monkeypatch) -> None:
    """Nothing says how light goes on beyond the places of a trace: 20 % of it was missing 5 m away."""
    near = SCENE.model_copy(update={"array": DetectorArray(), "follower": Follower(x_m=-0.6, z_m=6.5)})
    asked, formula = [], FormulaLight(near)
    monkeypatch.setattr(surveys, "light_of", lambda scene, space, *_, **__: asked.append(space) or formula)
    found = surveys.survey(near, Space(0.1, 0.8, 1.5), photons=0)
    assert asked == [Space(0.6, 0.8, 6.5)]
    assert float(found.space.z_m.max()) == 1.5 and float(found.space.x_m.max()) == 0.1


@pytest.mark.parametrize("z", [4.5, 6.5, 8.5])
def test_closed_form_across(z: float) -> None:
    """d ln E / dx = -p [2 ln2 / h^2 + 3 + c z] / z^2 at p beside the axis, to second order."""
    small = grid((5, 5), 0.02)
    weight = np.sqrt((small.place_m[:, 0] ** 2).sum())
    expected = 0.01 * z**2 / ((2 * np.log(2) / HALF**2 + 3 + C * z) * weight)
    # Left out: (p / z)^2 times the same number, and the square of the angle in tan.
    wide = (0.01 / z) ** 2 * 2 * np.log(2) / HALF**2
    assert sigma(small, z, "xyz")["x"] == pytest.approx(expected, rel=2 * wide + 1e-6)


@pytest.mark.parametrize("z", [4.5, 6.5, 8.5])
def test_closed_form_along_the_beam(z: float) -> None:
    """With the gain known a single element: s / (2 / z + c). Without, from the width of the beam alone."""
    one = grid((1, 1), 0.1)
    assert sigma(one, z, "z")["z"] == pytest.approx(0.01 / (2 / z + C), rel=1e-6)
    small = grid((5, 5), 0.02)
    squares = (small.place_m**2).sum(axis=1)
    spread = np.sqrt(((squares - squares.mean()) ** 2).sum())
    # Beside the beam's width, 1/r^3 and exp(-c r) change with p^2: (3 + c z) h^2 / (2 ln2) of it.
    expected = 0.01 * z**3 * HALF**2 / (2 * np.log(2) * spread)
    assert sigma(small, z, "xyz", gain=True)["z"] == pytest.approx(
        expected, rel=(3 + C * z) * HALF**2 / (2 * np.log(2))
    )


#: (array, names, gain unknown): bound in mm and degrees at 4.5, 6.5 and 8.5 m; three digits (prototype).
PUBLISHED = {
    "flat": (FLAT, "xyz", False, {"x": (0.607, 1.26, 2.15), "z": (6.73, 6.44, 6.89)}),
    "flat, gain": (FLAT, "xyz", True, {"z": (10.9, 32.8, 73)}),
    "small, gain": (SMALL, "xyz", True, {"x": (0.907, 1.89, 3.22), "z": (24.4, 73.5, 164)}),
    "flat, five": (FLAT, FIVE, False, {"x": (1.47, 10.2, 35.8), "yaw": (3.43, 10.3, 23)}),
    "curved": (CURVED, FIVE, False, {"x": (5.1, 9.0, 14.6), "z": (4.9, 5.6, 6.4), "yaw": (1.09, 0.84, 0.79)}),
    "hemisphere": (
        HEMISPHERE,
        FIVE,
        False,
        {"x": (2.9, 6.1, 10.5), "z": (4.2, 5.2, 6.2), "yaw": (0.21, 0.23, 0.25)},
    ),
}


@pytest.mark.parametrize("case", PUBLISHED)
def test_bounds_of_the_prototype(case: str) -> None:
    """Every digit that it prints."""
    elements, names, gain, expected = PUBLISHED[case]
    for name, values in expected.items():
        for z, value in zip((4.5, 6.5, 8.5), values, strict=True):
            mine = sigma(elements, z, names, gain)[name]
            mine = 1e3 * mine if name in "xyz" else float(np.degrees(mine))
            decimals = len(f"{value}".partition(".")[2]) if value != int(value) or value < 10 else 0
            assert abs(mine - value) <= 0.5001 * 10.0**-decimals + 1e-9, (name, z, mine)


def test_a_scatter_of_estimates_is_as_large_as_the_bound() -> None:
    """Linearised estimates from noisy readings, by a plain least-squares solution of their own."""
    rng = np.random.default_rng(0)
    model, pose = ArrayModel(FormulaLight(SCENE), CURVED), np.array([0.2, 0.1, 6.0, 0.1, -0.05, 0.0])
    readings, slopes = model.readings(pose[None])[0], model.slopes(pose, FIVE)
    noise = SensorNoise(brightest=0.01)
    spread = 0.01 * readings.max() * rng.standard_normal((4000, 25))
    estimates = np.linalg.lstsq(slopes, spread.T, rcond=None)[0]
    known = np.array(list(bound(model, pose, FIVE, noise).sigma.values()))
    # Standard deviation of 4000 draws: 1 / sqrt(8000) of itself; five of them, at 4 sigma.
    np.testing.assert_allclose(estimates.std(axis=1), known, rtol=4 / np.sqrt(8000))


def test_flat_arrays_trade_sideways_for_yaw_and_curved_do_not() -> None:
    model = {
        name: ArrayModel(FormulaLight(SCENE), e) for name, e in (("flat", FLAT), ("hemisphere", HEMISPHERE))
    }
    tied = {n: bound(m, on_axis(6.5), FIVE, ONE_PERCENT) for n, m in model.items()}
    assert abs(tied["flat"].correlation("x", "yaw")) > 0.99
    assert tied["flat"].sigma["yaw"] > 40 * tied["hemisphere"].sigma["yaw"]


def test_what_cannot_be_known_is_said_to_be_unknown() -> None:
    """Roll about a round beam's axis; five coordinates from two readings."""
    model = ArrayModel(FormulaLight(SCENE), FLAT)
    rolled = bound(model, on_axis(6.5), POSE, ONE_PERCENT)
    assert np.isinf(rolled.sigma["roll"]) and rolled.as_data()["sigma"]["roll_deg"] is None
    assert rolled.sigma["x"] == pytest.approx(sigma(FLAT, 6.5)["x"], rel=1e-6)
    assert np.isfinite(list(sigma(FLAT, 6.5).values())).all()
    assert np.isinf(rolled.criteria["A"]) and "roll unknown" in rolled.as_text()
    two = bound(ArrayModel(FormulaLight(SCENE), grid((2, 1), 0.4)), on_axis(6.5), FIVE, ONE_PERCENT)
    assert np.isinf([two.sigma[n] for n in ("x", "y", "yaw", "pitch")]).all() and two.sigma["z"] < 0.03
    turned = replace(rolled, names=("x", "yaw"), covariance=np.diag([1e-4, np.radians(140.0) ** 2]))
    assert turned.as_text().endswith("x 10 mm, yaw unknown"), "an angle that may be any is off by 104 degrees"


def test_an_elliptical_beam_makes_roll_known() -> None:
    oval = SCENE.with_values({"lamp.ellipticity": 1.5})
    found = bound(ArrayModel(FormulaLight(oval), FLAT), on_axis(6.5), POSE, ONE_PERCENT)
    assert 0 < found.sigma["roll"] < 0.1


def test_several_readings_share_what_is_not_known() -> None:
    """With the gain unknown two distances tell it: both poses are then better known than alone."""
    model, gain = ArrayModel(FormulaLight(SCENE), FLAT), {"gain": UNKNOWN}
    poses = np.stack([on_axis(4.5), on_axis(8.5)])
    together = bounds_together(model, poses, ("x", "y", "z"), ONE_PERCENT, gain)
    alone = [bound(model, pose, ("x", "y", "z"), ONE_PERCENT, gain) for pose in poses]
    assert together[1].sigma["z"] < 0.3 * alone[1].sigma["z"]
    # The nearer reading tells the gain nearly as well as both.
    assert together[0].nuisances["gain"] == pytest.approx(alone[0].nuisances["gain"], rel=0.1)


def test_a_tilted_lamp_is_a_follower_elsewhere() -> None:
    """The derivative by the lamp's direction against a scene whose lamp is tilted, in water without walls."""
    pose = np.array([0.2, -0.1, 6.0, 0.05, 0.1, 0.0])
    model = ArrayModel(FormulaLight(SCENE), CURVED)
    slopes = model.slopes(pose, ("lamp tilt x", "lamp tilt y"))
    for k, axis in enumerate("xy"):
        tilted = [
            ArrayModel(FormulaLight(SCENE.with_values({f"lamp.tilt_{axis}_deg": t})), CURVED).readings(
                pose[None]
            )[0]
            for t in (0.01, -0.01)
        ]
        expected = (tilted[0] - tilted[1]) / np.radians(0.02)
        np.testing.assert_allclose(slopes[:, k], expected, rtol=1e-4, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("name", ["absorption", "scattering", "lamp tilt x", "lamp tilt y"])
def test_what_is_not_known_changes_with_the_pose(name: str) -> None:
    """Its slopes by the pose are differences of it."""
    model, pose = ArrayModel(FormulaLight(SCENE), HEMISPHERE), np.array([0.3, -0.2, 5.0, 0.3, -0.2, 0.1])
    found, step = model.by_both(pose[None], POSE, [name])[0, :, 0], 1e-3
    for k in range(len(POSE)):
        around = pose + step * np.eye(len(POSE))[k] * np.array([[1.0], [-1.0]])
        more, less = model.by_nuisances(around, [name])[..., 0]
        scale = np.abs(found[:, k]).max()
        np.testing.assert_allclose(found[:, k], (more - less) / (2 * step), rtol=1e-3, atol=1e-3 * scale)


def test_nothing_turns_about_the_axis_of_a_round_beam_tilted_or_not() -> None:
    tilted = SCENE.with_values({"lamp.tilt_x_deg": 0.5})
    assert pose_names(SCENE) == pose_names(tilted) == FIVE
    assert pose_names(SCENE.with_values({"lamp.ellipticity": 1.2})) == POSE
    known = bound(ArrayModel(FormulaLight(tilted), HEMISPHERE), on_axis(6.5), FIVE, ONE_PERCENT).sigma
    assert known["y"] == pytest.approx(sigma(HEMISPHERE, 6.5)["y"], rel=0.05)


def test_layouts() -> None:
    assert FLAT.spacing_m == pytest.approx(0.15) and len(FLAT) == 25
    assert np.allclose(np.linalg.norm(CURVED.place_m - [0, 0, 0.32], axis=1), 0.32)
    assert np.allclose(np.linalg.norm(CURVED.normal, axis=1), 1)
    circle = rings((6, 2), 0.4)
    assert len(circle) == 12 and np.linalg.norm(circle.place_m, axis=1).max() == pytest.approx(0.2)


def test_electrical_noise_adds_as_variances() -> None:
    """Shot, dark and amplifier's noise of a current, and the step of a converter, by hand."""
    array = {"noise_percent": 0.0, "gain_mismatch_percent": 0.0, "adc_bits": 8, "sample_hz": 20.0}
    scene = Scene.from_dict({**SCENE.to_dict(), "array": array})
    noise = SensorNoise.of_scene(scene)
    light = np.array([0.01, 0.002])
    current = noise.ampere * light
    electric = 2 * 1.602176634e-19 * (current + 2e-9) * 10 + 5e-12**2 * 10
    step = 0.01 / 256
    np.testing.assert_allclose(noise.variance(light), electric / noise.ampere**2 + step**2 / 12, rtol=1e-12)


def test_jackknife_is_the_error_of_a_mean_and_finds_the_bias_of_a_square() -> None:
    """Of a mean sigma / sqrt(n); of its square, whose bias is the variance of the mean, both together."""
    values = np.random.default_rng(1).normal(10.0, 1.0, 12)
    without = (values.sum() - values) / 11
    error = values.std(ddof=1) / np.sqrt(12)
    assert jackknife(values.mean(), list(without)) * values.mean() == pytest.approx(error, rel=1e-9)
    square = jackknife(values.mean() ** 2, list(without**2)) * values.mean() ** 2
    assert square == pytest.approx(np.hypot(2 * values.mean() * error, error**2), rel=0.02)
    assert jackknife(1.0, []) == 0.0 and jackknife(1.0, [1.0, np.inf]) == 1.0


def test_an_empty_array_is_what_the_error_says_it_is() -> None:
    with pytest.raises(SceneError, match=r"flat grid of 5 x 5 over 0\.6 m"):
        array_of(Scene())
    array = array_of(Scene.from_dict({"array": {}}))
    assert (array.layout, array.count, array.size_m, array.radius_m) == ("grid", (5, 5), 0.6, 0.0)
