"""Readings made by the closed-form model, for tests of the statistics of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from lightfield.experiments.hide import measure, positions
from lightfield.formula.field import direct_field
from lightfield.readings import Readings
from lightfield.scene import Scene

SECONDS = 20.0


def scene(**values: float) -> Scene:
    """A lamp of 4 degrees in water of 0.12 per m, planes from 4.5 to 8.5 m."""
    base = Scene.from_dict({"lamp": {"hwhm_deg": 4.0}, "water": {"absorption_per_m": 0.12}})
    return base.with_values(values) if values else base


def readings(
    hidden: Mapping[str, Any] | None = None,
    *,
    seed: int = 0,
    layout: str = "line",
    order: str = "random",
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
        serial, outliers, plane_gain as `hide.measure` takes them.
    """
    rng = np.random.default_rng(seed)
    believed = scene()
    places = positions(believed, layout)
    n = len(places["x_m"])
    sequence = rng.permutation(n) if order == "random" else np.arange(n)
    table = Readings.from_arrays(
        **places,
        value=np.ones(n),
        stderr=np.full(n, np.nan),
        time_s=SECONDS * sequence,
        quantity="irradiance",
    ).check_against(believed)
    wrong = {"lamp.hwhm_deg": 4.0 * 1.15, "water.absorption_per_m": 0.12 * 0.87}
    truth = believed.with_values({**wrong, **(hidden or {})})
    light = direct_field(truth, table.x_m, table.y_m, table.z_m, table.wavelength_nm, table.medium)
    more = 1.0 if factor is None else factor(table)
    measured, _, _ = measure(believed, truth, table, rng, noise=noise, light=light, factor=more, **kinds)
    return measured, believed
