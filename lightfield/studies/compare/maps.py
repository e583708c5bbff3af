"""Render against formula: where Gaussian x inverse square x Beer-Lambert parts from the rendered light field.

The render is the reference, so every relative error is (formula - render) / render. A difference counts only
*beyond* `SIGMAS` Monte Carlo standard errors: excess = max(0, |formula - render| - SIGMAS stderr) / render.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from scipy.ndimage import gaussian_filter

from lightfield.arrays import Array, finite
from lightfield.errors import UsageError
from lightfield.formula.cells import along_a_side, cell_mean, pitch_m
from lightfield.formula.closed_form import direct_field
from lightfield.formula.own_formulas import lit
from lightfield.maps.sharper import Field, at_the_axis, itself, sharpened
from lightfield.maps.spot import Spot, smoothed, spot_shape
from lightfield.scene import Scene
from lightfield.scene.bands import BandLight, at_wavelengths, over_band, pieces
from lightfield.scene.in_tank import ROUNDING_M, cells_inside
from lightfield.scene.lamp.frame import axis_at
from lightfield.studies.compare.in_a_sentence import in_a_sentence
from lightfield.studies.compare.rings import (
    BEYOND,
    ERROR_LEVELS,
    OPEN,
    SIGMAS,
    WITHIN,
    Profile,
    Within,
    excess,
    known_error,
    meets,
    on_axis,
    radial_profile,
    standing,
)

# (scene, x, y, z, spectrum) -> mean over the spectrum in the unit of the maps, shape of x
Formula = Callable[[Scene, Array, Array, Array, BandLight], Array]


#: Rings between the last that is known to be within a level and the first that is known not to be, as many as
#: even a good render leaves.
_BETWEEN = 2


@dataclass(frozen=True)
class PlaneComparison:
    """One plane at one wavelength.

    Parameters
    ----------
    wavelength_nm, z_m : float
    x_m, y_m : arrays, shape (n_x,) and (n_y,), m
    render, stderr, formula : arrays, shape (n_y, n_x), unit of the comparison
        The formula is averaged over each cell, as the render is. NaN in cells outside the tank.
    axis_m : (float, float), m: where the lamp's axis meets the plane
    axis : Profile of one ring: of the place itself, by the cells there; NaN where the axis misses the plane
    render_spot, formula_spot : Spot
        Without what cells add to their widths.
    lost, lost_stderr : float
        Part of the light on the plane that the formula lacks (negative: it has too much).
    """

    wavelength_nm: float
    z_m: float
    x_m: Array
    y_m: Array
    render: Array
    stderr: Array
    formula: Array
    axis_m: tuple[float, float]
    axis: Profile
    profile: Profile
    render_spot: Spot
    formula_spot: Spot
    lost: float
    lost_stderr: float

    @property
    def ratio(self) -> Array:
        """Formula over render, NaN where no light was rendered and outside the tank, shape (n_y, n_x)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.render > 0, self.formula / self.render, np.nan)

    @property
    def is_lit(self) -> bool:
        """Was light rendered on the plane, beyond Monte Carlo error? Else nothing can be compared."""
        total = float(np.nansum(self.render))
        return total > SIGMAS * float(np.sqrt(np.sum(known_error(self.stderr) ** 2))) and total > 0

    @property
    def axis_error(self) -> float:
        """Relative error of the formula on the axis."""
        render, formula = self.axis.render[0], self.axis.formula[0]
        return float(formula / render - 1) if render > 0 else float("nan")

    @property
    def axis_error_stderr(self) -> float:
        """Monte Carlo standard error of `axis_error`."""
        render, formula = self.axis.render[0], self.axis.formula[0]
        return float(formula / render * self.axis.stderr[0] / render) if render > 0 else float("nan")

    @property
    def surely_off(self) -> float:
        """Size of `axis_error` less what noise may make of it; zero where it tells nothing."""
        off = abs(self.axis_error) - SIGMAS * self.axis_error_stderr if self.is_lit else 0.0
        return max(off, 0.0) if np.isfinite(off) else 0.0

    def smooth_excess(self) -> Array:
        """Relative error beyond Monte Carlo error in every cell, shape (n_y, n_x), of averages over
        neighbouring cells (Gaussian): contours that noise does not tear."""
        return excess(*self._smooth())

    def _smooth(self) -> tuple[Array, Array, Array]:
        """Render, its error and formula, averaged over neighbouring cells."""

        def mean(values: Array, sigma: float) -> Array:
            return np.asarray(gaussian_filter(values, sigma, mode="nearest", truncate=6.0))

        width_cells, known = 1.5, np.isfinite(self.render)
        weight = np.where(known, mean(known.astype(float), width_cells), 1.0)
        # The square of a Gaussian kernel is one of width sigma / sqrt 2 over 4 pi sigma^2.
        narrow = mean(known_error(self.stderr) ** 2, width_cells / np.sqrt(2)) / (4 * np.pi * width_cells**2)
        formula, render = (smoothed(v, width_cells, 6.0) for v in (self.formula, self.render))
        return render, np.sqrt(narrow) / weight, formula

    @property
    def told_on_axis(self) -> int:
        """How the error on the lamp's axis stands to the lower level, see `standing`; where that is open, how
        its average over neighbouring cells does."""
        there = int(standing(self.axis.render, self.axis.stderr, self.axis.formula, ERROR_LEVELS[0])[0])
        if there != OPEN:
            return there
        x, y = self.axis_m
        at = np.argmin(np.abs(self.y_m - y)), np.argmin(np.abs(self.x_m - x))
        render, stderr, formula = (np.atleast_1d(v[at]) for v in self._smooth())
        return int(standing(render, stderr, formula, ERROR_LEVELS[0])[0])

    def within(self, level: float) -> Within:
        """Up to where every ring is within a relative error."""
        nan = float("nan")
        if not self.is_lit:
            return Within(nan, nan, False)
        rings, r = self.profile.standings(level), self.profile.r_m
        first = int(np.argmax(rings != WITHIN))
        if rings[first] == WITHIN:
            return Within(float("inf"), nan, False)
        radius = float(0.5 * (r[first - 1] + r[first])) if first else 0.0
        off = np.flatnonzero(rings == BEYOND)
        off = off[off >= first]
        beyond = float(r[off[0]]) if off.size else nan
        is_left = bool(off.size) and int(off[0]) - first <= _BETWEEN
        return Within(radius if first or is_left else nan, beyond, is_left)

    def sharpened(self, field: Field) -> PlaneComparison:
        """The same, axis and widths without what cells make of them: by the formula at places."""
        sharp = itself(field, self.formula_spot)
        there = field(*(np.array([at]) for at in self.axis_m)) + 0 * self.axis.formula
        rest, error = at_the_axis(self.render - self.formula, self.stderr, self.x_m, self.y_m, self.axis_m)
        if not (meets(self.x_m, self.y_m, self.axis_m) and np.isfinite(rest)):
            rest, error = float((self.axis.render - self.axis.formula)[0]), float(self.axis.stderr[0])
        render = np.where(self.axis.render > 0, there + rest, self.axis.render)
        axis = replace(self.axis, render=render, stderr=np.array([error]), formula=there)
        spot = sharpened(self.render_spot, self.formula_spot, sharp)
        return replace(self, axis=axis, render_spot=spot, formula_spot=sharp)

    def as_data(self) -> dict[str, Any]:
        """Plain numbers for JSON and tables; what is unknown is None."""
        numbers = {
            "wavelength_nm": self.wavelength_nm,
            "z_m": self.z_m,
            "axis_render": self.axis.render[0],
            "axis_render_stderr": self.axis.stderr[0],
            "axis_formula": self.axis.formula[0],
            "axis_error": self.axis_error,
            "axis_error_stderr": self.axis_error_stderr,
            "lost": self.lost,
            "lost_stderr": self.lost_stderr,
            **{
                f"radius_within_{100 * level:.0f}_percent_m": self.within(level).radius_m
                for level in ERROR_LEVELS
            },
        }
        for name, spot in (("render", self.render_spot), ("formula", self.formula_spot)):
            numbers |= {
                f"{name}_centre_x_m": spot.centre_x_m,
                f"{name}_centre_y_m": spot.centre_y_m,
                f"{name}_hwhm_x_m": spot.hwhm_x_m,
                f"{name}_hwhm_y_m": spot.hwhm_y_m,
                f"{name}_ellipticity": spot.ellipticity,
            }
        errors = {f"render_{name}_stderr": error for name, error in self.render_spot.stderr.items()}
        return {name: finite(v) for name, v in (numbers | errors).items()}


