"""The samplers that run inside the tracer, single precision and all, draw from their densities."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from beams import aside, ies
from montecarlo import chi_square_p, normal_scores
from scattered_back import backscatter_ratio
from scipy import stats

from lightfield.render.tracer.emission import Emission
from lightfield.render.tracer.sobol import ScrambledSobol
from lightfield.scene import Lamp
from lightfield.scene.lamp.profile import relative_intensity
from lightfield.scene.water.phase.of_scene import parse_phase

pytestmark = pytest.mark.usefixtures("backend")

SAMPLES = 1 << 20
PHASES: dict[str, dict[str, Any]] = {
    "hg 0.924": {"type": "henyey-greenstein", "g": 0.924},
    "hg 0.98": {"type": "henyey-greenstein", "g": 0.98},
    "two-term": {"type": "two-term-hg", "g1": 0.9305, "g2": -0.502, "alpha": 0.9967},
    "fournier-forand": {"type": "fournier-forand", "n": 1.10, "mu": 3.5835},
    "petzold average": {"type": "petzold", "water": "average"},
    "petzold clear": {"type": "petzold", "water": "clear"},
    "hg and molecules": {
        "type": "with-molecules",
        "particles": {"type": "henyey-greenstein", "g": 0.924},
        "share": 0.3,
    },
}
# And Mitsuba's own Henyey-Greenstein function, which the tracer uses where it can.
PLUGINS = [*((name, False) for name in PHASES), ("hg 0.924", True), ("hg 0.98", True)]


def uniform(rng: np.random.Generator) -> Any:
    return mi.Float(rng.random(SAMPLES, dtype=np.float32))


def plugin(model: dict[str, Any], stock: bool = False) -> Any:
    if stock:
        return mi.load_dict({"type": "hg", "g": model["g"]})
    return mi.load_dict({"type": "lightfield_phase", "model": json.dumps(model)})


def scattered(phase: Any, forward: Any, rng: np.random.Generator) -> tuple[Any, Any]:
    """Direction after one scattering, and the density that the plugin says it had."""
    interaction = dr.zeros(mi.MediumInteraction3f, dr.width(forward))
    interaction.wi = -forward
    interaction.sh_frame = mi.Frame3f(interaction.wi)
    numbers = mi.Point2f(uniform(rng), uniform(rng))
    turned, _, density = phase.sample(mi.PhaseFunctionContext(None), interaction, uniform(rng), numbers)
    return turned, density


def angle(a: Any, b: Any) -> np.ndarray:
    """Angle between directions from their chord, which is exact where the cosine has no digits left."""
    chord = np.linalg.norm(np.array(a, np.float64) - np.array(b, np.float64), axis=0)
    return 2 * np.arcsin(np.minimum(0.5 * chord, 1.0))


def aslant(width: int) -> Any:
    """One direction that is parallel to no axis."""
    axis = np.array([0.3, -0.5, 0.8]) / np.linalg.norm([0.3, -0.5, 0.8])
    return mi.Vector3f(*(dr.full(mi.Float, float(c), width) for c in axis))


def test_turn_by_particles_and_molecules() -> None:
    """What the walk itself draws, beside the density of the mixture, over the whole sphere."""
    from lightfield.render.tracer.scattering import henyey_greenstein, with_molecules

    model = PHASES["hg and molecules"]
    truth, forward, rng = parse_phase(json.dumps(model)), aslant(SAMPLES), np.random.default_rng(7)
    turn = with_molecules(henyey_greenstein(model["particles"]["g"]), model["share"])
    numbers = mi.Point2f(uniform(rng), uniform(rng))
    turned = turn(forward, uniform(rng), numbers, dr.full(mi.Bool, True, SAMPLES))
    psi = angle(turned, forward)
    edges = np.radians(np.linspace(0.0, 180.0, 61))
    expected = SAMPLES * np.diff(np.concatenate([[0.0], truth.cdf(edges[1:])]))
    found, _ = np.histogram(psi, edges)
    assert stats.chisquare(found, expected * (found.sum() / expected.sum())).pvalue > 1e-4
    assert np.cos(psi).mean() == pytest.approx(truth.mean_cosine(), abs=4 / np.sqrt(SAMPLES))


@pytest.mark.parametrize(("name", "stock"), PLUGINS)
def test_phase_plugin(name: str, stock: bool) -> None:
    """Distribution of the angle, uniform azimuth, backscatter ratio, mean cosine, density."""
    model = PHASES[name]
    truth, forward = parse_phase(json.dumps(model)), aslant(SAMPLES)
    turned, density = scattered(plugin(model, stock), forward, np.random.default_rng(11))
    psi = angle(turned, forward)
    # Mitsuba's own plugin computes a cosine in single precision, with no digits left below 3 mrad.
    edges = np.concatenate([[0.0], np.geomspace(3e-3 if stock else 3e-4, np.pi, 61)])
    expected = SAMPLES * np.diff(np.concatenate([[0.0], truth.cdf(edges[1:])]))
    counts = np.histogram(psi, edges)[0]
    assert counts.sum() == SAMPLES
    assert 0.001 < stats.chisquare(counts, expected * SAMPLES / expected.sum()).pvalue < 0.999
    frame = mi.Frame3f(forward)
    local = np.array(frame.to_local(turned))
    azimuths = np.histogram(np.arctan2(local[1], local[0]), 36, (-np.pi, np.pi))[0]
    assert 0.001 < stats.chisquare(azimuths).pvalue < 0.999
    backward = backscatter_ratio(truth)
    observed = (psi > np.pi / 2).mean()
    assert abs(observed - backward) < 3 * np.sqrt(backward * (1 - backward) / SAMPLES)
    cosine = np.cos(psi)
    assert abs(cosine.mean() - truth.mean_cosine()) < 3 * cosine.std() / np.sqrt(SAMPLES)
    wide = psi > 0.01
    np.testing.assert_allclose(np.array(density)[wide], truth.pdf(cosine[wide]), rtol=0.005)


@pytest.mark.parametrize("stock", [False, True], ids=["own", "stock"])
@pytest.mark.parametrize("g", [0.924, *(pytest.param(g, marks=pytest.mark.slow) for g in (0.75, 0.98))])
def test_mean_cosine_after_n_scatterings(g: float, stock: bool) -> None:
    """Henyey-Greenstein: the mean cosine to the first direction is g^n after n scatterings."""
    phase = plugin({"type": "henyey-greenstein", "g": g}, stock)
    rng, first = np.random.default_rng(3), aslant(SAMPLES)
    direction = mi.Vector3f(first)
    for n in range(1, 13):
        direction = mi.Vector3f(dr.normalize(scattered(phase, direction, rng)[0]))
        dr.eval(direction)
        if n in (1, 2, 4, 8, 12):
            cosine = np.cos(angle(direction, first))
            assert abs(cosine.mean() - g**n) < 3 * cosine.std() / np.sqrt(SAMPLES)


LAMPS: dict[str, dict[str, Any]] = {
    "gaussian": {},
    "narrow": {"hwhm_deg": 0.5},
    "wide": {"hwhm_deg": 40.0},
    "flat top": {"profile": "super-gaussian", "shape_exponent": 8.0},
    "departing": {"profile_departure": [[0, 0.3], [2, -0.5], [5, 0.4], [12, 1.0]]},
    "skirt": {"profile": "two-component", "skirt_fraction": 0.1},
    "elliptic": {"ellipticity": 2.0},
    "oval, turned": {"ellipticity": 1.3, "ellipticity_diagonal": 0.6},
    "lopsided": {"asymmetry_x": 0.3, "asymmetry_y": -0.2, "ellipticity": 1.3},
    "isotropic": {"profile": "isotropic"},
    "tilted": {"tilt_x_deg": 10.0, "tilt_y_deg": -5.0},
}


def beam_histogram(lamp: Lamp, x: np.ndarray, y: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Normal scores of the power found in rings and sectors of the beam's own angles."""
    theta, phi = np.hypot(x, y), np.arctan2(y, x)
    reach = np.pi if lamp.profile == "isotropic" else min(np.radians(2.2 * lamp.hwhm_deg), np.pi / 2)
    rings, sectors, batches = np.linspace(0, reach, 13), np.linspace(-np.pi, np.pi, 9), 32
    sums = np.array([
        np.histogram2d(t, p, (rings, sectors), weights=w)[0] * batches / len(theta)
        for t, p, w in zip(*(np.array_split(v, batches) for v in (theta, phi, weight)), strict=True)
    ])  # fmt: skip
    node, share = np.polynomial.legendre.leggauss(20)
    t = 0.5 * (rings[1:] + rings[:-1])[:, None] + 0.5 * np.diff(rings)[:, None] * node
    p = 0.5 * (sectors[1:] + sectors[:-1])[:, None] + 0.5 * np.diff(sectors)[:, None] * node
    t, p = t[:, None, :, None], p[None, :, None, :]
    value = relative_intensity(lamp, t * np.cos(p), t * np.sin(p)) * np.sin(t)
    truth = np.einsum("rsij,i,j->rs", value, 0.5 * share, 0.5 * share)
    truth *= np.diff(rings)[:, None] * np.diff(sectors)
    stderr = sums.std(axis=0, ddof=1) / np.sqrt(batches)
    lit = truth > 1e-6 * truth.max()
    return normal_scores(sums.mean(axis=0)[lit], truth[lit], stderr[lit], batches)


