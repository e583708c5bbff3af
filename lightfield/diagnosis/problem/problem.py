"""One diagnosis: readings, base model and candidates, and how a set of effects becomes a model to fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.layout import Layout
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.least_squares import Fit, Whiten, least_squares
from lightfield.fitting.parameter import FitParameter, Model

Explanation = tuple[Candidate, ...]

#: Steps of a fit at most, and what a further one would have to gain in chi-square.
_STEPS, _LEFT = 40, 1e-3


@dataclass(frozen=True)
class Problem:
    """Readings, a forward model, its nuisance parameters, and the effects that may be missing.

    Parameters
    ----------
    value : array, shape (n,)
    keep : array of 0 and 1, shape (n,)
        Readings left out (saturated, gross outliers) carry 0.
    base : tuple of FitParameter
        Gain per channel, beam half-width, absorption.
    """

    forward: SceneForward
    layout: Layout
    value: Array
    keep: Array
    base: tuple[FitParameter, ...]
    candidates: tuple[Candidate, ...]

    def model(self, explanation: Explanation = ()) -> Model:
        """The base model with the effects of an explanation set free."""
        replaced = {path for c in explanation for path in c.effect.instead_of}
        base = (p.held(0.5 * (p.low + p.high)) if p.path in replaced else p for p in self.base)
        return Model(self.forward, (*base, *(p for c in explanation for p in c.parameters)))

    def fit(
        self,
        explanation: Explanation,
        whiten: Whiten,
        starts: Sequence[Array],
        max_steps: int = _STEPS,
        value: Array | None = None,
        tolerance: float = _LEFT,
    ) -> Fit:
        """The best of the fits from several starts."""
        model = self.model(explanation)
        target = self.value if value is None else value
        best: Fit | None = None
        for start in starts:
            fit = least_squares(model, target, whiten, start, self.keep, max_steps, tolerance)
            if best is None or fit.chi2 < best.chi2:
                best = fit
        assert best is not None, "a fit needs a start"
        return best

    def default_start(self, base: Array, explanation: Explanation, fraction: float = 1.0) -> Array:
        """Base coordinates followed by typical amplitudes and the first shapes of each effect."""
        parts = [np.asarray(base[: len(self.base)])]
        for candidate in explanation:
            for parameter, typical in zip(candidate.amplitudes, candidate.typical, strict=True):
                parts.append(
                    np.array([np.clip(parameter.start + fraction * typical, parameter.low, parameter.high)])
                )
            parts.append(np.array([p.start for p in candidate.shapes]))
        return np.concatenate(parts)
