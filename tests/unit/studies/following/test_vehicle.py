"""The vehicle moves as Fossen's own simulator has it; its laws are those of python-control."""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np
import pytest
from repository import ROOT

from lightfield.studies.following.control import (
    ALIKE_PUSH,
    DAMPING,
    FREQUENCY,
    INTEGRATED_PER_S,
    Lqr,
    axis_model,
    law_of,
    lqr_weights,
)
from lightfield.studies.following.vehicle import BENCHMARK, HEAVY, STEERED, VEHICLES, Vehicle, attitude

DATA = ROOT / "tests" / "data" / "remus100.csv"
#: Remus 100: a spheroid of 1.6 m and 0.19 m in water of 1026 kg/m^3; mass and added mass in closed form.
LONG, WIDE, DENSITY = 0.8, 0.095, 1026.0
MASS = 4 / 3 * np.pi * DENSITY * LONG * WIDE**2


def remus() -> Vehicle:
    """Lamb's factors of a spheroid (Fossen 2021, equations 8.129 to 8.133) and 0.3 of the roll inertia."""
    e = np.sqrt(1 - (WIDE / LONG) ** 2)
    log = np.log((1 + e) / (1 - e))
    alpha, beta = 2 * (1 - e**2) / e**3 * (0.5 * log - e), 1 / e**2 - (1 - e**2) / (2 * e**3) * log
    k1, k2 = alpha / (2 - alpha), beta / (2 - beta)
    k3 = e**4 * (beta - alpha) / ((2 - e**2) * (2 * e**2 - (2 - e**2) * (beta - alpha)))
    roll, pitch = 0.4 * MASS * WIDE**2, 0.2 * MASS * (LONG**2 + WIDE**2)
    added = (MASS * k1, MASS * k2, MASS * k2, 0.3 * roll, k3 * pitch, k3 * pitch)
    inertia, none = (roll, pitch, pitch), (0.0,) * 6
    return Vehicle(MASS, inertia, added, none, none, (0.0, 0.0, 0.02), (0.0, 0.0, 0.0), (np.inf,) * 6)


