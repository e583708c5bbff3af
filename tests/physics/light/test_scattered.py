"""Scattered light without photons: against volume integrals, closed forms, and traces within their errors."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scattering_water import scene
from scipy.special import j0

from lightfield.formula.scattered.multiple import Spread, largest_kz, multiple
from lightfield.formula.scattered.quadrature import emission, finest_rad, interval, near, turns
from lightfield.formula.scattered.scattered_field import ScatteredField, describes
from lightfield.formula.scattered.single import LitPaths, Resolution, SinglePaths, single_paths
from lightfield.scene.lamp.frame import beam_axes
from lightfield.scene.lamp.lamp import Lamp
from lightfield.scene.lamp.width import half_width_rad, intensity
from lightfield.scene.water.phase.of_scene import phase_function
from lightfield.scene.water.phase.spec import FournierForand, HenyeyGreenstein, TracedPhase, WithMolecules

FORWARD = HenyeyGreenstein(g=0.924)
A, B = 0.1, 0.3
Z = np.array([5.0])


def lit_paths(paths: SinglePaths, lamp: Lamp) -> LitPaths:
    """With the light of a lamp."""
    sent = intensity(lamp, paths.theta_squared) * paths.weight
    together = paths.water_m.shape[-1] == 1
    return LitPaths(sent.sum(axis=-1, keepdims=True) if together else sent, paths.water_m, paths.share)


def once_scattered(
    lamp: Lamp,
    phase: TracedPhase,
    place: tuple[float, float, float],
    behind_m: float = 0.0,
    nodes: tuple[int, int] = (120, 48),
) -> float:
    """First-order irradiance: the volume integral in spherical coordinates about the lamp.

    E = int dOmega I(theta) int dr b p(Theta) cos(theta_D) exp(-c (r + s)) / s^2, with the polar axis towards
    the receiver, chi chi to it graded, and r = R cos(chi) + R sin(chi) tan(eta), cos(Theta) = -sin(eta).
    """
    to = np.add(place, (0.0, 0.0, behind_m))
    length = float(np.linalg.norm(to))
    e3 = to / length
    e1 = np.cross([0.0, 1.0, 0.0], e3)
    e1 /= np.linalg.norm(e1)
    e2 = np.cross(e3, e1)
    x, w = np.polynomial.legendre.leggauss(nodes[0])
    t, wt = 0.5 * (x + 1), 0.5 * w
    chi, w_chi = (math.pi * t**5)[:, None, None], (5 * math.pi * t**4 * wt)[:, None, None]
    phi = (np.arange(nodes[1]) + 0.5) * (2 * math.pi / nodes[1])
    out = np.cos(chi)[..., None] * e3 + np.sin(chi)[..., None] * (
        np.cos(phi)[:, None] * e1 + np.sin(phi)[:, None] * e2
    )
    ahead = np.maximum(out[..., 2], 1e-9)
    window = behind_m / ahead  # where the water begins
    low = np.arctan2(window - length * np.cos(chi), length * np.sin(chi))
    eta = low + (0.5 * math.pi - low) * (t * t * (3 - 2 * t))[:, None]
    w_eta = (0.5 * math.pi - low) * (6 * t * (1 - t) * wt)[:, None]
    s = length * np.sin(chi) / np.cos(eta)
    r = length * np.cos(chi) + length * np.sin(chi) * np.tan(eta)
    down = (to[2] - r * out[..., 2]) / s
    theta = np.arccos(np.clip(out @ np.array(beam_axes(lamp)[2]), -1, 1))
    light = intensity(lamp, theta**2) * phase_function(phase).pdf(-np.sin(eta)) * np.maximum(down, 0.0)
    light = light * (out[..., 2] > 0) * np.exp(-(A + B) * (r - window + s))
    # dr / s^2 = d(eta) / (R sin(chi)), which the sine of the solid angle cancels.
    return float(B / length * (light * w_chi * w_eta).sum() * (2 * math.pi / nodes[1]))


AMONG = WithMolecules(particles=FORWARD, share=0.1)


@pytest.mark.parametrize("phase", [FORWARD, HenyeyGreenstein(g=0.7), FournierForand(n=1.1, mu=3.5835), AMONG])
@pytest.mark.parametrize(("radius", "behind"), [(0.05, 0.0), (0.6, 0.0), (0.6, 2.5)])
def test_light_scattered_once_is_the_volume_integral(
    phase: TracedPhase, radius: float, behind: float
) -> None:
    """To 0.1 %."""
    lamp = Lamp(hwhm_deg=3.81, apparent_distance_m=behind)
    z = np.array([4.0])
    paths = single_paths(phase, half_width_rad(lamp), np.array([radius]), z, behind)
    found = lit_paths(paths, lamp).light(A, B)[0]
    assert found == pytest.approx(once_scattered(lamp, phase, (radius, 0.0, 4.0), behind), rel=1e-3)


def test_light_of_molecules_alone() -> None:
    """Scattered once, nearly evenly to all sides: 0.2 % with few nodes, 0.01 % with more."""
    lamp, phase = Lamp(hwhm_deg=3.81), WithMolecules(particles=FORWARD, share=1.0)
    right = once_scattered(lamp, phase, (0.6, 0.0, 4.0))
    place = np.array([0.6]), np.array([4.0])
    for nodes, within in (((22, 9, 6), 2e-3), ((48, 32, 16), 1e-4)):
        paths = single_paths(phase, half_width_rad(lamp), *place, resolution=Resolution(*nodes))
        found = lit_paths(paths, lamp).light(A, B)[0]
        assert found == pytest.approx(right, rel=within)


@pytest.mark.parametrize("place", [(0.5, 0.0, 4.0), (-0.4, 0.3, 7.0)])
def test_a_tilted_beam_is_one_seen_from_its_own_axis(place: tuple[float, float, float]) -> None:
    """Thin water, so that all is scattered once: to 1.2 % of the volume integral about the tilted axis: it is
    taken to arrive from where the lamp is."""
    tilted = scene(lamp__tilt_x_deg=6.0, lamp__tilt_y_deg=-2.0)
    field = ScatteredField(*(np.array([v]) for v in place))
    found = field.at(tilted, np.array([A + B]), np.array([1e-4]))[0, 0] / 1e-4 * B
    assert found == pytest.approx(once_scattered(tilted.lamp, FORWARD, place), rel=1.2e-2)


def test_light_that_is_scattered_more_often_keeps_its_power() -> None:
    """Over a whole plane sum_n>1 (b Q)^n / n! of what each direction sends, with Q = int q ds at k = 0.

    At a = 0 nothing is lost but what turns back: Q is z times the share of light scattered by less than a
    right angle. Beyond 63 degrees, where 3 % arrive, the light falls with the cube of the tangent.
    """
    lamp, z, b = Lamp(hwhm_deg=3.0), 4.0, 0.3
    spread = Spread.on_planes(FORWARD, np.array([z]), largest_kz(lamp))
    tangent = np.linspace(0, 2, 20001)
    light = multiple(lamp, spread, tangent, 0.0, b)[0]
    power = 2 * math.pi * z**2 * (np.trapezoid(light * tangent, tangent) + light[-1] * tangent[-1] ** 2)
    forward = float(phase_function(FORWARD).cdf(0.5 * math.pi))
    theta, sent = emission(lamp)
    slant = b * z / np.cos(theta)
    expected = (sent * np.exp(-slant) * (np.expm1(slant * forward) - slant * forward)).sum()
    assert power == pytest.approx(expected, rel=1e-2)


@pytest.mark.parametrize("hwhm_deg", [3.8, 20.0, 50.0])
def test_few_slants_tell_of_all_angles_and_waters_at_once_of_each(hwhm_deg: float) -> None:
    """Beside the sum over every angle of emission, of one water after the other, written out here."""
    lamp, z, tangent = Lamp(hwhm_deg=hwhm_deg), 6.0, np.linspace(0, 0.4, 5)
    a, b = np.array([0.3, 0.05, 0.1, 0.3]), np.array([0.02, 1.5, 0.4, 0.8])
    spread = Spread.on_planes(FORWARD, np.array([2.0, z]), largest_kz(lamp))
    found, single = multiple(lamp, spread, tangent, a, b)[:, 1], paths_of(lamp, z, tangent)
    theta, sent = emission(lamp)
    slant = 1 / np.cos(theta)
    t, w = interval(128)
    k, weight = spread.reach * t * t, spread.reach * 2 * t * w
    for water, (ai, bi) in enumerate(zip(a.tolist(), b.tolist(), strict=True)):
        x = bi * np.outer(spread.q(np.array([ai]))[1, :, 0], slant)
        each = j0(np.outer(k, np.tan(theta))) * (np.exp(x) - 1 - x) @ (sent * np.exp(-(ai + bi) * z * slant))
        expected = j0(np.outer(tangent, k)) @ (k * weight * each) / (2 * math.pi * z**2)
        top = float(np.abs(expected).max())
        np.testing.assert_allclose(found[water], expected, rtol=1e-8, atol=1e-9 * top)
        alone = multiple(lamp, spread, tangent, ai, bi)[1]
        np.testing.assert_allclose(found[water], alone, rtol=1e-8, atol=1e-9 * top)
        np.testing.assert_allclose(single.light(a, b)[water], single.light(ai, bi), rtol=1e-12)


def paths_of(lamp: Lamp, z_m: float, tangent: np.ndarray) -> LitPaths:
    """Paths of light that is scattered once, with the light of a lamp."""
    width = math.radians(lamp.hwhm_deg)
    paths = single_paths(FORWARD, width, tangent * z_m, np.full(len(tangent), z_m))
    return lit_paths(paths, lamp)


@pytest.mark.parametrize("g", [0.89, 0.9, 0.93])
def test_turns_of_one_phase_function_serve_those_near_it(g: float) -> None:
    """To 0.2 %, which is the error of so few turns anyway, where more than once scattered light counts."""
    lamp, phase = Lamp(hwhm_deg=3.81), HenyeyGreenstein(g=g)
    known, tangent = near(phase), np.linspace(0, 0.3, 7)
    assert known != phase
    shared, own = (
        Spread.on_planes(known, Z, largest_kz(lamp)).of(phase),
        Spread.on_planes(phase, Z, largest_kz(lamp)),
    )
    assert multiple(lamp, shared, tangent, A, B) == pytest.approx(
        multiple(lamp, own, tangent, A, B), rel=2e-3
    )


def test_what_a_field_was_asked_before_does_not_change_its_light() -> None:
    """Nodes that beams and waters near each other share are their own, not those of who came first."""
    x, z = np.array([0.1, 0.6]), np.array([3.0, 6.0])
    field = ScatteredField(x, 0 * x, z)
    asked = [scene(lamp__hwhm_deg=w, water__phase__g=g) for w in (3.0, 6.0) for g in (0.9, 0.97)]
    for one in (*asked, *reversed(asked)):
        assert (field.light(one, [None]) == ScatteredField(x, 0 * x, z).light(one, [None])).all()


def test_clear_water_has_light_in_proportion_to_b_and_more_orders_in_proportion_to_its_square() -> None:
    lamp = Lamp(hwhm_deg=3.81)
    spread = Spread.on_planes(FORWARD, Z, largest_kz(lamp))
    thin, twice = (multiple(lamp, spread, np.array([0.05]), A, b)[0, 0] for b in (1e-4, 2e-4))
    assert twice / thin == pytest.approx(4.0, rel=2e-3)
    field, here = ScatteredField(np.array([0.3]), np.zeros(1), np.array([5.0])), scene()
    one, two, none = (field.at(here, np.array([A]), np.array([b]))[0, 0] for b in (1e-4, 2e-4, 0.0))
    assert two / one == pytest.approx(2.0, rel=1e-3)
    assert none == 0.0


def test_a_lamp_aside_lights_what_is_aside() -> None:
    x, y, z = np.array([0.1, 0.5, -0.4]), np.array([0.0, 0.2, 0.3]), np.array([4.0, 5.0, 8.0])
    aside = scene(lamp__offset_x_m=0.3, lamp__offset_y_m=-0.2)
    moved = ScatteredField(x + 0.3, y - 0.2, z).light(aside, [None])
    assert moved == pytest.approx(ScatteredField(x, y, z).light(scene(), [None]), rel=2e-4)


def test_a_tilt_may_turn_the_beam_away_from_a_place() -> None:
    """So far that the place is behind the lamp: little light, and the more the nearer the beam turns."""
    place = np.array([4.0]), np.zeros(1), np.array([1.5])
    tilts = np.arange(-60.0, 61.0, 10.0)
    field = ScatteredField(*place)
    light = np.array([field.light(scene(lamp__tilt_x_deg=float(t)), [None])[0, 0] for t in tilts])
    assert np.isfinite(light).all() and (light > 0).all()
    assert light[0] < 0.01 * light[-1] and (np.diff(light[tilts >= 0]) > 0).all()


def test_turbidity_that_grows_upwards_dims_what_is_above() -> None:
    """Along the straight line from the lamp: its mean height over its length."""
    x, y, z = np.array([0.3, 0.3]), np.array([0.5, -0.5]), np.array([5.0, 5.0])
    level, layered = scene(), scene(water__height_gradient_per_m2=0.02)
    field = ScatteredField(x, y, z)
    dimmed = field.light(layered, [None])[0] / field.light(level, [None])[0]
    length = np.sqrt(x**2 + y**2 + z**2)
    assert dimmed == pytest.approx(np.exp(-0.02 * 0.5 * y * length), rel=1e-9)


def test_light_scattered_once_is_right_far_beside_a_beam() -> None:
    """In water so clear that nothing else is, of a sharp forward peak: beside twice as many nodes (as few as
    near the axis are 0.2 % off at three half widths)."""
    lit = scene(lamp__hwhm_deg=8.0, water__scattering_per_m=1e-6, water__phase__g=0.97)
    width, phase = half_width_rad(lit.lamp), lit.water.phase
    tangent, z = width * np.array([0.5, 2.4, 3.0, 4.0]), np.full(4, 5.0)
    fine = single_paths(phase, width, tangent * z, z, resolution=Resolution(96, 28, 36))
    a = lit.water.absorption_per_m
    expected = lit_paths(fine, lit.lamp).light(a, 1e-6)
    found = ScatteredField(tangent * z, 0 * z, z).light(lit, [None])[0]
    assert found == pytest.approx(expected, rel=1.5e-3)


@pytest.mark.parametrize("exponent", [2.0, 4.0, 8.0])
def test_light_scattered_once_is_right_beside_a_beam_with_a_steep_edge(exponent: float) -> None:
    """Beside the volume integral, from its middle to far beside it; a Gaussian's nodes are up to 8 % off."""
    lit = scene(
        lamp__hwhm_deg=5.0,
        lamp__profile="super-gaussian",
        lamp__shape_exponent=exponent,
        water__scattering_per_m=1e-6,
    )
    tangent, z = math.tan(math.radians(5.0)) * np.array([0.0, 0.8, 1.2, 1.6, 2.2]), np.full(5, 5.0)
    expected = [once_scattered(lit.lamp, FORWARD, (5 * t, 0.0, 5.0), nodes=(150, 200)) for t in tangent]
    field = ScatteredField(tangent * z, 0 * z, z)
    found = field.at(lit, np.array([A + B]), np.array([1e-6]))[0] / 1e-6 * B
    assert found == pytest.approx(expected, rel=3e-3)


