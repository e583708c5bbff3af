"""What molecules of water scatter: their phase function in closed form, and their light in both solvers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scattered_back import backscatter_ratio

from lightfield.formula.closed_form import direct_field
from lightfield.formula.scattered.scattered_field import ScatteredField
from lightfield.render.maps import render_scene
from lightfield.scene import Scene
from lightfield.scene.bands import molecular_share
from lightfield.scene.water.coefficients import absorption_per_m, coefficients_in, scattering_per_m
from lightfield.scene.water.molecular import DEPOLARISATION
from lightfield.scene.water.phase.molecular import Molecular
from lightfield.studies.link.study import link
from lightfield.studies.working_range.poses import smooth_light


def water(particles_per_m: float, nm: float, **more: float) -> Scene:
    """Pure water with some particles, at one wavelength."""
    return Scene.from_dict(
        {
            "lamp": {"hwhm_deg": 4.0},
            "water": {"base": "pure", "scattering_per_m": particles_per_m, **more},
            "detector": {"planes_m": [3.0, 6.0], "width_m": 1.0, "pixels": 9, "bands_nm": [[nm - 1, nm + 1]]},
        }
    )


def test_closed_forms() -> None:
    """b = 8 pi / 3 beta(90) (2 + d) / (1 + d), 16.44 beta(90) at d = 0.039 (Zhang et al. 2009); half of it
    goes back; <cos> = 0, <cos^2> = (1/3 + f/5) / (1 + f/3)."""
    phase, d = Molecular(), DEPOLARISATION
    assert 1 / phase.pdf(0.0) == pytest.approx(8 * math.pi / 3 * (2 + d) / (1 + d))
    assert 1 / phase.pdf(0.0) == pytest.approx(16.44, abs=0.005)
    assert backscatter_ratio(phase) == pytest.approx(0.5)
    x, w = np.polynomial.legendre.leggauss(8)
    shares = 2 * math.pi * w * phase.pdf(x)
    f = (1 - d) / (1 + d)
    assert (shares.sum(), shares @ x) == pytest.approx((1.0, 0.0), abs=1e-12)
    assert shares @ x**2 == pytest.approx((1 / 3 + f / 5) / (1 + f / 3))
    u = np.linspace(0, 1, 101)
    np.testing.assert_allclose(phase.cdf(np.arccos(phase.sample(u))), u, atol=1e-12)


@pytest.mark.parametrize("particles", [0.0, 0.002])
def test_traced_light_of_clear_water(particles: float) -> None:
    """Where nearly all is scattered once, the trace agrees with exact single scattering to 3 %: with the
    particles' phase function molecules would be 12 times as bright in a beam of 4 degrees."""
    scene = water(particles, 450.0)
    known = {"rel_error": 1e-3, "max_photons": 4e5, "symmetry": True, "cache": False}
    rendering = render_scene(scene, **known)
    traced = rendering.relative_maps(np.array([450.0]), "diffuse")[0][0].sum(axis=(1, 2))
    x, y, z = (v.ravel() for v in rendering.grid.centres())
    single = ScatteredField(x, y, z).light(scene, [450.0])[0].reshape(2, -1).sum(axis=1)
    assert traced == pytest.approx(single, rel=0.03)


def test_one_mixture_answers_for_other_colours() -> None:
    """Traced at 550 nm, where molecules are 6 % of the scattering, asked at 450 (13 %) and 650 nm (3 %): to
    1 % of a trace of that colour's own."""
    known = {"rel_error": 1e-3, "max_photons": 6e5, "symmetry": True, "cache": False}
    green = render_scene(water(0.02, 550.0), **known)
    for nm in (450.0, 650.0):
        at = np.array([nm])
        own = render_scene(water(0.02, nm), **known)
        asked, right = (r.relative_maps(at, "diffuse")[0][0].sum(axis=(1, 2)) for r in (green, own))
        assert asked == pytest.approx(right, rel=0.01)


def test_coefficients_of_a_mixture() -> None:
    """At the traced colour as they are; elsewhere with the same attenuation; without molecules untouched."""
    scene, at = water(0.02, 550.0), np.array([450.0, 550.0, 650.0])
    share = molecular_share(scene)
    a, b = absorption_per_m(scene.water, at), scattering_per_m(scene.water, at)
    a_told, b_told = coefficients_in(scene.water, at, share)
    assert share == pytest.approx(0.062, abs=0.002)
    np.testing.assert_allclose(a_told + b_told, a + b)
    assert (a_told[1], b_told[1]) == pytest.approx((a[1], b[1]))
    # Particles scatter alike at all wavelengths here: molecules hardly change what is counted.
    assert b_told == pytest.approx(b[1], rel=0.015)
    assert molecular_share(scene.with_values({"water.base": "none", "water.absorption_per_m": 0.1})) == 0.0


def test_a_link_knows_what_molecules_scatter(monkeypatch: pytest.MonkeyPatch) -> None:
    """Exact single scattering on the axis of pure water, to four errors of the trace and 3 % for the rest:
    with the particles' phase function it would be 12 times as much."""
    monkeypatch.setattr("lightfield.studies.link.study.DOCKING_PHOTONS", 1e4)  # not asked here
    scene = water(0.0, 450.0)
    data = link(scene, waters={}, to_m=12.0, max_photons=4e5, rel_error=1e-3).dataset.isel(water=0)
    z = np.array([4.0, 7.0, 12.0])
    at = data.interp(z_m=z)
    axis = np.zeros(3)
    known = ScatteredField(axis, axis, z).light(scene, [450.0])[0] / direct_field(scene, axis, axis, z, 450.0)
    error = (at.power_stderr_w / at.power_formula_w).values
    assert (np.abs(at.scattered_over_direct.values - known) < 4 * error + 0.03 * known).all()


def test_an_array_sees_what_molecules_scatter() -> None:
    """The same light where poses are asked about, to a third: particles that are traced beside them stand
    for molecules there, in a beam whose light they are half a per cent of."""
    scene = water(0.0, 450.0)
    z, axis = np.array([4.0, 7.0]), np.zeros(2)
    place, facing = np.column_stack([axis, axis, z]), np.tile([0.0, 0.0, -1.0], (2, 1))
    light = smooth_light(scene, 3.0, 8.0, 0.3, 4e5).reading(place, facing)
    direct = direct_field(scene, axis, axis, z, 450.0)
    known = ScatteredField(axis, axis, z).light(scene, [450.0])[0]
    assert light - direct == pytest.approx(known, rel=0.35)
