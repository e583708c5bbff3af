"""Up to which range can the formula be trusted, in which water, with which receiver?

On the axis of the lamp in unbounded water, Gaussian x inverse square x Beer-Lambert is compared with the
render over optical thickness c z and single-scattering albedo b / c. Only ratios matter. The grid is computed
as a sweep like any other.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from lightfield.arrays import Array, Mask
from lightfield.formula.closed_form import refuse_pencil
from lightfield.scene import Scene
from lightfield.scene.bands import refuse_unlit
from lightfield.studies.compare.rings import SIGMAS
from lightfield.sweep.axes import ALBEDO, ATTENUATION, Axis
from lightfield.sweep.results import open_store
from lightfield.sweep.runner import SweepProgress, run_sweep
from lightfield.sweep.sweep_plan import SweepPlan, SweepSettings, make_plan

OPTICAL_DEPTHS = (0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 14.0, 20.0)
ALBEDOS = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95)
RECEIVERS: dict[str, dict[str, Any]] = {
    "irradiance": {"quantity": "irradiance"},
    "2 degree collimator": {"quantity": "radiance", "full_angle_deg": 2.0, "aim": "axis"},
}
#: Relative errors of the formula up to which it is asked for.
ERRORS = (0.05, 0.10, 0.25)
#: Albedo and error that are told of in a sentence.
_TYPICAL, _WITHIN = 0.8, 0.10
_DISTANCE_M, _CELL_M = 5.0, 0.05
#: A lamp on the axis along which it is asked about.
AIMED = dict.fromkeys(("offset_x_m", "offset_y_m", "tilt_x_deg", "tilt_y_deg"), 0.0)
_RECEIVER = "receiver"


def run_regime(
    scene: Scene, settings: SweepSettings, store: Path, **how: Any
) -> tuple[SweepPlan, SweepProgress, xr.Dataset]:
    """Run the sweep, or what is left of it: its plan, what was done, and the regime map (`regime_map`).

    Scene, settings and errors as of `regime_plan` and `run_sweep`, which is told `how` (workers, report).
    """
    plan = regime_plan(scene, settings)
    done = run_sweep(plan, store, **how)
    found = _regime_of(open_store(store)).load()
    provenance = {"scene_toml": scene.to_toml(), "scene_digest": scene.digest(), "seed": settings.seed}
    return plan, done, found.assign_attrs(provenance)


def regime_plan(scene: Scene, settings: SweepSettings) -> SweepPlan:
    """Optical thickness x single-scattering albedo x receiver, on the axis in unbounded water.

    Parameters
    ----------
    scene : Scene
        Lamp, phase function and first band; tank, water coefficients and detector are replaced, and the lamp
        stands in the axis and looks along it.

    Raises
    ------
    SceneError
        The lamp gives no light in its bands, or a pencil beam, which has no formula.
    """
    refuse_pencil(scene.lamp)
    refuse_unlit(scene)
    parts = scene.model_dump(mode="json", exclude_none=True)
    parts |= {
        "lamp": {**parts["lamp"], **AIMED},
        "water": {"phase": parts["water"]["phase"], "absorption_per_m": 0.1},
        "detector": {
            "planes_m": [_DISTANCE_M], "width_m": 3 * _CELL_M, "pixels": 3,
            "bands_nm": [scene.detector.bands_read_nm[0]],
        },
    }  # fmt: skip
    parts.pop("tank", None)
    receivers = {
        f"detector.{key}": tuple(receiver.get(key, default) for receiver in RECEIVERS.values())
        for key, default in (("quantity", "irradiance"), ("full_angle_deg", 2.0), ("aim", "axis"))
    }
    axes = [
        Axis(_RECEIVER, receivers),
        Axis(ALBEDO, {ALBEDO: ALBEDOS}),
        Axis(ATTENUATION, {ATTENUATION: tuple(depth / _DISTANCE_M for depth in OPTICAL_DEPTHS)}),
    ]
    return make_plan(Scene.from_dict(parts), axes, settings)


def _regime_of(store: xr.Dataset) -> xr.Dataset:
    """The regime map of a store that `regime_plan` was run into; see `regime_map`."""
    quantity = store.attrs["quantity"]
    on_axis = store.isel(wavelength_nm=0, z_m=0).transpose(_RECEIVER, ALBEDO, ATTENUATION, ...)
    names = (f"on_axis_{quantity}", f"on_axis_{quantity}_stderr", "formula_error_on_axis")
    render, stderr, error = (np.asarray(on_axis[name].values, float) for name in names)
    return regime_map(render, stderr, error, OPTICAL_DEPTHS, ALBEDOS, tuple(RECEIVERS))


def regime_map(
    render: Array,
    stderr: Array,
    error: Array,
    optical_depths: Sequence[float],
    albedos: Sequence[float],
    receivers: Sequence[str],
) -> xr.Dataset:
    """Relative error of the formula over a grid, known where anything was rendered.

    Parameters
    ----------
    render, stderr : arrays, shape (n_receivers, n_albedos, n_depths)
        On the axis, with the Monte Carlo standard error, in any unit.
    error : array of that shape
        formula / render - 1.
    optical_depths, albedos : sequence of float
        c z and b / c.

    Returns
    -------
    xarray.Dataset
        `formula_error` and `formula_error_stderr`, dimensions (receiver, albedo, optical_depth).
    """
    lit = render > 0
    noise = np.divide((1 + error) * stderr, render, out=np.full(render.shape, np.nan), where=lit)
    dims = ("receiver", "albedo", "optical_depth")
    about = {"units": "1", "long_name": "formula / render - 1 on the axis"}
    return xr.Dataset(
        {
            "formula_error": (dims, np.where(lit, error, np.nan), about),
            "formula_error_stderr": (dims, noise, {"units": "1", "long_name": "Monte Carlo standard error"}),
        },
        coords={
            "receiver": list(receivers),
            "albedo": ("albedo", np.asarray(albedos, float), {"long_name": "single-scattering albedo b / c"}),
            "optical_depth": ("optical_depth", np.asarray(optical_depths, float), {"long_name": "c z"}),
        },
    )


def depth_within(optical_depth: Array, error: Array, level: float) -> float:
    """Largest optical depth up to which the error stays within a level, interpolated between points.

    Parameters
    ----------
    optical_depth, error : arrays, shape (n,)
    level : float

    Returns
    -------
    float
        Infinite when it is never exceeded, NaN when already the first point exceeds it.
    """
    size = np.abs(error)
    beyond = np.flatnonzero(~(size <= level))
    if beyond.size == 0:
        return float("inf")
    k = int(beyond[0])
    if k == 0:
        return float("nan")
    if not np.isfinite(size[k]):
        return float(optical_depth[k - 1])
    # Logarithms of both: for thin water the error is proportional to the thickness.
    low, high = np.log(np.maximum(size[k - 1 : k + 1], 1e-12))
    share = (np.log(level) - low) / (high - low)
    return float(np.exp(np.interp(share, [0, 1], np.log(optical_depth[k - 1 : k + 1]))))


def undecided(error: Array, stderr: Array) -> Mask:
    """Points whose class Monte Carlo noise leaves open, shape of the errors of the formula there."""
    return np.any([np.abs(np.abs(error) - level) < SIGMAS * stderr for level in ERRORS], axis=0)


def rows(dataset: xr.Dataset) -> list[list[str]]:
    """Table: receiver, albedo, and the optical depth reached within 5, 10 and 25 %."""
    depth = dataset.optical_depth.values
    table = []
    for receiver in dataset.receiver.values:
        for albedo in dataset.albedo.values:
            error = dataset.formula_error.sel(receiver=receiver, albedo=albedo).values
            table.append(
                [str(receiver), f"{albedo:g}", *(_reach_text(depth, error, level) for level in ERRORS)]
            )
    return table


def as_text(dataset: xr.Dataset) -> str:
    """One sentence for the water of a typical albedo."""
    nearest = float(dataset.albedo.sel(albedo=_TYPICAL, method="nearest"))
    depth = dataset.optical_depth.values
    parts = []
    for receiver in dataset.receiver.values:
        error = dataset.formula_error.sel(receiver=receiver, albedo=nearest).values
        parts.append(f"c z = {_reach_text(depth, error, _WITHIN)} ({receiver})")
    said = f"In water of albedo {nearest:g} the formula is within {100 * _WITHIN:g} %"
    return f"{said} up to {' and '.join(parts)}."


def _reach_text(depth: Array, error: Array, level: float) -> str:
    unknown = np.isnan(error)
    if unknown[0]:
        return "unknown"
    found = depth_within(depth, error, level)
    if unknown.any() and found >= (last := depth[unknown.argmax() - 1]):
        return f"> {last:g}"
    if np.isinf(found):
        return f"> {depth[-1]:g}"
    return f"< {depth[0]:g}" if np.isnan(found) else f"{found:.2g}"
