"""Numbers read off the maps of a case: on the axis, half width, power on the plane, error of the formula."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from math import ceil, hypot, isqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array, Mask
from lightfield.formula.cells import along_a_side, axis_cells, cell_mean
from lightfield.formula.closed_form import direct_field, light_of_point, points_of_window
from lightfield.formula.own_formulas import factor, has_colours_of_its_own, lit
from lightfield.formula.path import optical_depth, rays
from lightfield.maps.sharper import at_the_axis, itself, without_cells
from lightfield.maps.spot import ENOUGH_PIXELS, PARTS_OF_PEAK, Spot, spot_shape
from lightfield.render.response.grid import Grid, cell_centres
from lightfield.scene import Lamp, Scene, Water
from lightfield.scene.bands import over_bands
from lightfield.scene.in_tank import ROUNDING_M
from lightfield.scene.lamp.frame import axis_at
from lightfield.scene.listed import OWN_FIELD

_ENOUGH_KNOWN, _FEWEST_CELLS = 0.02, 3.5  # relative error of a cell, cells in a half width
#: The formula's light is attenuated along the way to the middle of a cell, or of its parts: ways to the sides
#: of one differ by less than this, m. And parts of a plane at most.
_ONE_WAY_M, _MOST_PARTS = 0.03, 1_000_000


#: A point of a window in x and y beside its middle, m.
Place = tuple[float, float]


@dataclass(frozen=True)
class GridFormula:
    """The closed-form model on a grid, for any water: geometry once, attenuation per case.

    Parameters
    ----------
    lamp : Lamp
    sources : tuple of ((x, y), callable)
        Points of its window, m beside the middle, and the light of each at a wavelength in nm, averaged over
        every part of a cell, in clear water and for unit on-axis intensity of the whole window, m^-2:
        shape of `finer`.
    grid, finer : Grid
        The cells, and the equal parts that each has along x and y.
    """

    lamp: Lamp
    sources: tuple[tuple[Place, Callable[[float], Array]], ...]
    grid: Grid
    finer: Grid

    @classmethod
    def of(cls, scene: Scene, grid: Grid) -> GridFormula | None:
        """The formula of a scene's lamp, detector and own effects; None for a pencil beam, which has none.

        Raises
        ------
        SceneError
            An own effect has no finite value somewhere.
        """
        if scene.lamp.profile == "pencil":
            return None
        scene, sources = lit(scene), list[tuple[Place, Callable[[float], Array]]]()
        finer = _in_parts(grid, scene.lamp)
        for u, v, share in points_of_window(scene.lamp, grid.z_m, scene.detector):
            light = partial(_in_clear_water, scene, finer, (u, v), share)
            if not has_colours_of_its_own(scene):
                light = partial(_always, light())
            sources.append(((u, v), light))
        return cls(scene.lamp, tuple(sources), grid, finer)

    def bands(self, scene: Scene) -> Array:
        """Absolute maps of a case, shape (n_bands, n_planes, n_y, n_x), unit of the render's maps."""
        z, y, x = np.meshgrid(self.finer.z_m, self.finer.y_m, self.finer.x_m, indexing="ij")
        spectrum = over_bands(scene)
        maps = np.zeros((len(spectrum.intensity), *self.finer.shape))
        for point, light in self.sources:
            ray = rays(self.lamp, x, y, z, beside_m=point)
            for total, band, power in zip(maps, *spectrum, strict=True):
                for w, intensity in zip(band, power, strict=True):
                    left = np.exp(-optical_depth(scene.water, ray, z, w))
                    total += intensity / len(band) * light(w) * left
        planes, rows, columns = self.grid.shape
        return np.asarray(maps.reshape(len(maps), planes, rows, -1, columns, self._along_x).mean(axis=(3, 5)))

    @property
    def _along_x(self) -> int:
        """Parts of a cell along x."""
        return len(self.finer.x_m) // len(self.grid.x_m)


class FormulaAtPlaces(NamedTuple):
    """The closed-form model itself, without cells.

    Parameters
    ----------
    axis : array, shape (n_bands, n_planes), unit of the maps
        On the lamp's axis.
    widths_m : two arrays, shape (n_planes,)
        Half widths of straight light in clear water: found on cells, and of it itself. NaN: not measured.
    """

    axis: Array
    widths_m: tuple[Array, Array]