@dataclass(frozen=True)
class Comparison:
    """All planes of a rendering at all its wavelengths: wavelength by wavelength, near to far."""

    scene: Scene
    quantity: str
    units: str
    planes: tuple[PlaneComparison, ...]

    @property
    def wavelengths_nm(self) -> list[float]:
        """Wavelengths, each once."""
        return sorted({plane.wavelength_nm for plane in self.planes})

    @property
    def brightest_nm(self) -> float:
        """The wavelength of which most light was rendered."""
        light = {nm: sum(float(np.nansum(p.render)) for p in self.at(nm)) for nm in self.wavelengths_nm}
        return max(light, key=lambda nm: light[nm])

    @property
    def worst(self) -> tuple[PlaneComparison, ...]:
        """Of every wavelength the plane on whose axis the formula is most surely off, the worst first; the
        nearest where none tells."""
        each = [max(self.at(nm), key=lambda plane: plane.surely_off) for nm in self.wavelengths_nm]
        return tuple(sorted(each, key=lambda plane: -plane.surely_off))

    def at(self, wavelength_nm: float) -> list[PlaneComparison]:
        """Planes at one of the wavelengths, near to far."""
        return sorted((p for p in self.planes if p.wavelength_nm == wavelength_nm), key=lambda p: p.z_m)

    def as_data(self) -> dict[str, Any]:
        """Everything but the maps, as plain values."""
        return {
            "scene": self.scene.name,
            "scene_digest": self.scene.digest(),
            "quantity": self.quantity,
            "units": self.units,
            "sigmas": SIGMAS,
            "verdict": in_a_sentence(self),
            "planes": [plane.as_data() for plane in self.planes],
        }