def carries_the_beam(lamp: Lamp, seed: int) -> bool:
    """Do weighted directions give the power of the beam in every ring and sector, at unit axial intensity?"""
    rng = np.random.default_rng(seed)
    local, weight, _ = Emission(lamp, cone_rad=0.2).draw(uniform(rng), uniform(rng))
    x, y, z = np.array(local, np.float64)
    theta, across = np.arctan2(np.hypot(x, y), z), np.maximum(np.hypot(x, y), 1e-12)
    scores = beam_histogram(lamp, theta * x / across, theta * y / across, np.array(weight, np.float64))
    return 0.001 < chi_square_p(scores) < 0.999


@pytest.mark.parametrize("name", LAMPS)
def test_emission_carries_the_beam(name: str) -> None:
    assert carries_the_beam(Lamp.model_validate(LAMPS[name]), seed=7)


@pytest.mark.parametrize("name", ["gaussian", "elliptic", "tilted"])
def test_emitter_plugin(name: str) -> None:
    """`lightfield_lamp`: sample_ray and sample_direction give the same beam, in the frame of the scene."""
    lamp = Lamp.model_validate(LAMPS[name])
    emitter = mi.load_dict({"type": "lightfield_lamp", "intensity": 2.0, **LAMPS[name]})
    rng = np.random.default_rng(9)
    numbers = mi.Point2f(uniform(rng), uniform(rng))
    ray, power = emitter.sample_ray(mi.Float(0), mi.Float(0.5), mi.Point2f(0.5), numbers)
    axis = np.array([np.tan(np.radians(lamp.tilt_x_deg)), np.tan(np.radians(lamp.tilt_y_deg)), 1.0])
    axis /= np.linalg.norm(axis)
    right = np.array([axis[2], 0.0, -axis[0]]) / np.hypot(axis[0], axis[2])
    direction = np.array(ray.d, np.float64)
    x, y, z = right @ direction, np.cross(axis, right) @ direction, axis @ direction
    theta, across = np.arctan2(np.hypot(x, y), z), np.maximum(np.hypot(x, y), 1e-12)
    _, per_wavelength = emitter.sample_wavelengths(dr.zeros(mi.SurfaceInteraction3f), mi.Float(0.5))
    weight = np.array(power, np.float64)[0] / (2.0 * np.array(per_wavelength)[0])
    scores = beam_histogram(lamp, theta * x / across, theta * y / across, weight)
    assert 0.001 < chi_square_p(scores) < 0.999

    there = dr.zeros(mi.SurfaceInteraction3f, SAMPLES)
    there.p = mi.Point3f(4.0 * ray.d)
    sample, irradiance = emitter.sample_direction(there, mi.Point2f(0.5))
    expected = 2.0 * relative_intensity(lamp, theta * x / across, theta * y / across) / 16.0
    np.testing.assert_allclose(np.array(irradiance)[0], expected, rtol=2e-3, atol=1e-6)
    np.testing.assert_allclose(np.array(sample.d), -direction, atol=1e-6)


