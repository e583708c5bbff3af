"""Every sampler draws from its own density: chi-square over log-angle bins, expectation from direct
integration.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from lightfield.scene import Lamp
from lightfield.scene.lamp.profile import inverse_cdf_table, relative_intensity, sample, solid_angle_sr
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


def lamps(folder: Path) -> dict[str, Lamp]:
    (folder / "lamp.csv").write_text("angle_deg,intensity\n0,1\n3,0.9\n6,0.3\n12,0.05\n40,0\n")
    return {
        "gaussian": Lamp(),
        "flat-top": Lamp(profile="super-gaussian", hwhm_deg=8, shape_exponent=8),
        "two-component": Lamp(profile="two-component", skirt_fraction=0.1, skirt_hwhm_deg=20),
        "table": Lamp(profile="table", intensity_table=str(folder / "lamp.csv")),
        "departing": Lamp(hwhm_deg=5, profile_departure=((0.0, 0.3), (3.0, -0.5), (6.0, 0.4), (12.0, 1.0))),
        "isotropic": Lamp(profile="isotropic"),
    }


@pytest.mark.parametrize("name", ["gaussian", "flat-top", "two-component", "table", "departing", "isotropic"])
def test_lamp_sampler(name: str, tmp_path: Path) -> None:
    """Directions of a round beam follow its relative intensity."""
    lamp = lamps(tmp_path)[name]
    edges = np.radians(np.concatenate([np.geomspace(0.05, 60, 80), [90, 179.9]]))
    fine = np.unique(np.concatenate([edges, np.radians([3, 6, 12, 40])]))  # kinks of the table
    mass = expected(lambda theta: relative_intensity(lamp, theta, 0 * theta), fine)
    probability = np.add.reduceat(mass, np.searchsorted(fine, edges[:-1]))
    probability /= expected(
        lambda theta: relative_intensity(lamp, theta, 0 * theta),
        np.unique(np.concatenate([np.radians([1e-6, 1e-3]), fine, [math.pi]])),
    ).sum()
    for seed in (1, 2, 3):
        rng = np.random.default_rng(seed)
        x, y, weight = sample(lamp, rng.random(SAMPLES), rng.random(SAMPLES))
        assert np.all(weight == 1)
        assert 1e-4 < p_value(np.hypot(x, y), probability, edges, SAMPLES) < 1 - 1e-4


@pytest.mark.parametrize(
    "beam", [{"ellipticity": 1.8}, {"ellipticity": 0.7, "asymmetry_x": 0.4, "asymmetry_y": -0.2}]
)
def test_elliptic_lamp_sampler(beam: dict[str, float]) -> None:
    """Weighted directions of an oval or lopsided beam have its moments, within four standard errors."""
    lamp, n = Lamp(hwhm_deg=5, **beam), 400_000
    rng = np.random.default_rng(7)
    x, y, weight = sample(lamp, rng.random(n), rng.random(n))
    grid = np.radians(np.linspace(-60, 60, 1201))
    gx, gy = np.meshgrid(grid, grid)
    density = relative_intensity(lamp, gx, gy) * np.sinc(np.hypot(gx, gy) / math.pi)
    assert solid_angle_sr(lamp) == pytest.approx(density.sum() * (grid[1] - grid[0]) ** 2, rel=1e-6)
    for drawn, on_grid in (
        (x, gx),
        (y, gy),
        (np.sqrt(np.abs(x)) * np.sign(x), np.sqrt(np.abs(gx)) * np.sign(gx)),
    ):
        truth = np.sum(density * on_grid**2) / density.sum()
        ratio = np.sum(weight * drawn**2) / weight.sum()
        error = np.std(weight * (drawn**2 - ratio)) / weight.mean() / math.sqrt(n)
        assert abs(ratio - truth) < 4 * error


def test_inverse_table_is_monotone() -> None:
    u, theta = inverse_cdf_table(Lamp(profile="two-component", skirt_fraction=0.1))
    assert u[0] == 0 and u[-1] == 1
    assert np.all(np.diff(u) >= 0) and np.all(np.diff(theta) > 0)


def test_json_of_a_scene_gives_its_phase() -> None:
    """The tracer gets the phase function as JSON."""
    phase: PhaseFunction = parse_phase('{"type": "fournier-forand", "n": 1.10, "mu": 3.5835}')
    assert phase.backscatter_ratio() == pytest.approx(0.01831, abs=1e-5)
