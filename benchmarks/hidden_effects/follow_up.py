"""The advice followed: the readings that an ambiguous verdict asks for are taken and judged with the rest."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np

from benchmarks.hidden_effects.catalogue import Trial
from benchmarks.hidden_effects.lights import lit_scene, scene_of
from benchmarks.runs import Row
from lightfield.diagnosis.diagnose import Diagnosis, diagnose
from lightfield.experiments.layouts import SECONDS_PER_READING
from lightfield.experiments.measure import SAMPLES, Instrument
from lightfield.fitting.forward import SceneForward
from lightfield.render.at_readings import rendered_light

PHOTONS, REL_ERROR = 4e6, 0.003


def follow(trial: Trial, found: Diagnosis, clean: np.ndarray, light: np.ndarray, diffuse: Any) -> Row:
    """Take the readings of the advice from a fresh render of the truth and diagnose everything again.

    Parameters
    ----------
    clean, light : array, shape (n,)
        Noise-free readings and light of the truth so far.

    Returns
    -------
    dict
        Empty where the verdict is not ambiguous, or where no reading was asked for.
    """
    advice = found.verdict.next_measurement
    if found.verdict.verdict != "ambiguous" or advice is None or not advice.readings:
        return {}
    spots = [spot for spot in advice.readings for _ in range(spot.repeats)]
    rng = np.random.default_rng([trial.seed, 1])
    before, n = found.readings, len(spots)
    places = {k: np.array([getattr(s, k) for s in spots]) for k in ("x_m", "y_m", "z_m", "medium")}
    after = float(np.nanmax(before.time_s)) + SECONDS_PER_READING * (1 + rng.permutation(n))
    extra = replace(before.subset(np.zeros(n, int)), **places, time_s=after)
    scene = scene_of(trial.truth)
    there, _ = rendered_light(
        lit_scene(trial.truth), extra, seed=1 + trial.seed % 1000, rel_error=REL_ERROR, max_photons=PHOTONS
    )
    own = SceneForward(scene, before, full=float(clean.max()))
    gains = dict.fromkeys(own.gains.names, 1.0 / float((light * own.reader.power({})).max()))
    expected = SceneForward(scene, extra, full=float(clean.max())).reader.read(there, gains)
    sigma = Instrument(trial.noise).sigma(expected)
    quoted = sigma * np.sqrt(rng.chisquare(SAMPLES - 1, n) / (SAMPLES - 1))
    extra = replace(extra, value=expected + sigma * rng.standard_normal(n), stderr=quoted)
    again = diagnose(_joined(before, extra), found.forward.scene, diffuse=diffuse, advise=False)
    accepted = [sorted(e.effects) for e in again.verdict.explanations]
    return {
        "advice": {
            "between": [sorted(names) for names in advice.between],
            "now": advice.separation_now_sigma,
            "predicted": advice.separation_predicted_sigma,
            "verdict": again.verdict.verdict,
            "effects": sorted(again.verdict.effects),
            "accepted": accepted,
        }
    }


def _joined(first: Any, second: Any) -> Any:
    """One table with the rows of both."""
    columns = {
        f.name: np.r_[getattr(first, f.name), getattr(second, f.name)]
        for f in fields(first)
        if isinstance(getattr(first, f.name), np.ndarray)
    }
    return replace(first, **columns)
