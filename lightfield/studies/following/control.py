"""Three laws that bring a vehicle to where it should be: PID, sliding mode, LQR.

Each sees errors (where to, less where) and velocities along surge, sway, heave and yaw, and answers with
forces. They take the four as if they were apart, which a small vehicle at low speed nearly is.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from scipy.linalg import solve_continuous_are

from lightfield.arrays import Array, Mask
from lightfield.studies.following.vehicle import STEERED, Vehicle

#: Undamped frequencies of PID, rad/s, and their damping (chosen: the vehicle answers within two seconds, well
#: below 10 Hz; yaw has to hold the Munk moment too).
FREQUENCY, DAMPING = np.array([0.8, 0.8, 0.8, 1.6]), 0.9
#: Part of the proportional gain that is integrated in a second (chosen: a current is out in half a minute).
INTEGRATED_PER_S = 0.06
#: Largest integral of an error, m s and rad s: what a long absence of light must not wind up (chosen).
_MOST_INTEGRATED = 3.0
#: Slope of the sliding surface, 1/s, its reaching acceleration, m/s^2 and rad/s^2, and the boundary layer,
#: m/s and rad/s, within which it does not chatter (Slotine & Li 1991, Applied Nonlinear Control, section 7.2;
#: numbers chosen).
_SLOPE, _REACHING, _LAYER = 0.5, np.array([0.5, 0.5, 0.5, 3.0]), 0.2
#: Errors, velocities, integrals and accelerations that LQR weighs alike (Bryson & Ho 1975, section 5.2;
#: numbers chosen).
_ALIKE, _ALIKE_RATE, _ALIKE_INTEGRAL = 0.1, 0.2, 1.0
ALIKE_PUSH = np.array([0.1, 0.1, 0.1, 1.0])
#: Speed, m/s and rad/s, at which drag is taken as linear (chosen: typical of station keeping).
_LINEAR_AT = 0.1


class Law(Protocol):
    """Force from error and velocity, body axes."""

    def force(self, error: Array, velocity: Array, seconds: float, lit: Mask) -> Array:
        """Along surge, sway, heave and yaw, shape (s, 4); integrals grow by `seconds` only where `lit`."""


@dataclass
class Pid:
    """Mass times (w^2 e - 2 d w v + 0.06 w^2 integral of e)."""

    inertia: Array
    _sum: Array | float = field(default=0.0, repr=False)

    def force(self, error: Array, velocity: Array, seconds: float, lit: Mask) -> Array:
        grown = self._sum + error * seconds * lit[:, None]
        self._sum = np.clip(grown, -_MOST_INTEGRATED, _MOST_INTEGRATED)
        stiff = FREQUENCY**2
        pull = stiff * (error + INTEGRATED_PER_S * self._sum) - 2 * DAMPING * FREQUENCY * velocity
        return np.asarray(self.inertia * pull)


@dataclass
class SlidingMode:
    """First order with a boundary layer: s = -v + slope e is driven to zero; drag is made up for."""

    inertia: Array
    linear: Array
    quadratic: Array

    def force(self, error: Array, velocity: Array, seconds: float, lit: Mask) -> Array:
        surface = _SLOPE * error - velocity
        equivalent = -_SLOPE * self.inertia * velocity
        drag = (self.linear + self.quadratic * np.abs(velocity)) * velocity
        return np.asarray(equivalent + drag + self.inertia * _REACHING * np.clip(surface / _LAYER, -1.0, 1.0))


@dataclass
class Lqr:
    """Linear quadratic regulator of error, velocity and integral, axis by axis."""

    gains: Array  # [4 axes, integral and error and velocity]
    _sum: Array | float = field(default=0.0, repr=False)

    def force(self, error: Array, velocity: Array, seconds: float, lit: Mask) -> Array:
        grown = self._sum + error * seconds * lit[:, None]
        self._sum = np.clip(grown, -_MOST_INTEGRATED, _MOST_INTEGRATED)
        by_sum, by_error, by_rate = self.gains.T
        return np.asarray(by_sum * self._sum + by_error * error - by_rate * velocity)


def axis_model(inertia: float, drag: float) -> tuple[Array, Array]:
    """A and B of d/dt (integral, error, velocity) for one axis; the input is a force."""
    a = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [0.0, 0.0, -drag / inertia]])
    return a, np.array([[0.0], [0.0], [1.0 / inertia]])


def lqr_weights(inertia: float, push: float) -> tuple[Array, Array]:
    """Q and R of one axis, whose `push` is an acceleration, m/s^2 or rad/s^2."""
    alike = np.array([_ALIKE_INTEGRAL, _ALIKE, _ALIKE_RATE])
    return np.diag(alike**-2.0), np.array([[(inertia * push) ** -2.0]])


def _lqr_gains(inertia: float, drag: float, push: float) -> Array:
    """Of integral, error and velocity, positive towards the goal."""
    (a, b), (q, r) = axis_model(inertia, drag), lqr_weights(inertia, push)
    gains = np.linalg.solve(r, b.T @ solve_continuous_are(a, b, q, r))[0]
    return gains * np.array([-1.0, -1.0, 1.0])


def law_of(name: str, vehicle: Vehicle) -> Law:
    """One of pid, sliding, lqr for a vehicle."""
    inertia = np.diag(vehicle.mass)[list(STEERED)]
    linear, quadratic = (np.array(v)[list(STEERED)] for v in (vehicle.linear, vehicle.quadratic))
    if name == "pid":
        return Pid(inertia)
    if name == "sliding":
        return SlidingMode(inertia, linear, quadratic)
    drag = linear + quadratic * _LINEAR_AT
    return Lqr(np.array([_lqr_gains(m, d, p) for m, d, p in zip(inertia, drag, ALIKE_PUSH, strict=True)]))
