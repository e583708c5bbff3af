"""What a trace of one scene adds to the light that is known without photons: a smooth ratio next to one.

Single and small-angle scattering (`formula.scattered`) tell never-reflected light to a per cent or so. A
trace of the same lamp and water, not reweighed, tells what is left: a few polynomials in the logarithm of the
distance and the squared angle to the axis, and in a tank, whose walls take what goes astray, in the direction
from it. The photons of a whole map stand behind each of these numbers, and the steps of a fit have no noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import legvander

from lightfield.arrays import Array
from lightfield.formula.scattered.field import ScatteredField
from lightfield.formula.scattered.nodes import half_width_rad
from lightfield.render.maps import Rendering, render_scene
from lightfield.render.response.grid import Grid
from lightfield.render.response.response import Reference
from lightfield.scene import Scene
from lightfield.scene.bands import molecular_share
from lightfield.scene.lamp.frame import beam_axes
from lightfield.scene.water.coefficients import coefficients_in

#: Part of the light by which the polynomials may miss it (left after nine in eleven traced fields: at
#: most 0.2 % but in water of b = 0.8 per m and g = 0.8, where it is 0.6 %).
TRUNCATION = 0.002
#: Terms in distance and in angle. Beside photons of other code, 1e8 of them, in water of b = 0.7 per m and
#: g = 0.88 three in angle leave 0.18 % of the light, four 0.09 %, more as much (benchmarks/scattering_fits).
_TERMS = (3, 4)
#: Planes and cells across the widest of them; the map reaches to the readings, and so many half widths of the
#: beam.
_PLANES, _ACROSS, _HALF_WIDTHS = 5, 22, 1.5
#: Cells darker than this part of the brightest on their plane are left out.
_DARK = 1e-3


@dataclass(frozen=True)
class Ratio:
    """Traced over known light, as polynomials.

    Parameters
    ----------
    span : (float, float), m
        Nearest and farthest distance.
    most : float
        Squared tangent of the largest angle.
    terms : (int, int)
        In distance and in angle.
    in_tank : bool
        With terms of the direction from the axis.
    value : array, shape (n_wavelengths, n_terms)
    root : array, shape (n_wavelengths, n_terms, n_terms)
        Its error: covariance = root @ root.T; all wavelengths share their photons.
    photons : int
    """

    span: tuple[float, float]
    most: float
    terms: tuple[int, int]
    in_tank: bool
    value: Array
    root: Array
    photons: int

    def basis(self, scene: Scene, x_m: Array, y_m: Array, z_m: Array) -> Array:
        """The polynomials at places in front of a lamp, shape (n, n_terms)."""
        return _basis(scene, (x_m, y_m, z_m), self.span, self.most, self.terms, self.in_tank)


def traced_ratio(
    scene: Scene, x_m: Array, y_m: Array, z_m: Array, wavelengths_nm: Array, *, photons: float, seed: int
) -> Ratio:
    """Trace a scene on maps around places and compare with the light that is known without photons.

    Parameters
    ----------
    scene : Scene
        That `formula.scattered.field.describes`; its walls and surface send nothing back here.
    x_m, y_m, z_m : arrays, shape (n,), m
        Places that the ratio is asked for at.
    wavelengths_nm : array, shape (n_wavelengths,)
    photons : float
    seed : int
    """
    span, most = (float(z_m.min()), float(z_m.max())), _most(scene, x_m, y_m, z_m)
    black = scene
    if scene.tank is not None:
        black = scene.with_values({"tank.wall_albedo": 0.0, "tank.surface_reflectance": 0.0}, validate=False)
    grid = _grid(scene, span, most)
    water = scene.water
    share = molecular_share(scene)
    a, b = coefficients_in(water, wavelengths_nm, share)
    reference = Reference(float(a.min()), float(b.max()), 0.0, 0.0, share)
    rendering = render_scene(
        black, grid=grid, reference=reference, rel_error=1e-5, max_photons=photons, seed=seed, symmetry=True
    )
    return _fitted(scene, rendering, a, b, span, most)


def _most(scene: Scene, x_m: Array, y_m: Array, z_m: Array) -> float:
    """Squared tangent of the largest angle of the map."""
    tangent = _around(scene, (x_m, y_m, z_m))[1]
    return float(max(tangent.max(), _HALF_WIDTHS * np.tan(half_width_rad(scene.lamp)))) ** 2


def _grid(scene: Scene, span: tuple[float, float], most: float) -> Grid:
    """Cells within the angle on planes over the distances, and in the tank."""
    count = _PLANES if span[1] > 1.001 * span[0] else 1
    planes = np.geomspace(*span, count) if count > 1 else np.array(span[:1])
    reach = np.sqrt(most) * (span[1] + scene.lamp.apparent_distance_m)
    pitch = 2 * reach / _ACROSS
    lamp = scene.lamp
    ux, uy, uz = beam_axes(lamp)[2]
    tilt = max(abs(ux), abs(uy)) / uz
    half = int(np.ceil((reach + tilt * span[1] + np.hypot(lamp.offset_x_m, lamp.offset_y_m)) / pitch))
    x = pitch * np.arange(-half, half + 1)
    grid = Grid(planes, x, x, pitch, pitch)
    cx, cy, cz = grid.centres()
    near = (_around(scene, (cx.ravel(), cy.ravel(), cz.ravel()))[1] ** 2 <= 1.02 * most).reshape(grid.shape)
    # On the nearest planes the beam may be narrower than a cell.
    near |= np.hypot(cx - lamp.offset_x_m - ux / uz * cz, cy - lamp.offset_y_m - uy / uz * cz) <= pitch
    if scene.tank is not None:
        (left, right), (low, high), _ = scene.tank.box_m
        near &= (cx - pitch / 2 >= left) & (cx + pitch / 2 <= right)
        near &= (cy - pitch / 2 >= low) & (cy + pitch / 2 <= high)
    return Grid(planes, x, x, pitch, pitch, occupied=near)


def _around(scene: Scene, places: tuple[Array, Array, Array]) -> tuple[Array, Array, Array, Array]:
    """Distance along the beam from the apparent source, tangent of the angle to it, and its two parts."""
    lamp = scene.lamp
    right, up, forward = beam_axes(lamp)
    d = places[0] - lamp.offset_x_m, places[1] - lamp.offset_y_m, places[2] + lamp.apparent_distance_m
    along, aside, above = np.array([right, up, forward])[[2, 0, 1]] @ np.stack(d)
    return along, np.hypot(aside, above) / along, aside / along, above / along


def _basis(
    scene: Scene,
    places: tuple[Array, Array, Array],
    span: tuple[float, float],
    most: float,
    terms: tuple[int, int],
    in_tank: bool,
) -> Array:
    along, tangent, aside, above = _around(scene, places)
    low, high = (np.log(v) for v in span)
    z = np.log(np.maximum(along - scene.lamp.apparent_distance_m, 1e-3))
    first = np.clip(2 * (z - low) / (high - low) - 1, -1.2, 1.2) if high > low + 1e-3 else np.zeros_like(z)
    second = np.clip(2 * tangent**2 / most - 1, -1, 1.2)
    by_z, by_angle = legvander(first, terms[0] - 1), legvander(second, terms[1] - 1)
    columns = [(by_z[:, :, None] * by_angle[:, None, :]).reshape(len(z), -1)]
    if in_tank:
        scale = np.sqrt(most)
        columns.append(np.stack([aside / scale, above / scale, (aside**2 - above**2) / most], axis=1))
    return np.hstack(columns)


def _fitted(
    scene: Scene, rendering: Rendering, a: Array, b: Array, span: tuple[float, float], most: float
) -> Ratio:
    grid, response = rendering.grid, rendering.response
    x, y, z = (v.ravel() for v in grid.centres())
    # One of the cells that share their photons.
    tallied = np.arange(len(x)) if response.merged is None else response.merged.ravel()
    _, one = np.unique(tallied, return_index=True)
    x, y, z = x[one], y[one], z[one]
    known = _in_cells(scene, grid, x, y, z, a, b)
    traced = np.stack(
        [
            response.batches(ai, bi, part="diffuse").reshape(-1, len(tallied))[:, one]
            for ai, bi in zip(a, b, strict=True)
        ]
    )  # [n_wavelengths, n_batches, n_cells]
    ratio = traced / known[:, None]
    lit = np.all(ratio.mean(axis=1) > 0, axis=0)
    for plane in np.unique(z):
        here = z == plane
        lit[here] &= np.all(known[:, here] > _DARK * known[:, here].max(axis=1, keepdims=True), axis=0)
    terms, in_tank = (_TERMS if span[1] > 1.001 * span[0] else (1, _TERMS[1])), scene.tank is not None
    basis = _basis(scene, (x[lit], y[lit], z[lit]), span, most, terms, in_tank)
    value, root = _polynomials(ratio[:, :, lit], basis)
    return Ratio(span, most, terms, in_tank, value, root, response.photons)


def _in_cells(scene: Scene, grid: Grid, x: Array, y: Array, z: Array, a: Array, b: Array) -> Array:
    """Known light as the mean over every cell, by two Gauss nodes each way, shape (n_wavelengths, n)."""
    dx, dy = grid.pitch_x_m / np.sqrt(12), grid.pitch_y_m / np.sqrt(12)
    places = [(x + i * dx, y + j * dy) for i in (-1, 1) for j in (-1, 1)]
    field = ScatteredField(
        np.concatenate([p for p, _ in places]), np.concatenate([p for _, p in places]), np.tile(z, 4)
    )
    return np.asarray(field.at(scene, a, b).reshape(len(a), 4, -1).mean(axis=1))


def _polynomials(ratio: Array, basis: Array) -> tuple[Array, Array]:
    """Least squares of maps in independent batches, shape (n_wavelengths, n_batches, n_cells).

    Returns
    -------
    value : array, shape (n_wavelengths, n_terms)
    root : array, shape (n_wavelengths, n_terms, n_terms)
    """
    values, roots = [], []
    for batches in ratio:
        count = len(batches)
        variance = batches.var(axis=0, ddof=1) / count
        # A handful of batches gives a cell a noisy error, which is large where it has too much light: smooth.
        usable = variance > 0
        law = np.linalg.lstsq(basis[usable], np.log(variance[usable]), rcond=None)[0]
        sigma = np.exp(0.5 * basis @ law)
        sigma *= np.sqrt(np.mean(variance / sigma**2))
        white = basis / sigma[:, None]
        plain = np.linalg.inv(white.T @ white)
        solve = plain @ white.T
        each = (batches / sigma) @ solve.T
        value = each.mean(axis=0)
        # Planes share photons: how much the batches' fits scatter over what independent cells would.
        away = (each - value) @ np.linalg.cholesky(np.linalg.inv(plain)) / np.sqrt(count)
        together = float((away**2).sum() / (len(value) * (count - 1)))
        values.append(value)
        roots.append(np.linalg.cholesky(plain * max(together, 0.5)))
    return np.array(values), np.array(roots)
