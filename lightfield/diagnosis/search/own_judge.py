"""Explanations by diffuse light, judged under the errors that the response of theirs has."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lightfield.diagnosis.adequacy.score_tests import AdequacyTest
from lightfield.diagnosis.problem.problem import FAR_BEHIND, Explanation
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.own_errors import (
    from_shapes,
    refitted,
    under_own_errors,
    with_response_error,
)
from lightfield.diagnosis.search.preparation import Bench, Prepared, judged
from lightfield.fitting.least_squares import Fit


@dataclass(frozen=True)
class OwnErrors:
    """Judges explanations by diffuse light, whose response has an error of its own size.

    Parameters
    ----------
    main : Bench
        Of the base model; sets scale and tolerance.
    """

    prepared: Prepared
    main: Bench
    rng: np.random.Generator

    def promise(self, fit: Fit) -> float:
        """Chi-square and growth of the log determinant where the fit lies now."""
        problem, main = self.prepared.problem, self.main.whiten
        noise = with_response_error(problem, self.prepared.noise, fit)
        whiten = Whitener(noise, main.rho, main.phi, main.tolerance)
        residual = whiten(problem.keep * (problem.value - fit.prediction))
        return float(residual @ residual) + whiten.log_determinant - main.log_determinant

    def hopeless(self, fit: Fit, best: Fit) -> bool:
        """Do many readings put it far behind the best fit even with its own errors, as a sample shows?"""
        if self.prepared.problem.sample is None:
            return False
        rows, problem = self.prepared.problem.sample
        main = self.main.whiten.of(rows)
        own = with_response_error(problem, self.prepared.noise.subset(rows), fit)
        whiten = Whitener(own, main.rho, main.phi, main.tolerance)
        mine, other = (
            float((w(problem.keep * (problem.value - f.prediction[rows])) ** 2).sum())
            for w, f in ((whiten, fit), (main, best))
        )
        behind = mine + whiten.log_determinant - main.log_determinant - other
        return behind > FAR_BEHIND * max(1.0, other / len(problem.value))

    def refit(self, explanation: Explanation, fit: Fit) -> tuple[AdequacyTest, Fit, float]:
        """Test, fit from where the last one lies, and growth of the log determinant."""
        settle = from_shapes if len(explanation) == 1 else under_own_errors
        problem = self.prepared.problem
        whiten, best = refitted(settle, problem, explanation, fit, self.main.whiten)
        growth = whiten.log_determinant - self.main.whiten.log_determinant
        return judged(self.prepared, whiten, self.rng), best, growth
