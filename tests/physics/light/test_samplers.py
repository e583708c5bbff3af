"""Every sampler draws from its own density: chi-square over log-angle bins, expectation from direct
integration.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scattered_back import backscatter_ratio
from scipy.stats import chi2

from lightfield.scene import Lamp
from lightfield.scene.lamp.profile import relative_intensity, solid_angle_sr
from lightfield.scene.water.phase.function import PhaseFunction
from lightfield.scene.water.phase.henyey_greenstein import HenyeyGreensteinPhase, TwoTermHenyeyGreensteinPhase
from lightfield.scene.water.phase.molecular import Molecular, ParticlesAndMolecules
from lightfield.scene.water.phase.of_scene import parse_phase
from lightfield.scene.water.phase.tabulated import FournierForandPhase, petzold

SAMPLES = 400_000
NODES, WEIGHTS = np.polynomial.legendre.leggauss(64)

PHASES = {
    "hg 0.924": HenyeyGreensteinPhase(0.924),
    "hg 0.99": HenyeyGreensteinPhase(0.99),
    "hg 0": HenyeyGreensteinPhase(0.0),
    "hg -0.6": HenyeyGreensteinPhase(-0.6),
    "two-term": TwoTermHenyeyGreensteinPhase(0.9305, -0.502, 0.9967),
    "two-term wide": TwoTermHenyeyGreensteinPhase(0.6, -0.8, 0.5),
    "fournier-forand": FournierForandPhase(1.10, 3.5835),
    "fournier-forand steep": FournierForandPhase(1.05, 4.2),
    "petzold average": petzold("average"),
    "petzold clear": petzold("clear"),
    "petzold coastal": petzold("coastal"),
    "petzold harbor": petzold("harbor"),
    "molecules": Molecular(),
    "hg and molecules": ParticlesAndMolecules(HenyeyGreensteinPhase(0.924), 0.2),
}


def expected(density_per_sr, edges: np.ndarray) -> np.ndarray:
    """Integral of a density over rings between angles, by quadrature in log angle, independent of any CDF."""
    log = np.log(edges)
    half, middle = 0.5 * np.diff(log), 0.5 * (log[1:] + log[:-1])
    psi = np.exp(middle[:, None] + half[:, None] * NODES)
    return 2 * math.pi * half * ((density_per_sr(psi) * np.sin(psi) * psi) @ WEIGHTS)


def p_value(angles: np.ndarray, probability: np.ndarray, edges: np.ndarray, total: int) -> float:
    """Chi-square of counts in bins, the rest of the sphere as one more bin; bins expecting under 20 are
    pooled.
    """
    counts = np.histogram(angles, edges)[0].astype(float)
    observed, model = [total - counts.sum()], [total * (1 - probability.sum())]
    for count, mean in zip(counts, total * probability, strict=True):
        if model[-1] < 20:
            observed[-1] += count
            model[-1] += mean
        else:
            observed.append(count)
            model.append(mean)
    if model[-1] < 20:
        last_observed, last_model = observed.pop(), model.pop()
        observed[-1] += last_observed
        model[-1] += last_model
    o, m = np.array(observed), np.array(model)
    return float(chi2.sf(np.sum((o - m) ** 2 / m), len(m) - 1))


@pytest.mark.parametrize("name", PHASES)
def test_phase_sampler(name: str) -> None:
    """From 1e-3 deg, where half of a Fournier-Forand's decades lie, to 180 deg; p in (1e-4, 1 - 1e-4) for
    three seeds.
    """
    phase = PHASES[name]
    edges = np.geomspace(math.radians(1e-3), math.pi, 60)
    # 1 - cos keeps its digits where cos alone has lost them; the density is asked through the cosine all the
    # same.
    probability = expected(lambda psi: phase.pdf(np.cos(psi)), edges)
    for seed in (1, 2, 3):
        cosine = phase.sample(np.random.default_rng(seed).random(SAMPLES))
        angles = np.arccos(np.clip(cosine, -1, 1))
        assert 1e-4 < p_value(angles, probability, edges, SAMPLES) < 1 - 1e-4


@pytest.mark.parametrize("name", PHASES)
def test_phase_table_for_the_tracer(name: str) -> None:
    """The (u, angle) table inverted linearly in log angle, in single precision as on the device, is the same
    density.
    """
    phase = PHASES[name]
    u, psi = phase.inverse_cdf_table()
    assert u[0] == 0 and u[-1] == 1 and np.all(np.diff(u) > 0) and np.all(np.diff(psi) > 0) and psi[0] > 0
    edges = np.geomspace(math.radians(1e-2), math.pi, 60)
    probability = expected(lambda psi: phase.pdf(np.cos(psi)), edges)
    for seed in (1, 2, 3):
        drawn = np.random.default_rng(seed).random(SAMPLES)
        angles = np.exp(np.interp(drawn, u, np.log(psi)))
        assert 1e-4 < p_value(angles, probability, edges, SAMPLES) < 1 - 1e-4


@pytest.mark.parametrize("name", PHASES)
def test_cdf_is_the_integral_of_the_density(name: str) -> None:
    """Closed or tabulated distribution against quadrature of the density, ring by ring."""
    phase = PHASES[name]
    edges = np.geomspace(math.radians(0.05), math.pi, 120)
    rings = expected(lambda psi: phase.pdf(np.cos(psi)), edges)
    np.testing.assert_allclose(np.diff(phase.cdf(edges)), rings, rtol=2e-3, atol=1e-7)
    assert phase.cdf(math.pi) == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("g", [0.5, 0.924])
def test_cosine_after_n_scatterings(g: float) -> None:
    """Exact for any phase function with mean cosine g: <cos> of the direction after n scatterings is g^n."""
    rng, n = np.random.default_rng(5), 400_000
    along = np.ones(n)
    for order in range(1, 9):
        cosine, turn = HenyeyGreensteinPhase(g).sample(rng.random(n)), 2 * math.pi * rng.random(n)
        along = along * cosine + np.sqrt((1 - along**2) * (1 - cosine**2)) * np.cos(turn)
        assert abs(along.mean() - g**order) < 4 * along.std() / math.sqrt(n)


@pytest.mark.parametrize(
    "beam",
    [
        {"ellipticity": 1.8},
        {"ellipticity": 0.7, "asymmetry_x": 0.4, "asymmetry_y": -0.2},
        {"ellipticity": 0.8, "ellipticity_diagonal": 1.9},
    ],
)
def test_solid_angle_of_an_oval_beam(beam: dict[str, float]) -> None:
    """Against a sum over a fine grid of angles."""
    lamp = Lamp(hwhm_deg=5, **beam)
    grid = np.radians(np.linspace(-60, 60, 1201))
    gx, gy = np.meshgrid(grid, grid)
    density = relative_intensity(lamp, gx, gy) * np.sinc(np.hypot(gx, gy) / math.pi)
    assert solid_angle_sr(lamp) == pytest.approx(density.sum() * (grid[1] - grid[0]) ** 2, rel=1e-6)


def test_json_of_a_scene_gives_its_phase() -> None:
    """The tracer gets the phase function as JSON."""
    phase: PhaseFunction = parse_phase('{"type": "fournier-forand", "n": 1.10, "mu": 3.5835}')
    assert backscatter_ratio(phase) == pytest.approx(0.01831, abs=1e-5)
