"""One set: read from the full render, diagnosed as a user would, and set beside what was hidden."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.hidden_effects.benches import believed_scene, bench_named, table_of, true_scene
from benchmarks.hidden_effects.experiment import BRIGHT
from benchmarks.hidden_effects.lights import light_of, scene_of
from benchmarks.many_effects.catalogue import Trial
from benchmarks.many_effects.visible import deltas
from benchmarks.runs import Row, attempted
from lightfield.arrays import Array
from lightfield.diagnosis.certainty import Certainty
from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.problem.layout import layout_of
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.experiments import unknowns
from lightfield.experiments.measure import Instrument, LightAtReadings, measure
from lightfield.readings import Readings
from lightfield.render.backend.choice import use_backend

#: Correlation of successive errors; factor on the stated errors.
SERIAL, STATED = 0.4, {"half stated": 0.5, "double stated": 2.0}
#: Readings that follow each other and are spoiled together, as a part of all, twice; by so many sigma.
CLUSTER, SPOILED = 0.012, (6.0, 30.0)
#: What a row keeps of each effect of the best set: with the gaps other rules can be tried on the same rows.
_OF_EACH = {
    "effect", "form", "level", "sigma_to_remove", "gap", "gap_named", "gap_plus", "rival", "alternatives",
}  # fmt: skip


def run(trial: Trial, folder: Path) -> Row:
    """Make, diagnose, compare. A crash is an outcome too."""
    truth = trial.truth
    row: Row = {
        "seed": trial.seed, "key": trial.key, "stratum": truth.stratum, "bench": truth.bench,
        "hidden": list(truth.hidden), "count": len(truth.hidden), "lamp": trial.lamp, "errors": trial.errors,
        "unknown": truth.unknown, "draw": trial.draw,
    }  # fmt: skip
    return attempted(row, _run, trial, folder)


def _run(trial: Trial, folder: Path) -> Row:
    truth, bench = trial.truth, bench_named(trial.truth.bench)
    rng = np.random.default_rng(trial.seed)
    table = table_of(bench, trial.order, rng)
    believed = believed_scene(true_scene(bench, truth.beam), rng)
    instrument = Instrument(trial.noise, serial=SERIAL if trial.errors == "serial" else 0.0)
    factor: Array | float = 1.0
    if truth.unknown:
        factor, _ = unknowns.draw(truth.unknown, layout_of(table), rng)
    value, error = light_of(truth, folder, table)
    light, n = LightAtReadings(value[: len(table)], error[: len(table)]), len(table)
    scene = scene_of(truth)
    readings, clean = measure(scene, table, light, instrument, rng, factor)
    readings = _misstated(instrument.stated(readings), instrument.sigma(clean), trial.errors, rng)
    begun = time.process_time()
    verdict = diagnose(readings, believed).verdict
    spent = {"cpu_seconds": time.process_time() - begun, "traced_on": use_backend().kind}
    row = {"n": n} | spent | as_data(verdict)
    known = clean if not truth.unknown else measure(scene, table, light, instrument, rng)[1]
    return row | deltas(trial, believed, readings, clean, known, instrument.sigma)


def _misstated(readings: Readings, sigma: Array, errors: str, rng: np.random.Generator) -> Readings:
    """Readings whose table states other errors than they have, or with clusters of spoiled ones in them."""
    readings = replace(readings, stderr=np.asarray(readings.stderr) * STATED.get(errors, 1.0))
    if errors != "cluster":
        return readings
    value, order = np.array(readings.value), layout_of(readings).order
    long = max(round(CLUSTER * len(value)), 2)
    bright = np.flatnonzero(value[order] > BRIGHT * value.max())
    for _ in range(2):  # a bubble on the window, twice
        begin = int(rng.choice(bright[bright < len(value) - long]))
        rows = order[begin : begin + long]
        value[rows] -= sigma[rows] * rng.uniform(*SPOILED)
    return replace(readings, value=value)


def as_data(verdict: Verdict) -> Row:
    """What a verdict says, as plain data."""
    first, last = verdict.ladder[0], verdict.ladder[-1]
    return {
        "verdict": verdict.verdict,
        "best_set": verdict.best_set,
        "certain": verdict.certain,
        "simplest": verdict.simplest,
        "partial": verdict.partial,
        "slots": [
            [one.effect, *dict.fromkeys(n for names in one.alternatives for n in names if n != one.effect)]
            for one in verdict.found
            if one.level == Certainty.ONE_OF
        ],
        "found": [one.model_dump(include=_OF_EACH) for one in verdict.found],
        "family": [sorted(e.effects) for e in verdict.explanations],
        "coordinate": verdict.unexplained_coordinate,
        "percent": [first.error_percent, last.error_percent, verdict.noise_floor_percent],
        "removed": sum(rung.removed_percent or 0.0 for rung in verdict.ladder),
        "set_aside": len(verdict.set_aside),
    }
