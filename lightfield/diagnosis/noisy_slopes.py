"""What the noise of the diffuse light pretends to see.

The response of the diffuse light has a Monte Carlo error, and so have its derivatives: they come from the
same photons. Residual and derivative then move together, and a score is not zero on average even where
nothing is missing (errors in variables; Fuller 1987, Measurement Error Models). With an error M z of the
light, z standard normal, the residual moves by -M z, the derivative by M' z, and the mean of the score is
-tr(C^-1 M' M^T). M is the error that the response states of itself, in modes that keep their photons while
scene parameters move.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lightfield.diagnosis.problem import Problem
from lightfield.diagnosis.templates import Template
from lightfield.fit import Fit, Parameter, Whiten

Array = NDArray[np.float64]


class NoisySlopes:
    """Means of scores beside the free parameters of a fit, where nothing is missing.

    Parameters
    ----------
    free : array of bool, shape (n_parameters,)
        Which parameters the fit could move.
    """

    def __init__(self, problem: Problem, whiten: Whiten, fit: Fit, free: NDArray[np.bool_]) -> None:
        self._problem, self._whiten, self._fit = problem, whiten, fit
        self._modes, _ = problem.forward.errors(fit.values)
        self._white = whiten(problem.keep[:, None] * self._modes)
        self._slopes = fit.jacobian[:, free]
        parameters = [p for p, moved in zip(fit.model.parameters, free, strict=True) if moved]
        at = fit.u[free].tolist()
        self._own = np.array([self._mean(fit.values, p, u) for p, u in zip(parameters, at, strict=True)])

    def of(self, template: Template) -> float:
        """Mean of the projection of a whitened residual on what a template keeps beside the free parameters.

        In units of the template's direction; its single amplitude starts where it is neutral.
        """
        (column,) = template.columns.T
        (amplitude,) = template.candidate.amplitudes
        shapes = zip(template.candidate.shapes, template.shape, strict=True)
        values = self._fit.values | {p.path: p.value(x) for p, x in shapes}
        absorbed, *_ = np.linalg.lstsq(self._slopes, column, rcond=1e-9)
        rest = np.linalg.norm(column - self._slopes @ absorbed)
        return float((self._mean(values, amplitude, amplitude.start) - absorbed @ self._own) / rest)

    def _mean(self, values: Mapping[str, float], parameter: Parameter, at: float) -> float:
        """-tr(C^-1 M' M^T) for the derivative with respect to a parameter."""
        step = parameter.step if at + parameter.step <= parameter.high else -parameter.step
        modes, _ = self._problem.forward.errors({**values, parameter.path: parameter.value(at + step)})
        if modes.shape != self._modes.shape:  # light of a kind that was not there, of photons of its own
            return 0.0
        change = self._whiten(self._problem.keep[:, None] * (modes - self._modes))
        return -float((self._white * change).sum()) / step
