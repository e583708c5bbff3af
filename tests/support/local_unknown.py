"""A local unknown fitted to readings, alone beside the base model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lightfield.diagnosis.problem.local_unknowns import finely
from lightfield.diagnosis.problem.setup import problem_of
from lightfield.fitting import effects
from lightfield.fitting.effects.local import local_unknowns
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.least_squares import Fit
from lightfield.readings import Readings
from lightfield.scene import Scene


def fitted_alone(table: Readings, believed: Scene, name: str) -> tuple[Fit, Fit]:
    """The base model, and with that unknown, from starts over its ranges."""
    stderr = np.hypot(0.005 * table.value, 8e-4)
    table = replace(table, stderr=stderr)
    scene = believed.with_values({"effect": local_unknowns(table)})
    problem, _ = problem_of(SceneForward(scene, table), table, [effects.all_of(scene)[name]], None)
    one = finely(*problem.candidates)

    def whiten(columns: np.ndarray) -> np.ndarray:
        return (columns.T / stderr).T

    base = problem.fit((), whiten, [problem.model().start])
    starts = [np.r_[base.u, one.typical, shape] for shape in one.grid]
    begun = [problem.fit((one,), whiten, [start], max_steps=3) for start in starts]
    return base, problem.fit((one,), whiten, [min(begun, key=lambda f: f.chi2).u])
