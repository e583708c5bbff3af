"""Fits of sets of effects, each remembered: what the ladder, the switches and "Fit these" rest on."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.verdict.ladder import bright, percent, rms_over
from lightfield.errors import FitError
from lightfield.explorer.experiment import Experiment, candidate_of
from lightfield.fitting import effects
from lightfield.fitting.least_squares import Fit, Whiten, least_squares
from lightfield.fitting.parameter import Model
from lightfield.memory import Latest

#: Sets whose fits are kept, the last ones.
_KEPT = 1000
#: What a fit may leave of chi-square.
_LEFT = 1e-5


@dataclass(frozen=True)
class Goodness:
    """How well a model follows what it is held against.

    Parameters
    ----------
    error_percent : float
        Rms of (reading - model) / model over the bright readings.
    chi2, dof : float, int
        In units of the quoted errors and the error budget.
    """

    error_percent: float
    chi2: float
    dof: int

    @property
    def chi2_per_dof(self) -> float:
        return self.chi2 / self.dof


@dataclass(frozen=True)
class Fitted:
    """A set of effects, fitted.

    Parameters
    ----------
    values, stderr : mapping
        By path, of base parameters and effects; a standard error is NaN where it is undetermined.
    """

    values: Mapping[str, float]
    stderr: Mapping[str, float]
    score: Goodness


class Fits:
    """Fits to one experiment."""

    def __init__(self, experiment: Experiment) -> None:
        self.experiment = experiment
        self._known: Latest[frozenset[str], Fitted] = Latest(_KEPT)
        #: Readings that count in the error in per cent, shape (n,).
        self.counted = np.asarray(bright(experiment.problem), bool)

    def known(self, keys: Iterable[str]) -> Fitted | None:
        """The fit of a set, if it was made."""
        if (key := frozenset(keys)) not in self._known:
            return None
        return self._known[key]  # and remembers that it was asked for

    def of(
        self,
        keys: tuple[str, ...],
        near: Mapping[str, float] | None = None,
        follow: Callable[[float], None] = lambda part: None,
        ends: Callable[[], None] = lambda: None,
    ) -> Fitted:
        """The best fit of a set that is known; from some values, or from the usual starts.

        Parameters
        ----------
        follow : callable
            Told the part of the fits that is done; what it raises ends them.
        ends : callable
            Called at every step of a fit; what it raises ends them.

        Raises
        ------
        FitError
            An effect that cannot be switched here, or two that cannot be switched together.
        """
        found = self.known(keys)
        if found is not None and near is None:
            return found
        chosen = self.explanation(keys)
        problem = self.experiment.problem
        model = problem.model(chosen)
        starts = [model.start if near is None else _start(model, near)]
        if chosen and near is None:
            base = self._begun(model)
            starts = problem.starts(base, chosen, self._whitening(ends))
            if len(keys) > 1 and (before := self.known(keys[:-1])) is not None:
                starts.append(_start(model, before.values))
        fits = []
        for number, start in enumerate(starts):
            follow(number / len(starts))
            fits.append(self._fit(model, start, ends))
        best = min(fits, key=lambda fit: fit.chi2)
        fitted = self._fitted(best)
        if found is not None and found.score.chi2 <= fitted.score.chi2:
            return found
        self._known[frozenset(keys)] = fitted
        return fitted

    def base(self, keys: tuple[str, ...], held: Mapping[str, float]) -> Fitted:
        """A fit of the base parameters alone, the effects as stated, and off as far as nothing is."""
        model = self.experiment.problem.model(self.explanation(keys))
        free = {p.path for p in self.experiment.problem.base}
        parameters = tuple(
            p if p.path in free else p.held(p.coordinate_of(held[p.path]) if p.path in held else p.start)
            for p in model.parameters
        )
        some = Model(model.forward, parameters)
        fit = self._fit(some, some.start, lambda: None)
        return self._fitted(fit)

    def explanation(self, keys: Iterable[str]) -> tuple[Candidate, ...]:
        """The effects of some keys, which can be switched together.

        Raises
        ------
        FitError
        """
        chosen: list[Candidate] = []
        for key in keys:
            one = candidate_of(self.experiment, key)
            for other in chosen:
                if not one.effect.combines_with(other.effect):
                    raise FitError(
                        "these effects cannot be switched on together",
                        found=f"{other.name}, {one.name}",
                        rule=effects.TOGETHER,
                        remedy=f"switch {other.name} off first",
                    )
            chosen.append(one)
        return tuple(chosen)

    def score(self, prediction: Array, parameters: int) -> Goodness:
        """How well a prediction, shape (n,), with so many free parameters does."""
        e = self.experiment
        residual = e.whiten(e.problem.keep * (e.problem.value - prediction))
        dof = max(int(e.problem.keep.sum()) - parameters, 1)
        return Goodness(percent(e.problem, prediction, self.counted), float(residual @ residual) * e.phi, dof)

    def moved(self, keys: Iterable[str]) -> int:
        """How many parameters a fit of some effects moves."""
        own = (p for key in keys for p in self.experiment.candidates[key].parameters)
        return sum(not p.is_held for p in (*self.experiment.problem.base, *own))

    @property
    def floor_percent(self) -> float:
        """What the readings' own errors leave of any explanation, as errors count here."""
        value = self.experiment.problem.value[self.counted]
        return rms_over(self.experiment.sigma[self.counted], value)

    def _begun(self, model: Model) -> Array:
        base = self.known(())
        return model.start if base is None else _start(model, base.values)

    def _whitening(self, ends: Callable[[], None]) -> Whiten:
        """That of the experiment, which asks at every step whether the fit goes on."""

        def whiten(columns: Array) -> Array:
            ends()
            return self.experiment.whiten(columns)

        return whiten

    def _fit(self, model: Model, start: Array, ends: Callable[[], None]) -> Fit:
        problem, whiten = self.experiment.problem, self._whitening(ends)
        return least_squares(model, problem.value, whiten, start, problem.keep, tolerance=_LEFT)

    def _fitted(self, fit: Fit) -> Fitted:
        score = self.score(fit.prediction, int((fit.model.high > fit.model.low).sum()))
        return Fitted(fit.values, fit.stderr(self.experiment.phi), score)


def _start(model: Model, values: Mapping[str, float]) -> Array:
    """Coordinates of some values, within the bounds; of what has none the model's start."""
    start = [
        p.coordinate_of(values[p.path])
        if p.path in values and (p.coordinate != "log" or values[p.path] > 0)
        else p.start
        for p in model.parameters
    ]
    return np.clip(np.array(start), model.low, model.high)
