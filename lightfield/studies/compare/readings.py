"""Readings against the model: refit, a report with named reasons for missing errors, and where it fails."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from lightfield.arrays import Array
from lightfield.diagnosis import ledger
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.diagnosis.problem.setup import TRACES, budget_of, problem_of, remembered, source_of, spectral
from lightfield.diagnosis.search.preparation import bench, prepare
from lightfield.diagnosis.verdict.calibration import by_shape
from lightfield.diagnosis.verdict.compose import estimates, units_of
from lightfield.diagnosis.verdict.ladder import bright, held_out, percent
from lightfield.diagnosis.verdict.parts import Estimate
from lightfield.diagnosis.verdict.plausibility import hints
from lightfield.errors import UsageError
from lightfield.fitting import effects
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.least_squares import Fit, Whiten
from lightfield.fitting.light_source import DiffuseSource
from lightfield.scene import Scene

#: Correlations below this are not printed.
_WORTH_PRINTING = 0.3


@dataclass(frozen=True)
class Where:
    """Misfit of one group of readings."""

    label: str
    readings: int
    mean_percent: float
    rms_percent: float
    mean_sigma: float
    rms_sigma: float


@dataclass(frozen=True)
class FitReport:
    """A refit of the model to readings, and where it fails.

    Parameters
    ----------
    chi2_per_dof : float
        In units of the quoted errors and the error budget.
    residual_percent, residual_sigma : array, shape (n,)
    where : dict of lists of Where
        By plane, radius, wavelength and time, as far as the readings have them.
    """

    forward: SceneForward
    problem: Problem
    explanation: Explanation
    fit: Fit
    estimates: dict[str, Estimate]
    correlations: list[tuple[str, str, float]]
    chi2: float
    dof: int
    adequacy_p: float
    error_percent: float
    held_out_percent: float
    residual_percent: Array
    residual_sigma: Array
    where: dict[str, list[Where]]
    solver: str
    notes: list[str]

    @property
    def chi2_per_dof(self) -> float:
        return self.chi2 / self.dof

    @property
    def scene(self) -> Scene:
        """The fitted scene."""
        return self.forward.scene_at(self.fit.values)

    @property
    def effects(self) -> list[str]:
        return [c.name for c in self.explanation]

    def save(self, folder: str | Path, command: str = "compare") -> Path:
        """Store the fitted scene as a rung and add it to the folder's ledger.

        Returns
        -------
        Path
            The stored scene.
        """
        target = Path(folder)
        known = ledger.fingerprint(self.forward.readings)
        number = len(list(target.glob("rung*.toml"))) if target.is_dir() else 0
        while (target / f"rung{number}.toml").exists():
            number += 1
        path = target / f"rung{number}.toml"
        self.scene.save(path)
        row = {
            "label": "+ " + " + ".join(self.effects) if self.effects else "base",
            "effects": self.effects,
            "error_percent": self.error_percent,
            "chi2_per_dof": self.chi2_per_dof,
            "scene": path.name,
        }
        ledger.append(target, [row], command, known)
        return path


def _groups(problem: Problem) -> dict[str, list[tuple[str, Any]]]:
    layout = problem.layout
    out: dict[str, list[tuple[str, Any]]] = {}
    planes = sorted(set(zip(layout.air, np.round(layout.z_m, 3), strict=True)))
    mixed = bool(layout.air.any() and not layout.air.all())
    out["plane"] = [
        (
            f"z = {z:g} m" + ((" air" if air else " water") if mixed else ""),
            (np.round(layout.z_m, 3) == z) & (layout.air == air),
        )
        for air, z in planes
    ]
    radius = np.hypot(layout.x_m, layout.y_m)
    if np.ptp(radius) > 1e-6:
        edges = np.unique(np.quantile(radius, np.linspace(0, 1, 6)))
        out["radius"] = [
            (f"r = {a:.2f} to {b:.2f} m", (radius >= a) & ((radius < b) | (b == edges[-1]) & (radius <= b)))
            for a, b in pairwise(edges)
        ]
    if layout.channel.max() > 0:
        out["wavelength"] = [
            (f"{w:g} nm", layout.wavelength_nm == w) for w in np.unique(layout.wavelength_nm)
        ]
    if layout.has_time:
        minutes = (layout.time_s - layout.time_s.min()) / 60
        edges = np.linspace(0, float(minutes.max()), 6)
        out["time"] = [
            (f"t = {a:.0f} to {b:.0f} min", (minutes >= a) & ((minutes < b) | (b == edges[-1])))
            for a, b in pairwise(edges)
        ]
    return out


def _where(problem: Problem, per_cent: Array, in_sigma: Array) -> dict[str, list[Where]]:
    counted = bright(problem)
    out: dict[str, list[Where]] = {}
    for name, groups in _groups(problem).items():
        rows = []
        for label, members in groups:
            kept, lit = members & (problem.keep > 0), members & counted
            if not kept.any():
                continue
            s = in_sigma[kept]
            p = per_cent[lit] if lit.any() else np.array([np.nan])
            rows.append(
                Where(
                    label,
                    int(kept.sum()),
                    float(p.mean()),
                    float(np.sqrt((p**2).mean())),
                    float(s.sum() / np.sqrt(len(s))),
                    float(np.sqrt((s**2).mean())),
                )
            )
        if len(rows) > 1:
            out[name] = rows
    return out


def _correlations(fit: Fit) -> list[tuple[str, str, float]]:
    covariance = fit.covariance()
    sigma = np.sqrt(np.diag(covariance))
    out = []
    for i, one in enumerate(fit.paths):
        for j in range(i + 1, len(fit.paths)):
            value = covariance[i, j] / (sigma[i] * sigma[j])
            if np.isfinite(value) and abs(value) > _WORTH_PRINTING:
                out.append((one, fit.paths[j], float(value)))
    return sorted(out, key=lambda c: -abs(c[2]))


def _chosen(problem: Problem, names: Sequence[str], untestable: dict[str, str]) -> Explanation:
    """One form per named effect; "effect:form" picks a form other than the first."""
    out: list[Candidate] = []
    for name in names:
        effect, form = effects.get_form(name)
        if effect.name in untestable:
            raise UsageError(
                "this effect cannot be fitted here", where=f"--with {name}", found=untestable[effect.name],
                remedy="leave it out, or measure what it needs",
            )  # fmt: skip
        forms = [
            c
            for c in problem.candidates
            if c.name == effect.name and (c.form.name == form.name or ":" not in name)
        ]
        if not forms:
            raise UsageError(
                "this form of the effect cannot be fitted here", where=f"--with {name}",
                remedy="leave the form out, or measure what it needs",
            )  # fmt: skip
        for other in out:
            if not forms[0].effect.combines_with(other.effect):
                raise UsageError(
                    "these effects cannot be fitted together",
                    where="--with",
                    found=f"{other.name}, {effect.name}",
                    rule="each effect once, and what is known for direct light alone not with diffuse light",
                    remedy="leave one of them out",
                )
        out.append(forms[0])
    return tuple(out)


def fit_readings(
    readings: Any,
    scene: Scene,
    with_effects: Sequence[str] = (),
    *,
    solver: str = "analytic",
    diffuse: DiffuseSource | str | None = None,
    seed: int = 0,
    tracing: Mapping[str, Any] | None = None,
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
    seed : int
        Of the bootstrap.
    tracing : mapping, optional
        rel_error, max_photons and seed of the renders, see `lightfield.render.at_readings.rendered_light`.

    Raises
    ------
    UsageError
        Unknown effect or solver, or an effect that these readings cannot show.
    """
    if solver not in ("analytic", "render"):
        raise UsageError("unknown solver", found=solver, rule="analytic or render")
    with threadpool_limits(1, "blas"):
        return _fit_readings(readings, scene, with_effects, solver, diffuse, seed, tracing or {})


