"""Struts and bubbles are local unknowns: shadows by rays from a disc, cast here, are dips and plumes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from analytic_readings import readings
from local_unknown import fitted_alone

from lightfield.fitting.effects.local import AMPLITUDES, local_unknowns
from lightfield.readings import Readings

Shade = Callable[[Readings], np.ndarray]
LAMP_M = 0.04


def rays(table: Readings, at_m: np.ndarray | float, lamp_m: float = LAMP_M) -> np.ndarray:
    """Where rays from points of the lamp's disc to every reading pass a distance, x in m, (n, points)."""
    k = (np.arange(300) + 0.5) / 300
    start = lamp_m * np.sqrt(k) * np.cos(np.arange(300) * np.pi * (3 - np.sqrt(5)))
    part = np.asarray(at_m / table.z_m)
    return start + (table.x_m[:, None] - start) * np.broadcast_to(part, table.x_m.shape)[:, None]


def strut(x_m: float, z_m: float, width_m: float, lamp_m: float = LAMP_M) -> Shade:
    """An upright rod that stands in the tank."""

    def shade(table: Readings) -> np.ndarray:
        hidden = np.abs(rays(table, z_m, lamp_m) - x_m) < 0.5 * width_m
        return np.where(table.z_m > z_m, 1 - hidden.mean(axis=1), 1.0)

    return shade


def carried(x_m: float, before_m: float, width_m: float) -> Shade:
    """An upright rod that the carriage holds before the detector, at one place in the tank's x."""

    def shade(table: Readings) -> np.ndarray:
        hidden = np.abs(rays(table, table.z_m - before_m) - x_m) < 0.5 * width_m
        return np.asarray(1 - hidden.mean(axis=1))

    return shade


def bubbles(x_m: float, z_m: float, width_m: float) -> Shade:
    """A round column: exp(-integral of 3 per m exp(-(d/width)^2)) along every ray, summed up."""

    def shade(table: Readings) -> np.ndarray:
        depth = np.zeros(len(table.z_m))
        steps = (np.arange(800) + 0.5) / 800
        for s in steps:
            x, z = s * table.x_m, s * table.z_m
            depth += 3.0 * np.exp(-((x - x_m) ** 2 + (z - z_m) ** 2) / width_m**2)
        return np.asarray(np.exp(-depth * np.hypot(table.x_m, table.z_m) / len(steps)))

    return shade


@pytest.mark.parametrize(
    ("shade", "name", "where"),
    [
        pytest.param(carried(0.15, 0.4, 0.2), "dip_in_x", {"x0": 0.15 * 1.065}, id="strut on the carriage"),
        pytest.param(strut(-0.2, 6.0, 0.08), "plume", {"x0": -0.2, "z0": 6.0}, id="strut in the tank"),
        pytest.param(strut(-0.1, 3.0, 0.1), "plume", {"x0/z0": -0.1 / 3.0}, id="strut before all planes"),
        pytest.param(strut(0.1, 2.0, 0.024, 0.005), "plume", {"x0/z0": 0.05}, id="narrow and black"),
        pytest.param(bubbles(0.15, 6.0, 0.1), "plume", {"x0": 0.15, "z0": 6.0}, id="bubbles"),
    ],
)
@pytest.mark.slow
def test_a_shadow_is_a_local_unknown(shade: Shade, name: str, where: dict[str, float]) -> None:
    """It takes three quarters of the misfit at least, and stands where the thing does.

    Not all: the edges of a rod's shadow are no Gaussian's.
    """
    table, believed = readings(factor=shade, seed=1, layout="fine")
    base, fit = fitted_alone(table, believed, name)
    spare = len(table.value) - len(fit.u)
    assert fit.chi2 - spare < 0.25 * (base.chi2 - spare)
    found = {path.rpartition(".")[2]: value for path, value in fit.values.items()}
    for key, true in where.items():
        value = found["x0"] / found["z0"] if "/" in key else found[key]
        assert value == pytest.approx(true, abs=0.01 if "/" in key else 0.35 if key == "z0" else 0.03), key


def test_what_the_amplitudes_of_local_unknowns_are_called() -> None:
    """They alone have a neutral value, 0."""
    table, _ = readings(seed=1, layout="fine")
    found = [(name, p.neutral) for one in local_unknowns(table) for name, p in one.parameters.items()]
    assert {name for name, neutral in found if neutral is not None} == set(AMPLITUDES)
    assert {neutral for name, neutral in found if name in AMPLITUDES} == {0.0}