@pytest.fixture(scope="module")
def stretches() -> list[np.ndarray]:
    """Place and angles, velocity, force, shape (100, 3, 6), of each."""
    rows = np.loadtxt(DATA, delimiter=",", skiprows=7)
    return [part[:, 1:].reshape(-1, 3, 6) for part in np.split(rows, [len(rows) // 2])]


def test_a_remus_goes_the_way_that_fossens_simulator_has_stored(stretches: list[np.ndarray]) -> None:
    """Two seconds of acceleration and turn, and two of steady flight: nine digits were stored."""
    for rows in stretches:
        place, velocity = rows[:1, 0], rows[:1, 1]
        for _, _, force in rows[:-1]:
            place, velocity = remus().step(place, velocity, force[None], np.zeros(3), 0.02)
        np.testing.assert_allclose(place[0], rows[-1, 0], rtol=1e-7, atol=1e-7)
        np.testing.assert_allclose(velocity[0], rows[-1, 1], rtol=1e-6, atol=1e-7)
        # It was more than a straight line.
        assert np.abs(rows[-1, 1] - rows[0, 1]).max() > 1e-3


def test_the_comparison_sees_a_wrong_vehicle(stretches: list[np.ndarray]) -> None:
    rows = stretches[0]
    for wrong in (replace(remus(), centre_m=(0.0, 0.0, 0.01)), replace(remus(), added=(0.0,) * 6)):
        place, velocity = rows[:1, 0], rows[:1, 1]
        for _, _, force in rows[:-1]:
            place, velocity = wrong.step(place, velocity, force[None], np.zeros(3), 0.02)
        assert np.abs(velocity[0] - rows[-1, 1]).max() > 1e-4


def tumbling(vehicle: Vehicle, current: np.ndarray, seconds: float = 2.0) -> tuple[np.ndarray, np.ndarray]:
    place = np.array([[0.0, 0.0, 0.0, 0.3, -0.2, 0.5]])
    velocity = np.array([[0.4, -0.2, 0.1, 0.3, -0.2, 0.5]])
    velocity[:, :3] += np.einsum("sij,i->sj", attitude(place[:, 3:]), current)
    for _ in range(int(seconds / 0.002)):
        place, velocity = vehicle.step(place, velocity, np.zeros((1, 6)), current, 0.002)
    return place, velocity


@pytest.mark.parametrize("name", VEHICLES)
def test_a_current_carries_everything_along(name: str) -> None:
    """Galileo: in a constant current the way is that in still water, and the drift."""
    current = np.array([0.2, -0.3, 0.1])
    still, moved = tumbling(VEHICLES[name], np.zeros(3)), tumbling(VEHICLES[name], current)
    np.testing.assert_allclose(moved[0][0, :3] - still[0][0, :3], 2.0 * current, atol=4e-3)  # Euler's steps
    np.testing.assert_allclose(moved[0][0, 3:], still[0][0, 3:], atol=4e-3)


def test_nothing_is_gained_or_lost_without_drag() -> None:
    """C does no work: kinetic energy stays in weightless, frictionless tumbling; the restoring force is a
    potential."""
    free = replace(HEAVY, linear=(0.0,) * 6, quadratic=(0.0,) * 6)

    def energy(place: np.ndarray, velocity: np.ndarray) -> float:
        roll, pitch = place[0, 3], place[0, 4]
        height = -9.80665 * free.mass_kg * free.centre_m[2] * np.cos(pitch) * np.cos(roll)
        return float(0.5 * velocity[0] @ free.mass @ velocity[0] + height)

    start = np.array([[0.0, 0.0, 0.0, 0.3, -0.2, 0.5]]), np.array([[0.4, -0.2, 0.1, 0.3, -0.2, 0.5]])
    moving = 0.5 * start[1][0] @ free.mass @ start[1][0]
    assert abs(energy(*tumbling(free, np.zeros(3))) - energy(*start)) < 0.01 * moving  # Euler's steps


@pytest.mark.parametrize("name", VEHICLES)
def test_terminal_speed_and_upright_rest(name: str) -> None:
    """Thrust balances drag, in closed form; heeled by 20 degrees it rights itself."""
    level, whole = replace(VEHICLES[name], free=STEERED), VEHICLES[name]
    force = np.zeros((1, 6))
    force[0, 0] = 20.0
    straight, heeled = (np.zeros((1, 6)), np.zeros((1, 6))), (np.zeros((1, 6)), np.zeros((1, 6)))
    heeled[0][0, 3] = np.radians(20.0)
    for _ in range(600):
        straight = level.step(*straight, force, np.zeros(3), 0.02)
        heeled = whole.step(*heeled, np.zeros((1, 6)), np.zeros(3), 0.02)
    d, q = level.linear[0], level.quadratic[0]
    terminal = (-d + np.sqrt(d**2 + 4 * q * 20.0)) / (2 * q)
    assert straight[1][0, 0] == pytest.approx(terminal, rel=1e-3)
    assert abs(heeled[0][0, 3]) < np.radians(2.0)


def test_four_degrees_of_freedom_stay_level() -> None:
    held = replace(HEAVY, free=STEERED)
    place, velocity = np.zeros((1, 6)), np.zeros((1, 6))
    force = np.array([[30.0, 20.0, 10.0, 5.0, 5.0, 3.0]])
    for _ in range(200):
        place, velocity = held.step(place, velocity, force, np.array([0.1, 0.0, 0.0]), 0.02)
    assert (place[0, [3, 4]] == 0).all() and (velocity[0, [3, 4]] == 0).all() and place[0, 5] != 0


@pytest.mark.parametrize("vehicle", [HEAVY, BENCHMARK])
def test_lqr_gains_are_those_of_python_control(vehicle: Vehicle) -> None:
    law = law_of("lqr", vehicle)
    assert isinstance(law, Lqr)
    for k, axis in enumerate(STEERED):
        inertia = vehicle.mass[axis, axis]
        drag = vehicle.linear[axis] + 0.1 * vehicle.quadratic[axis]
        gains, _, poles = control.lqr(*axis_model(inertia, drag), *lqr_weights(inertia, ALIKE_PUSH[k]))
        np.testing.assert_allclose(law.gains[k], np.asarray(gains)[0] * [-1, -1, 1], rtol=1e-6)
        assert (np.real(poles) < 0).all()


def test_pid_answers_a_step_as_its_transfer_function_does() -> None:
    """One axis with linear drag, held upright: position after a step of 10 cm, from python-control."""
    vehicle = replace(HEAVY, quadratic=(0.0,) * 6, free=STEERED)
    m, d, w = vehicle.mass[0, 0], vehicle.linear[0], FREQUENCY[0]
    s = control.TransferFunction.s
    pull = m * w**2 * (1 + INTEGRATED_PER_S / s)
    plant = 1 / (m * s**2 + d * s)
    # Damping acts on the velocity alone, not on the error.
    inner = plant / (1 + plant * 2 * DAMPING * w * m * s)
    loop = control.minreal(control.feedback(pull * inner), verbose=False)
    time = 0.02 * np.arange(1000)
    expected = control.forced_response(loop, time, np.full(len(time), 0.1)).outputs
    law, place, velocity, found = law_of("pid", vehicle), np.zeros((1, 6)), np.zeros((1, 6)), []
    for _ in time:
        found.append(place[0, 0])
        error = np.array([[0.1 - place[0, 0], 0, 0, 0]])
        force = np.zeros((1, 6))
        force[:, STEERED] = law.force(error, velocity[:, STEERED], 0.02, np.array([True]))
        place, velocity = vehicle.step(place, velocity, force, np.zeros(3), 0.02)
    # Steps of 0.02 s against continuous time: 1 % of the step.
    np.testing.assert_allclose(found, expected, atol=1e-3)


@pytest.mark.parametrize(("law", "left"), [("pid", 0.01), ("lqr", 0.01), ("sliding", 0.2)])
def test_laws_hold_against_a_current(law: str, left: float) -> None:
    """0.1 m/s from ahead: PID and LQR integrate it out; a sliding mode with a boundary layer keeps an error,
    drag times layer over (inertia, reaching acceleration, slope) once it stands still."""
    vehicle = replace(HEAVY, free=STEERED)
    pilot, place, velocity = law_of(law, vehicle), np.zeros((1, 6)), np.zeros((1, 6))
    for _ in range(2400):
        error = np.zeros((1, 4))
        error[0, 0] = -place[0, 0]
        force = np.zeros((1, 6))
        force[:, STEERED] = pilot.force(error, velocity[:, STEERED], 0.05, np.array([True]))
        place, velocity = vehicle.step(place, velocity, force, np.array([-0.1, 0.0, 0.0]), 0.05)
    assert abs(place[0, 0]) < left
    if law == "sliding":
        push = 0.1 * (vehicle.linear[0] + 0.1 * vehicle.quadratic[0])
        assert -place[0, 0] == pytest.approx(push * 0.2 / (vehicle.mass[0, 0] * 0.5 * 0.5), rel=0.01)
