"""Oval beams, turned about their axis, against rotations written out here."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lightfield.scene import Lamp
from lightfield.scene.lamp.frame import has_round_section, is_mirrored
from lightfield.scene.lamp.profile import relative_intensity, solid_angle_sr
from lightfield.scene.lamp.section import effective_angles, oval, oval_widths, section_widths, widest_turn

ACROSS_RAD = np.random.default_rng(8).uniform(-0.2, 0.2, (2, 50))


def turned(ratio: float, turn_rad: float) -> Lamp:
    """Widths of 6 sqrt(ratio) degrees at a turn from x towards y, and of 6 / sqrt(ratio) across."""
    size = math.log(ratio)
    # The ellipticity widens y alone: x is narrower by the square root of it.
    e = math.exp(-size * math.cos(2 * turn_rad))
    d = math.exp(size * math.sin(2 * turn_rad))
    return Lamp(hwhm_deg=6.0 / math.sqrt(e), ellipticity=e, ellipticity_diagonal=d)


@pytest.mark.parametrize("turn_deg", [0.0, 20.0, 45.0, 75.0, 90.0, 110.0, 135.0, 170.0])
def test_an_oval_beam_is_the_same_at_every_turn(turn_deg: float) -> None:
    """A Gaussian that is 1.8 times as wide in one direction as across, whichever that is."""
    turn = math.radians(turn_deg)
    lamp, (x, y) = turned(1.8, turn), ACROSS_RAD
    along, across = math.cos(turn) * x + math.sin(turn) * y, math.cos(turn) * y - math.sin(turn) * x
    wide, narrow = (math.radians(6.0) * 1.8**power for power in (0.5, -0.5))
    gaussian = np.exp(-math.log(2) * ((along / wide) ** 2 + (across / narrow) ** 2))
    np.testing.assert_allclose(relative_intensity(lamp, x, y), gaussian, rtol=1e-12)
    assert math.cos(2 * (widest_turn(lamp) - turn)) == pytest.approx(1.0, abs=1e-9)
    assert np.multiply(lamp.hwhm_deg, oval_widths(lamp)) == pytest.approx(np.degrees([narrow, wide]))
    assert solid_angle_sr(lamp) == pytest.approx(solid_angle_sr(turned(1.8, 0.0)), rel=1e-6)
    straight = turn_deg in (0.0, 90.0)
    assert is_mirrored(lamp) == (straight, straight) and not has_round_section(lamp)


def test_a_beam_that_is_not_turned_is_as_wide_in_x_as_its_profile() -> None:
    assert oval(Lamp(ellipticity=1.7)) == (1.0, 0.0, 1.7)
    nearly = oval(Lamp(ellipticity=1.7, ellipticity_diagonal=1 + 1e-12))
    assert nearly == pytest.approx((1.0, 0.0, 1.7), abs=1e-11)
    assert oval_widths(Lamp(ellipticity=0.4)) == pytest.approx((0.4, 1.0))


def test_a_lopsided_oval_beam_lies_within_its_widths() -> None:
    """Every direction has a width: the angle over that at which an even beam is as bright."""
    lamp = Lamp(ellipticity=1.2, ellipticity_diagonal=0.7, asymmetry_x=0.2, asymmetry_y=-0.1)
    phi = np.linspace(0, 2 * math.pi, 200)
    width = 1 / np.hypot(*effective_angles(lamp, np.cos(phi), np.sin(phi)))
    narrow, wide = section_widths(lamp)
    assert narrow <= width.min() < 1 < width.max() <= wide
