"""How photons leave the lamp: stratified, low-discrepancy, and enough of them at the angles that matter.

Directions are drawn from a proposal density q(theta) about the beam axis, piecewise constant per solid
angle, and weighed by I / q, I being the radiant intensity relative to the axis. A photon's weight therefore
carries the shape of the beam exactly, whatever the proposal.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log, pi

import drjit as dr
import mitsuba as mi
import numpy as np

from lightfield.render.response.grid import AngleNodes
from lightfield.render.tracer.sobol import ScrambledSobol
from lightfield.scene import Lamp
from lightfield.scene.lamp.frame import beam_axes
from lightfield.scene.lamp.profile import relative_intensity, sections_of
from lightfield.scene.lamp.section import is_lopsided, narrowing, widest_turn

_FINE = 4096  # steps in which the wished density is integrated
# Steps of the cumulative distribution: even, then ever smaller towards 1, where a tail is thin and wide.
_EVEN, _FIRST_OCTAVE, _LAST_OCTAVE, _PER_OCTAVE = 512, 4, 16, 8
TABLE = 4096
#: Turns at which the widest section of a measured beam is sought.
_TURNS = 72


@dataclass(frozen=True)
class FirstFlights:
    """First flights: positions, unit directions, weights (sr per photon), nodes of the emission tally."""

    position: mi.Point3f
    direction: mi.Vector3f
    weight: mi.Float
    node: mi.UInt32


class Emission:
    """Sampler of a lamp's first flights.

    Parameters
    ----------
    lamp : Lamp
        Beam profile, pose, apparent source and window radius.
    cone_rad : float
        Half-angle of the cone that holds all detectors, as seen from the lamp.
    wide_share : float
        Share of photons sent uniformly into that cone; the rest follows the beam.
    nodes : AngleNodes, optional
        Tally grid. Photons then carry the solid angle they stand for, without the beam's intensity.
    """

    def __init__(
        self, lamp: Lamp, cone_rad: float, wide_share: float = 0.4, nodes: AngleNodes | None = None
    ) -> None:
        self.lamp, self.nodes = lamp, nodes
        isotropic = lamp.profile == "isotropic"
        reach = pi if isotropic else 0.5 * pi
        # Equal steps of sin(theta/2) resolve small angles; s = sin^2(theta/2) does not round off.
        edges = np.linspace(0, np.sin(0.5 * reach), _FINE + 1) ** 2
        theta = 2 * np.arcsin(np.sqrt(0.5 * (edges[:-1] + edges[1:])))
        omega = 4 * pi * np.diff(edges)
        shapeless = lamp.profile in ("isotropic", "pencil")
        envelope = np.ones_like(theta) if shapeless else self._envelope(theta)
        beam = envelope * omega
        cone = np.where(theta <= max(cone_rad, theta[_FINE // 256]), omega, 0.0)
        mass = (1 - wide_share) * beam / beam.sum() + wide_share * cone / cone.sum()
        self.theta_rad, self.density = theta, mass / (omega * mass.sum())  # photons per solid angle, 1/sr
        cumulative = np.concatenate([[0.0], np.cumsum(mass)]) / mass.sum()
        # Rounded as the sampler sees them, so that the weights undo exactly what is drawn.
        steps = _steps().astype(np.float32)
        corners = np.interp(steps, cumulative, edges).astype(np.float32)
        self.steps, self.corners = mi.Float(steps), mi.Float(corners)
        omega, share = 4 * pi * np.diff(corners.astype(float)), np.diff(steps.astype(float))
        self.weight_of_bin = mi.Float(omega / share)
        self.is_tabulated = lamp.profile == "table" or bool(lamp.profile_departure)
        if self.is_tabulated:
            turns, sections = sections_of(lamp, np.linspace(0, 0.5 * pi, TABLE))
            self.table, self.turns = mi.Float(sections.ravel()), mi.Float(turns)
            self.sections = len(turns)
        xx, xy, yy = narrowing(lamp)
        # Variables and not literals: another lamp needs no new kernel.
        self.value = {
            name: dr.opaque(mi.Float, value)
            for name, value in {
                "narrow_xx": xx,
                "narrow_xy": xy,
                "narrow_yy": yy,
                "asymmetry_x": lamp.asymmetry_x,
                "asymmetry_y": lamp.asymmetry_y,
                "hwhm": np.radians(lamp.hwhm_deg),
                "skirt_hwhm": np.radians(lamp.skirt_hwhm_deg),
                "exponent": lamp.shape_exponent,
                "fraction": lamp.skirt_fraction,
                "radius": lamp.radius_m,
                "apparent": lamp.apparent_distance_m,
                "offset_x": lamp.offset_x_m,
                "offset_y": lamp.offset_y_m,
            }.items()
        }
        self._right, self._up, self._axis = (
            mi.Vector3f(*(dr.opaque(mi.Float, c) for c in axis)) for axis in beam_axes(lamp)
        )

    def _envelope(self, theta: np.ndarray) -> np.ndarray:
        """Intensity of the beam's widest section; for a tally by direction, of any beam asked later."""
        uneven = self.lamp.profile == "table" or is_lopsided(self.lamp)
        # Of a formula the widest section and the narrowest, where a ring is that the other has farther out.
        extremes = widest_turn(self.lamp) + np.array([[0.0], [0.5 * pi]])
        turns = 2 * pi * np.arange(_TURNS)[:, None] / _TURNS if uneven else extremes
        across, up = np.cos(turns), np.sin(turns)
        if self.nodes is not None:
            # Splines over coarse outer rings lift a beam's tail: photons there must not be rare and heavy.
            wide = relative_intensity(self.lamp, theta / 1.3 * across, theta / 1.3 * up).max(axis=0)
            return np.asarray(wide + 0.05 * np.exp(-theta / np.radians(8.0)))
        return np.asarray(relative_intensity(self.lamp, theta * across, theta * up).max(axis=0))

    def intensity(self, theta_x: mi.Float, theta_y: mi.Float) -> mi.Float:
        """Radiant intensity relative to the axis, at beam-frame angles in rad; none behind the lamp."""
        if self.lamp.profile == "isotropic":
            return mi.Float(1)
        ahead = theta_x * theta_x + theta_y * theta_y <= (0.5 * pi) ** 2
        return dr.select(ahead, self._shape(theta_x, theta_y), 0)

    def _shape(self, theta_x: mi.Float, theta_y: mi.Float) -> mi.Float:
        """The same, as its formula or table goes on behind the lamp."""
        value = self.value
        away = dr.maximum(dr.sqrt(theta_x * theta_x + theta_y * theta_y), 1e-20)
        wider = 1 + (value["asymmetry_x"] * theta_x + value["asymmetry_y"] * theta_y) / away
        x, y = theta_x / wider, theta_y / wider
        x, y = (
            value["narrow_xx"] * x + value["narrow_xy"] * y,
            value["narrow_xy"] * x + value["narrow_yy"] * y,
        )
        theta = dr.sqrt(x * x + y * y)
        if self.is_tabulated:
            if self.sections == 1:
                return self._section(theta, mi.UInt32(0))
            turn = dr.atan2(y, x)
            turn = dr.select(turn < 0, turn + 2 * pi, turn)
            after = dr.binary_search(
                1, self.sections - 1, lambda k: dr.gather(mi.Float, self.turns, k) <= turn
            )
            before = after - 1
            first, last = (dr.gather(mi.Float, self.turns, k) for k in (before, after))
            part = dr.clip((turn - first) / (last - first), 0, 1)
            return dr.lerp(self._section(theta, before), self._section(theta, after), part)
        core, skirt = theta / value["hwhm"], theta / value["skirt_hwhm"]
        shape = dr.exp(-log(2) * dr.power(dr.maximum(core, 1e-6), value["exponent"]))
        return (shape + value["fraction"] * dr.exp(-log(2) * skirt * skirt)) / (1 + value["fraction"])

    def _section(self, theta: mi.Float, which: mi.UInt32) -> mi.Float:
        """The tabulated intensity in one half plane."""
        at = dr.clip(theta * ((TABLE - 1) / (0.5 * pi)), 0, TABLE - 1.001)
        low = mi.UInt32(at) + TABLE * which
        a, b = dr.gather(mi.Float, self.table, low), dr.gather(mi.Float, self.table, low + 1)
        return dr.lerp(a, b, at - mi.Float(mi.UInt32(at)))

    def sample(self, index: mi.UInt32, points: ScrambledSobol, rng: mi.PCG32) -> FirstFlights:
        """First flights of the photons `index` of a batch."""
        u1, u2 = points.point(index)
        local, weight, theta = self.draw(u1, u2)
        node = mi.UInt32(0) if self.nodes is None else self._node(self.nodes, theta, u2, rng)
        direction = self.in_tank(local)
        origin = self.on_window(rng.next_float32(), rng.next_float32())
        # Light starts at the window z = 0 and seems to diverge from a point behind it; what a wide or tilted
        # beam sends back from the window begins there.
        back = dr.select(direction.z > 0, self.value["apparent"] / dr.maximum(direction.z, 1e-3), 0)
        position = mi.Point3f(origin.x + direction.x * back, origin.y + direction.y * back, 0)
        return FirstFlights(position, direction, weight, node)

    def on_window(self, u: mi.Float, v: mi.Float) -> mi.Point3f:
        """Where light seems to come from: a point of the window, as far behind it as the lamp says."""
        radius = self.value["radius"] * dr.sqrt(u)
        sin_a, cos_a = dr.sincos(2 * pi * v)
        x, y = self.value["offset_x"] + radius * cos_a, self.value["offset_y"] + radius * sin_a
        return mi.Point3f(x, y, -self.value["apparent"])

    def towards(self, direction: mi.Vector3f) -> mi.Float:
        """Radiant intensity relative to the axis in a direction in the frame of the tank."""
        return self.intensity(*self.angles(direction))

    def density_towards(self, direction: mi.Vector3f) -> mi.Float:
        """Part of the photons that is sent out per solid angle in a direction of the tank, 1/sr."""
        s = 0.25 * dr.squared_norm(direction - self._axis)  # sin^2(theta / 2)
        last = len(self.weight_of_bin) - 1
        bin_ = dr.binary_search(0, last, lambda i: dr.gather(mi.Float, self.corners, i + 1) <= s)
        return dr.rcp(dr.gather(mi.Float, self.weight_of_bin, bin_))

    def in_tank(self, local: mi.Vector3f) -> mi.Vector3f:
        """A beam-frame direction in the frame of the tank."""
        return dr.normalize(self._right * local.x + self._up * local.y + self._axis * local.z)

    def angles(self, direction: mi.Vector3f) -> tuple[mi.Float, mi.Float]:
        """Beam-frame angles (theta_x, theta_y), rad, of a direction in the frame of the tank."""
        x, y, z = (dr.dot(direction, axis) for axis in (self._right, self._up, self._axis))
        across = dr.sqrt(x * x + y * y)
        scale = dr.atan2(across, z) / dr.maximum(across, 1e-20)
        return x * scale, y * scale

    def draw(self, u1: mi.Float, u2: mi.Float) -> tuple[mi.Vector3f, mi.Float, mi.Float]:
        """Beam-frame direction, its weight in sr, and its angle from the axis, for two uniform numbers."""
        if self.lamp.profile == "pencil":
            # Power 1 on average: equal deposits in one cell would all be rounded to the same side.
            return mi.Vector3f(0 * u1, 0, 1), u1 + 0.5, 0 * u1
        # The steps are such that the bin follows from u1 without a search.
        octave = -dr.log2(dr.maximum(1 - u1, 2.0**-_LAST_OCTAVE)) - _FIRST_OCTAVE
        even, tail = _EVEN - _EVEN // 2**_FIRST_OCTAVE, (_LAST_OCTAVE - _FIRST_OCTAVE) * _PER_OCTAVE
        bin_ = dr.select(
            octave < 0, mi.UInt32(u1 * _EVEN), even + mi.UInt32(dr.maximum(octave, 0) * _PER_OCTAVE)
        )
        bin_ = dr.minimum(bin_, even + tail)
        low, high = dr.gather(mi.Float, self.steps, bin_), dr.gather(mi.Float, self.steps, bin_ + 1)
        inside = dr.clip((u1 - low) / (high - low), 0, 1)
        s = dr.lerp(
            dr.gather(mi.Float, self.corners, bin_), dr.gather(mi.Float, self.corners, bin_ + 1), inside
        )
        theta = 2 * dr.asin(dr.sqrt(dr.clip(s, 0, 1)))
        sin_phi, cos_phi = dr.sincos(2 * pi * u2)
        sin_theta = 2 * dr.sqrt(dr.maximum(s * (1 - s), 0))
        weight = dr.gather(mi.Float, self.weight_of_bin, bin_)
        if self.nodes is None:
            weight *= self.intensity(theta * cos_phi, theta * sin_phi)
        return mi.Vector3f(sin_theta * cos_phi, sin_theta * sin_phi, 1 - 2 * s), weight, theta

    def _node(self, nodes: AngleNodes, theta: mi.Float, turn: mi.Float, rng: mi.PCG32) -> mi.UInt32:
        """Node near the direction, chosen at random with the weights of the splines (unbiased)."""
        t = dr.minimum(dr.asinh(theta / nodes.scale_rad) / nodes.step, nodes.n_theta - 2.001)
        low = mi.UInt32(t)
        f, u = t - mi.Float(low), 6 * rng.next_float32()
        share_before = (1 - f) * (1 - f) * (1 - f)
        share_at = f * f * (3 * f - 6) + 4
        share_after = f * (f * (3 - 3 * f) + 3) + 1
        # Rings are even about the axis: the ring before the first is the second.
        before = dr.select(low == 0, 1, low - 1)
        u_at, u_after = u - share_before, u - share_before - share_at
        ring = dr.select(
            u_at < 0, before, dr.select(u_after < 0, low, dr.select(u_after < share_after, low + 1, low + 2))
        )
        at = turn * nodes.n_phi
        sector = mi.UInt32(at)
        sector += dr.select(rng.next_float32() < at - mi.Float(sector), mi.UInt32(1), mi.UInt32(0))
        return ring * nodes.n_phi + sector % nodes.n_phi


def _steps() -> np.ndarray:
    """Ascending values of the cumulative distribution between which the proposal is constant, 0 to 1."""
    even = np.arange(_EVEN - _EVEN // 2**_FIRST_OCTAVE) / _EVEN
    octaves = np.arange((_LAST_OCTAVE - _FIRST_OCTAVE) * _PER_OCTAVE + 1) / _PER_OCTAVE + _FIRST_OCTAVE
    return np.concatenate([even, 1 - 2.0**-octaves, [1.0]])
