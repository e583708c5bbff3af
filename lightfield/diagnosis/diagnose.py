"""Which physical effect is missing? Readings and a scene in; a verdict, a ladder and advice out."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from lightfield.arrays import Array, finite
from lightfield.diagnosis import ledger
from lightfield.diagnosis.adequacy.level import ALPHA
from lightfield.diagnosis.certainty import Certainty
from lightfield.diagnosis.clearer_light import by_clearer_light
from lightfield.diagnosis.course import course
from lightfield.diagnosis.knowledge import Inquiry
from lightfield.diagnosis.other_lamp import by_another_lamp
from lightfield.diagnosis.problem.setup import source_of, spectral, with_usual_errors
from lightfield.diagnosis.search.cascade import SearchResult
from lightfield.diagnosis.search.preparation import Prepared
from lightfield.diagnosis.verdict import calibration, compose
from lightfield.diagnosis.verdict.best_set.so_far import SoFar
from lightfield.diagnosis.verdict.cautions.caution import Caution, Warns
from lightfield.diagnosis.verdict.ladder import Step, bright, climb, percent, rms_over
from lightfield.diagnosis.verdict.parts import Doubt, DoubtReason, Kind
from lightfield.diagnosis.verdict.rest.left_over import ranked
from lightfield.diagnosis.verdict.speech import exactly
from lightfield.diagnosis.verdict.terminal import as_text
from lightfield.diagnosis.verdict.trust import noise_floor, standard_errors
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.fitting import effects
from lightfield.fitting.diffuse_light import DiffuseSource
from lightfield.fitting.effects import Effect
from lightfield.fitting.effects.local import as_file, local_unknowns
from lightfield.fitting.fitted_curves import (
    LAMP_TABLE,
    SPECTRUM_TABLE,
    fitted_curves,
    save_lamp,
    save_spectrum,
)
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.least_squares import Fit
from lightfield.fitting.light_source import without_unknown
from lightfield.memory import give_back
from lightfield.readings import Readings
from lightfield.render.at_readings import rendered_light
from lightfield.render.limits import AT_READINGS
from lightfield.scene import Scene
from lightfield.storage.files import write_text

#: Effects of the user's own to begin with, where those of the table explain nothing.
HYPOTHESES = "hypotheses.toml"
#: The verdict, there too.
VERDICT = "verdict.json"
#: Fitted curves with their errors.
CURVES = "curves.json"
#: What a diagnosis leaves in a folder, beside its verdict.
_NAMES = ("rung*.toml", CURVES, HYPOTHESES, LAMP_TABLE, SPECTRUM_TABLE)
#: Photons of the fresh render that ends a ladder, and at most where its error is more than a part of the
#: readings': it could not object. Readings that mirror each other share them. Chosen: time against precision.
FRESH_PHOTONS, MOST_FRESH_PHOTONS, _PRECISE = 1.5e6, 1.2e7, 0.5
#: A fresh render whose error is larger than this many times what is expected contradicts the fit. Chosen; two
#: independent errors may add up to more by chance, by so many standard deviations of that.
_CONFIRMED, _CHANCE_SIGMA = 1.15, 3
#: No render is asked to be better than this, relatively. Chosen.
_FINEST = 1e-4


@dataclass(frozen=True)
class Diagnosis:
    """A verdict and everything it rests on.

    Parameters
    ----------
    verdict : Verdict
        Plain data, as written to JSON.
    basis : VerdictBasis
        What the data were made of.
    older : tuple of str
        Files of earlier runs in the folder in which it was saved, that are none of its own.
    """

    verdict: Verdict
    basis: compose.VerdictBasis
    older: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"<Diagnosis of {self.verdict.readings} readings: {self.verdict.headline}>"

    @property
    def forward(self) -> SceneForward:
        return self.basis.forward

    @property
    def readings(self) -> Readings:
        return self.basis.readings

    @property
    def prepared(self) -> Prepared:
        return self.basis.prepared

    @property
    def finding(self) -> SearchResult:
        return self.basis.finding

    @property
    def steps(self) -> list[Step]:
        """The ladder with its fits."""
        return self.basis.steps

    @property
    def scene(self) -> Scene:
        """The fitted scene of the last rung."""
        return self.forward.scenes.at(self.steps[-1].fit.values)

    @cached_property
    def widest(self) -> Fit:
        """The fit of the last rung with the largest forms of its curves."""
        last = self.steps[-1]
        return self.prepared.problem.with_largest_forms(last.explanation, last.fit, self.finding.whiten)

    @cached_property
    def sigma(self) -> Array:
        """Standard error of every reading as the diagnosis used it, shape (n,)."""
        return standard_errors(self.prepared, self.finding)

    def rendered(self, max_photons: float = MOST_FRESH_PHOTONS) -> Diagnosis:
        """Render the last rung afresh, in full, and add its error to the ladder: physics, not curve fitting.

        A render that contradicts the fit takes back what the fit said.

        Parameters
        ----------
        max_photons : float
            Photon budget of a trace.
        """
        problem, verdict = self.prepared.problem, self.verdict
        photons, precision, floor = (
            min(FRESH_PHOTONS, max_photons),
            AT_READINGS.rel_error,
            self._floor_percent,
        )
        light, error = self._rendered(photons, precision, 1)
        fresh, stderr = self._off_percent(light, error)
        if stderr > _PRECISE * floor > 0 and photons < max_photons:
            # What it lacks is traced with other random numbers, and both count by their photons.
            more = (stderr / (_PRECISE * floor)) ** 2 - 1
            photons = min(more * photons, max_photons - photons)
            other, its = self._rendered(photons, max(precision / np.sqrt(1 + more), _FINEST), 2)
            share = 1 / (1 + (self._off_percent(other, its)[1] / stderr) ** 2)
            light, error = (1 - share) * light + share * other, np.hypot((1 - share) * error, share * its)
            fresh, stderr = self._off_percent(light, error)
        counted = bright(problem)
        last = verdict.ladder[-1].model_copy(
            update={"rendered_error_percent": finite(fresh), "rendered_stderr_percent": finite(stderr)}
        )
        update: dict[str, object] = {"ladder": [*verdict.ladder[:-1], last]}
        fitted = np.nan if last.error_percent is None else last.error_percent
        both, n = np.hypot(fitted, stderr), int(counted.sum())
        chance = _CHANCE_SIGMA * fitted * stderr / (np.sqrt(n) * both**2)
        if fresh > (_CONFIRMED + chance) * both:
            doubt = Doubt(
                reason=DoubtReason.NOT_CONFIRMED, named=verdict.effects,
                fitted_percent=fitted, rendered_percent=fresh,
            )  # fmt: skip
            told = {"fitted_percent": fitted, "rendered_percent": fresh}
            update["cautions"] = [*verdict.cautions, Caution(warns=Warns.NOT_CONFIRMED, values=told)]
            if verdict.verdict != Kind.UNEXPLAINED:
                found = [one.model_copy(update={"level": Certainty.ONE_OF}) for one in verdict.found]
                update |= {
                    "verdict": Kind.UNEXPLAINED,
                    "effects": [],
                    "reason_to_doubt": doubt,
                    "found": found,
                }
        return replace(self, verdict=verdict.model_copy(update=update))

    @property
    def _floor_percent(self) -> float:
        """What the readings' own errors leave of any explanation, as the ladder counts."""
        counted = bright(self.prepared.problem)
        value = self.prepared.problem.value[counted]
        return rms_over(noise_floor(self.prepared, self.finding)[counted], value)

    def _rendered(self, photons: float, precision: float, seed: int) -> tuple[Array, Array]:
        """Light of a fresh render of the last rung, and its error, both of shape (n,)."""
        return rendered_light(
            self.scene, self.readings, seed=seed, rel_error=precision, max_photons=photons, symmetry=True
        )

    def _off_percent(self, light: Array, error: Array) -> tuple[float, float]:
        """Error of a fresh render of the last rung against the readings, and its own, in per cent."""
        problem, values = self.prepared.problem, self.steps[-1].fit.values
        model, up = self.forward.reader.read(light, values), self.forward.reader.read(light + error, values)
        counted = bright(problem)
        return percent(problem, model, counted), rms_over((up - model)[counted], model[counted])

    def as_text(self) -> str:
        """The verdict for people, several lines."""
        return as_text(self.verdict)

    def save(
        self, folder: str | Path, command: str = "diagnose", effects_file: str | Path | None = None
    ) -> Diagnosis:
        """Write verdict.json and one scene per rung, and add the run to the folder's ledger.

        What was fitted has its error in a comment beside it. Curves of the last rung are written with theirs,
        a beam profile as a lamp table too, for other scenes with this lamp; and where nothing explains the
        readings, effects of one's own to begin with.

        Parameters
        ----------
        folder : path-like
        command : str
            What the ledger calls this run.
        effects_file : path-like, optional
            Effects of the user's own that were read: they are not written over.

        Returns
        -------
        Diagnosis
            The same, with its number in the ledger, and `older`.
        """
        target = Path(folder)
        rows, before = [], {file.name for name in _NAMES for file in target.glob(name)}
        known = ledger.readings_hash(self.readings)
        number = ledger.runs(target, known) + 1
        verdict = self.verdict.model_copy(update={"run": number})
        for k, (rung, step) in enumerate(zip(verdict.ladder, self.steps, strict=True)):
            name = f"rung{k}.toml"
            notes = {path: f"fitted: {exactly(one)}" for path, one in rung.parameters.items()}
            self.forward.scenes.at(step.fit.values).save(target / name, notes)
            before.discard(name)
            rows.append(
                rung.model_dump(include={"label", "effects", "error_percent", "chi2_per_dof"})
                | {"scene": name}
            )
        last = self.steps[-1].fit
        lamp = save_lamp(self.forward, last, target, self.finding.level.phi, self.widest)
        spectrum = save_spectrum(self.forward, last, target)
        before -= {table.name for table in (lamp, spectrum) if table}
        if curves := fitted_curves(self.forward, last, self.finding.level.phi, self.widest):
            data = [curve.as_data() for curve in curves]
            write_text(target / CURVES, json.dumps(data, indent=2) + "\n")
            before.discard(CURVES)
        read = effects_file is not None and Path(effects_file).resolve() == (target / HYPOTHESES).resolve()
        if verdict.verdict == Kind.UNEXPLAINED and not read:
            write_text(target / HYPOTHESES, as_file(ranked(local_unknowns(self.readings), verdict.left_over)))
        if verdict.verdict == Kind.UNEXPLAINED or read:
            before.discard(HYPOTHESES)
        write_text(target / VERDICT, verdict.model_dump_json(indent=2) + "\n")
        ledger.add_rungs(target, rows, command, known)
        return replace(self, verdict=verdict, older=tuple(sorted(before)))


