"""Bounded least squares of a forward model in a whitened metric: SciPy's search, ended by what is felt."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from lightfield.arrays import Array
from lightfield.decompositions import eigen
from lightfield.fitting.parameter import Model

Whiten = Callable[[Array], Array]

#: A parameter within this part of its range is at a bound; within this one the bound itself is tried. Chosen
#: (test_least_squares.py compares with SciPy).
_AT, _NEAR = 1e-6, 1e-2
#: Steps at most, and what of chi-square ends them. Chosen, as the above.
_STEPS, _LITTLE = 40, 1e-4
#: Damping that leaves a Newton step, but for directions that are not determined at all. Derived: rounding of
#: doubles, with room.
_NEWTON = 1e-9
#: Squares of directions, over the largest, that are not determined; a parameter has a part in one if the
#: square of that is so large. Derived: rounding of doubles, squared, with room; its root.
LOOSE, OPEN = 1e-12, 1e-6
#: Square of a range over the variance of what lies anywhere in it alike. Derived.
_EVEN = 12.0


@dataclass(frozen=True)
class Fit:
    """A fitted model.

    Parameters
    ----------
    u : array, shape (n_parameters,)
        Coordinates at the minimum.
    prediction, residual : array, shape (n_readings,)
        Model readings; whitened residual, zero where a reading is left out.
    chi2 : float
        Sum of the squared whitened residuals.
    differentiate : callable
        Gives `jacobian`.
    converged : bool
        The search ended by itself.
    evaluations : int
        Predictions that it took.
    """

    model: Model
    u: Array
    prediction: Array
    residual: Array
    chi2: float
    differentiate: Callable[[], Array] = field(repr=False, compare=False)
    converged: bool
    evaluations: int = field(default=0, compare=False)

    @cached_property
    def jacobian(self) -> Array:
        """Whitened derivatives at the minimum, shape (n_readings, n_parameters)."""
        return self.differentiate()

    @property
    def values(self) -> dict[str, float]:
        """Fitted scene values by path."""
        return self.model.values(self.u)

    @property
    def paths(self) -> tuple[str, ...]:
        return tuple(p.path for p in self.model.parameters)

    @property
    def by_path(self) -> dict[str, float]:
        """Coordinates by path."""
        return dict(zip(self.paths, self.u.tolist(), strict=True))

    def covariance(self, scale: float = 1.0, held: Collection[str] = ()) -> Array:
        """Covariance of the coordinates, shape (n_parameters, n_parameters); NaN rows where undetermined, and
        of those that are held, by path."""
        norm = np.linalg.norm(self.jacobian, axis=0)
        moving = (norm > 0) & ~self.at_bound() & np.array([path not in held for path in self.paths], bool)
        out = np.full((len(norm), len(norm)), np.nan)
        if not moving.any():
            return out
        scaled = self.jacobian[:, moving] / norm[moving]
        square, directions = eigen(scaled.T @ scaled)
        firm = square > LOOSE * square.max()
        inverse = (directions[:, firm] / square[firm]) @ directions[:, firm].T
        out[np.ix_(moving, moving)] = scale * inverse / np.outer(norm[moving], norm[moving])
        # Along a loose direction the readings stay as they are: what has a part in it may be anything.
        undetermined = np.flatnonzero(moving)[(directions[:, ~firm] ** 2).sum(axis=1) > OPEN]
        out[undetermined], out[:, undetermined] = np.nan, np.nan
        return out

    def covariance_within_ranges(self, scale: float = 1.0) -> Array:
        """The same where what the readings leave open is open as far as the ranges go, as if all in a range
        were as likely beforehand; nothing of what lies at a bound."""
        moving = np.flatnonzero((self.model.high > self.model.low) & ~self.at_bound())
        slopes, room = self.jacobian[:, moving], (self.model.high - self.model.low)[moving]
        known = slopes.T @ slopes / scale + np.diag(_EVEN / room**2)
        unit = np.sqrt(np.diag(known))
        out = np.zeros((len(self.u), len(self.u)))
        out[np.ix_(moving, moving)] = np.linalg.inv(known / np.outer(unit, unit)) / np.outer(unit, unit)
        return out

    def stderr(self, scale: float = 1.0) -> dict[str, float]:
        """Standard error of every scene value; NaN where it is undetermined or at a bound."""
        sigma = np.sqrt(np.diag(self.covariance(scale)))
        return {
            p.path: float(s * abs(p.slope(x)))
            for p, x, s in zip(self.model.parameters, self.u, sigma, strict=True)
        }

    def away_from(self, u: Array) -> float:
        """How far it lies from other coordinates, shape (n_parameters,), in its errors, at most."""
        sigma = np.sqrt(np.diag(self.covariance()))
        known = np.isfinite(sigma) & (sigma > 0)
        return float(np.max(np.abs(self.u - u)[known] / sigma[known], initial=0.0))

    def to_go(self) -> tuple[float, Array]:
        """What one more Newton step would take from chi-square, and that step in errors, (n_parameters,)."""
        free = (self.model.high > self.model.low) & ~self.at_bound()
        step, sigma = np.zeros(len(self.u)), np.sqrt(np.diag(self.covariance()))
        step[free] = _newton(self.jacobian[:, free], self.residual)
        known = np.isfinite(sigma) & (sigma > 0)
        gain = float(self.residual @ self.jacobian @ step)
        return gain, np.divide(step, sigma, out=np.zeros(len(step)), where=known)

    def at_bound(self) -> NDArray[np.bool_]:
        """Which parameters lie at a bound, shape (n_parameters,); what is held has none."""
        room = self.model.high - self.model.low
        width = _AT * room
        return (room > 0) & ((self.u <= self.model.low + width) | (self.u >= self.model.high - width))


@dataclass(frozen=True)
class _Point:
    """The model at the coordinates `u`."""

    u: Array
    prediction: Array
    residual: Array
    chi2: float


class _Ended(Exception):  # noqa: N818  an end, not an error
    """The search has nothing more to find."""


class _Search:
    """What SciPy asks for on its way, in coordinates x that go from 0 to 1 over every range that is free.

    `best` is the best point so far, where derivatives were taken last, and `slopes` are these.
    """

    best: _Point
    slopes: Array

    def __init__(
        self, model: Model, value: Array, whiten: Whiten, weight: Array, start: Array, tolerance: float
    ) -> None:
        self.model, self.value, self.whiten, self.weight = model, value, whiten, weight
        self.start, self.tolerance = start, tolerance
        self.low, self.high, self.room = model.low, model.high, model.high - model.low
        self.moving = self.room > 0
        self.tried = self.evaluations = 0
        self.little_gained = False
        self._last: _Point | None = None

    def point(self, u: Array) -> _Point:
        """The model at some coordinates; nothing is done when they are asked for twice in a row."""
        if self._last is None or not np.array_equal(u, self._last.u):
            prediction = self.model.predict(u)
            residual = self.whiten(self.weight * (self.value - prediction))
            self._last = _Point(u, prediction, residual, float(residual @ residual))
            self.tried, self.evaluations = self.tried + 1, self.evaluations + 1
        return self._last

    def differentiate(self, at: _Point) -> Array:
        """Whitened derivatives by the coordinates, shape (n_readings, n_parameters)."""
        self.evaluations += int(self.moving.sum())
        return np.asarray(self.whiten(self.weight[:, None] * self.model.jacobian(at.u, at.prediction)))

    @property
    def little(self) -> float:
        """What would not be felt, in the sum of squares."""
        return self.tolerance * max(1.0, self.best.chi2 / len(self.value))

    def run(self, start: Array, steps: int) -> bool:
        """SciPy's search; did it end by itself?"""
        try:
            return self._run(start, steps, "exact")
        except np.linalg.LinAlgError:  # LAPACK ends so of some matrices, well-conditioned ones among them
            return self._run(self.best.u, max(steps - self.tried, 1), "lsmr")

    def _run(self, start: Array, steps: int, solver: Literal["exact", "lsmr"]) -> bool:
        begin = (start - self.low)[self.moving] / self.room[self.moving]
        ftol = self.tolerance / len(self.value)
        try:
            with np.errstate(divide="ignore", invalid="ignore"):  # see `_at`
                found = optimize.least_squares(
                    self._residual, begin, self._derivatives, (0, 1),
                    ftol=ftol, gtol=None, max_nfev=steps, tr_solver=solver,
                )  # fmt: skip
        except _Ended:
            return True
        return bool(found.status > 0)

    def _at(self, x: Array) -> _Point:
        if not np.isfinite(x).all():  # derivatives so small that their powers are zero
            raise _Ended
        u = self.start.copy()
        u[self.moving] = self.low[self.moving] + x * self.room[self.moving]
        return self.point(u)

    def _residual(self, x: Array) -> Array:
        return self._at(x).residual

    def _derivatives(self, x: Array) -> Array:
        self.best = self._at(x)
        self.slopes = self.differentiate(self.best)
        if not np.isfinite((self.slopes * self.room) ** 2).all():  # light grows beyond all numbers here
            self.slopes = np.zeros(self.slopes.shape)
            self.little_gained = True
            raise _Ended
        below, above = self._drawn_out(_AT)
        free = self.slopes[:, self.moving & ~below & ~above]
        gain = self.best.residual @ free @ _newton(free, self.best.residual)
        self.little_gained = bool(gain < self.little)
        if self.little_gained:
            raise _Ended
        return np.asarray(-(self.slopes * self.room)[:, self.moving])

    def _drawn_out(self, within: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """What is drawn below its range, and above it, and lies within a part of the range of that end."""
        drawn, x = self.slopes.T @ self.best.residual, self.best.u - self.low
        return (drawn < 0) & (x <= within * self.room), (drawn > 0) & (x >= (1 - within) * self.room)

    def beyond(self) -> _Point:
        """A Newton step on from the best point, clipped, what is drawn out of its range at the bound.

        The best point itself where there is nothing to gain.
        """
        below, above = self._drawn_out(_NEAR)
        bounded = below | above
        if self.little_gained and not bounded.any():
            return self.best
        u, free = self.best.u, self.moving & ~bounded
        step = np.where(below, self.low - u, np.where(above, self.high - u, 0.0))
        step[free] = _newton(self.slopes[:, free], self.best.residual - self.slopes @ step)
        return self.point(np.clip(u + step, self.low, self.high))


def _newton(slopes: Array, residual: Array) -> Array:
    """Newton step of the coordinates, were the model linear; 0 for what changes nothing."""
    norm = np.linalg.norm(slopes, axis=0)
    norm[norm == 0] = np.inf
    columns = slopes / norm
    gram = columns.T @ columns + _NEWTON * np.eye(len(norm))
    return np.asarray(np.linalg.solve(gram, columns.T @ residual) / norm)


def least_squares(
    model: Model,
    value: Array,
    whiten: Whiten,
    start: Sequence[float] | Array,
    keep: Array | None = None,
    max_steps: int = _STEPS,
    tolerance: float = _LITTLE,
) -> Fit:
    """Minimise |whiten(value - prediction)|^2 within the bounds.

    SciPy's trust region reflective search (Branch, Coleman and Li 1999, SIAM J. Sci. Comput. 21, 1). It stays
    off the bounds: where it ends beside one that the readings draw it to, the bound itself is tried.

    Parameters
    ----------
    value : array, shape (n_readings,)
    whiten : callable
        Multiplies columns by the inverse Cholesky factor of the noise covariance.
    start : array, shape (n_parameters,)
    keep : array of 0 and 1, shape (n_readings,), optional
        Readings left out carry 0.
    max_steps : int
        Steps that are tried at most.
    tolerance : float
        Stop when a step would lower the sum of squares by less than this, in sigma^2, or in the scatter that
        the model leaves where that is larger.
    """
    weight = np.ones(len(value)) if keep is None else keep
    begin = np.clip(np.asarray(start, float), model.low, model.high)
    search = _Search(model, value, whiten, weight, begin, tolerance)

    def fit(at: _Point, slopes: Array | None, converged: bool) -> Fit:
        differentiate = partial(search.differentiate, at) if slopes is None else lambda: slopes
        return Fit(
            model, at.u, at.prediction, at.residual, at.chi2, differentiate, converged, search.evaluations
        )

    if not max_steps or not search.moving.any():
        return fit(search.point(begin), None, not search.moving.any())
    while True:
        converged = search.run(begin, max_steps - search.tried)
        ended, further = search.best, search.beyond()
        gain = ended.chi2 - further.chi2
        if further is ended or not gain >= 0:
            return fit(ended, search.slopes, converged)
        if search.little_gained or gain < search.little or search.tried >= max_steps:
            return fit(further, None, converged)
        begin = further.u
