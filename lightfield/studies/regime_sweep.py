"""The regime map as a sweep like any other: its plan, and the map read from its store."""

from __future__ import annotations

import numpy as np
import xarray as xr

from lightfield.scene import Scene
from lightfield.studies.regime import (
    ALBEDOS,
    CELL_M,
    DISTANCE_M,
    OPTICAL_DEPTHS,
    RECEIVERS,
    Point,
    regime_map,
)
from lightfield.sweep.axes import ALBEDO, ATTENUATION, Axis
from lightfield.sweep.plan import Plan, SweepSettings, make_plan

RECEIVER = "receiver"


def regime_plan(scene: Scene, settings: SweepSettings) -> Plan:
    """Optical thickness x single-scattering albedo x receiver, on the axis in unbounded water.

    Parameters
    ----------
    scene : Scene
        Lamp and phase function; tank, water coefficients and detector are replaced.
    settings : SweepSettings
    """
    parts = scene.model_dump(mode="json", exclude_none=True)
    parts |= {
        "water": {"phase": parts["water"]["phase"], "absorption_per_m": 0.1},
        "detector": {"planes_m": [DISTANCE_M], "width_m": 3 * CELL_M, "pixels": 3},
    }
    parts.pop("tank", None)
    receivers = {
        f"detector.{key}": tuple(receiver.get(key, default) for receiver in RECEIVERS.values())
        for key, default in (("quantity", "irradiance"), ("full_angle_deg", 2.0), ("aim", "axis"))
    }
    axes = [
        Axis(RECEIVER, receivers),
        Axis(ALBEDO, {ALBEDO: ALBEDOS}),
        Axis(ATTENUATION, {ATTENUATION: tuple(depth / DISTANCE_M for depth in OPTICAL_DEPTHS)}),
    ]
    return make_plan(Scene.from_dict(parts), axes, settings)


def regime_of(store: xr.Dataset) -> xr.Dataset:
    """The regime map of a store that `regime_plan` was run into; see `regime.regime_map`."""
    names = list(RECEIVERS)
    quantity = store.attrs["quantity"]
    render = (
        store[f"on_axis_{quantity}"].isel(wavelength_nm=0, z_m=0).transpose(RECEIVER, ALBEDO, ATTENUATION)
    )
    error = store["formula_error_on_axis"].isel(wavelength_nm=0, z_m=0).transpose(*render.dims)
    stderr = store[f"on_axis_{quantity}_stderr"].isel(wavelength_nm=0, z_m=0).transpose(*render.dims)
    values = [np.asarray(part.values, float) for part in (render, stderr, error)]
    depths = [float(c) * DISTANCE_M for c in store[ATTENUATION].values]

    def point(depth: float, albedo: float, receiver: str) -> Point:
        at = (names.index(receiver), ALBEDOS.index(albedo), int(np.argmin(np.abs(np.array(depths) - depth))))
        mean, noise, wrong = (float(part[at]) for part in values)
        return Point(mean, noise, mean * (1 + wrong))

    return regime_map(point)