def test_between_its_nodes_the_field_is_what_it_is_at_them() -> None:
    """A field of one distance and few angles has its nodes elsewhere: interpolation is good to 2e-4."""
    x, z = np.tile(np.linspace(0, 1, 7), 3), np.repeat([3.0, 5.3, 9.0], 7)
    together = ScatteredField(x, 0 * x, z).light(scene(), [None])[0]
    for plane in np.unique(z):
        here = z == plane
        alone = ScatteredField(x[here], 0 * x[here], z[here]).light(scene(), [None])[0]
        assert together[here] == pytest.approx(alone, rel=2e-4)


def test_what_is_described() -> None:
    assert describes(scene())
    assert not describes(scene(lamp__ellipticity=1.2))
    assert not describes(scene(detector__acceptance_hwhm_deg=40.0))
    assert not describes(scene(detector__quantity="scalar_irradiance"))


def test_weights_of_scattering_angles_are_shares() -> None:
    """All of the light, and below a right angle the cumulative share; the mean cosine is g."""
    nodes = turns(FORWARD, 64)
    assert nodes.weight.sum() == pytest.approx(1.0, abs=1e-12)
    assert nodes.weight @ np.cos(nodes.at) == pytest.approx(0.924, abs=1e-5)
    forward = turns(FORWARD, 64, 0.5 * math.pi)
    assert forward.weight.sum() == pytest.approx(float(phase_function(FORWARD).cdf(0.5 * math.pi)))


