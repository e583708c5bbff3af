"""Motion of a small underwater vehicle in six degrees of freedom, or in four.

    M dv/dt + C(v_r) v_r + D v_r + D_n |v_r| v_r + g(angles) = tau,    v_r = v - v_current
    d(place, angles)/dt = J(angles) v

(Fossen 2021, Handbook of Marine Craft Hydrodynamics and Motion Control, 2nd edition, equations 8.1 and 8.2;
M and C of rigid body and added mass together, equation 3.46; g of equation 4.6; an irrotational current,
section 10.3). Velocities v along forward, starboard, down, and about them (roll, pitch, yaw); places north,
east, down of an origin, angles roll, pitch, yaw. Thrusters answer at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lightfield.arrays import Array

#: m/s^2 (the standard one).
_GRAVITY = 9.80665


@dataclass(frozen=True)
class Vehicle:
    """What decides how a vehicle moves.

    Parameters
    ----------
    mass_kg : float
    inertia_kg_m2 : (float, float, float)
        About the centre of gravity.
    added : tuple of 6 floats, kg and kg m^2
        Mass of the water that is moved with it.
    linear, quadratic : tuple of 6 floats
        Drag by velocity, N s/m and N m s, and by its square.
    centre_m, buoyant_m : (float, float, float), m
        Centres of gravity and of buoyancy, forward, starboard and down.
    thrust : tuple of 6 floats, N and N m
        Most that its thrusters give along every axis.
    free : tuple of int
        Degrees of freedom that are not held at zero.
    """

    mass_kg: float
    inertia_kg_m2: tuple[float, float, float]
    added: tuple[float, ...]
    linear: tuple[float, ...]
    quadratic: tuple[float, ...]
    centre_m: tuple[float, float, float]
    buoyant_m: tuple[float, float, float]
    thrust: tuple[float, ...]
    free: tuple[int, ...] = (0, 1, 2, 3, 4, 5)

    @cached_property
    def mass(self) -> Array:
        """M: rigid body about the origin and added mass, shape (6, 6)."""
        arm = np.eye(6)
        arm[:3, 3:] = _cross(np.array(self.centre_m)).T
        body = np.diag([self.mass_kg] * 3 + list(self.inertia_kg_m2))
        return np.asarray(arm.T @ body @ arm + np.diag(self.added))

    @cached_property
    def _answer(self) -> Array:
        """Acceleration per force: inverse of M among the free degrees, zero elsewhere."""
        found = np.zeros((6, 6))
        at = np.ix_(self.free, self.free)
        found[at] = np.linalg.inv(self.mass[at])
        return found

    def acceleration(self, angles: Array, velocity: Array, force: Array, current: Array) -> Array:
        """dv/dt, shape (s, 6).

        Parameters
        ----------
        angles : array, shape (s, 3), rad
            Roll, pitch, yaw.
        velocity, force : array, shape (s, 6)
        current : array, shape (3,), m/s
            North, east, down; constant.
        """
        flow = np.zeros_like(velocity)
        flow[:, :3] = np.einsum("sij,i->sj", attitude(angles), current)
        through = velocity - flow
        drag = (np.array(self.linear) + np.array(self.quadratic) * np.abs(through)) * through
        net = force - _coriolis(self.mass, through) - drag - self._restoring(angles)
        changed = np.zeros_like(velocity)
        changed[:, :3] = _across(
            flow[:, :3], velocity[:, 3:]
        )  # a constant current as a turning vehicle sees it
        found = changed + net @ self._answer.T
        held = [k for k in range(6) if k not in self.free]
        found[:, held] = 0.0
        return np.asarray(found)

    def step(
        self, place: Array, velocity: Array, force: Array, current: Array, seconds: float
    ) -> tuple[Array, Array]:
        """Place and angles, and velocity, shape (s, 6) each, after a short time.

        Euler's method, velocities first (Fossen 2021, section B.1.1); steps of 0.02 s.
        """
        after = velocity + seconds * self.acceleration(place[:, 3:], velocity, force, current)
        moved = place.copy()
        moved[:, :3] += seconds * np.einsum("sij,sj->si", attitude(place[:, 3:]), after[:, :3])
        moved[:, 3:] += seconds * _turning(place[:, 3:], after[:, 3:])
        return moved, after

    def _restoring(self, angles: Array) -> Array:
        """Of weight and buoyancy, which are equal: the vehicle only rights itself."""
        weight = self.mass_kg * _GRAVITY
        roll, pitch = angles[:, 0], angles[:, 1]
        down = np.stack([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)], axis=1)
        lever = np.array(self.centre_m) * weight - np.array(self.buoyant_m) * weight
        return -np.concatenate([np.zeros_like(down), _across(lever, down)], axis=1)


def attitude(angles: Array) -> Array:
    """Turn directions of the vehicle into north, east, down, shape (s, 3, 3) (Fossen 2021, equation 2.31)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(angles).T, np.sin(angles).T
    rows = (
        (cy * cp, -sy * cr + cy * sp * sr, sy * sr + cy * cr * sp),
        (sy * cp, cy * cr + sr * sp * sy, -cy * sr + sp * sy * cr),
        (-sp, cp * sr, cp * cr),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _turning(angles: Array, rates: Array) -> Array:
    """Rates of roll, pitch and yaw from those about the vehicle's axes (Fossen 2021, equation 2.41)."""
    roll, pitch = angles[:, 0], angles[:, 1]
    p, q, r = rates.T
    across = q * np.sin(roll) + r * np.cos(roll)
    return np.stack(
        [p + across * np.tan(pitch), q * np.cos(roll) - r * np.sin(roll), across / np.cos(pitch)], axis=1
    )


def _coriolis(mass: Array, velocity: Array) -> Array:
    """C(v) v, shape (s, 6) (Fossen 2021, theorem 3.2)."""
    momentum = velocity @ mass.T
    linear, turn = velocity[:, :3], velocity[:, 3:]
    along = _across(turn, momentum[:, :3])
    about = _across(linear, momentum[:, :3]) + _across(turn, momentum[:, 3:])
    return np.concatenate([along, about], axis=1)


def _across(v: Array, w: Array) -> Array:
    """Cross product along the last axis; NumPy's own takes ten times as long for a few of them."""
    a, b, c = v[..., 0], v[..., 1], v[..., 2]
    d, e, f = w[..., 0], w[..., 1], w[..., 2]
    return np.stack([b * f - c * e, c * d - a * f, a * e - b * d], axis=-1)


def _cross(v: Array) -> Array:
    """Matrix of the cross product with v."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


#: Thrust along forward, starboard and down, N, and about down, N m, of eight thrusters of 30 N, four of them
#: at 45 degrees with a lever arm of 0.1888 m (geometry: see `HEAVY`); their data sheet (Blue Robotics T200,
#: 16 V) has 50 N.
_THRUST = (85.0, 85.0, 120.0, 26.0, 14.0, 22.0)
#: BlueROV2 Heavy, the numbers of github.com/rakeshv24/bluerov2_dock, config/auv_bluerov2_heavy.yaml (Oregon
#: State University), trimmed to neutral buoyancy.
HEAVY = Vehicle(
    11.5,
    (0.16, 0.16, 0.16),
    (5.5, 12.7, 14.6, 0.12, 0.12, 0.12),
    (4.03, 6.22, 5.18, 0.07, 0.07, 0.07),
    (18.18, 21.66, 36.99, 1.55, 1.55, 1.55),
    (0.0, 0.0, 0.02),
    (0.0, 0.0, 0.0),
    _THRUST,
)
#: The same vehicle as measured by von Benzon et al. 2022 (J. Mar. Sci. Eng. 10, 1898,
#: doi:10.3390/jmse10121898): drag four to ten times as large.
BENCHMARK = Vehicle(
    13.5,
    (0.26, 0.23, 0.37),
    (6.36, 7.12, 18.68, 0.189, 0.135, 0.222),
    (13.7, 0.0, 33.0, 0.0, 0.8, 0.0),
    (141.0, 217.0, 190.0, 1.19, 0.47, 1.5),
    (0.0, 0.0, 0.0),
    (0.0, 0.0, -0.01),
    _THRUST,
)
VEHICLES = {"bluerov2-heavy": HEAVY, "bluerov2-benchmark": BENCHMARK}
#: Surge, sway, heave and yaw: what is steered; with four degrees of freedom the rest is held at zero.
STEERED = (0, 1, 2, 5)