def compare(dataset: xr.Dataset, formula: Formula | None = None) -> Comparison:
    """Compare the maps of a rendering with the formula, in the scene that is stored with them.

    Parameters
    ----------
    dataset : xarray.Dataset
        From `lightfield.maps.dataset.to_dataset` or a file that it was written to.
    formula : callable, optional
        Default: the closed-form model of the scene, without any light that was scattered or reflected.

    Raises
    ------
    UsageError
        The data set has single positions, and no planes.
    """
    if "x_m" not in dataset.dims:
        raise UsageError(
            "these maps are of single positions, not of planes",
            rule="render and formula are compared on planes",
            remedy="render the scene with planes_m instead of positions_m",
        )
    scene = Scene.from_toml(dataset.attrs["scene_toml"], where="scene of the data set")
    if formula is None:
        formula = closed_form
    quantity = dataset.attrs["quantity"]
    x, y = dataset.x_m.values.astype(float), dataset.y_m.values.astype(float)
    # Asked here too: maps of before planes were clipped to the tank have cells outside it.
    outside = cells_inside(scene.tank, x, y, *(pitch_m(c) or ROUNDING_M for c in (x, y))) < 1
    planes = []
    for index, wavelength in enumerate(dataset.wavelength_nm.values.astype(float)):
        spectrum = BandLight(*(v[0] for v in at_wavelengths(scene.lamp, [wavelength])))
        if "wavelength_bounds_nm" in dataset:  # the map is a mean over the band: so is the formula
            low, high = dataset["wavelength_bounds_nm"].values[index] + scene.detector.wavelength_shift_nm
            spectrum = over_band(scene.lamp, low, high, scene.detector, pieces(scene))
        for number, z in enumerate(dataset.z_m.values.astype(float)):
            field = partial(_on_a_plane, formula, scene, z, spectrum)
            expected = on_cells(formula, scene, x, y, z, spectrum)
            render, stderr = (
                np.where(outside, np.nan, dataset[name].values[index, number])
                for name in (quantity, f"{quantity}_stderr")
            )
            axis_x, axis_y = (float(at) for at in axis_at(scene.lamp, z))
            plane = compare_plane(wavelength, z, x, y, render, stderr, expected, (axis_x, axis_y))
            planes.append(plane.sharpened(field))
    return Comparison(scene, quantity, dataset[quantity].attrs["units"], tuple(planes))


