"""The comparison finds differences that were put in, and only those."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from lightfield.maps.dataset import to_dataset
from lightfield.render.maps import render_scene
from lightfield.report.compare.page import comparison_page, write_comparison
from lightfield.scene import Scene
from lightfield.studies.compare.in_a_sentence import in_a_sentence
from lightfield.studies.compare.maps import compare, compare_plane
from lightfield.studies.compare.rings import BEYOND, OPEN, WITHIN, Profile, excess, radial_profile, standing


@pytest.fixture
def formula(light):
    return lambda scene, x, y, z, wavelength: light(scene, x, y, z)


def test_without_a_difference_nothing_is_reported(make, formula):
    # Cells of 1 cm, so that averaging over the cell (formula) and its centre (stand-in) are the same to 1e-3.
    comparison = compare(to_dataset(make(pixels=201, noise=0.02)), formula)
    for plane in comparison.planes:
        assert plane.within(0.05).radius_m == np.inf
        assert abs(plane.lost) < 3 * plane.lost_stderr + 1e-3
        # 3 sigma + 5 % of 2 % noise is 5.5 sigma: not one of 40 000 cells.
        assert (excess(plane.render, plane.stderr, plane.formula) > 0.05).sum() == 0
    assert "within 5 % on every plane" in in_a_sentence(comparison)


def dark(rendering, *planes):
    """The data set with planes that no light reached, though the formula expects some."""
    dataset = to_dataset(rendering)
    for plane in planes:
        dataset["irradiance"][:, plane] = 0.0
        dataset["irradiance_stderr"][:, plane] = np.inf
    return dataset


@pytest.mark.usefixtures("undrawn")
def test_a_plane_without_light_is_not_judged(make, formula):
    rendering = make(glow=0.02, noise=0.002)
    whole, comparison = (compare(d, formula) for d in (to_dataset(rendering), dark(rendering, 1)))
    assert [plane.is_lit for plane in comparison.planes] == [True, False, True]
    assert in_a_sentence(comparison).endswith(
        " No light was rendered at 6.5 m: nothing can be compared there."
    )
    alone = compare(to_dataset(rendering).isel(z_m=[0, 2]), formula)
    assert in_a_sentence(comparison).startswith(
        in_a_sentence(alone).replace("every plane", "every lit plane")
    )
    assert comparison.planes[0].as_data() == whole.planes[0].as_data()
    told = comparison.planes[1].as_data()
    assert told["lost"] is told["axis_error"] is told["radius_within_5_percent_m"] is None
    assert not re.search(r"\bnan\b", comparison_page(comparison, {}), re.IGNORECASE)


@pytest.mark.usefixtures("undrawn")  # in the page: the same figures are drawn as pictures
def test_without_any_light_there_is_no_verdict(make, formula, tmp_path):
    comparison = compare(dark(make(), 0, 1, 2), formula)
    assert in_a_sentence(comparison).startswith(
        "No light was rendered on any plane: nothing can be compared."
    )
    write_comparison(comparison, {}, tmp_path)


def test_lost_light_is_the_glow_that_was_added(make, formula):
    rendering = make(glow=0.04, noise=0.01)
    comparison = compare(to_dataset(rendering), formula)
    diffuse, everything = rendering.truth("diffuse")[0], rendering.truth()[0]
    for index, plane in enumerate(comparison.planes):
        share = diffuse[index].sum() / everything[index].sum()
        assert plane.lost == pytest.approx(share, abs=4 * plane.lost_stderr + 2e-3)
        assert plane.lost_stderr < 1e-3


def test_axis_error_and_radius_are_those_of_the_glow(make, formula):
    rendering = make(glow=0.02, noise=0.002)
    plane = compare(to_dataset(rendering), formula).planes[0]
    diffuse, everything = rendering.truth("diffuse")[0, 0], rendering.truth()[0, 0]
    share = diffuse / everything
    middle = 65 // 2
    assert plane.axis_error == pytest.approx(-share[middle, middle], abs=4 * plane.axis_error_stderr + 1e-3)
    x = rendering.grid.x_m[middle:]
    expected = x[np.argmax(share[middle, middle:] > 0.10)]
    assert plane.within(0.10).radius_m == pytest.approx(expected, abs=2 * 2 / 65)


def test_the_axis_is_that_of_the_lamp_wherever_it_meets_the_plane():
    """Of a lamp 0.5 m aside the light of one in the middle, 0.5 m aside; none on a plane that it misses."""
    detector = {"planes_m": [2.0, 3.0], "width_m": 2.0, "pixels": 40, "bands_nm": [[469.0, 471.0]]}
    water = {"absorption_per_m": 0.1}
    found = []
    for x in (0.0, 0.5, 1.2):
        lamp = {"hwhm_deg": 5.0, "offset_x_m": x}
        scene = Scene.from_dict({"lamp": lamp, "water": water, "detector": detector})
        found.append(compare(to_dataset(render_scene(scene, max_photons=1e3, rel_error=0.5))))
    there, aside, beyond = ([plane.axis.formula[0] for plane in one.planes] for one in found)
    assert aside == pytest.approx(there, rel=1e-9)
    assert "on the axis it is within 5 % on every plane" in in_a_sentence(found[1])
    assert np.isnan(beyond).all() and found[2].planes[0].as_data()["axis_error"] is None
    assert "the lamp's axis meets none of the planes" in in_a_sentence(found[2])


def test_one_pixel_is_as_large_as_its_plane():
    """Half of the beam's width: at its middle it is a fifth brighter than in the mean."""
    detector = {"planes_m": [1.0], "width_m": 0.1, "pixels": 1}
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 4.0}, "detector": detector})
    plane = compare(to_dataset(render_scene(scene, max_photons=2e4, rel_error=0.01))).planes[0]
    assert abs(plane.axis_error) < 4 * plane.axis_error_stderr + 2e-3


