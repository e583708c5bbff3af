"""Nodes of the scattered light: sums over them are the integrals that they stand for."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import legendre
from scipy.integrate import quad

from lightfield.formula.scattered.quadrature import (
    EmissionTable,
    emission,
    finest_rad,
    in_cell,
    interval,
    near,
    shares_at,
    turns,
)
from lightfield.scene import Lamp
from lightfield.scene.water.phase.spec import HenyeyGreenstein


@pytest.mark.parametrize("g", [0.0, 0.6, 0.924])
def test_turns_have_the_moments_of_their_phase_function(g: float) -> None:
    """Of Henyey and Greenstein's the mean of the Legendre polynomial of order l is g^l."""
    angle, share = turns(HenyeyGreenstein(g=g), 48)
    moments = share @ legendre.legvander(np.cos(angle), 4)
    assert moments == pytest.approx(g ** np.arange(5.0), abs=1e-9)


def test_turns_of_one_phase_function_have_the_moments_of_another() -> None:
    """By the shares of that one; angles are shared within a quarter of 1 - g."""
    phase = HenyeyGreenstein(g=0.93)
    nodes_of = near(phase)
    assert isinstance(nodes_of, HenyeyGreenstein) and 0.8 < (1 - nodes_of.g) / 0.07 < 1.25
    share = shares_at(phase, nodes_of, 48)
    cosine = np.cos(turns(nodes_of, 48).at)
    assert share @ legendre.legvander(cosine, 4) == pytest.approx(0.93 ** np.arange(5.0), abs=1e-9)


def test_turns_up_to_an_angle_are_what_is_scattered_by_less() -> None:
    """Forwards of a right angle: (1 - g^2) / (2 g) (1 / (1 - g) - 1 / sqrt(1 + g^2))."""
    g = 0.8
    forwards = (1 - g * g) / (2 * g) * (1 / (1 - g) - 1 / np.sqrt(1 + g * g))
    angle, share = turns(HenyeyGreenstein(g=g), 48, np.pi / 2)
    assert angle.max() < np.pi / 2
    assert share.sum() == pytest.approx(forwards, rel=1e-12)


@pytest.mark.parametrize("hwhm_deg", [2.0, 12.0])
def test_emission_sums_to_the_light_of_a_gaussian_beam(hwhm_deg: float) -> None:
    """2 pi times the integral of exp(-ln 2 (theta / hwhm)^2) sin(theta), and of its cosine beside it."""
    lamp = Lamp(profile="gaussian", hwhm_deg=hwhm_deg)
    angle, weight = emission(lamp)
    half = np.radians(hwhm_deg)
    for factor in (np.ones_like, np.cos):
        whole, _ = quad(
            lambda t, f=factor: 2 * np.pi * np.exp(-np.log(2) * (t / half) ** 2) * np.sin(t) * f(t),
            0, min(8 * half, np.pi / 2), epsabs=1e-14, epsrel=1e-12,
        )  # fmt: skip
        assert weight @ factor(angle) == pytest.approx(whole, rel=1e-5)


def test_a_gaussian_beam_is_as_fine_as_its_own_standard_deviation() -> None:
    """hwhm / sqrt(2 ln 2)."""
    fine = finest_rad(Lamp(profile="gaussian", hwhm_deg=4.0))
    assert fine == pytest.approx(np.radians(4.0) / np.sqrt(2 * np.log(2)), rel=1e-3)


def test_between_the_angles_of_a_table_a_beam_is_itself() -> None:
    half = np.radians(5.0)
    table, lamp = EmissionTable.of(half), Lamp(profile="gaussian", hwhm_deg=5.0)
    told = table.intensity(lamp)
    theta = np.linspace(0, 0.4, 1001)
    before, part = table.between(theta**2)
    beam = told[before] * (1 - part) + told[before + 1] * part
    assert beam == pytest.approx(np.exp(-np.log(2) * (theta / half) ** 2), abs=1e-5)


def test_nodes_of_cells_and_intervals_sum_polynomials_exactly() -> None:
    """Of a square of side one about zero, x^2 y^2 is 1/144; from 0 to 1, x^3 is 1/4, stretched or not."""
    at, weight = in_cell(3)
    assert weight.sum() == pytest.approx(1.0, rel=1e-12)
    assert weight @ (at[:, 0] ** 2 * at[:, 1] ** 2) == pytest.approx(1 / 144, rel=1e-12)
    for stretched in (False, True):
        x, w = interval(8, stretched)
        assert w @ x**3 == pytest.approx(0.25, rel=1e-12)
