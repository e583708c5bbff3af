"""The gain of a visit, from readings repeated at one place in several visits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.optimize import brentq, linprog

from lightfield.arrays import Array
from lightfield.diagnosis.problem.layout import Labels, layout_of
from lightfield.diagnosis.problem.quoted import MAD_TO_SIGMA
from lightfield.readings import Readings
from lightfield.readings.columns import PLACE_DECIMALS

#: Visits of a place from which a gain error can be told from the readings' own. Chosen: of two there is one
#: difference.
_FEWEST_VISITS = 3
#: Visits from which a lamp that warms up can be told from them, and time constants that are tried, as part of
#: the time between the first and the last. Chosen: twice the parameters.
_WARMING_VISITS, _WARMING_TIMES = 6, tuple(np.geomspace(0.1, 1.0, 6))
#: Readings fainter than this many of their errors say nothing of a gain. Chosen: in brighter ones the
#: logarithm is a straight line to half a per cent; on half and twice no test hangs.
_BRIGHT_SIGMA = 10
#: Deviations beyond this many robust standard deviations are outliers, not repositioning. Chosen: of 20 good
#: ones one in a thousand sets is.
_OUTLIER = 4.0
#: Relative variance to which the gain is solved for: that of a millionth. Chosen: far below any gain.
_SOLVED = 1e-12
#: The value assumed without repeats counts like this many degrees of freedom. Chosen: three repeats that
#: agree by chance must not promise perfect repositioning.
_PRIOR_DOF = 1.0


@dataclass(frozen=True)
class Repeats:
    """Deviations of repeated readings from the mean of their place and wavelength, in visit order.

    Parameters
    ----------
    deviation, stderr, time_s : array, shape (n,)
        Relative deviation; its stated error; when (NaN: unknown).
    place : array of int, shape (n,)
        Label of place and wavelength.
    reference : bool
        Whether they were marked as readings of a reference position.
    """

    deviation: Array
    stderr: Array
    time_s: Array
    place: Labels
    reference: bool

    @property
    def visits(self) -> int:
        """Visits of the place that was visited most often."""
        return int(np.bincount(self.place).max())


def repeats_of(readings: Readings) -> Repeats | None:
    """The repeated readings of a table: those of the reference positions if any are marked, else all.

    Returns
    -------
    Repeats or None
        None where no place was read with known errors in three visits.
    """
    layout = layout_of(readings)
    value = np.asarray(readings.value, float)
    stderr = _errors(value, np.asarray(readings.stderr, float))
    usable = ~np.asarray(readings.saturated) & np.isfinite(stderr) & (stderr > 0)
    usable &= value > _BRIGHT_SIGMA * stderr
    marked = usable & (np.asarray(readings.role) == "reference")
    for chosen in (marked, usable):
        columns = (layout.x_m, layout.y_m, layout.z_m, layout.air, layout.channel)
        _, place = np.unique(np.round(np.stack(columns, axis=1), PLACE_DECIMALS), axis=0, return_inverse=True)
        rows: list[tuple[float, float, float, int]] = []
        for label in np.flatnonzero(np.bincount(place[chosen]) >= _FEWEST_VISITS):
            here = np.flatnonzero(chosen & (place == label))
            visits = [here[layout.visit[here] == v] for v in np.unique(layout.visit[here])]
            if len(visits) < _FEWEST_VISITS:
                continue
            means = np.array([value[v].mean() for v in visits])
            errors = np.array([np.sqrt((stderr[v] ** 2).sum()) / len(v) for v in visits])
            middle = float(np.median(means))
            times = [float(layout.time_s[v].mean()) for v in visits]
            rows += [
                (m / middle - 1, e / middle, t, int(label))
                for m, e, t in zip(means, errors, times, strict=True)
            ]
        if rows:
            deviation, error, time, labels = (np.array(c) for c in zip(*rows, strict=True))
            return Repeats(
                deviation, error, time, np.unique(labels, return_inverse=True)[1], chosen is marked
            )
    return None


def _errors(value: Array, stderr: Array) -> Array:
    """Standard errors; where some readings state none, the part of them that the others do in the median."""
    known = np.isfinite(stderr) & (stderr > 0) & (value > 0)
    if known.all() or not known.any():
        return stderr
    return np.where(known, stderr, np.median(stderr[known] / value[known]) * np.abs(value))


def plane_gain_error(repeats: Repeats, assumed: float) -> float:
    """Relative gain error of a visit beyond the stated errors of the readings.

    The variance at which the deviations have their expected chi-square (Paule and Mandel 1982,
    doi:10.6028/jres.087.022), once changes of lamp and water in time are taken out, which are effects, not
    errors: a straight line at each place, and a warm-up of all where visits are many.

    Parameters
    ----------
    assumed : float
        Value without repeats, which counts as one degree of freedom.
    """
    count = repeats.visits
    tangent, rest = min(_without_trend(repeats), key=lambda pair: float(np.abs(pair[1]).sum()))
    # As many as there are parameters lie on what was taken out.
    others = np.sort(np.abs(rest))[int(np.linalg.matrix_rank(tangent)) :]
    if not len(others):
        return assumed
    spread = max(MAD_TO_SIGMA * float(np.median(others)), float(np.median(repeats.stderr)))
    kept = np.abs(rest) < _OUTLIER * spread
    tangent, deviation, error = tangent[kept], repeats.deviation[kept], repeats.stderr[kept]
    dof = len(deviation) - int(np.linalg.matrix_rank(tangent))
    if dof < 1:
        return assumed

    def excess(variance: float) -> float:
        weight = 1 / np.sqrt(error**2 + variance)
        whitened, basis = weight * deviation, weight[:, None] * tangent
        left = whitened - basis @ np.linalg.lstsq(basis, whitened, rcond=None)[0]
        return float(left @ left) - dof

    found = brentq(excess, 0.0, 1.0, xtol=_SOLVED) if excess(0.0) > 0 > excess(1.0) else 0.0
    # Wavelengths of one visit share its gain: they are no further evidence.
    independent = min(dof, count - 1)
    pooled = (independent * found + _PRIOR_DOF * assumed**2) / (independent + _PRIOR_DOF)
    return float(np.sqrt(pooled))


def _without_trend(repeats: Repeats) -> list[tuple[Array, Array]]:
    """Columns that are taken out, shape (n, k), and what they leave, shape (n,), for every trend in time.

    The least sum of absolute values is left: of six visits least squares bend to a wild one, and it hides.
    """
    time = repeats.time_s
    columns = [(repeats.place == k).astype(float) for k in range(int(repeats.place.max()) + 1)]
    trends: list[list[Array]] = [[]]
    if np.isfinite(time).all() and np.ptp(time) > 0:
        part = (time - time.min()) / np.ptp(time)
        # Water that changes dims far places more than near ones.
        lines = [column * part for column in columns]
        trends = [lines]
        if repeats.visits >= _WARMING_VISITS:
            trends = [[*lines, np.exp(-part / one)] for one in _WARMING_TIMES]
    out = []
    for trend in trends:
        tangent = np.stack([*columns, *trend], axis=1)
        out.append((tangent, _least_left(tangent, repeats.deviation)))
    return out


def _least_left(tangent: Array, deviation: Array) -> Array:
    """What columns, shape (n, k), leave of deviations, shape (n,), with the least sum of absolute values."""
    n, k = tangent.shape
    parts = sparse.hstack([sparse.csr_array(tangent), sparse.eye_array(n), -sparse.eye_array(n)], "csr")
    cost, least = np.r_[np.zeros(k), np.ones(2 * n)], np.r_[np.full(k, -np.inf), np.zeros(2 * n)]
    found = linprog(
        cost, A_eq=parts, b_eq=deviation, bounds=np.stack([least, np.full_like(least, np.inf)], 1)
    )
    return np.asarray(deviation - tangent @ found.x[:k])
