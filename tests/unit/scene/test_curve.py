"""Curves that a scene states by nodes."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.errors import SceneError
from lightfield.render.response.beam_nodes import BeamNodes
from lightfield.render.response.grid import angle_nodes
from lightfield.scene import Lamp, Scene
from lightfield.scene.curve import integral_to, sum_of, value_at
from lightfield.scene.lamp.profile import relative_intensity, solid_angle_sr
from lightfield.scene.lamp.tabulated import intensity_rows

NODES = ((1.0, 0.5), (2.0, -1.0), (4.0, 0.25))


def test_linear_between_nodes_and_constant_beyond() -> None:
    at = np.array([0.0, 1.0, 1.5, 2.0, 3.0, 9.0])
    np.testing.assert_allclose(value_at(NODES, at), [0.5, 0.5, -0.25, -1.0, -0.375, 0.25])
    assert value_at(((3.0, 0.7),), at).tolist() == [0.7] * 6


def test_the_sum_of_two_curves_is_that_of_their_values() -> None:
    other, at = ((-1.0, 0.2), (3.0, 0.6)), np.linspace(-3.0, 6.0, 91)
    both = np.interp(at, [1, 2, 4], [0.5, -1, 0.25]) + np.interp(at, [-1, 3], [0.2, 0.6])
    np.testing.assert_allclose(value_at(sum_of(NODES, other), at), both, atol=1e-12)
    assert sum_of((), NODES) == NODES == sum_of(NODES, ())


@pytest.mark.parametrize("nodes", [NODES, ((3.0, 0.7),), ((-2.0, 1.0), (0.5, 0.0))])
def test_integral_is_that_of_the_values(nodes: tuple[tuple[float, float], ...]) -> None:
    fine = (np.arange(60_000) + 0.5) / 60_000
    for end in (0.0, 0.3, 1.5, 3.0, 8.0, -1.5):
        summed = (value_at(nodes, end * fine) * end).mean()
        assert integral_to(nodes, np.array([end]))[0] == pytest.approx(summed, abs=1e-4)


def test_a_scene_with_curves_is_the_same_after_writing_and_reading() -> None:
    scene = Scene.from_dict(
        {
            "lamp": {"profile_departure": [[0, 0.1], [5, -0.2]], "power_departure": [[0, 0], [60.5, 0.02]]},
            "water": {"absorption_departure": [[2, 0.01], [3, 0.0]], "colour_departure": [[450, 0.01]]},
            "detector": {"plane_departure": [[4.5, 0.01], [5.5, -0.02]]},
        }
    )
    assert Scene.from_toml(scene.to_toml()) == scene
    assert scene.digest() != Scene().digest()


def test_empty_curves_leave_the_key_of_a_scene_as_it_was() -> None:
    """Results that were kept before scenes had curves are still found."""
    assert Scene.from_dict({"lamp": {"profile_departure": []}}).digest() == Scene().digest()


@pytest.mark.parametrize(
    ("nodes", "says"),
    [
        ([[1, 0], [1, 0.1]], "must rise"),
        ([[2, 0], [1, 0.1]], "must rise"),
        ([[0, 301]], "profile_departure"),
        ([[0, "much"]], "profile_departure"),
        ([[0]], "profile_departure"),
        ([[0, float("nan")]], "profile_departure"),
        (3, "profile_departure"),
    ],
)
def test_nodes_that_make_no_curve_are_one_clear_error(nodes: object, says: str) -> None:
    with pytest.raises(SceneError, match=says):
        Scene.from_dict({"lamp": {"profile_departure": nodes}})


def test_a_stretched_beam_departs_at_stretched_angles() -> None:
    """Of a tally by direction: the beam as seen from farther is that with all its angles larger."""
    nodes = BeamNodes(angle_nodes(4.0), 4.0)
    lamp = Lamp(hwhm_deg=4.0, profile_departure=((0.0, 0.2), (3.0, -0.4), (9.0, 0.5)))
    wide = Lamp(hwhm_deg=5.2, profile_departure=((0.0, 0.2), (3.9, -0.4), (11.7, 0.5)))
    np.testing.assert_allclose(nodes.values(lamp, 1.3), nodes.values(wide), rtol=1e-9, atol=1e-12)


def test_power_of_a_departing_beam_is_its_integral() -> None:
    """By a fine sum over rings."""
    lamp = Lamp(hwhm_deg=5.0, profile_departure=((0.0, -0.3), (4.0, 0.4), (11.0, -1.0)))
    theta = (np.arange(200_000) + 0.5) * (np.pi / 2 / 200_000)
    light = relative_intensity(lamp, theta, np.zeros_like(theta))
    summed = 2 * np.pi * np.sum(light * np.sin(theta)) * (np.pi / 2 / 200_000)
    assert solid_angle_sr(lamp) == pytest.approx(summed, rel=1e-6)


def test_a_table_of_a_beam_is_right_between_its_rows() -> None:
    lamp = Lamp(hwhm_deg=4.0, skirt_fraction=0.1, profile_departure=((0.0, 0.2), (3.0, -0.4), (12.0, 0.5)))
    angle, intensity = intensity_rows(lamp, 15.0).values()
    between = np.linspace(0, 90, 5000)
    true = relative_intensity(lamp, np.radians(between), np.zeros(5000))
    np.testing.assert_allclose(np.interp(between, angle, intensity), true / true[0], atol=1e-3)
    assert angle[0] == 0 and angle[-1] == 90 and intensity[0] == 1
