"""A band whose attenuations are spread hardens: in closed form, and by the few that stand for all."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from lightfield.scene import Water
from lightfield.scene.water.hardening import hardening_depth, within_band


@pytest.mark.parametrize("q_r", [0.0, 0.1, 0.5, 1.0])
def test_one_way_and_many_ways_are_means_over_one_distribution(q_r: float) -> None:
    """Mean of exp(-(c - K) r) over attenuations c that are normal about K, by an adaptive quadrature."""
    path_m = 20.0
    water = Water(hardening_per_m=q_r / path_m)
    mean = quad(lambda u: norm.pdf(u) * np.exp(-q_r * u), -12, 12, epsabs=1e-13)[0]
    assert np.exp(hardening_depth(water, path_m)) == pytest.approx(mean, rel=1e-9)
    changes, shares = within_band(water.hardening_per_m)
    assert shares.sum() == pytest.approx(1.0) and shares @ changes == pytest.approx(0.0, abs=1e-12)
    assert shares @ np.exp(-changes * path_m) == pytest.approx(mean, rel=3e-4)