def test_measured_beam_is_carried(tmp_path: Path) -> None:
    """The same for a table with a kink and an edge."""
    table = tmp_path / "beam.csv"
    table.write_text("angle_deg,intensity\n0,1\n2,1\n7.5,0.1\n8,0\n")
    lamp = Lamp.model_validate({"profile": "table", "intensity_table": str(table)})
    assert carries_the_beam(lamp, seed=13)


def test_measured_beam_that_is_not_round_is_carried(tmp_path: Path) -> None:
    """The same for a Gaussian beside the axis, from half planes 0, 10 ... 350 of a luminaire file."""
    file = ies(tmp_path / "aside.ies", aside, np.arange(0.0, 351.0, 10.0))
    lamp = Lamp.model_validate({"profile": "table", "intensity_table": str(file)})
    assert carries_the_beam(lamp, seed=17)


@pytest.mark.parametrize("lamp", [{"profile": "isotropic"}, {"hwhm_deg": 40.0, "tilt_x_deg": 60.0}])
def test_light_that_flies_back_begins_at_the_window(lamp: dict[str, Any]) -> None:
    """What flies ahead meets the window plane on its line from the source, 0.5 m behind its middle."""
    given = Lamp(**lamp, offset_x_m=0.2, radius_m=0.05, apparent_distance_m=0.5)
    flights = Emission(given, 0.5).sample(dr.arange(mi.UInt32, 4096), ScrambledSobol(3), mi.PCG32(size=4096))
    position, direction = np.array(flights.position).T, np.array(flights.direction).T
    aside = position - [0.2, 0.0, 0.0]
    ahead = direction[:, 2] > 0.01
    aside[ahead] -= 0.5 * direction[ahead] / direction[ahead, 2:]
    aside[ahead, 2] = 0.0
    back = direction[:, 2] < 0
    assert back.sum() > 100 and ahead.sum() > 100
    assert np.linalg.norm(aside[ahead | back], axis=1).max() < 0.05 + 1e-4
