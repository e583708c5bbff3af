"""What could be known at best: distances between noise-free readings and the models fitted to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.layout import layout_of
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.problem.setup import problem_of
from lightfield.fitting import effects
from lightfield.fitting.diffuse_light import DiffuseSource
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.least_squares import Fit
from lightfield.render.diffuse.dense_water import trace_for
from lightfield.scene import Scene

Array = np.ndarray


class Oracle:
    """Knows the noise-free readings and the true noise.

    Parameters
    ----------
    believed : Scene
    readings : Readings
    clean : array, shape (n,)
        Noise-free readings.
    sigma : array, shape (n,)
        True standard error.
    plane_gain : float
        Relative error of every visit to a plane, true or as the tool assumes it.
    dense_per_m : float, optional, m^-1
        The true water, if it is dense.
    """

    def __init__(
        self,
        believed: Scene,
        readings: Any,
        clean: Array,
        sigma: Array,
        plane_gain: float,
        diffuse: DiffuseSource,
        dense_per_m: float | None,
    ) -> None:
        trace = None if dense_per_m is None else trace_for(dense_per_m)
        self.forward = SceneForward(believed, replace(readings, value=clean), diffuse, dense_per_m=trace)
        # Not by anything in the noisy readings: the same light for all fits.
        self.problem, _ = problem_of(
            self.forward, replace(readings, value=clean), effects.table().values(), None
        )
        visit = layout_of(readings).visit
        several = np.bincount(visit)[visit] > 1
        together = (visit[:, None] == visit[None]) & several[:, None]
        covariance = np.diag(sigma**2) + plane_gain**2 * np.outer(clean, clean) * together
        self._inverse = np.linalg.inv(np.linalg.cholesky(covariance))
        self.base = self.problem.fit((), self.whiten, [self.problem.model().start])

    def whiten(self, columns: Array) -> Array:
        return np.asarray(self._inverse @ columns)

    @property
    def delta(self) -> float:
        """Distance of the truth from the base model, in sigma."""
        return float(np.sqrt(self.base.chi2))

    def fit(self, candidates: Sequence[Candidate], values: dict[str, Any], problem: Problem) -> Fit:
        """Fit from given values, to the clean readings or to those of another problem."""
        model = problem.model(tuple(candidates))
        start = [p.coordinate_of(values[p.path]) if p.path in values else p.start for p in model.parameters]
        start[: len(self.base.u)] = self.base.u
        return problem.fit(tuple(candidates), self.whiten, [np.clip(start, model.low, model.high)])

    def formulas(self, names: Sequence[str], values: dict[str, Any]) -> list[Candidate]:
        """The forms that the hidden values belong to; fewer than names where nature follows none of them."""
        return [
            c
            for c in self.problem.candidates
            if c.name in names and any(p.path in values for p in c.amplitudes)
        ]

    def second(self, names: Sequence[str], values: dict[str, Any]) -> float:
        """Of two hidden effects: distance of the noise-free readings from what one of them alone can do."""
        alone = [self.fit((c,), values, self.problem).chi2 for c in self.formulas(names, values)]
        return float(np.sqrt(min(alone, default=np.inf)))

    def nearest(self, names: Sequence[str]) -> tuple[str, float]:
        """The single effect by another name that imitates the noise-free readings best, and its distance."""
        best, name = self.delta, "base model"
        for candidate in self.problem.candidates:
            if candidate.name not in names:
                for start in self._starts(candidate):
                    fit = self.problem.fit((candidate,), self.whiten, [start], max_steps=25)
                    if (distance := float(np.sqrt(max(fit.chi2, 0.0)))) < best:
                        best, name = distance, candidate.name
        return name, best

    def _starts(self, candidate: Candidate) -> list[Array]:
        """From the linear solution at every point of the shape grid."""
        out = []
        values, base = self.base.values, self.base
        for shape in candidate.grid:
            shapes = {p.path: p.value(u) for p, u in zip(candidate.shapes, shape, strict=True)}
            columns = []
            for parameter in candidate.amplitudes:
                step = (
                    parameter.step if parameter.start + parameter.step <= parameter.high else -parameter.step
                )
                moved = self.forward.predict(
                    {**values, **shapes, parameter.path: parameter.value(parameter.start + step)}
                )
                columns.append((moved - base.prediction) / step)
            design = np.hstack([base.jacobian, self.whiten(np.array(columns).T)])
            length = np.linalg.norm(design, axis=0) + 1e-300
            size = np.linalg.lstsq(design / length, base.residual, rcond=1e-9)[0] / length
            amplitudes = [
                np.clip(p.start + s, p.start + 0.3 * (p.low - p.start), p.start + 0.3 * (p.high - p.start))
                for p, s in zip(candidate.amplitudes, size[len(base.u) :], strict=True)
            ]
            out.append(np.array([*base.u, *amplitudes, *shape]))
        return out