def _fit_readings(
    readings: Any,
    scene: Scene,
    with_effects: Sequence[str],
    solver: str,
    diffuse: DiffuseSource | str | None,
    seed: int,
    tracing: Mapping[str, Any],
) -> FitReport:
    readings = readings.check_against(scene)
    source, reason = source_of(scene, diffuse, readings)
    scene = spectral(scene, readings)
    budget, quoted = budget_of(readings), np.asarray(readings.stderr, float)
    source, dense = remembered(source), None
    for _ in range(TRACES):
        forward = SceneForward(scene, readings, source, dense_per_m=dense)
        problem, untestable = problem_of(forward, readings, list(effects.table().values()), reason)
        explanation = _chosen(problem, with_effects, untestable)
        if not any(c.effect.instead_of for c in explanation):
            problem = by_shape(problem)
        rng = np.random.default_rng(seed)
        prepared = prepare(problem, quoted, budget, rng)
        made = bench(prepared, 0.0, rng)
        problem = prepared.problem
        base = problem.fit((), made.whiten, [problem.model().start])
        fit = _best(problem, explanation, made.whiten, base.u)
        dense = forward.light.to_trace([fit.values]) or prepared.to_trace_per_m
        if dense is None:
            break
    noted = [*hints(forward, problem, fit, budget.calibration), *readings.warnings]
    notes = [f"assumed: {a}" for a in budget.assumed] + [f"warning: {w}" for w in noted]
    for _ in range(2 if solver == "render" else 0):
        from lightfield.render.at_readings import rendered_light  # loads the renderer

        light, error = rendered_light(forward.scene_at(fit.values), readings, **tracing)
        forward = forward.corrected(light, error, fit.values)
        problem = replace(problem, forward=forward)
        fit = problem.fit(explanation, made.whiten, [fit.u], tolerance=1e-6)
    adequacy = made.test.on(problem)(fit)
    sigma = np.sqrt(prepared.noise.variance(1.0, 0.0))
    difference = problem.value - fit.prediction
    per_cent = 100 * difference / fit.prediction
    in_sigma = np.where(problem.keep > 0, difference / sigma, 0.0)
    kept = int(problem.keep.sum())
    return FitReport(
        forward,
        problem,
        explanation,
        fit,
        estimates(fit, adequacy.phi, units_of(scene)),
        _correlations(fit),
        fit.chi2 * made.phi,
        max(kept - len(fit.u), 1),
        adequacy.p,
        percent(problem, fit.prediction, bright(problem)),
        held_out(problem, explanation, fit, made.whiten),
        per_cent,
        in_sigma,
        _where(problem, per_cent, in_sigma),
        solver,
        notes,
    )


def _best(problem: Problem, explanation: Explanation, whiten: Whiten, base: Array) -> Fit:
    starts = [base]
    if explanation:
        starts = [problem.default_start(base, explanation, size) for size in (1.0, 10.0, -3.0)]
    return problem.fit(explanation, whiten, starts, tolerance=1e-6)
