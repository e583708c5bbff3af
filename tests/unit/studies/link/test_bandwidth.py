"""Bandwidth of traced paths against a closed form, and whether its error is honest."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from lightfield.scene import Scene
from lightfield.scene.water.molecular import refractive_index
from lightfield.studies.link.bandwidth import (
    GROUP_INDEX,
    HALF_POWER,
    LIGHT_M_PER_S,
    PATH_NODES,
    bandwidth_of,
    between_nodes,
    coarser,
)
from lightfield.studies.link.study import link

SECONDS_PER_M = GROUP_INDEX / LIGHT_M_PER_S


def scene(b: float) -> Scene:
    phase = {"type": "henyey-greenstein", "g": 0.92}
    water = {"absorption_per_m": 0.05, "scattering_per_m": b, "phase": phase}
    return Scene.from_dict({"lamp": {"hwhm_deg": 3.81, "power_w": 10.0}, "water": water})


def tallied(length_m: float, scattered: float, nodes: int = PATH_NODES) -> tuple[np.ndarray, np.ndarray]:
    """Exponential delays of a mean excess, shared between the steps of a tally as a trace shares them."""
    excess = 60.0 * (np.arange(nodes) / (nodes - 1)) ** 3
    fine = length_m * np.geomspace(1e-6, 40, 200_000)
    weight = np.exp(-fine / length_m) * np.gradient(fine) / length_m
    low = np.clip(np.searchsorted(excess, fine, side="right") - 1, 0, nodes - 2)
    share = (fine - excess[low]) / (excess[low + 1] - excess[low])
    out = np.bincount(low, (1 - share) * weight, nodes) + np.bincount(low + 1, share * weight, nodes)
    return scattered * out / out.sum(), excess


@pytest.mark.parametrize("length_m", [0.01, 0.1, 1.0])
@pytest.mark.parametrize("scattered", [1.0, 10.0])
def test_exponential_delays_have_a_closed_form(length_m, scattered) -> None:
    """|D + S / (1 + i w t)| = (D + S) / sqrt(2), t the mean delay; the stated error covers the steps."""
    by_path, excess = tallied(length_m, scattered)
    (found,), (error,) = bandwidth_of(np.ones(1), np.stack([by_path[:, None]] * 4), excess)
    delay = length_m * SECONDS_PER_M

    def above(ln_f: float) -> float:
        turned = 1 + scattered / (1 + 2j * np.pi * np.exp(ln_f) * delay)
        return abs(turned) / (1 + scattered) - HALF_POWER

    right = np.exp(brentq(above, np.log(1e-3 / delay), np.log(1e3 / delay)))
    assert found == pytest.approx(right, rel=0.012)
    assert abs(found - right) < 2 * error + 1e-3 * right
    # Steps twice as wide: the error says so.
    rough, rough_excess = tallied(length_m, scattered, PATH_NODES // 2 + 1)
    (found,), (error,) = bandwidth_of(np.ones(1), np.stack([rough[:, None]] * 4), rough_excess)
    assert abs(found - right) < 2 * error + 1e-3 * right


@pytest.mark.parametrize("salinity", [0.0, 35.0])
def test_what_is_sent_travels_by_the_group_index(salinity: float) -> None:
    """Slope of the published refractive index by differences; the refractive index itself is 1.8 % less."""
    w, step = np.array([450.0, 500.0, 550.0, 600.0]), 0.01
    index, above, below = (refractive_index(w + d, 20.0, salinity) for d in (0.0, step, -step))
    group = index - w * (above - below) / (2 * step)
    assert group == pytest.approx(np.full(4, GROUP_INDEX), rel=0.013)
    assert np.all(group > 1.012 * index)


def test_light_that_comes_straight_sets_no_limit() -> None:
    by_path, excess = tallied(0.1, 0.4)
    (found,), (error,) = bandwidth_of(np.ones(1), np.stack([by_path[:, None]] * 4), excess)
    assert np.isinf(found) and np.isnan(error)


def test_a_coarser_tally_keeps_light_and_mean_path() -> None:
    by_path, excess = tallied(0.3, 2.0)
    halved, steps = coarser(by_path[:, None], excess)
    assert len(steps) == 101 and halved.sum() == pytest.approx(2.0)
    assert steps @ halved[:, 0] == pytest.approx(excess @ by_path)


def test_no_curve_leads_to_where_there_is_no_limit() -> None:
    nodes = np.array([4.0, 8.0, 16.0, 32.0])
    width, error = between_nodes(
        np.array([6.0, 10.0, 16.0, 25.0]), nodes, np.array([np.inf, np.inf, 1e9, 1e8]), nodes
    )
    assert np.isinf(width[:2]).all() and np.isnan(error[:2]).all()
    assert width[2] == pytest.approx(1e9) and 1e8 < width[3] < 1e9


def test_a_distance_where_no_photon_arrived_does_not_lift_the_limit_before_it() -> None:
    nodes, asked = np.array([4.0, 8.0, 16.0, 32.0, 60.0]), np.array([4.0, 8.0, 12.0, 32.0, 50.0])
    width, _ = between_nodes(asked, nodes, np.array([np.inf, 1e9, np.inf, 1e8, np.inf]), 0.1 * nodes)
    assert np.isinf(width[0]) and width[1] == pytest.approx(1e9)
    assert 1e8 < width[2] < 1e9 and width[3] == pytest.approx(1e8) and np.isnan(width[4])


@pytest.mark.slow
def test_the_error_of_a_bandwidth_is_what_seeds_scatter() -> None:
    found, stated = [], []
    for seed in range(8):
        data = link(scene(0.15), waters={}, max_photons=3e5, rel_error=1e-4, seed=seed, cache=False).dataset
        at = data.isel(water=0).interp(z_m=[10.0, 20.0, 30.0])
        found.append(at.bandwidth_hz.values)
        stated.append(at.bandwidth_stderr_hz.values)
    spread, error = np.std(found, axis=0, ddof=1), np.mean(stated, axis=0)
    assert np.all(spread < 2 * error)
    assert np.all(error < 5 * spread + 0.03 * np.mean(found, axis=0))


def test_where_nothing_scattered_arrives_there_is_no_limit() -> None:
    found, error = bandwidth_of(np.ones(2), np.zeros((3, 0, 2)), np.zeros(0))
    assert np.isinf(found).all() and np.isnan(error).all()
