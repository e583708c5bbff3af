"""Where a spot of light on a plane is, how wide and how round: its contour at half maximum."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from scipy.ndimage import gaussian_filter
from skimage.measure import find_contours

from lightfield.arrays import Array

_REPLICATES = 24  # of the noise, for the standard errors: their own error is 15 %
# Parts of the maximum above which log E is taken for a quadratic form: the highest that has pixels enough.
PARTS_OF_PEAK, ENOUGH_PIXELS = (0.95, 0.9, 0.85, 0.8, 0.7), 40


class Unmeasured(Enum):
    """Why a spot has no shape."""

    DARK = "no light on the plane"
    BEYOND_EDGE = "half of the maximum lies beyond the edge of the plane, or the spot is under two pixels"
    NO_ELLIPSE = "no ellipse fits the contour at half maximum"


@dataclass(frozen=True)
class Spot:
    """Shape of a spot; what could not be measured is NaN, and `problem` says why.

    Parameters
    ----------
    peak : float, unit of the map: maximum of the smooth spot
    centre_x_m, centre_y_m : float, m
    hwhm_x_m, hwhm_y_m : float, m: half width at half maximum of the fitted ellipse along x and along y
    stderr : dict of the five above, `ellipticity` and `hwhm_m` to their standard errors; empty without an
        error map
    """

    peak: float
    centre_x_m: float
    centre_y_m: float
    hwhm_x_m: float
    hwhm_y_m: float
    stderr: dict[str, float]
    problem: Unmeasured | None = None

    @property
    def ellipticity(self) -> float:
        """hwhm_y / hwhm_x."""
        return self.hwhm_y_m / self.hwhm_x_m

    @property
    def hwhm_m(self) -> float:
        """Half width at half maximum, m: geometric mean of those along x and along y."""
        return float(np.sqrt(self.hwhm_x_m * self.hwhm_y_m))


def spot_shape(value: Array, x_m: Array, y_m: Array, stderr: Array | None = None, seed: int = 0) -> Spot:
    """Measure a spot.

    The maximum comes from a quadratic fit of log E around it, for the largest noisy pixel is too bright; the
    contour at half of it is taken from the map and an ellipse is fitted to it (Halir & Flusser 1998, as in
    scikit-image).

    Parameters
    ----------
    value : array, shape (n_y, n_x)
        NaN where nothing is known: a contour that meets such pixels is taken for one beyond the edge.
    x_m, y_m : arrays, shape (n_x,) and (n_y,), m: evenly spaced pixel centres
    stderr : array, shape (n_y, n_x), optional
        Standard error of `value`; gives the standard errors by simulation.
    seed : int
        Of that simulation.
    """
    (peak, x0, y0, hwhm_x, hwhm_y), problem = _measure(value, x_m, y_m)
    errors: dict[str, float] = {}
    if stderr is not None and not problem:
        rng = np.random.default_rng(seed)
        noise = np.where(np.isfinite(stderr), stderr, 0.0)
        runs = [
            _measure(value + noise * rng.standard_normal(value.shape), x_m, y_m)[0]
            for _ in range(_REPLICATES)
        ]
        table = np.array([[*run, run[4] / run[3], np.sqrt(run[3] * run[4])] for run in runs])
        names = ("peak", "centre_x_m", "centre_y_m", "hwhm_x_m", "hwhm_y_m", "ellipticity", "hwhm_m")
        errors = dict(zip(names, map(float, np.nanstd(table, axis=0, ddof=1)), strict=True))
    return Spot(peak, x0, y0, hwhm_x, hwhm_y, errors, problem)


def smoothed(value: Array, sigma: float, truncate: float = 4.0) -> Array:
    """Gaussian mean of neighbouring pixels over those that are known; NaN stays NaN, shape (n_y, n_x)."""

    def weighed(values: Array) -> Array:
        return np.asarray(gaussian_filter(values, sigma, mode="nearest", truncate=truncate))

    value = np.asarray(value, float)
    known = np.isfinite(value)
    if known.all():
        return weighed(value)
    weight = np.where(known, weighed(known.astype(float)), 1.0)
    return np.where(known, weighed(np.where(known, value, 0.0)) / weight, np.nan)


def _measure(
    value: Array, x_m: Array, y_m: Array
) -> tuple[tuple[float, float, float, float, float], Unmeasured | None]:
    peak, at = _peak(value)
    nothing = (peak, np.nan, np.nan, np.nan, np.nan)
    if not peak > 0:
        return nothing, Unmeasured.DARK
    if min(value.shape) < 2:  # a row of pixels has no contour
        return nothing, Unmeasured.BEYOND_EDGE
    contours = find_contours(value, 0.5 * peak)
    closed = [c for c in contours if len(c) > 8 and np.array_equal(c[0], c[-1])]
    around = [c for c in closed if _encloses(c, at)]
    if not around:
        return nothing, Unmeasured.BEYOND_EDGE
    rows, columns = max(around, key=len).T
    x = np.interp(columns, np.arange(x_m.size), x_m)
    y = np.interp(rows, np.arange(y_m.size), y_m)
    ellipse = _ellipse(np.column_stack([x, y])[:-1])
    if ellipse is None:
        return nothing, Unmeasured.NO_ELLIPSE
    return (peak, *ellipse), None


def _ellipse(points: Array) -> tuple[float, float, float, float] | None:
    """Centre x and y, and half widths along x and y, of the ellipse that fits points, shape (n, 2), best.

    Direct least squares of a conic a x^2 + b x y + c y^2 + d x + e y + f = 0 with 4 a c - b^2 > 0 (Halir and
    Flusser 1998, Numerically stable direct least squares fitting of ellipses, equations 15 to 29).
    """
    origin, scale = points.mean(axis=0), points.std()
    if not scale > 0:
        return None
    x, y = ((points - origin) / scale).T
    quadratic, linear = np.column_stack([x * x, x * y, y * y]), np.column_stack([x, y, np.ones_like(x)])
    try:
        follow = -np.linalg.solve(linear.T @ linear, linear.T @ quadratic)  # d, e, f of a, b, c
    except np.linalg.LinAlgError:
        return None
    scatter = quadratic.T @ (quadratic + linear @ follow)
    reduced = np.stack([scatter[2] / 2, -scatter[1], scatter[0] / 2])
    # Its eigenvalues are real; NumPy gives them as complex numbers from 2.5 on.
    vectors = np.linalg.eig(reduced)[1].real
    (allowed,) = np.nonzero(4 * vectors[0] * vectors[2] - vectors[1] ** 2 > 0)
    if len(allowed) != 1:
        return None
    conic = vectors[:, allowed[0]]
    (a, b, c), (d, e, f) = conic, follow @ conic
    centre = np.linalg.solve([[2 * a, b], [b, 2 * c]], [-d, -e])
    size = -(f + 0.5 * (d * centre[0] + e * centre[1]))
    if not (size / a > 0 and size / c > 0):
        return None
    where = origin + scale * centre
    width, height = scale * np.sqrt([size / a, size / c])
    return float(where[0]), float(where[1]), float(width), float(height)


def _peak(value: Array) -> tuple[float, tuple[float, float]]:
    """Maximum and its place (row, column), from log E = quadratic form near the brightest pixels."""
    # Pixels are chosen on a smoothed map: chosen by their own noise, they would be too bright.
    smooth = smoothed(value, 1.0)
    smooth = np.where(np.isnan(smooth), -np.inf, smooth)
    row, column = np.unravel_index(int(np.argmax(smooth)), value.shape)
    brightest, place = float(value[row, column]), (float(row), float(column))
    if not brightest > 0:
        return float(np.nanmax(value)), place
    chosen = [(smooth > level * smooth[row, column]) & (value > 0) for level in PARTS_OF_PEAK]
    many = [pixels for pixels in chosen if np.count_nonzero(pixels) >= ENOUGH_PIXELS]
    if not many:
        return brightest, place
    rows, columns = np.nonzero(many[0])
    u, v = (columns - column).astype(float), (rows - row).astype(float)
    design = np.column_stack([np.ones_like(u), u, v, u * u, u * v, v * v])
    bright = value[rows, columns]
    # Weight by the value: the logarithm makes noise large where the light is weak.
    c = np.linalg.lstsq(design * bright[:, None], np.log(bright) * bright, rcond=None)[0]
    hessian = np.array([[2 * c[3], c[4]], [c[4], 2 * c[5]]])
    if np.linalg.eigvalsh(hessian)[-1] >= 0:
        return brightest, place
    top = np.linalg.solve(hessian, -c[1:3])
    inside = abs(top[0]) <= np.ptp(columns) / 2 + 1 and abs(top[1]) <= np.ptp(rows) / 2 + 1
    if not inside:
        return brightest, place
    return float(np.exp(c[0] + 0.5 * c[1:3] @ top)), (float(row + top[1]), float(column + top[0]))


def _encloses(contour: Array, point: tuple[float, float]) -> bool:
    """Winding number of a closed contour around a point is not zero."""
    offset = contour - np.asarray(point)
    turn = np.diff(np.unwrap(np.arctan2(offset[:, 0], offset[:, 1])))
    return bool(abs(turn.sum()) > np.pi)