def test_a_cell_larger_than_what_a_collimator_sees_of_the_lamp_is_averaged_over_it():
    """From 8.7 mm about the axis alone the lamp is within 1 degree; the cells are 40 mm wide."""
    detector = {"quantity": "radiance", "planes_m": [0.5], "width_m": 0.2, "pixels": 5}
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 10.0}, "detector": detector})
    plane = compare(to_dataset(render_scene(scene, max_photons=2e5, rel_error=0.005))).planes[0]
    assert abs(plane.axis_error) < 4 * plane.axis_error_stderr + 0.02


def test_shape_of_both_spots(make, formula):
    plane = compare(to_dataset(make(glow=0.0, lamp__ellipticity=1.3, lamp__offset_x_m=0.1)), formula).planes[
        0
    ]
    for spot in (plane.render_spot, plane.formula_spot):
        assert spot.centre_x_m == pytest.approx(0.1, abs=0.01)
        assert spot.ellipticity == pytest.approx(1.3, rel=0.02)
    # The half width of the paper's beam at 4.5 m: tan 3.81 deg x 4.5 m, less 0.3 % for r and cos.
    assert plane.formula_spot.hwhm_x_m == pytest.approx(np.tan(np.radians(3.81)) * 4.5, rel=0.01)


def test_noise_alone_is_no_excess():
    render = np.array([1.0, 1.0, 1.0, 0.0])
    stderr = np.array([0.1, 0.1, np.inf, np.inf])
    np.testing.assert_allclose(excess(render, stderr, np.array([1.29, 1.4, 9.0, 1.0])), [0, 0.1, 0, 0])


def test_rings_have_the_error_of_a_mean():
    x = np.linspace(-1, 1, 41)
    ones, stderr = np.ones((41, 41)), np.full((41, 41), 0.1)
    profile = radial_profile(ones, stderr, 2 * ones, x, x)
    radius = np.hypot(*np.meshgrid(x, x))
    n = np.count_nonzero((radius > 0.475) & (radius < 0.525))
    at = np.argmin(abs(profile.r_m - 0.50))
    assert profile.stderr[at] == pytest.approx(0.1 / np.sqrt(n))
    np.testing.assert_allclose(profile.formula, 2)
    assert profile.r_m.max() <= 1.03


@pytest.mark.parametrize(("pixels", "centre"), [(2, (0.0, 0.0)), (20, (0.9, 0.9))])
def test_the_first_ring_about_a_corner_of_the_outermost_cells_is_kept(pixels, centre):
    """No cell is nearer to the centre than 0.7 of its size, and the edge of the plane one size off."""
    pitch = 2 / pixels
    x = (np.arange(pixels) + 0.5) * pitch - 1
    profile = radial_profile(
        np.ones((pixels, pixels)), np.full((pixels, pixels), 0.1), np.ones((pixels, pixels)), x, x, centre
    )
    np.testing.assert_allclose(profile.r_m, [pitch / np.sqrt(2)])
    np.testing.assert_allclose(profile.stderr, [0.05])  # of four cells


def test_four_pixels_are_compared(make, formula):
    comparison = compare(to_dataset(make(pixels=2)), formula)
    assert "Of the light on the plane" in in_a_sentence(comparison)


def test_silent_cells_have_unknown_error_and_do_not_count():
    x = np.linspace(-1, 1, 21)
    render = np.zeros((21, 21))
    plane = compare_plane(525, 5.0, x, x, render, np.full((21, 21), np.inf), np.full((21, 21), 1e-9))
    assert (excess(plane.render, plane.stderr, plane.formula) == 0).all()
    assert np.isnan(plane.lost)
    assert plane.as_data()["lost"] is None
    assert np.isinf(plane.profile.stderr).all()


def test_summary_is_plain_json(make, formula):
    text = json.dumps(compare(to_dataset(make(pixels=33)), formula).as_data(), allow_nan=False)
    assert json.loads(text)["planes"][1]["z_m"] == 6.5