def diagnose(
    readings: Readings,
    scene: Scene,
    *,
    diffuse: DiffuseSource | str | None = "trace",
    only: Sequence[str] | None = None,
    alpha: float = ALPHA,
    seed: int = 0,
    advise: bool = True,
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Find the smallest sets of physical effects beside which nothing is missing in the model.

    Parameters
    ----------
    readings : Readings
        A reading table.
    scene : Scene
        What the experimenter believes. Gain, beam half-width and absorption are refitted; an effect that the
        scene already switches on stays on.
    diffuse : "trace", None or callable
        Where scattered and reflected light comes from: traced by the renderer and kept in its cache, not at
        all (then scattering, walls and surface cannot be tested), or a function that takes what
        `render.diffuse.response_for` does: a scene, three arrays of positions, `share`, `dense_per_m`.
    only : sequence of str, optional
        Names of the effects to consider; default: the whole table.
    alpha : float
        Family-wise false-alarm probability of the test of the base model.
    seed : int
        Of the bootstrap, and of the traces that scattered light is settled with.
    advise : bool
        Work out held-out errors and the next measurement.
    progress : callable, optional
        Told what begins, and how far the search is: many readings take a while. A `SoFar` keeps the best set
        of effects, should the diagnosis be stopped.

    Raises
    ------
    FitError
        Too few readings, or too many for one diagnosis.
    MeasurementError
        Readings that do not belong to this scene.
    UsageError
        Unknown effect.
    """
    readings = with_usual_errors(readings.check_against(scene))
    source, reason = source_of(scene, diffuse, readings)
    scene = spectral(scene, readings)
    readings = without_unknown(readings, scene)
    every = effects.all_of(scene)
    chosen: list[Effect] = (
        [effects.get(name, scene) for name in only]
        if only is not None
        else [*every.values(), *effects.curves().values()]
    )
    so_far, traced = _following(progress), diffuse == "trace"
    inquiry = Inquiry(readings, scene, source, reason, chosen, traced, alpha, seed, so_far, only or ())
    # On many small matrices more BLAS threads only get in each other's way.
    with threadpool_limits(1, "blas"):
        return _diagnose(inquiry, advise)


def _following(progress: Callable[[str], None] | None) -> SoFar:
    if isinstance(progress, SoFar):
        return progress
    return SoFar() if progress is None else SoFar(progress)


def _diagnose(inquiry: Inquiry, advise: bool) -> Diagnosis:
    progress = inquiry.progress
    inquiry, outcome = by_clearer_light(inquiry, course(inquiry))
    outcome, lamp_instead = by_another_lamp(inquiry, outcome)
    known, prepared, finding = outcome.known, outcome.known.prepared, outcome.known.finding
    best = finding.closest
    starts = [finding.level.base, *([best.fit] if best else [])]
    progress("errors of planes held out")
    explanation, phi = best.explanation if best else (), finding.level.bench.phi * prepared.excess
    sigma = noise_floor(prepared, finding)
    steps = climb(prepared.problem, explanation, finding.whiten, starts, phi, sigma, advise)
    progress("rivals, limits and advice")
    lamp = calibration.judged_power(prepared, known.problem, finding)
    basis = compose.VerdictBasis(
        known.problem.forward, inquiry.readings, prepared, finding, steps, known.untestable, outcome.trust,
        lamp, inquiry.seed, outcome.also, lamp_instead,
    )  # fmt: skip
    verdict = compose.verdict_of(basis, advise).model_copy(update={"asked": list(inquiry.asked)})
    give_back()
    return Diagnosis(verdict, basis)