def at_places(scene: Scene, z_m: Array, widths_m: tuple[Array, Array]) -> FormulaAtPlaces:
    """The closed-form model of a scene where its axis meets the planes, and widths as they are given."""
    x, y = axis_at(lit(scene).lamp, z_m)
    spectrum = over_bands(scene)
    light = np.zeros((len(spectrum.intensity), len(z_m)))
    for total, band, power in zip(light, *spectrum, strict=True):
        for w, intensity in zip(band, power, strict=True):
            total += intensity / len(band) * direct_field(scene, x, y, z_m, np.full(len(z_m), w))
    return FormulaAtPlaces(light, widths_m)


def straight_widths_m(scene: Scene, grid: Grid) -> tuple[Array, Array]:
    """Half widths of straight light in clear water, on cells and itself, m, each of shape (n_planes,)."""
    clear, planes = scene.model_copy(update={"water": Water()}), (len(grid.z_m),)
    on_cells, sharp = np.full(planes, np.nan), np.full(planes, np.nan)
    cells = (grid.x_m, grid.y_m, grid.pitch_x_m, grid.pitch_y_m)
    pitch, count = max(grid.pitch_x_m, grid.pitch_y_m), len(grid.x_m) * len(grid.y_m)
    for k, z in enumerate(grid.z_m.tolist()):

        def field(x: Array, y: Array, z: float = z) -> Array:
            return direct_field(clear, x, y, np.full_like(x, z))

        spot = spot_shape(
            cell_mean(field, *cells, along_a_side(lit(clear), z, pitch, count)), grid.x_m, grid.y_m
        )
        if not spot.problem and not (found := itself(field, spot)).problem:
            on_cells[k], sharp[k] = spot.hwhm_m, found.hwhm_m
    return on_cells, sharp