def compare_plane(
    wavelength_nm: float,
    z_m: float,
    x_m: Array,
    y_m: Array,
    render: Array,
    stderr: Array,
    formula: Array,
    axis_m: tuple[float, float] = (0.0, 0.0),
) -> PlaneComparison:
    """Compare one map with the formula's, both of shape (n_y, n_x), where the map knows values."""
    formula = np.where(np.isnan(render), np.nan, formula)
    formula_spot = spot_shape(formula, x_m, y_m)
    known = not formula_spot.problem
    middle = axis_m if meets(x_m, y_m, axis_m) else (0.0, 0.0)
    centre = (formula_spot.centre_x_m, formula_spot.centre_y_m) if known else middle
    total, power = float(np.nansum(render)), float(np.nansum(formula))
    total_stderr = float(np.sqrt(np.sum(known_error(stderr) ** 2)))
    return PlaneComparison(
        wavelength_nm=float(wavelength_nm),
        z_m=float(z_m),
        x_m=x_m,
        y_m=y_m,
        render=render,
        stderr=stderr,
        formula=formula,
        axis_m=axis_m,
        axis=on_axis(render, stderr, formula, x_m, y_m, axis_m),
        profile=radial_profile(render, stderr, formula, x_m, y_m, centre),
        render_spot=spot_shape(render, x_m, y_m, stderr),
        formula_spot=formula_spot,
        lost=1 - power / total if total > 0 else float("nan"),
        lost_stderr=power / total**2 * total_stderr if total > 0 else float("nan"),
    )


def _on_a_plane(formula: Formula, scene: Scene, z_m: float, spectrum: BandLight, x: Array, y: Array) -> Array:
    return formula(scene, x, y, np.full_like(x, z_m), spectrum)


def on_cells(
    formula: Formula, scene: Scene, x_m: Array, y_m: Array, z_m: float, spectrum: BandLight
) -> Array:
    """The formula averaged over every cell and over a spectrum, shape (n_y, n_x)."""
    field = partial(_on_a_plane, formula, scene, z_m, spectrum)
    # One cell alone does not tell its size: the plane does.
    dx, dy = (pitch_m(c) or size for c, size in zip((x_m, y_m), scene.plane_size_m, strict=True))
    side = along_a_side(lit(scene), z_m, max(dx, dy), len(x_m) * len(y_m))
    return cell_mean(field, x_m, y_m, dx, dy, side)


def closed_form(scene: Scene, x_m: Array, y_m: Array, z_m: Array, spectrum: BandLight) -> Array:
    """The closed-form model in absolute units, W m^-2 nm^-1 (W m^-2 sr^-1 nm^-1 for radiance)."""
    each = zip(*spectrum, strict=True)
    return np.asarray(
        np.mean([intensity * direct_field(scene, x_m, y_m, z_m, at) for at, intensity in each], axis=0)
    )
