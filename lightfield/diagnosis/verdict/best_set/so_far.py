"""The best set of effects so far, while a search runs: in a line, and in full when it is stopped."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import isnan
from typing import Any

from lightfield.arrays import jsonable
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.diagnosis.verdict.ladder import bright, percent
from lightfield.diagnosis.verdict.speech import in_unit, join
from lightfield.fitting.least_squares import Fit
from lightfield.wording import rounded

#: Error over that of the best of another search from which a search is behind: light that was traced anew, or
#: readings set aside, change it by less. Chosen.
_BEHIND = 1.1


@dataclass(frozen=True)
class BestSoFar:
    """The best set so far."""

    problem: Problem
    explanation: Explanation
    fit: Fit

    @property
    def error_percent(self) -> float:
        """Rms of (reading - model) / model over the bright readings."""
        return percent(self.problem, self.fit.prediction, bright(self.problem))

    def is_behind(self, other: BestSoFar) -> bool:
        """Does it miss the readings by clearly more than the best of another search?"""
        return self.error_percent > _BEHIND * other.error_percent


class SoFar:
    """Follows a search.

    Parameters
    ----------
    tell : callable
        Takes one line: what is being done.

    Attributes
    ----------
    sets : int
        Sets of effects that were fitted.
    """

    def __init__(self, tell: Callable[[str], None] = lambda line: None) -> None:
        self._tell = tell
        self.sets = 0
        self.best: BestSoFar | None = None
        self._base_percent: float | None = None

    def __call__(self, stage: str) -> None:
        self._tell(stage)

    def tried(self, sets: int, problem: Problem, explanation: Explanation, fit: Fit) -> None:
        """So many sets more were fitted, and this is the best so far."""
        self.sets += sets
        if self.best is None or fit is not self.best.fit:
            here = BestSoFar(problem, explanation, fit)
            if not explanation:
                self._base_percent = here.error_percent
            # Every search calls its own best so: another one may begin far behind.
            if self.best is None or problem is self.best.problem or not here.is_behind(self.best):
                self.best = here
        if sets:
            self._tell(self._line(self.best))

    def _line(self, best: BestSoFar) -> str:
        names = " + ".join(c.name for c in best.explanation) or "no effect"
        return f"{self.sets} sets of effects tried; best so far: {_percent(best.error_percent)} with {names}"

    def as_text(self) -> str:
        """The best set in full, several lines; "" where nothing was fitted yet."""
        if self.best is None:
            return ""
        best = self.best
        names = join([c.name for c in best.explanation]) or "no effect"
        base = "" if self._base_percent is None else f" (without any {_percent(self._base_percent)})"
        lines = [
            f"Stopped after {self.sets} sets of effects. What fits best so far was not tested, and other "
            "effects may do as well:",
            f"  error {_percent(best.error_percent)} with {names}{base}",
        ]
        return "\n".join([*lines, *(f"  {_effect(c, best)}" for c in best.explanation)])

    def as_data(self) -> dict[str, Any]:
        """The same for programs: no verdict, as `interrupted` says; {} where nothing was fitted yet."""
        if self.best is None:
            return {}
        best = self.best
        return {
            "interrupted": True,
            "sets_tried": self.sets,
            "best_so_far": {
                "effects": [c.name for c in best.explanation],
                "error_percent": jsonable(best.error_percent),
                "error_percent_without": jsonable(self._base_percent),
                "parameters": {path: float(value) for path, value in best.fit.values.items()},
            },
        }


def _percent(error: float) -> str:
    return "in no per cent (a dark model)" if isnan(error) else f"{rounded(error, 3)} %"


def _effect(candidate: Candidate, best: BestSoFar) -> str:
    if candidate.effect.is_free_form:
        return f"{candidate.name}: a curve of {len(candidate.amplitudes)} functions"
    known = best.problem.forward.scene.parameters()
    told = []
    for parameter in candidate.parameters:
        unit, value = known[parameter.path].unit, best.fit.values[parameter.path]
        told.append(in_unit(f"{parameter.path} = {value:.4g}", unit))
    return f"{candidate.name}: {', '.join(told)}"
