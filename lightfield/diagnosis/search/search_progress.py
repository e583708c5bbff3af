"""What a search tells while it runs: what begins, and the best set of effects so far."""

from __future__ import annotations

from typing import Protocol

from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.fitting.least_squares import Fit


class Progress(Protocol):
    """Is told what a search does."""

    def __call__(self, stage: str) -> None:
        """Something begins."""

    def tried(self, sets: int, problem: Problem, explanation: Explanation, fit: Fit) -> None:
        """So many sets more were fitted, and this is the best so far."""