def test_few_photons_tell_nothing(make, formula):
    """The same glow in a render of 60 % noise: neither within 5 % nor beyond it."""
    known, noisy = (compare(to_dataset(make(glow=0.02, noise=noise)), formula) for noise in (0.002, 0.6))
    assert "too few photons" not in in_a_sentence(known)
    assert "on the axis too few photons tell whether it is within 5 % on every plane" in in_a_sentence(noisy)
    assert "off the axis too few photons tell" in in_a_sentence(noisy)
    assert [np.isinf(plane.within(0.05).radius_m) for plane in noisy.planes] == [False] * 3
    assert [plane.told_on_axis for plane in noisy.planes] == [OPEN] * 3


def test_an_error_is_within_a_level_beyond_it_or_open():
    render, formula = np.ones(6), np.array([1.04, 1.04, 1.06, 1.06, 1.2, 1.2])
    stderr = np.array([0.02, 0.03, 0.01, 1e-3, 0.04, 0.2])
    found = standing(render, stderr, formula, 0.05)
    np.testing.assert_array_equal(found, [WITHIN, OPEN, OPEN, BEYOND, BEYOND, OPEN])


def test_a_ring_counts_together_with_those_beside_it():
    """One cell on the axis is known to 8 %, the ring about it to 2 %: together within 5 %."""
    r, ones = np.arange(4) * 0.1, np.ones(4)
    near = Profile(r, ones, np.array([0.08, 0.02, 0.01, 0.001]), np.array([1.07, 1.0, 1.0, 1.2]))
    np.testing.assert_array_equal(near.standings(0.05), [WITHIN, WITHIN, BEYOND, BEYOND])
    dark = Profile(r, np.zeros(4), np.full(4, np.inf), np.full(4, 1e-9))
    np.testing.assert_array_equal(dark.standings(0.05), [OPEN] * 4)


def test_what_falls_from_too_bright_to_too_dark_is_not_within(make):
    """Errors of a formula that goes from +20 to -20 % over the plane cancel in no mean of it."""
    rng = np.random.default_rng(3)
    truth, stderr = 1 + np.linspace(0.2, -0.2, 14), np.full(14, 0.06)
    for _ in range(200):
        render = 1 + stderr * rng.standard_normal(14)
        rings = Profile(np.arange(14) * 0.05, render, stderr, truth)
        assert (rings.standings(0.10)[[0, 1, 12, 13]] != WITHIN).sum() >= 2
        assert not ((rings.standings(0.05) == WITHIN) & (rings.standings(0.10) != WITHIN)).any()


def plane_of(states: list[int], monkeypatch, plane):
    monkeypatch.setattr(Profile, "standings", lambda self, level: np.array(states))
    return plane.within(0.10)


def test_where_too_few_photons_tell_nothing_is_said_to_be_off(make, formula, monkeypatch):
    plane = compare(to_dataset(make(noise=0.01)), formula).planes[-1]
    rest = len(plane.profile.r_m)
    r = plane.profile.r_m
    found = plane_of([OPEN] * 10 + [BEYOND] * (rest - 10), monkeypatch, plane)
    assert np.isnan(found.radius_m) and found.beyond_m == r[10] and not found.is_left
    found = plane_of([WITHIN] * 5 + [OPEN] + [BEYOND] * (rest - 6), monkeypatch, plane)
    assert found.radius_m == pytest.approx(0.5 * (r[4] + r[5])) and found.is_left
    found = plane_of([WITHIN] * rest, monkeypatch, plane)
    assert found.radius_m == np.inf and not found.is_left
    assert plane_of([OPEN] * rest, monkeypatch, plane)[:2] == pytest.approx([np.nan, np.nan], nan_ok=True)


@pytest.mark.parametrize(
    ("lost", "said"),
    [
        ((2e-4, 1e-4, -3e-4), "The formula has the light on the plane to 0.05 % at 4.5 m and at 8.5 m; "),
        (
            (2e-4, 0.1, -0.03),
            "Of the light on the plane the formula adds 0.0 % at 4.5 m and 3.0 % at 8.5 m; ",
        ),
        (
            (0.02, 0.1, -3e-4),
            "Of the light on the plane the formula loses 2.0 % at 4.5 m and 0.0 % at 8.5 m; ",
        ),
        (
            (0.02, 0.1, -0.03),
            "Of the light on the plane the formula loses 2.0 % at 4.5 m and adds 3.0 % at 8.5 m; ",
        ),
    ],
)
def test_nothing_is_neither_lost_nor_added(make, formula, lost: tuple[float, ...], said: str) -> None:
    made = compare(to_dataset(make(pixels=5)), formula)
    planes = tuple(replace(p, lost=part) for p, part in zip(made.planes, lost, strict=True))
    assert in_a_sentence(replace(made, planes=planes)).startswith(said)


@pytest.mark.parametrize("nm", [450.0, 650.0])
def test_of_several_colours_the_sentence_speaks_of_the_brightest(make, formula, nm: float) -> None:
    made = compare(to_dataset(make(pixels=5)), formula)
    faint = [replace(p, render=p.render / 350, wavelength_nm=nm) for p in made.planes]
    assert in_a_sentence(replace(made, planes=(*made.planes, *faint))).startswith("At 525 nm, ")
