"""Waters of a few moments that stand for all: with readings that begin long after the lamp."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.scene.water.ageing import at_time, growth_per_m, moments
from lightfield.scene.water.coefficients import scattering_per_m
from lightfield.scene.water.water import Water

PATH_M = np.full(40, 6.0)


@pytest.mark.parametrize("begin_s", [0.0, 600.0, 3000.0, 1e6])
@pytest.mark.parametrize("drift", [0.0, 0.1])
def test_each_time_has_its_own_attenuation_along_the_straight_line(begin_s: float, drift: float) -> None:
    """Whatever is left of the particles: light of one moment, moved to the other by Beer and Lambert."""
    water = Water(settling_per_m=0.3, settling_time_s=60.0, drift_per_m_per_hour=drift)
    time = begin_s + np.linspace(0, 4200, 40)
    at, shares = moments(water, time, PATH_M, 4)
    assert np.isfinite(at).all() and np.isfinite(shares).all()
    assert (at >= begin_s).all() and (at <= time[-1]).all()
    light = (shares * np.exp(-growth_per_m(water, at) * 6.0)[:, None]).sum(axis=0)
    assert light == pytest.approx(np.exp(-growth_per_m(water, time) * 6.0), rel=1e-9)


def test_readings_of_one_moment_need_one() -> None:
    at, shares = moments(Water(settling_per_m=0.3), np.full(5, 120.0), PATH_M[:5], 4)
    assert at.tolist() == [120.0] and (shares == 1).all()


def test_what_settles_takes_its_colour_with_it() -> None:
    """Attenuation of the water of a moment is that at time 0 and its growth, at every wavelength."""
    nm = np.array([450.0, 550.0, 650.0])
    power = Water(scattering_per_m=0.1, settling_per_m=0.3, scattering_slope=1.5)
    # As stated at 550 nm, whatever the curve is there.
    curve = Water(scattering_per_m=0.1, settling_per_m=0.3, scattering_departure=((450, 0.5), (650, -0.1)))
    for water, shape in ((power, (550 / nm) ** 1.5), (curve, np.exp([0.3, 0.0, -0.3]))):
        then = scattering_per_m(at_time(water, 1800.0), nm)
        assert then == pytest.approx(scattering_per_m(water, nm) + growth_per_m(water, 1800.0, nm))
        assert then == pytest.approx((0.1 + 0.3 * np.exp(-0.5)) * shape)
