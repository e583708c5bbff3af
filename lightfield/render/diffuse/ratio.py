"""What a trace of one scene adds to the light that is known without photons: a smooth ratio next to one.

Single and small-angle scattering (`formula.scattered`) tell never-reflected light to a per cent or so. A
trace of the same lamp and water, not reweighed, tells what is left: a few polynomials in the logarithm of the
distance and the angle to the axis, and in a tank, whose walls take what goes astray, in the direction
from it and in the distance to them. The photons of a whole map stand behind each of these numbers, and the
steps of a fit have no noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import legvander

from lightfield.arrays import TINY, Array
from lightfield.decompositions import thin_svd
from lightfield.errors import RenderError
from lightfield.formula.scattered.quadrature import in_cell
from lightfield.formula.scattered.scattered_field import ScatteredField
from lightfield.render.maps import Rendering, render_scene
from lightfield.render.response.grid import Grid
from lightfield.render.response.response import Reference
from lightfield.render.settings import BY_PHOTONS
from lightfield.scene import Scene
from lightfield.scene.bands import molecular_share
from lightfield.scene.lamp.colour import REFERENCE_NM, in_colour
from lightfield.scene.lamp.frame import axis_at, beam_axes, from_source
from lightfield.scene.lamp.width import half_width_rad
from lightfield.scene.tank import walls_m
from lightfield.scene.water.coefficients import coefficients_in

#: Part of the light by which the polynomials may miss it (left after nine in eleven traced fields: at
#: most 0.2 % but in water of b = 0.8 per m and g = 0.8, where it is 0.6 %).
TRUNCATION = 0.002
#: Terms in distance and in angle. Beside photons of other code, 1e8 of them, in water of b = 0.7 per m and
#: g = 0.88 they leave 0.1 % of scattered light; as many in the squared angle, which do not follow light that
#: peaks on the axis, left 0.25 %, and up to 1 % on the axis far away. In four other waters what they leave is
#: the photons' noise: chi-square 42 to 77 of 60 rings (benchmarks/scattering_fits).
_TERMS = (3, 4)
#: Terms of a tank: the direction from the axis has three, walls near by one more.
_DIRECTION, _WALLS = 3, 4
#: Beside a wall that light is missing which would come from behind it: by exp(-d/m), growing with the square
#: of the distance. In five tanks of 1 to 3.66 m (half widths of 4 to 20 degrees, b 0.15 to 1 per m, g 0.9 to
#: 0.97) chi-square of cells falls from 1.2 to 1.9 to 1.1 to 1.4, as with 0.3 m; within 0.15 m of a wall at
#: the far end 0.3 to 1.1 % of scattered light were missing, and up to 0.2 % are. Cells nearer than three of
#: it tell it.
_BESIDE_WALL_M, _NEAR_WALL = 0.2, 3.0
#: Fewer of them, without those of the tank at the end, where lit cells are too few to tell them apart: the
#: beam is narrow and readings lie far beside it.
_FEWER = ((_TERMS, _WALLS), (_TERMS, _DIRECTION), (_TERMS, 0), ((2, 2), 0), ((2, 1), 0), ((1, 1), 0))
#: Told apart are terms, each of length one over cells that count by their light, with no singular value below
#: this (maps of the experiments have 0.03 to 0.6, of a tank 0.6 m deep read to 48 degrees 0.003). Chosen.
_APART = 1e-2
#: Gauss nodes in a cell as wide as half the beam's full width there (a Gaussian's mean is right to
#: 0.3 %), and at most, where it is narrower.
_NODES, _MOST_NODES = 2, 8
#: Planes and cells across the widest of them; the map reaches to the readings, and so many half widths of the
#: beam.
_PLANES, _ACROSS, _HALF_WIDTHS = 5, 22, 1.5
#: Least factor by which the scatter of ten batches lessens the variance of a term. Chosen.
_LEAST_SHARED = 0.25
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
    of_tank : int
        More terms: of the direction from the axis, and of walls near by.
    value : array, shape (n_wavelengths, n_terms)
    root : array, shape (n_wavelengths, n_terms, n_terms)
        Its error: covariance = root @ root.T; all wavelengths share their photons.
    """

    span: tuple[float, float]
    most: float
    terms: tuple[int, int]
    of_tank: int
    value: Array
    root: Array
    photons: int

    def basis(self, scene: Scene, x_m: Array, y_m: Array, z_m: Array) -> Array:
        """The polynomials at places in front of a lamp, shape (n, n_terms)."""
        return _basis(scene, (x_m, y_m, z_m), self.span, self.most, self.terms, self.of_tank)


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

    Raises
    ------
    RenderError
        No photon was scattered to any of the places, or none can be.
    """
    # Beams of other colours have this ratio, too, and so has light that hardens: the tally knows neither.
    scene = in_colour(scene, REFERENCE_NM).with_values({"water.hardening_per_m": 0.0}, validate=False)
    span, most = (float(z_m.min()), float(z_m.max())), _most(scene, x_m, y_m, z_m)
    black = scene
    if scene.tank is not None:
        paths = ("tank.wall_albedo", "tank.surface_reflectance", "tank.pane_reflectance")
        black = scene.with_values(dict.fromkeys(paths, 0.0), validate=False)
    grid = _grid(scene, span, most)
    water = scene.water
    share = molecular_share(scene)
    a, b = coefficients_in(water, wavelengths_nm, share)
    reference = Reference(float(a.min()), float(b.max()), 0.0, 0.0, share)
    rendering = render_scene(
        black,
        grid=grid,
        reference=reference,
        rel_error=BY_PHOTONS,
        max_photons=photons,
        seed=seed,
        symmetry=True,
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
    wanted = reach + float(np.abs(axis_at(scene.lamp, np.array(span))).max())
    # Cells beyond a wall tell nothing: a narrow tank has as many across it as a wide one.
    rooms = [max(map(abs, wall)) for wall in walls_m(scene.tank)[:2]]
    dx, dy = (2 * min(reach, room) / _ACROSS for room in rooms)
    halves = [int(np.ceil(min(wanted, room) / pitch)) for room, pitch in zip(rooms, (dx, dy), strict=True)]
    x, y = (pitch * np.arange(-n, n + 1) for n, pitch in zip(halves, (dx, dy), strict=True))
    grid = Grid(planes, x, y, dx, dy)
    cx, cy, cz = grid.centres()
    near = (_around(scene, (cx.ravel(), cy.ravel(), cz.ravel()))[1] ** 2 <= 1.02 * most).reshape(grid.shape)
    # On the nearest planes the beam may be narrower than a cell.
    axis_x, axis_y = axis_at(scene.lamp, cz)
    near |= np.hypot(cx - axis_x, cy - axis_y) <= max(dx, dy)
    if scene.tank is not None:
        (left, right), (low, high), _ = scene.tank.box_m
        near &= (cx - dx / 2 >= left) & (cx + dx / 2 <= right)
        near &= (cy - dy / 2 >= low) & (cy + dy / 2 <= high)
    return Grid(planes, x, y, dx, dy, occupied=near)


def _around(scene: Scene, places: tuple[Array, Array, Array]) -> tuple[Array, Array, Array, Array]:
    """Distance along the beam from the apparent source, tangent of the angle to it, and its two parts."""
    lamp = scene.lamp
    right, up, forward = beam_axes(lamp)
    along, aside, above = np.array([right, up, forward])[[2, 0, 1]] @ np.stack(from_source(lamp, *places))
    return along, np.hypot(aside, above) / along, aside / along, above / along


def _basis(
    scene: Scene,
    places: tuple[Array, Array, Array],
    span: tuple[float, float],
    most: float,
    terms: tuple[int, int],
    of_tank: int,
) -> Array:
    along, tangent, aside, above = _around(scene, places)
    low, high = (np.log(v) for v in span)
    z = np.log(np.maximum(along - scene.lamp.apparent_distance_m, 1e-3))
    first = np.clip(2 * (z - low) / (high - low) - 1, -1.2, 1.2) if high > low + 1e-3 else np.zeros_like(z)
    second = np.clip(2 * tangent / np.sqrt(most) - 1, -1, 1.2)
    by_z, by_angle = legvander(first, terms[0] - 1), legvander(second, terms[1] - 1)
    columns = [(by_z[:, :, None] * by_angle[:, None, :]).reshape(len(z), -1)]
    if of_tank:
        scale = np.sqrt(most)
        each = [aside / scale, above / scale, (aside**2 - above**2) / most]
        if of_tank > _DIRECTION:
            each.append(_beside_walls(scene, places) * (places[2] / span[1]) ** 2)
        columns.append(np.stack(each, axis=1))
    return np.hstack(columns)


def _beside_walls(scene: Scene, places: tuple[Array, Array, Array]) -> Array:
    """One at a wall, at floor or surface, and less the farther from them, shape (n,)."""
    assert scene.tank is not None
    ends = [(at - low, high - at) for at, (low, high) in zip(places[:2], scene.tank.box_m[:2], strict=True)]
    return np.asarray(sum(np.exp(-np.maximum(d, 0) / _BESIDE_WALL_M) for pair in ends for d in pair))


def _fitted(
    scene: Scene, rendering: Rendering, a: Array, b: Array, span: tuple[float, float], most: float
) -> Ratio:
    grid, response = rendering.grid, rendering.response
    x, y, z = (v.ravel() for v in grid.centres())
    # Mirror images share their photons: how sure that leaves the terms, the scatter of batches tells.
    known = _in_cells(scene, grid, x, y, z, a, b)
    traced = np.stack(
        [response.batches(ai, bi, part="diffuse") for ai, bi in zip(a, b, strict=True)]
    )  # [n_wavelengths, n_batches, n_cells]
    lit = np.all(traced.mean(axis=1) > 0, axis=0)
    for plane in np.unique(z):
        here = z == plane
        lit[here] &= np.all(known[:, here] > _DARK * known[:, here].max(axis=1, keepdims=True), axis=0)
    if not lit.any():
        raise RenderError(
            "no cell has scattered light to compare",
            found=f"scattering of {b.max():g} per m, {response.photons:g} photons",
            rule="water that scatters, and photons enough to reach the places",
            remedy="trace more photons, or where the water scatters",
        )
    terms, of_tank, basis = _terms_told(scene, (x[lit], y[lit], z[lit]), known[0, lit], span, most)
    value, root = _polynomials(
        traced[:, :, lit] / known[:, None, lit], basis, _sharing(terms, basis.shape[1])
    )
    return Ratio(span, most, terms, of_tank, value, root, response.photons)


def _terms_told(
    scene: Scene, cells: tuple[Array, Array, Array], light: Array, span: tuple[float, float], most: float
) -> tuple[tuple[int, int], int, Array]:
    """As many terms as cells with this light tell apart, and the polynomials there, (n_cells, n_terms)."""
    by_distance = span[1] > 1.001 * span[0]
    tank = scene.tank
    alone = tank is None or _beside_walls(scene, cells).max() < np.exp(-_NEAR_WALL)
    for (along, across), more in _FEWER:
        if alone and more == _WALLS:
            continue
        terms, of_tank = (along if by_distance else 1, across), 0 if tank is None else more
        basis = _basis(scene, cells, span, most, terms, of_tank)
        seen = basis * np.sqrt(light)[:, None]  # as photons tell the cells
        length = np.linalg.norm(seen, axis=0)
        if len(basis) <= basis.shape[1] or not np.all(length > 0):
            continue
        if np.linalg.svd(seen / length, compute_uv=False)[-1] > _APART:
            break
    return terms, of_tank, basis


def _in_cells(scene: Scene, grid: Grid, x: Array, y: Array, z: Array, a: Array, b: Array) -> Array:
    """Known light as the mean over every cell, by Gauss nodes each way, shape (n_wavelengths, n)."""
    half_width = np.tan(half_width_rad(scene.lamp)) * (z + scene.lamp.apparent_distance_m)
    cell = max(grid.pitch_x_m, grid.pitch_y_m)
    counts = np.clip(np.ceil(_NODES * cell / half_width), _NODES, _MOST_NODES).astype(int)
    out = np.empty((len(a), len(z)))
    for count in np.unique(counts):
        here = np.flatnonzero(counts == count)
        nodes, weight = in_cell(int(count))
        field = ScatteredField(
            (x[here] + grid.pitch_x_m * nodes[:, :1]).ravel(),
            (y[here] + grid.pitch_y_m * nodes[:, 1:]).ravel(),
            np.tile(z[here], len(nodes)),
        )
        each = field.at(scene, a, b).reshape(len(a), len(nodes), -1)
        out[:, here] = np.einsum("wnc,n->wc", each, weight)
    return out


def _sharing(terms: tuple[int, int], count: int) -> Array:
    """Degree in distance of every polynomial, shape (n_terms,): planes share photons, and so their errors."""
    along, across = terms
    return np.append(np.repeat(np.arange(along), across), np.zeros(count - along * across, int))


def _polynomials(ratio: Array, basis: Array, degree: Array) -> tuple[Array, Array]:
    """Least squares of maps in independent batches, shape (n_wavelengths, n_batches, n_cells).

    Parameters
    ----------
    degree : array of int, shape (n_terms,)
        In distance, see `_sharing`.

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
        left, size, right = thin_svd(white)
        root = right.T / size  # of the covariance of independent cells
        each = (batches / sigma) @ left @ root.T
        value = each.mean(axis=0)
        # How much the batches' fits scatter over what independent cells would, by the degree in distance:
        # photons that all planes share leave the level less sure, and what changes along the beam surer.
        scatter = each.var(axis=0, ddof=1) / count / (root**2).sum(axis=1)
        shared = np.array([scatter[degree == n].mean() for n in range(degree.max() + 1)])[degree]
        values.append(value)
        root *= np.sqrt(np.maximum(shared, _LEAST_SHARED))[:, None]
        roots.append(root @ _of_batches(np.linalg.solve(root, (each - value).T)))
    return np.array(values), np.array(roots)


def _of_batches(scatter: Array) -> Array:
    """Root of the covariance of a mean, where one of batches, shape (n, n_batches), is expected to be one.

    What few batches show shrinks towards that, but for its scale, by as much as their number asks for (oracle
    approximating shrinkage: Chen, Wiesel, Eldar and Hero 2010, IEEE Trans. Signal Process. 58, 5016, eq. 23).
    """
    n, batches = scatter.shape
    shown = scatter @ scatter.T / (batches - 1) / batches
    scale, square = np.trace(shown) / n, float((shown**2).sum())
    share = (1 - 2 / n) * square + (n * scale) ** 2
    share /= (batches - 2 / n) * max(square - n * scale**2, TINY)
    share = min(share, 1.0)
    return np.linalg.cholesky((1 - share) * shown + share * scale * np.eye(n))
