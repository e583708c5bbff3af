"""Readings made by the closed-form model, for tests of the statistics of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from lightfield.experiments.layouts import Order, scan
from lightfield.experiments.measure import Instrument, LightAtReadings, measure
from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
from lightfield.scene import Scene


def scene(**values: float) -> Scene:
    """A lamp of 4 degrees in water of 0.12 per m, planes from 4.5 to 8.5 m."""
    base = Scene.from_dict({"lamp": {"hwhm_deg": 4.0}, "water": {"absorption_per_m": 0.12}})
    return base.with_values(values) if values else base


def readings(
    hidden: Mapping[str, Any] | None = None,
    *,
    seed: int = 0,
    layout: str = "line",
    order: Order = "random",
    noise: float = 0.005,
    factor: Any = None,
    **kinds: float,
) -> tuple[Readings, Scene]:
    """Readings of a true scene, and the scene that its experimenter believes in (15 % off).

    Parameters
    ----------
    hidden : mapping
        Parameter values of the truth.
    factor : callable, optional
        Takes the layout table, gives a factor on the light.
    **kinds
        serial, outliers, plane_gain of the `Instrument`.
    """
    rng = np.random.default_rng(seed)
    believed = scene()
    table = scan(believed, layout, order, rng)
    wrong = {"lamp.hwhm_deg": 4.0 * 1.15, "water.absorption_per_m": 0.12 * 0.87}
    truth = believed.with_values({**wrong, **(hidden or {})})
    places = table.x_m, table.y_m, table.z_m
    light = direct_field(truth, *places, table.wavelength_nm, table.medium, table.time_s)
    more = 1.0 if factor is None else factor(table)
    measured, _ = measure(truth, table, LightAtReadings(light), Instrument(noise, **kinds), rng, more)
    return measured, believed


def many_lines(n: int, distances: int, **hidden: float) -> tuple[Readings, Scene]:
    """Readings along lines across the beam, one line after the other, with an error of 0.5 %."""
    believed, rng = scene(), np.random.default_rng(3)
    z = np.repeat(np.linspace(4.5, 8.5, distances), n // distances)
    x = np.tile(np.linspace(-0.9, 0.9, n // distances), distances)
    light = direct_field(believed.with_values(hidden), x, 0 * x, z)
    error = np.hypot(0.005 * light, 0.0008 * light.max())
    table = Readings.from_arrays(
        x_m=x, y_m=0 * x, z_m=z, value=light + error * rng.standard_normal(len(x)), stderr=error,
        time_s=np.arange(len(x)), quantity="irradiance",
    )  # fmt: skip
    return table.check_against(believed), believed