def _in_parts(grid: Grid, lamp: Lamp) -> Grid:
    """Parts of the cells, to the sides of which ways from the lamp are as good as one."""
    most = isqrt(max(_MOST_PARTS // (len(grid.x_m) * len(grid.y_m)), 1))
    away = float(grid.z_m.min()) + lamp.apparent_distance_m
    sides: list[tuple[Array, float]] = []
    for centres, pitch, offset in (
        (grid.x_m, grid.pitch_x_m, lamp.offset_x_m),
        (grid.y_m, grid.pitch_y_m, lamp.offset_y_m),
    ):
        aside = float(np.abs(centres - offset).max()) + 0.5 * pitch
        n = min(ceil(pitch * aside / hypot(aside, away) / _ONE_WAY_M), most)
        sides.append((np.add.outer(centres, cell_centres(pitch, n)).ravel(), pitch / n))
    (x, pitch_x), (y, pitch_y) = sides
    return replace(grid, x_m=x, y_m=y, pitch_x_m=pitch_x, pitch_y_m=pitch_y, inside=None)


def _in_clear_water(
    scene: Scene, grid: Grid, point: Place, share: float, wavelength_nm: float | None = None
) -> Array:
    """Unattenuated direct light of a point of the window averaged over every cell, (n_planes, n_y, n_x)."""
    alone = scene.model_copy(update={"water": Water(), OWN_FIELD: ()})
    z, cells = grid.z_m[:, None, None], (grid.x_m, grid.y_m, grid.pitch_x_m, grid.pitch_y_m)

    def field(x: Array, y: Array) -> Array:
        # Own effects speak of the lamp, and not of points of its window.
        x, y, each_z = np.broadcast_arrays(x, y, z)
        light = light_of_point(alone, point, x, y, each_z, wavelength_nm)
        return light * factor(scene, ("path",), x, y, each_z, wavelength_nm)

    pitch, count = max(grid.pitch_x_m, grid.pitch_y_m), len(grid.x_m) * len(grid.y_m)
    side = along_a_side(scene, float(z.min()), pitch, count)
    return np.asarray(share * cell_mean(field, *cells, side))


def _always(light: Array, _wavelength_nm: float) -> Array:
    """The same light at every wavelength."""
    return light


def derive(
    mean: Array,
    stderr: Array,
    formula: Array | None,
    grid: Grid,
    lamp: Lamp,
    merged: NDArray[np.integer[Any]] | None = None,
    places: FormulaAtPlaces | None = None,
) -> dict[str, Array]:
    """Derived quantities of one case.

    Parameters
    ----------
    mean, stderr : arrays, shape (n_bands, n_planes, n_y, n_x)
        NaN outside the tank. Errors of different cells are taken as independent: a photon rarely meets a
        plane twice.
    formula : array of that shape, optional
    lamp : Lamp
        Its axis is meant by "on the axis": NaN on planes that it does not meet.
    merged : array of int, shape (n_planes, n_y, n_x), optional
        Cells of the same number are mirror images that share one error.
    places : FormulaAtPlaces, optional
        The formula itself: what is told of the axis and of widths is then without what cells make of it.

    Returns
    -------
    dict of name to array, shape (n_bands, n_planes)
        See `schema.derived_variables`; NaN where there is nothing to tell.
    """
    near = _on_axis(grid, lamp)
    # An error that k cells share counts k times over in a sum, and not as the root of k.
    images = 1.0 if merged is None else np.bincount(merged.ravel())[merged]
    known = np.where(np.isfinite(stderr), stderr, 0.0) * np.sqrt(images)
    axis, model = _mean_of(mean, near), None if formula is None else _mean_of(formula, near)
    axis_error = np.sqrt(_mean_of(images * stderr**2, near) / np.maximum(near.sum((-2, -1)), 1))
    if places is not None and model is not None and formula is not None:
        top, top_error = _beside_straight(mean - formula, stderr * np.sqrt(images), grid, lamp)
        there, lit_up = np.isfinite(top), axis > 0
        rest = np.where(there, top, axis - model)
        axis, model = np.where(lit_up, places.axis + rest, axis), places.axis
        axis_error = np.where(there & lit_up, top_error, axis_error)
    area = grid.pitch_x_m * grid.pitch_y_m
    power, power_error = np.nansum(mean, (-2, -1)) * area, np.sqrt((known**2).sum((-2, -1))) * area
    spots = [half_width(mean[at], known[at], grid) for at in np.ndindex(axis.shape)]
    width, width_error, together = (v.reshape(axis.shape) for v in np.array(spots).T)
    if places is not None:
        on_cells, width = width, without_cells(width, *places.widths_m, together)
        width_error = width_error * on_cells / width
    result = {
        "on_axis": axis,
        "on_axis_stderr": axis_error,
        "plane_power": power,
        "plane_power_stderr": power_error,
        "half_width": width,
        "half_width_stderr": width_error,
    }
    if formula is not None and model is not None:
        with np.errstate(divide="ignore", invalid="ignore"):
            for name, told, render, error in (
                ("axis", model, axis, axis_error),
                ("power", np.sum(formula, (-2, -1), where=~np.isnan(mean)) * area, power, power_error),
            ):
                ratio = np.where(render > 0, told / render, np.nan)
                result[f"formula_error_{name}"] = ratio - 1
                result[f"formula_error_{name}_stderr"] = np.where(render > 0, ratio * error / render, np.nan)
    return result


def _beside_straight(rest: Array, stderr: Array, grid: Grid, lamp: Lamp) -> tuple[Array, Array]:
    """Light that is not straight, and its error, on the lamp's axis, shape (n_bands, n_planes); see
    `at_the_axis`."""
    found = np.full((2, *rest.shape[:2]), np.nan)
    places = list(zip(*axis_at(lamp, grid.z_m), strict=True))
    met = np.flatnonzero(_on_axis(grid, lamp).any((-2, -1))).tolist()
    for band in range(len(rest)):
        for plane in met:
            cells = rest[band, plane], stderr[band, plane], grid.x_m, grid.y_m
            found[:, band, plane] = at_the_axis(*cells, places[plane])
    return found[0], found[1]


def _on_axis(grid: Grid, lamp: Lamp) -> Mask:
    """The cell, or the equally near cells, where the lamp's axis meets each plane; none of one it misses."""
    near, sides = np.zeros(grid.shape, bool), ((grid.x_m, grid.pitch_x_m), (grid.y_m, grid.pitch_y_m))
    for cells, *at in zip(near, *axis_at(lamp, grid.z_m), strict=True):
        beside = [centres - place for (centres, _), place in zip(sides, at, strict=True)]
        if all(np.abs(v).min() <= 0.5 * p + ROUNDING_M for v, (_, p) in zip(beside, sides, strict=True)):
            cells[:] = axis_cells(*beside)
    return near


def _mean_of(values: Array, cells: Mask) -> Array:
    """Mean over some cells of each plane, shape (..., n_planes); NaN where there are none."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(cells, values, 0.0).sum((-2, -1)) / cells.sum((-2, -1)))


class HalfWidth(NamedTuple):
    """Half width at half maximum of a spot (geometric mean of x and y) and its standard error, m; NaN: none.
    And how many cells along each side were taken together."""

    m: float
    stderr_m: float
    together: int = 1


def half_width(value: Array, stderr: Array, grid: Grid) -> HalfWidth:
    """Half width of a spot.

    Parameters
    ----------
    value, stderr : arrays, shape (n_y, n_x)
        NaN where nothing is known.
    """
    brightest = np.nanmax(value)
    bright = value > 0.5 * brightest
    if not bright.any() or brightest <= 0:
        return HalfWidth(float("nan"), float("nan"))
    noise = float(np.median(stderr[bright] / value[bright]))
    # The spot is found on cells that are known to 2 %: noise of more than that bends its contour and its top.
    cells = np.sqrt(np.count_nonzero(bright) / np.pi)  # in a half width
    n = int(np.clip(np.ceil(noise / _ENOUGH_KNOWN), 1, max(1, cells // _FEWEST_CELLS)))
    value, variance = (_coarse(part, n) for part in (value, stderr**2))
    x_m, y_m = (_coarse(c[None, :].repeat(n, 0), n)[0] for c in (grid.x_m, grid.y_m))
    spot = spot_shape(value, x_m, y_m)
    if spot.problem:
        return HalfWidth(float("nan"), float("nan"))
    return HalfWidth(spot.hwhm_m, _half_width_stderr(spot, value, np.sqrt(variance) / n, x_m, y_m), n)


def _half_width_stderr(spot: Spot, value: Array, stderr: Array, x_m: Array, y_m: Array) -> float:
    """Noise on the contour and of the maximum over the slope of the spot's flank."""
    x, y = np.meshgrid(x_m - spot.centre_x_m, y_m - spot.centre_y_m)
    s = np.hypot(x / spot.hwhm_x_m, y / spot.hwhm_y_m)  # 1 on the contour
    step = max((x_m[1] - x_m[0]) / spot.hwhm_x_m, (y_m[1] - y_m[0]) / spot.hwhm_y_m)
    inner, outer = np.abs(s - (1 - step)) < step, np.abs(s - (1 + step)) < step
    ring = np.abs(s - 1) < 0.5 * step
    if min(map(np.count_nonzero, (inner, outer, ring))) < 3:
        return float("nan")
    slope = (value[inner].mean() - value[outer].mean()) / (s[outer].mean() - s[inner].mean())
    on_ring = np.sqrt((stderr[ring] ** 2).sum()) / np.count_nonzero(ring)
    # `spot` takes the maximum from a quadratic form over the smallest disc of cells enough: its value in the
    # centre has four times the variance of a mean. Else from the brightest cell.
    discs = [s < np.sqrt(np.log2(1 / level)) for level in PARTS_OF_PEAK]
    core = next((disc for disc in discs if np.count_nonzero(disc) >= ENOUGH_PIXELS), None)
    if core is None:
        at_peak = stderr.flat[np.argmin(s)]
    else:
        at_peak = 2 * np.sqrt((stderr[core] ** 2).sum()) / np.count_nonzero(core)
    return float(spot.hwhm_m * np.hypot(on_ring, 0.5 * at_peak) / slope) if slope > 0 else float("nan")


def _coarse(values: Array, n: int) -> Array:
    """Means over n x n cells; what does not fit is left out on both sides."""
    rows, columns = (size // n * n for size in values.shape)
    top, left = (values.shape[0] - rows) // 2, (values.shape[1] - columns) // 2
    inside = values[top : top + rows, left : left + columns]
    return np.asarray(inside.reshape(rows // n, n, columns // n, n).mean(axis=(1, 3)))
