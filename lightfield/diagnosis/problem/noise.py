"""Noise of the readings: smoothed standard errors, serial correlation, error budget; and how to whiten by
it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dtrtri
from scipy.optimize import nnls

from lightfield.arrays import Array
from lightfield.diagnosis.problem.layout import Layout

#: Assumed when a table has hardly any standard errors: relative part, constant part over the largest reading.
ASSUMED_RELATIVE, ASSUMED_FLOOR = 0.01, 0.001
#: How far a model error that is of no interest, and that of the response of diffuse light (of one trace), is
#: the same in two bands.
CHANNELS_ALIKE, RESPONSES_ALIKE = 0.7, 0.99
_TALL = 2.0
#: Fewer standard errors than this say nothing about the others.
FEWEST_STATED = 4


def errors_stated(quoted: Array) -> bool:
    """Does the table quote enough standard errors to go by?"""
    return int((np.isfinite(quoted) & (quoted > 0)).sum()) >= FEWEST_STATED


def smooth_stderr(quoted: Array, prediction: Array, group: NDArray[np.int_]) -> Array:
    """Standard error as a function of the predicted reading, shape (n,).

    Errors estimated from a few dozen samples scatter by 10 %; weights made from them would carry that scatter
    into every template. The variance is read noise + shot noise + proportional noise,
    s^2 = c0 + c1 f + c2 f^2 with c >= 0, evaluated at the prediction f, never at the noisy reading.

    Parameters
    ----------
    quoted : array, shape (n,)
        Standard errors of the table; NaN where unknown.
    prediction : array, shape (n,)
    group : array of int, shape (n,)
        Readings of one group may share a factor (integration time, channel).
    """
    top = float(np.max(np.abs(prediction)))
    level = np.clip(prediction, 0, None) / top
    basis = np.stack([np.ones_like(level), level, level**2], axis=1)
    if not errors_stated(quoted):
        return np.asarray(top * np.sqrt(ASSUMED_FLOOR**2 + (ASSUMED_RELATIVE * level) ** 2))
    known = np.isfinite(quoted) & (quoted > 0)
    variance = (quoted[known] / top) ** 2
    fitted = np.full(known.sum(), np.median(variance))
    robust = np.ones_like(fitted)
    curve = np.zeros(3)
    for _ in range(8):
        weight = robust / fitted
        curve = nnls(basis[known] * weight[:, None], variance * weight)[0]
        fitted = np.maximum(basis[known] @ curve, 1e-4 * np.median(variance))
        misfit = np.log(variance / fitted)
        spread = 1.4826 * np.median(np.abs(misfit - np.median(misfit))) + 0.05
        robust = 1 / (1 + (misfit / (4 * spread)) ** 2)
    smooth = np.maximum(basis @ curve, 1e-4 * np.median(variance))
    factor = np.ones_like(smooth)
    for label in np.unique(group):
        members = (group == label)[known]
        if members.sum() >= 8:
            shift = float(np.median(misfit[members]))
            if abs(shift) > 5 * 1.25 * spread / np.sqrt(members.sum()):
                factor[group == label] = np.exp(shift)
    sigma = top * np.sqrt(smooth * factor)
    # A reading whose own error is far above the curve was marked as poor on purpose.
    poor = known & (np.nan_to_num(quoted) > _TALL * sigma)
    return np.asarray(np.where(poor, np.nan_to_num(quoted), sigma))


@dataclass(frozen=True)
class Budget:
    """Error budget in relative units and metres, and which of its terms were assumed rather than given."""

    plane_gain: float
    position_m: float
    tolerance: float
    gain_stated: bool = False
    assumed: tuple[str, ...] = ()


@dataclass(frozen=True)
class Noise:
    """Everything the covariance is made of.

    Parameters
    ----------
    sigma, prediction : array, shape (n,)
        Smoothed standard error, and the model reading it belongs to.
    position_slope : array, shape (n,)
        |gradient| of the prediction with respect to x, y, z, per metre.
    photon_modes : array, shape (n, k), optional
        Monte Carlo errors of the predictions as independent contributions.
    response_error : array, shape (n,), optional
        Size of a smooth error of the predictions' scattered and reflected light.
    """

    layout: Layout
    sigma: Array
    prediction: Array
    budget: Budget
    position_slope: Array
    photon_modes: Array | None = None
    response_error: Array | None = None

    def extra(self, tolerance: float) -> Array:
        """Covariance that does not scale with the quoted errors, shape (n, n)."""
        lay, f = self.layout, np.clip(self.prediction, 0, None)
        out = np.zeros((lay.size, lay.size))
        if self.budget.plane_gain > 0:
            together = lay.visit[:, None] == lay.visit[None]
            if not self.budget.gain_stated:
                # Assumed for lack of better, it must not widen the errors of readings that have a stay to
                # themselves.
                together &= (together.sum(0) > 1)[:, None]
            out += self.budget.plane_gain**2 * np.outer(f, f) * together
        if self.budget.position_m > 0:
            out[np.diag_indices(lay.size)] += (self.budget.position_m * self.position_slope) ** 2
        smooth = [(tolerance, f, CHANNELS_ALIKE)] if tolerance > 0 else []
        if self.response_error is not None and self.response_error.any():
            smooth.append((1.0, self.response_error, RESPONSES_ALIKE))
        if smooth:
            one_channel = lay.channel[:, None] == lay.channel[None]
            for relative, part, alike in smooth:
                out += relative**2 * np.outer(part, part) * lay.alike * np.where(one_channel, 1.0, alike)
        return out if self.photon_modes is None else out + self._of_photons

    @cached_property
    def _of_photons(self) -> Array:
        """Covariance of the Monte Carlo errors, shape (n, n)."""
        assert self.photon_modes is not None
        return np.asarray(self.photon_modes @ self.photon_modes.T)

    def serial(self, rho: float) -> Array:
        """Correlation of the readings' own noise in scan order, shape (n, n)."""
        lay = self.layout
        if rho == 0:
            return np.eye(lay.size)
        lag = np.abs(np.subtract.outer(lay.position, lay.position))
        return np.where(
            lay.channel[:, None] == lay.channel[None], rho ** np.minimum(lag, 80), 0.0
        ) + 1e-9 * np.eye(lay.size)

    def covariance(self, rho: float, phi: float, tolerance: float) -> Array:
        """phi S R S + plane gain + stage + tolerated smooth model error + Monte Carlo, shape (n, n)."""
        return phi * np.outer(self.sigma, self.sigma) * self.serial(rho) + self.extra(tolerance)


class Whitener:
    """Multiplies columns by the inverse Cholesky factor of the covariance."""

    def __init__(self, noise: Noise, rho: float = 0.0, phi: float = 1.0, tolerance: float = 0.0) -> None:
        self.noise, self.rho, self.phi, self.tolerance = noise, rho, phi, tolerance
        factor = np.linalg.cholesky(noise.covariance(rho, phi, tolerance))
        diagonal = np.diag(factor)
        #: Logarithm of the determinant of the covariance.
        self.log_determinant = 2 * float(np.log(diagonal).sum())
        self._inverse: Array | None = None
        self._diagonal = 1 / diagonal
        if np.abs(factor - np.diag(diagonal)).max() > 1e-12 * diagonal.max():
            self._inverse, _ = dtrtri(factor, lower=1)

    def __call__(self, columns: Array) -> Array:
        if self._inverse is not None:
            return np.asarray(self._inverse @ columns)
        return np.asarray(
            self._diagonal * columns if columns.ndim == 1 else self._diagonal[:, None] * columns
        )

    def replicates(self, rng: np.random.Generator, count: int) -> Array:
        """Whitened noise, shape (n, count)."""
        return rng.standard_normal((self.noise.layout.size, count))
