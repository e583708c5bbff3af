"""Readings against the model: refit, a report with named reasons for missing errors, and where it fails."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from lightfield.arrays import Array
from lightfield.diagnosis import ledger
from lightfield.diagnosis.problem.assumed import Assumed
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.noise import Budget
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.diagnosis.problem.setup import budget_of, problem_of, source_of, spectral
from lightfield.diagnosis.problem.untestable import Untestable, in_words
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.better_light.settling import settle
from lightfield.diagnosis.search.followed import can_follow, scatters
from lightfield.diagnosis.search.preparation import Bench, bench, judged, prepare_problem
from lightfield.diagnosis.verdict.best_set.scattered_too import by_hand
from lightfield.diagnosis.verdict.calibration import by_shape
from lightfield.diagnosis.verdict.cautions.caution import Caution, Warns
from lightfield.diagnosis.verdict.cautions.plausibility import hints
from lightfield.diagnosis.verdict.estimates import estimates, units_in
from lightfield.diagnosis.verdict.ladder import bright, held_out, percent, rms_over
from lightfield.diagnosis.verdict.parts import Estimate
from lightfield.errors import UsageError
from lightfield.fitting import effects
from lightfield.fitting.diffuse_light import DiffuseSource
from lightfield.fitting.fitted_curves import save_lamp, save_spectrum
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.least_squares import Fit, Whiten
from lightfield.fitting.light_source import without_unknown
from lightfield.fitting.retraced import Retraced
from lightfield.readings import Readings
from lightfield.render.at_readings import rendered_light
from lightfield.render.settings import Tracing
from lightfield.scene import Scene
from lightfield.studies.compare.residuals import Residuals
from lightfield.studies.defaults import SOLVER

#: Correlations below this are not printed.
_WORTH_PRINTING = 0.3


@dataclass(frozen=True)
class Refit:
    """A fit, with the problem that it solves and the effects that it sets free.

    Parameters
    ----------
    errors : mapping
        Least errors by path, of light that is itself uncertain, for noise as it is whitened.
    """

    problem: Problem
    explanation: Explanation
    fit: Fit
    errors: Mapping[str, float] = field(default_factory=dict)

    @property
    def forward(self) -> SceneForward:
        """Predicts the readings."""
        return self.problem.forward

    @property
    def scene(self) -> Scene:
        """The fitted scene."""
        return self.forward.scenes.at(self.fit.values)

    @property
    def effects(self) -> list[str]:
        """Names of the effects."""
        return [c.name for c in self.explanation]

    def corrected(self, whiten: Whiten, tracing: Tracing) -> Refit:
        """Fitted again with light that equals a fresh render of the fitted scene."""
        light, error = rendered_light(self.scene, self.forward.readings, **tracing)
        forward = self.forward.with_light(self.forward.light.corrected(light, error, self.fit.values))
        problem = replace(self.problem, forward=forward)
        fit = problem.fit(self.explanation, whiten, [self.fit.u], tolerance=1e-6)
        before = self.fit.values
        moved = {path: float(np.hypot(e, fit.values[path] - before[path])) for path, e in self.errors.items()}
        return Refit(problem, self.explanation, fit, moved)


@dataclass(frozen=True)
class Statistics:
    """How well a fit follows the readings.

    Parameters
    ----------
    chi2 : float
        In units of the quoted errors and the error budget.
    dof : int
        Readings that count, less free parameters.
    adequacy_p : float
        Probability of so large a misfit by chance if nothing is missing.
    error_percent, held_out_percent : float
        Root mean square of the bright readings; the same for each plane from the others. NaN: the model is
        dark, or there is one plane.
    noise_floor_percent : float
        Where the error would be if only noise were left; NaN where the model is dark.
    base_chi2_per_dof : float
        Of the model without the named effects, by the noise of this fit: that of a fit of its own is in units
        of the noise that is judged there.
    """

    chi2: float
    dof: int
    adequacy_p: float
    error_percent: float
    held_out_percent: float
    noise_floor_percent: float
    base_chi2_per_dof: float

    @property
    def chi2_per_dof(self) -> float:
        return self.chi2 / self.dof


@dataclass(frozen=True)
class FitReport:
    """A refit of the model to readings, and where it fails.

    `base_prediction`, shape (n,), is that of the model without the named effects; `sigma` are the errors.
    """

    model: Refit
    solver: str
    estimates: dict[str, Estimate]
    statistics: Statistics
    residuals: Residuals
    assumed: tuple[Assumed, ...]
    cautions: list[Caution]
    base_prediction: Array
    sigma: Array

    @property
    def notes(self) -> list[str]:
        """What was assumed, and what to be warned of, in words."""
        return [f"assumed: {a}" for a in self.assumed] + [f"warning: {c.sentence}" for c in self.cautions]

    def save(self, folder: str | Path, command: str = "compare") -> Path:
        """Store the fitted scene as a rung and add it to the folder's ledger.

        Returns
        -------
        Path
            The stored scene.
        """
        target = Path(folder)
        known = ledger.readings_hash(self.model.forward.readings)
        number = len(list(target.glob("rung*.toml"))) if target.is_dir() else 0
        while (target / f"rung{number}.toml").exists():
            number += 1
        path = target / f"rung{number}.toml"
        self.model.scene.save(path)
        save_lamp(self.model.forward, self.model.fit, target)
        save_spectrum(self.model.forward, self.model.fit, target)
        row = {
            "label": "+ " + " + ".join(self.model.effects) if self.model.effects else "base",
            "effects": self.model.effects,
            "error_percent": self.statistics.error_percent,
            "chi2_per_dof": self.statistics.chi2_per_dof,
            "base_chi2_per_dof": self.statistics.base_chi2_per_dof,
            "held_out_percent": self.statistics.held_out_percent,
            "scene": path.name,
        }
        ledger.add_rungs(target, [row], command, known)
        return path


def correlations(fit: Fit) -> list[tuple[str, str, float]]:
    """Pairs of parameters whose fitted values hang together, the strongest first."""
    covariance = fit.covariance()
    sigma = np.sqrt(np.diag(covariance))
    out = []
    for i, j in combinations(range(len(fit.paths)), 2):
        value = covariance[i, j] / (sigma[i] * sigma[j])
        if np.isfinite(value) and abs(value) > _WORTH_PRINTING:
            out.append((fit.paths[i], fit.paths[j], float(value)))
    return sorted(out, key=lambda c: -abs(c[2]))


def _chosen(problem: Problem, names: Sequence[str], untestable: Untestable) -> Explanation:
    """One form per named effect; "effect:form" picks a form other than the first."""
    out: list[Candidate] = []
    for name in names:
        effect, form = effects.get_form(name, problem.forward.scene)
        if effect.name in untestable:
            raise UsageError(
                "this effect cannot be fitted here", where=name, found=in_words(untestable[effect.name]),
                remedy="leave it out, or measure what it needs",
            )  # fmt: skip
        forms = [
            c
            for c in (*problem.candidates, *problem.curves)
            if c.name == effect.name and (c.form.name == form.name or ":" not in name)
        ]
        if not forms:
            raise UsageError(
                "this form of the effect cannot be fitted here", where=name,
                remedy="leave the form out, or measure what it needs",
            )  # fmt: skip
        # Of a curve that which can follow most; else the usual form.
        one = forms[-1] if effect.is_free_form else forms[0]
        for other in out:
            if not one.effect.combines_with(other.effect):
                raise UsageError(
                    "these effects cannot be fitted together",
                    found=f"{other.name}, {effect.name}",
                    rule=effects.TOGETHER,
                    remedy="leave one of them out",
                )
        out.append(one)
    return tuple(out)


def fit_readings(
    readings: Readings,
    scene: Scene,
    with_effects: Sequence[str] = (),
    *,
    solver: str = SOLVER,
    diffuse: DiffuseSource | str | None = None,
    tracing: Tracing | None = None,
) -> FitReport:
    """Refit gain, beam width, absorption and the named effects, and say where the model fails.

    Parameters
    ----------
    readings : Readings
    scene : Scene
    with_effects : sequence of str
        Effects to set free, "name" or "name:form".
    solver : "analytic" or "render"
        The render corrects the fast model by a fresh trace of the fitted scene, twice.
    diffuse : "trace", None or callable
        Source of scattered and reflected light, as `diagnose` takes it. Also what is not set free helps to
        tell noise from misfit.
    tracing : mapping, optional
        rel_error, max_photons and seed of the renders, see `lightfield.render.at_readings.rendered_light`.

    Raises
    ------
    UsageError
        Unknown effect or solver, or an effect that these readings cannot show.
    """
    if solver not in ("analytic", "render"):
        raise UsageError("unknown solver", found=solver, rule="analytic or render")
    readings = without_unknown(readings.check_against(scene), scene)
    with threadpool_limits(1, "blas"):
        budget = budget_of(readings)
        model, made, base = _refit(readings, scene, with_effects, diffuse, budget)
        cautions = hints(model.forward, model.problem, model.fit, budget.calibration)
        cautions += [Caution.of_table(w) for w in readings.warnings]
        for _ in range(2 if solver == "render" else 0):
            model = model.corrected(made.whiten, tracing or {})
        problem, fit = model.problem, model.fit
        if not fit.converged:
            cautions.append(_not_converged(fit))
        adequacy = made.test.on(problem)(fit)
        least = {path: float(np.sqrt(adequacy.phi) * error) for path, error in model.errors.items()}
        sigma, lit = np.sqrt(made.whiten.noise.variance(1.0, 0.0)), bright(problem)
        return FitReport(
            model,
            solver,
            estimates(fit, adequacy.phi, units_in(model.forward), least),
            Statistics(
                fit.chi2 * made.phi,
                max(int(problem.keep.sum()) - len(fit.u), 1),
                adequacy.p,
                percent(problem, fit.prediction, lit),
                held_out(problem, model.explanation, fit, made.whiten),
                rms_over(sigma[lit], fit.prediction[lit]),
                _base_chi2_per_dof(problem, base, made),
            ),
            Residuals.of(problem, fit.prediction, sigma),
            budget.assumed,
            cautions,
            base,
            sigma,
        )


def _base_chi2_per_dof(problem: Problem, prediction: Array, made: Bench) -> float:
    residual = made.whiten(problem.keep * (problem.value - prediction))
    model = problem.model()
    free = int((model.high > model.low).sum())
    return float(residual @ residual) * made.phi / max(int(problem.keep.sum()) - free, 1)


def _not_converged(fit: Fit) -> Caution:
    """What a fit that was stopped still had to go."""
    gain, step = fit.to_go()
    most = int(np.argmax(np.abs(step)))
    told = {"gain": gain, "sigma": float(np.abs(step[most]))}
    return Caution(warns=Warns.NOT_CONVERGED, about=fit.paths[most], values=told)


def _refit(
    readings: Readings,
    scene: Scene,
    with_effects: Sequence[str],
    diffuse: DiffuseSource | str | None,
    budget: Budget,
) -> tuple[Refit, Bench, Array]:
    """Fit with the fast model, traced in the water that the fit ends in; scattered light until it settles."""
    source, reason = source_of(scene, diffuse, readings)
    quoted = np.asarray(readings.stderr, float)
    traces = Retraced(spectral(scene, readings), readings, source)
    every = [*effects.all_of(scene).values(), *effects.curves().values()]
    for forward in traces:
        problem, untestable = problem_of(forward, readings, every, reason)
        explanation = _chosen(problem, with_effects, untestable)
        if not any(c.effect.instead_of for c in explanation):
            problem = by_shape(problem)
        rng = np.random.default_rng(0)
        prepared = prepare_problem(problem, quoted, budget, rng)
        made = bench(prepared, 0.0, rng)
        problem = prepared.problem
        base = problem.fit((), made.whiten, [problem.model().start])
        starts = problem.starts(base.u, explanation, made.whiten) if explanation else [base.u]
        fit = problem.fit(explanation, made.whiten, starts, tolerance=1e-6)
        traces.asked = forward.light.to_trace([fit.values]) or prepared.to_trace_per_m
    if can_follow(problem) and scatters(problem, fit):
        there = settle(problem, explanation, fit, made.whiten)
        problem, fit = there.problem, there.fit
        test = judged(replace(prepared, problem=problem), there.whiten, rng)
        made = replace(made, whiten=there.whiten, test=test)
    assert isinstance(made.whiten, Whitener)
    errors: Mapping[str, float] = {}
    if (told := by_hand(problem, explanation, fit, made.whiten)) is not None:
        problem, fit, errors = told.problem, told.fit, told.errors
        test = judged(replace(prepared, problem=problem), told.whiten, rng)
        made = replace(made, whiten=told.whiten, test=test)
    without = base if explanation else fit
    return Refit(problem, explanation, fit, errors), made, without.prediction
