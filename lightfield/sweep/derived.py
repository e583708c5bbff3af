"""Numbers read off the maps of a case: on the axis, half width, power on the plane, error of the formula."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightfield.analytic import direct_field, optical_depth, rays
from lightfield.errors import LightfieldError
from lightfield.lamps.profile import solid_angle_sr
from lightfield.lamps.spectrum import spectral_power
from lightfield.render.grid import Grid, band_wavelengths
from lightfield.scene import Scene
from lightfield.spot import Spot, spot_shape

Array = NDArray[np.floating[Any]]
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)


@dataclass(frozen=True)
class Formula:
    """The closed-form model on a grid, for any water: geometry once, attenuation per case.

    Parameters
    ----------
    field : array, shape (n_planes, n_y, n_x), m^-2
        Averaged over every cell, in clear water and for unit on-axis intensity.
    scene : Scene
        Lamp and detector that it belongs to.
    grid : Grid
    """

    field: Array
    scene: Scene
    grid: Grid

    @classmethod
    def of(cls, scene: Scene, grid: Grid) -> Formula | None:
        """The formula of a scene's lamp and detector; None for a pencil beam, which has no formula."""
        clear = scene.with_values(
            {
                "water.base": "none",
                "water.absorption_per_m": 0.0,
                "water.scattering_per_m": 0.0,
                "water.chlorophyll_mg_per_m3": 0.0,
                "water.cdom_440_per_m": 0.0,
                "water.sediment_g_per_m3": 0.0,
                "water.hardening_per_m": 0.0,
                "water.gradient_per_m2": 0.0,
                "water.layer_absorption_per_m": 0.0,
            },
            validate=False,
        )
        total = np.zeros(grid.shape)
        try:
            for u, wu in zip(_NODES, _WEIGHTS, strict=True):
                for v, wv in zip(_NODES, _WEIGHTS, strict=True):
                    z, y, x = np.meshgrid(
                        grid.z_m,
                        grid.y_m + 0.5 * v * grid.pitch_y_m,
                        grid.x_m + 0.5 * u * grid.pitch_x_m,
                        indexing="ij",
                    )
                    total += 0.25 * wu * wv * direct_field(clear, x, y, z)
        except LightfieldError:
            return None
        return cls(total, scene, grid)

    def bands(self, scene: Scene) -> Array:
        """Absolute maps of a case, shape (n_bands, n_planes, n_y, n_x), unit of the render's maps."""
        z, y, x = np.meshgrid(self.grid.z_m, self.grid.y_m, self.grid.x_m, indexing="ij")
        # Within a cell the path changes far less than its attenuation length: the centre's will do.
        ray = rays(scene.lamp, x, y, z)
        maps = [
            np.mean(
                [
                    i * np.exp(-optical_depth(scene.water, ray, z, w))
                    for w, i in zip(band, power, strict=True)
                ],
                axis=0,
            )
            for band, power in zip(band_wavelengths(scene), intensity_of(scene), strict=True)
        ]
        return np.asarray(np.array(maps) * self.field)


def intensity_of(scene: Scene) -> Array:
    """On-axis radiant intensity at `band_wavelengths`, W/(sr nm) (power, W/nm, for a pencil beam)."""
    at = band_wavelengths(scene)
    sr = 1.0 if scene.lamp.profile == "pencil" else float(solid_angle_sr(scene.lamp))
    return np.asarray(spectral_power(scene.lamp, at.ravel()).reshape(at.shape) / sr)


def derive(mean: Array, stderr: Array, formula: Array | None, grid: Grid) -> dict[str, Array]:
    """Derived quantities of one case.

    Parameters
    ----------
    mean, stderr : arrays, shape (n_bands, n_planes, n_y, n_x)
        Errors of different cells are taken as independent: a photon rarely meets a plane twice.
    formula : array of that shape, optional
    grid : Grid

    Returns
    -------
    dict of name to array, shape (n_bands, n_planes)
        See `store.DERIVED`; NaN where there is nothing to tell.
    """
    near = _axis_cells(grid)
    known = np.where(np.isfinite(stderr), stderr, 0.0)
    axis, axis_error = mean[..., near].mean(-1), np.sqrt((stderr[..., near] ** 2).sum(-1)) / near.sum()
    area = grid.pitch_x_m * grid.pitch_y_m
    power, power_error = mean.sum((-2, -1)) * area, np.sqrt((known**2).sum((-2, -1))) * area
    width, width_error = np.full(axis.shape, np.nan), np.full(axis.shape, np.nan)
    for at in np.ndindex(axis.shape):
        spot = spot_shape(mean[at], grid.x_m, grid.y_m)
        if not spot.problem:
            width[at], width_error[at] = spot.hwhm_m, half_width_stderr(spot, mean[at], known[at], grid)
    result = {
        "on_axis": axis,
        "on_axis_stderr": axis_error,
        "plane_power": power,
        "plane_power_stderr": power_error,
        "half_width": width,
        "half_width_stderr": width_error,
    }
    if formula is not None:
        with np.errstate(divide="ignore", invalid="ignore"):
            for name, model, render, error in (
                ("axis", formula[..., near].mean(-1), axis, axis_error),
                ("power", formula.sum((-2, -1)) * area, power, power_error),
            ):
                ratio = np.where(render > 0, model / render, np.nan)
                result[f"formula_error_{name}"] = ratio - 1
                result[f"formula_error_{name}_stderr"] = np.where(render > 0, ratio * error / render, np.nan)
    return result


def half_width_stderr(spot: Spot, value: Array, stderr: Array, grid: Grid) -> float:
    """Standard error of the half width: noise on the contour and of the maximum over the slope of the flank.

    Parameters
    ----------
    spot : Spot
    value, stderr : arrays, shape (n_y, n_x)
    grid : Grid
    """
    x, y = np.meshgrid(grid.x_m - spot.centre_x_m, grid.y_m - spot.centre_y_m)
    s = np.hypot(x / spot.hwhm_x_m, y / spot.hwhm_y_m)  # 1 on the contour
    step = max(grid.pitch_x_m / spot.hwhm_x_m, grid.pitch_y_m / spot.hwhm_y_m)
    inner, outer = np.abs(s - (1 - step)) < step, np.abs(s - (1 + step)) < step
    ring, core = np.abs(s - 1) < 0.5 * step, value > 0.8 * spot.peak
    if min(map(np.count_nonzero, (inner, outer, ring, core))) < 3:
        return float("nan")
    slope = (value[inner].mean() - value[outer].mean()) / (s[outer].mean() - s[inner].mean())
    on_ring = np.sqrt((stderr[ring] ** 2).sum()) / np.count_nonzero(ring)
    # A quadratic form fitted over a disc has four times the variance of a mean at its centre.
    at_peak = 2 * np.sqrt((stderr[core] ** 2).sum()) / np.count_nonzero(core)
    if slope <= 0:
        return float("nan")
    return float(spot.hwhm_m * np.hypot(on_ring, 0.5 * at_peak) / slope)


def _axis_cells(grid: Grid) -> NDArray[np.bool_]:
    """The cell, or the equally near cells, at x = y = 0; shape (n_y, n_x)."""
    radius = np.hypot(*np.meshgrid(grid.x_m, grid.y_m))
    return np.asarray(radius <= radius.min() * (1 + 1e-6) + 1e-12)
