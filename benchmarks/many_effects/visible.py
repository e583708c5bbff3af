"""How visible everything hidden is: by how many sigma the noise-free readings are missed without it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.many_effects.catalogue import BEAM_FORMS, Trial
from lightfield.arrays import Array
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.layout import layout_of
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.problem.setup import PLANE_GAIN_PERCENT, problem_of
from lightfield.diagnosis.problem.untestable import Hinders, Hindrance
from lightfield.fitting import effects
from lightfield.fitting.forward import SceneForward
from lightfield.readings import Readings
from lightfield.render.diffuse.source import response_for
from lightfield.scene import Scene


def deltas(
    trial: Trial,
    believed: Scene,
    readings: Readings,
    clean: Array,
    known: Array,
    sigma_of: Callable[[Array], Array],
) -> dict[str, Any]:
    """Sigma of every hidden effect, of a lamp of its own shape, and of an unknown.

    The noise-free readings are fitted with everything hidden but the one, under their true errors.

    Parameters
    ----------
    clean, known : array, shape (n,)
        Noise-free readings, and what they would be without an unknown influence.
    sigma_of : callable
        True standard error of readings.
    """
    truth = trial.truth
    lit = believed
    if trial.lamp:
        lit = believed.with_values(
            {name: value for name, value in truth.values if name in ("lamp.profile", "lamp.intensity_table")}
        )
    curve = ("beam_profile",) if trial.lamp else ()
    whole = Fits(lit, readings, known, sigma_of(known), [*truth.hidden, *curve])
    values = dict(truth.values)
    left = whole.chi2(truth.hidden, values)
    delta = {
        name: float(np.sqrt(max(whole.chi2([n for n in truth.hidden if n != name], values) - left, 0.0)))
        for name in truth.hidden
    }
    out: dict[str, Any] = {"delta": delta, "left_sigma": float(np.sqrt(left))}
    if trial.lamp or truth.unknown:
        other = Fits(
            believed, readings, clean, sigma_of(clean), [*truth.hidden, *(BEAM_FORMS if trial.lamp else ())]
        )
        out["delta_other"] = float(np.sqrt(max(other.chi2(truth.hidden, values), 0.0)))
    return out


class Fits:
    """Fits of hidden effects to noise-free readings."""

    def __init__(
        self, scene: Scene, readings: Readings, clean: Array, sigma: Array, names: Sequence[str]
    ) -> None:
        table = [effects.get(name) for name in names]
        shines = scene.reflects or scene.water.scattering_per_m > 0
        diffuse = response_for if shines or any(effect.diffuse for effect in table) else None
        exact = replace(readings, value=clean, stderr=sigma)
        forward = SceneForward(scene, exact, diffuse)
        untraced = None if diffuse else Hindrance(Hinders.NOT_TRACED)
        self.problem: Problem = problem_of(forward, exact, table, untraced)[0]
        # Beside a lamp that nobody knows: what its curve could do instead is not visible.
        self._beside = [c for c in self.problem.curves if c.name == "beam_profile"][-1:]
        visit = layout_of(readings).visit
        together = (visit[:, None] == visit[None]) & (np.bincount(visit)[visit] > 1)[:, None]
        gain = PLANE_GAIN_PERCENT / 100
        covariance = np.diag(sigma**2) + gain**2 * np.outer(clean, clean) * together
        self._inverse = np.linalg.inv(np.linalg.cholesky(covariance))
        self.base = self.problem.fit((), self.whiten, [self.problem.model().start])

    def whiten(self, columns: Array) -> Array:
        return np.asarray(self._inverse @ columns)

    def chi2(self, names: Sequence[str], values: dict[str, Any]) -> float:
        """Of the best fit of some effects, which begins at their true values."""
        chosen = (*(self._form(name, values) for name in names), *self._beside)
        model = self.problem.model(chosen)
        start = [p.coordinate_of(values[p.path]) if p.path in values else p.start for p in model.parameters]
        far = np.clip(np.array(start), model.low, model.high)
        near = far.copy()
        near[: len(self.base.u)] = self.base.u
        return self.problem.fit(chosen, self.whiten, [near, far]).chi2

    def _form(self, name: str, values: dict[str, Any]) -> Candidate:
        curves = [c for c in self.problem.curves if c.name == name]
        if curves:  # hidden as a curve: the form with most functions
            return curves[-1]
        mine = [c for c in self.problem.candidates if c.name == name]
        return next((c for c in mine if all(p.path in values for p in c.parameters)), mine[0])
