"""One set: read from the full render, diagnosed as a user would, and set beside what was hidden."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from benchmarks.each_effect.campaigns import Trial
from benchmarks.hidden_effects.benches import believed_scene
from benchmarks.many_effects.experiment import as_data
from benchmarks.many_effects.visible import Fits
from benchmarks.runs import Row, attempted
from lightfield.arrays import Array
from lightfield.diagnosis.diagnose import diagnose
from lightfield.experiments.measure import Instrument, measure, rendered
from lightfield.fitting.forward import SceneForward
from lightfield.readings import Readings
from lightfield.scene import Scene

NOISES = (0.005, 0.01)
PHOTONS = 1e8
_FLOOR, _END = "tank.floor_over_walls", "tank.end_over_walls"


def run(trial: Trial) -> Row:
    """Make, diagnose, compare. A crash is an outcome too."""
    row: Row = {
        "seed": trial.seed, "key": trial.key, "campaign": trial.campaign.name, "asked": trial.asked,
        "hidden": list(trial.hidden),
    }  # fmt: skip
    return attempted(row, _run, trial)


def _run(trial: Trial) -> Row:
    rng = np.random.default_rng(trial.seed)
    scene, table = trial.campaign.table(rng)
    width = (
        {}
        if scene.lamp.profile == "table"
        else {"lamp.hwhm_deg": scene.lamp.hwhm_deg * rng.uniform(0.8, 1.2)}
    )
    water = {"water.absorption_per_m": scene.water.absorption_per_m * rng.uniform(0.8, 1.2)}
    plain = scene.with_values(width | water)
    truth = plain.with_values(dict(trial.values))
    believed = plain if not width else believed_scene(plain, rng)
    instrument = Instrument(float(rng.choice(NOISES)))
    light = rendered(truth, table, instrument.noise, rng, PHOTONS)
    relative = replace(table, scale="relative", units="")
    readings, clean = measure(truth, relative, light, instrument, rng)
    readings, sigma = instrument.stated(readings), instrument.sigma(clean)
    if trial.campaign.units:
        factor = _calibrated(truth, table, clean)
        value, stderr = factor * readings.value, factor * readings.stderr
        readings = replace(readings, value=value, stderr=stderr, scale=table.scale, units=table.units)
        clean, sigma = factor * clean, factor * sigma
    begun = time.process_time()
    verdict = diagnose(readings, believed).verdict
    row = {"n": len(clean), "cpu_seconds": time.process_time() - begun} | as_data(verdict)
    values = dict(trial.values)
    if truth.tank is not None:  # where no part of it reflects more than all
        shares = {_FLOOR: truth.tank.floor_share, _END: truth.tank.end_share}
        values |= {path: share for path, share in shares.items() if path in values}
    pulls = {
        path: (estimate.value - values[path]) / estimate.stderr
        for one in verdict.found
        for path, estimate in one.parameters.items()
        if one.effect == trial.effect and path in values and estimate.stderr
    }
    return row | {"pulls": pulls, "delta": _delta(trial, plain, readings, clean, sigma)}


def _calibrated(truth: Scene, table: Readings, clean: Array) -> Array:
    """What a unit of a reading stands for at its wavelength, shape (n,): by the lamp's power and spectrum."""
    light, factor = SceneForward(truth, table).predict({}), np.ones(len(clean))
    for wave in np.unique(table.wavelength_nm):
        mine = table.wavelength_nm == wave
        factor[mine] = light[mine] @ clean[mine] / (clean[mine] @ clean[mine])
    return factor


def _delta(trial: Trial, plain: Scene, readings: Readings, clean: Array, sigma: Array) -> float | None:
    """By how many sigma the noise-free readings are missed without what was asked about."""
    if not trial.asked:
        return None
    values, others = dict(trial.values), [n for n in trial.hidden if n != trial.effect]
    fits = Fits(plain, readings, clean, sigma, trial.hidden)
    missed = fits.chi2(others, values) - fits.chi2(trial.hidden, values)
    return float(np.sqrt(max(missed, 0.0)))
