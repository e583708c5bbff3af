"""Spots of known shape are measured right, with errors that tell the scatter."""

import numpy as np
import pytest

from lightfield.maps.spot import Unmeasured, _ellipse, spot_shape

X = Y = np.linspace(-1, 1, 65)


def spot(hwhm_x=0.3, hwhm_y=0.3, x0=0.0, y0=0.0, power=2.0):
    x, y = np.meshgrid(X, Y)
    rho = np.hypot((x - x0) / hwhm_x, (y - y0) / hwhm_y)
    return 5e-3 * np.exp(-np.log(2) * rho**power)


@pytest.mark.parametrize("power", [1.5, 2.0, 4.0])
def test_round_spots_of_any_profile(power):
    found = spot_shape(spot(power=power), X, Y)
    # Half maximum is at 0.3 m by construction; a cusp (1.5) is blunted by pixels of a tenth of it.
    assert found.hwhm_m == pytest.approx(0.3, rel=0.02)
    assert found.ellipticity == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (5, 1)])
def test_a_row_of_pixels_has_no_shape(shape):
    found = spot_shape(np.ones(shape), np.arange(shape[1]) * 0.1, np.arange(shape[0]) * 0.1)
    assert found.problem is Unmeasured.BEYOND_EDGE and found.peak == pytest.approx(1.0)


def test_shifted_elliptic_spot():
    found = spot_shape(spot(0.25, 0.4, 0.13, -0.07), X, Y)
    assert (found.centre_x_m, found.centre_y_m) == pytest.approx((0.13, -0.07), abs=1e-3)
    assert (found.hwhm_x_m, found.hwhm_y_m) == pytest.approx((0.25, 0.4), rel=5e-3)
    assert found.peak == pytest.approx(5e-3, rel=5e-3)
    assert found.ellipticity == pytest.approx(1.6, rel=5e-3)


def test_stated_errors_are_the_scatter():
    rng = np.random.default_rng(1)
    clean = spot(0.3, 0.33, 0.1, 0.0)
    stderr = 0.05 * clean + 2e-5
    found = [
        spot_shape(clean + stderr * rng.standard_normal(clean.shape), X, Y, stderr, seed=k) for k in range(40)
    ]
    for name in ("peak", "centre_x_m", "centre_y_m", "hwhm_x_m", "hwhm_y_m", "ellipticity"):
        scatter = np.std([getattr(f, name) for f in found], ddof=1)
        stated = np.mean([f.stderr[name] for f in found])
        # Scatter of 40 has an error of 11 %. Contours of a map that is already noisy scatter a bit more.
        assert 0.6 < stated / scatter < 1.9, name


def test_noise_does_not_inflate_the_peak():
    rng = np.random.default_rng(2)
    clean = spot()
    noisy = [spot_shape(clean * (1 + 0.1 * rng.standard_normal(clean.shape)), X, Y).peak for _ in range(20)]
    assert np.mean(noisy) == pytest.approx(5e-3, rel=0.03), "the brightest pixel would be 20 % too high"


def test_a_spot_wider_than_the_plane_is_said_and_not_guessed():
    found = spot_shape(spot(3.0, 3.0), X, Y)
    assert np.isnan(found.hwhm_x_m)
    assert found.problem is Unmeasured.BEYOND_EDGE


def test_a_dark_plane_is_said():
    assert spot_shape(np.zeros((65, 65)), X, Y).problem is Unmeasured.DARK


@pytest.mark.parametrize(
    ("long", "short", "turn"), [(3.0, 1.0, 0.4), (2.0, 2.0, 0.0), (1.0, 0.2, 2.0), (5e-3, 4e-3, 1.5)]
)
def test_an_ellipse_is_found_again_from_points_on_it(long, short, turn):
    """Half widths along x and y of a turned ellipse: where its equation has y = 0, or x = 0."""
    t = np.linspace(0.3, 5.9, 40)
    x = 0.7 + long * np.cos(t) * np.cos(turn) - short * np.sin(t) * np.sin(turn)
    y = -1.2 + long * np.cos(t) * np.sin(turn) + short * np.sin(t) * np.cos(turn)
    found = _ellipse(np.column_stack([x, y]))
    along = [1 / np.hypot(np.cos(turn - q) / long, np.sin(turn - q) / short) for q in (0.0, np.pi / 2)]
    assert found == pytest.approx((0.7, -1.2, *along), rel=1e-9)


def test_one_place_is_no_ellipse():
    assert _ellipse(np.full((12, 2), 0.3)) is None
