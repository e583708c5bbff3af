"""Generalised least squares over all colours at once, with errors that all colours share.

    y[j, l] = X[j, l, :] theta[l, :] + H[j, :] beta + eps[j, l]

beta (errors of stays at a distance, of the light that a trace predicts) has a prior of zero mean and known
width. Eliminating theta colour by colour leaves equations for the few beta, so thousands of colours cost no
more than their number. The covariance of theta is

    cov(theta_l, theta_m) = own_l [l = m] + G_l B G_m^T        B = cov(beta), a few by a few
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from lightfield.arrays import Array, Mask
from lightfield.decompositions import eigen

#: Of a colour's largest singular value, below which a combination of its parameters is not told.
_LEAST_SINGULAR = 1e-9
#: A chi-square whose probability is smaller than this is no chance: the model does not fit.
POOR_FIT = 0.01


def misfit_p(chi2: float, dof: int) -> float:
    """Probability of a larger chi-square where the model holds; NaN where nothing is left to tell."""
    return float(stats.chi2.sf(chi2, dof)) if dof > 0 else float("nan")


def misfit_factor(chi2: float, dof: int) -> float:
    """What errors are multiplied by where the model does not fit; 1 where that may be chance.

    Source
    ------
    Birge (1932), Phys. Rev. 40, 207, doi:10.1103/PhysRev.40.207.
    """
    poor = dof > 0 and chi2 > dof and stats.chi2.sf(chi2, dof) <= POOR_FIT
    return float(np.sqrt(chi2 / dof)) if poor else 1.0


@dataclass(frozen=True, eq=False)
class JointEstimate:
    """What the readings say of the parameters of every colour.

    Parameters
    ----------
    theta : array, shape (n_colours, n_parameters)
    own : array, shape (n_colours, n_parameters, n_parameters)
        Covariance by the readings' own errors.
    modes : array, shape (n_colours, n_parameters, n_shared)
        Errors that all colours share: covariance between colours = modes @ modes^T.
    beta : array, shape (n_shared,)
    residual : array, shape (n_rows, n_colours)
        y - X theta - H beta; NaN where nothing was read.
    chi2 : float
    errors_times : float
        What the errors of every colour were multiplied by because of the misfit, see `misfit_factor`.
    """

    theta: Array
    own: Array
    modes: Array
    beta: Array
    residual: Array
    chi2: float
    dof: int
    errors_times: float = 1.0

    def widened(self) -> JointEstimate:
        """The same with errors as large as the misfit says.

        What misfits may do so in all colours alike: the rest of their errors is common to all.
        """
        times = misfit_factor(self.chi2, self.dof)
        size, direction = np.linalg.eigh(self.of_each())
        root = (direction * np.sqrt(np.clip(size, 0, None))[:, None]) @ direction.transpose(0, 2, 1)
        more = np.sqrt(times**2 - 1) * root
        return replace(self, modes=np.concatenate([self.modes, more], axis=2), errors_times=times)

    @property
    def stderr(self) -> Array:
        """Standard error of every parameter, shape (n_colours, n_parameters)."""
        own = np.einsum("lpp->lp", self.own)
        return np.asarray(np.sqrt(own + (self.modes**2).sum(axis=2)))

    def of_each(self) -> Array:
        """Covariance of the parameters of every colour, shape (n_colours, n_parameters, n_parameters)."""
        return np.asarray(self.own + self.modes @ self.modes.transpose(0, 2, 1))

    def covariance(self, parameter: int) -> Array:
        """Covariance of a parameter between colours, shape (n_colours, n_colours)."""
        modes = self.modes[:, parameter]
        return np.asarray(modes @ modes.T + np.diag(self.own[:, parameter, parameter]))


@dataclass(frozen=True, eq=False)
class Design:
    """Everything of the equations but y.

    Parameters
    ----------
    sigma : array, shape (n_rows, n_colours)
        NaN where nothing was read.
    X : array, shape (n_rows, n_colours, n_parameters)
    H : array, shape (n_rows, n_shared)
        How errors that all colours share act on each row, see `stays`.
    shared_stderr : array, shape (n_shared,)
        0 switches one off.

    Source
    ------
    Aitken (1935), Proc. R. Soc. Edinburgh 55, 42; the elimination is Schur's complement.
    """

    sigma: Array
    X: Array
    H: Array
    shared_stderr: Array

    @property
    def known(self) -> Mask:
        """What was read, shape (n_rows, n_colours)."""
        return np.isfinite(self.sigma)

    def estimate(self, y: Array) -> JointEstimate:
        """Parameters and shared errors from values, shape (n_rows, n_colours)."""
        theta, beta, residual = self._solved(y)
        spread = np.zeros((len(beta), len(beta)))
        spread[np.ix_(self._some, self._some)] = self._spread
        size, direction = eigen(spread)
        root = direction * np.sqrt(np.clip(size, 0, None))
        chi2 = float((self._weight * residual**2).sum() + (self._precision * beta**2).sum())
        told = np.linalg.matrix_rank(self._normal, hermitian=True).sum()
        return JointEstimate(
            theta, self._own, self._onto @ root, beta,
            np.where(self.known, residual, np.nan), chi2, int(self.known.sum() - told),
        )  # fmt: skip

    def whitened(self, y: Array) -> Array:
        """A vector whose squared length is chi-square at the best theta and beta; linear in y."""
        _, beta, residual = self._solved(y)
        return np.concatenate([(np.sqrt(self._weight) * residual).ravel(), np.sqrt(self._precision) * beta])

    def _solved(self, y: Array) -> tuple[Array, Array, Array]:
        value = np.where(self.known, y, 0.0)
        weighted, beta = self._weight * value, np.zeros(len(self.shared_stderr))
        alone = np.einsum("lpq,jlq,jl->lp", self._own, self._zeroed, weighted)  # theta without beta
        right = weighted.sum(axis=1) @ self.H - np.einsum("lkp,lp->k", self._between, alone)
        beta[self._some] = self._spread @ right[self._some]
        theta = alone - self._onto @ beta
        residual = value - np.einsum("jlp,lp->jl", self._zeroed, theta) - (self.H @ beta)[:, None]
        return theta, beta, np.where(self.known, residual, 0.0)

    @cached_property
    def _weight(self) -> Array:
        return np.where(self.known, 1.0 / np.where(self.known, self.sigma, 1.0) ** 2, 0.0)

    @cached_property
    def _zeroed(self) -> Array:
        return np.where(self.known[..., None], self.X, 0.0)

    @cached_property
    def _normal(self) -> Array:
        return np.asarray(np.einsum("jlp,jlq->lpq", self._zeroed, self._weight[..., None] * self._zeroed))

    @cached_property
    def _own(self) -> Array:
        return np.asarray(np.linalg.pinv(self._normal, rcond=_LEAST_SINGULAR, hermitian=True))

    @cached_property
    def _between(self) -> Array:
        """H^T W X of every colour, shape (n_colours, n_shared, n_parameters)."""
        return np.asarray(np.einsum("jk,jl,jlp->lkp", self.H, self._weight, self._zeroed, optimize=True))

    @cached_property
    def _onto(self) -> Array:
        """How theta follows beta, shape (n_colours, n_parameters, n_shared)."""
        return np.asarray(self._own @ self._between.transpose(0, 2, 1))

    @cached_property
    def _some(self) -> Mask:
        return self.shared_stderr > 0

    @cached_property
    def _precision(self) -> Array:
        return np.where(self._some, 1.0 / np.where(self._some, self.shared_stderr, 1.0) ** 2, 0.0)

    @cached_property
    def _spread(self) -> Array:
        """Covariance of the beta that there are."""
        N = np.diag(self._precision) + np.einsum("jk,j,jm->km", self.H, self._weight.sum(axis=1), self.H)
        N -= np.einsum("lkp,lpm->km", self._between, self._onto)
        return np.asarray(np.linalg.inv(N[np.ix_(self._some, self._some)]))


def stays(stay: NDArray[np.int_], count: int) -> Array:
    """H of errors of stays at a distance, shape (n_rows, count).

    Parameters
    ----------
    stay : array of int, shape (n_rows,)
    """
    return (stay[:, None] == np.arange(count)).astype(float)
