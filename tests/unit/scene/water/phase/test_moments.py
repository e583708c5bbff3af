"""Moments of phase functions in closed form: of their densities, and of what their samplers draw."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import legendre

from lightfield.scene.water.molecular import DEPOLARISATION
from lightfield.scene.water.phase.function import PhaseFunction
from lightfield.scene.water.phase.henyey_greenstein import HenyeyGreensteinPhase, TwoTermHenyeyGreensteinPhase
from lightfield.scene.water.phase.molecular import Molecular, ParticlesAndMolecules

ORDERS = np.arange(8)


def henyey_greenstein(g: float) -> np.ndarray:
    """The mean of the Legendre polynomial of order l is g^l."""
    return np.asarray(g ** ORDERS.astype(float))


def molecular() -> np.ndarray:
    """1 + f cos^2 is (1 + f/3) P_0 + (2 f/3) P_2, and the mean of P_2^2 over the sphere is 1/5."""
    f = (1 - DEPOLARISATION) / (1 + DEPOLARISATION)
    return np.where(ORDERS == 0, 1.0, np.where(ORDERS == 2, 2 * f / 15 / (1 + f / 3), 0.0))


CASES: dict[str, tuple[PhaseFunction, np.ndarray]] = {
    "forward": (HenyeyGreensteinPhase(0.924), henyey_greenstein(0.924)),
    "backward": (HenyeyGreensteinPhase(-0.4), henyey_greenstein(-0.4)),
    "isotropic": (HenyeyGreensteinPhase(0.0), henyey_greenstein(0.0)),
    "two terms": (
        TwoTermHenyeyGreensteinPhase(0.9, -0.5, 0.97),
        0.97 * henyey_greenstein(0.9) + 0.03 * henyey_greenstein(-0.5),
    ),
    "molecules": (Molecular(), molecular()),
    "mixture": (
        ParticlesAndMolecules(HenyeyGreensteinPhase(0.924), 0.3),
        0.7 * henyey_greenstein(0.924) + 0.3 * molecular(),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_moments_of_the_density_are_those_of_its_series(name: str) -> None:
    """By Gauss and Legendre's rule, which is exact for the series up to its 400th term."""
    phase, moments = CASES[name]
    cosine, weight = legendre.leggauss(400)
    polynomials = legendre.legvander(cosine, ORDERS[-1])
    assert 2 * np.pi * (weight * phase.pdf(cosine)) @ polynomials == pytest.approx(moments, abs=1e-9)
    assert phase.mean_cosine() == pytest.approx(moments[1], abs=1e-6)


@pytest.mark.parametrize("name", CASES)
def test_what_is_drawn_has_the_same_moments(name: str) -> None:
    """At the middles of equal parts of the uniform numbers; of a table, as the mixture's, to its steps."""
    phase, moments = CASES[name]
    drawn = phase.sample((np.arange(200_000) + 0.5) / 200_000)
    assert legendre.legvander(drawn, ORDERS[-1]).mean(axis=0) == pytest.approx(moments, abs=2e-6)