def test_a_beam_that_is_not_brightest_on_its_axis_has_its_widths() -> None:
    """Half and edge are parts of the brightest, whatever the intensity on the axis and its scale."""
    theta, h = np.linspace(0.0, 30.0, 301), 5.0
    ring = (1 - 0.6 * np.exp(-((theta / 2.0) ** 2))) * np.exp(-np.log(2) * (theta / h) ** 8)
    widths = []
    for factor in (1.0, 0.4):
        flat = factor * np.maximum(ring, 1e-6) * 2 ** ((theta / h) ** 2)  # over the Gaussian that departs
        departure = tuple(zip(theta.tolist(), np.log(flat).tolist(), strict=True))
        lamp = Lamp(hwhm_deg=h, profile_departure=departure)
        widths.append((half_width_rad(lamp), finest_rad(lamp)))
    expected = np.interp(-0.5 * ring.max(), -ring[40:], theta[40:])
    assert np.degrees(widths[0][0]) == pytest.approx(expected, abs=0.02)
    assert widths[0] == pytest.approx(widths[1], rel=1e-6)


def test_absorption_below_zero_is_none_on_endless_paths() -> None:
    """Those at 90 degrees would be of infinite light, where a fit steps a little too far."""
    x, z = np.array([0.0, 0.4]), np.array([5.0, 5.0])
    field, (a, b) = ScatteredField(x, 0 * x, z), (np.zeros(1), np.array([0.3]))
    none, less = field.at(scene(), a, b), field.at(scene(), a - 1e-6, b)
    assert np.isfinite(none).all() and less == pytest.approx(none, rel=1e-4)


def test_water_that_nothing_gets_through_has_light_that_is_a_number() -> None:
    """Fits in dense water ask for so many scattering lengths that their exponential was none."""
    lamp = Lamp(hwhm_deg=3.81)
    spread = Spread.on_planes(FORWARD, Z, largest_kz(lamp))
    light = multiple(lamp, spread, np.array([0.0, 0.3]), A, np.array([1.0, 1e3, 1e5]))
    assert np.isfinite(light).all()
    assert (light[0] > 0).all() and np.abs(light[1:]).max() < 1e-3 * light[0].max()
    x = np.array([0.1, 0.5])
    dense = ScatteredField(x, 0 * x, Z + 0 * x).at(scene(), np.array([A]), np.array([1e5]))
    assert (dense >= 0).all() and (dense < 1e-300).all()
