"""One data set: made, diagnosed, and compared with what was hidden; the outcome is a row of plain data."""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from benchmarks.hidden_effects.benches import BENCHES, believed_scene, held_out_places, table_of, true_scene
from benchmarks.hidden_effects.catalogue import NOISE_KINDS, Trial
from benchmarks.hidden_effects.follow_up import follow
from benchmarks.hidden_effects.lights import light_of, scene_of
from benchmarks.hidden_effects.oracle import Oracle
from benchmarks.runs import Row, attempted
from lightfield.diagnosis.diagnose import Diagnosis, diagnose
from lightfield.diagnosis.problem.layout import layout_of
from lightfield.diagnosis.problem.setup import PLANE_GAIN_PERCENT
from lightfield.diagnosis.verdict.parts import Kind
from lightfield.experiments import unknowns
from lightfield.experiments.measure import Instrument, LightAtReadings, measure
from lightfield.fitting.diffuse_light import has_diffuse_light
from lightfield.fitting.forward import SceneForward

#: Readings below this part of the largest one of their plane do not count in an error in per cent.
BRIGHT = 0.05
#: Rivals of the truth are sought where the effect can be seen.
SEEN = 4.0
#: Responses kept in memory, those used last: a trial asks for clear and for denser water at one width of the
#: beam or two, the next of its set-up for the same. A tally takes 40 to 60 MB, more once it was evaluated;
#: all of them filled 4 GB. One that is asked for again later comes from the cache on disk.
KEPT = 8


class Tracing:
    """`response_for`, with the wall-clock and processor time of its traces since this was made.

    Parameters
    ----------
    bench : str
        Responses of one set-up, where only beam and absorption change, are kept in memory, the newest few.
    sequence : int
        Which random numbers they are traced with.
    """

    _kept: ClassVar[OrderedDict[tuple[Any, ...], Any]] = OrderedDict()
    _spent: ClassVar[np.ndarray] = np.zeros(2)

    def __init__(self, bench: str = "", sequence: int = 0) -> None:
        self.bench, self.sequence, self._before = bench, sequence, self._spent.copy()

    @property
    def seconds(self) -> float:
        return float((self._spent - self._before)[0])

    @property
    def cpu_seconds(self) -> float:
        return float((self._spent - self._before)[1])

    def __call__(self, scene: Any, *places: Any, **options: Any) -> Any:
        from lightfield.render.diffuse.source import response_for, sent_width_deg
        from lightfield.render.diffuse.traced import TracedWater

        where = (np.asarray(p).tobytes() for p in places)
        options = {**options, "seed": self.sequence}
        key = (self.bench, *sorted(options.items()), sent_width_deg(scene.lamp.hwhm_deg), *where)
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key]
        response = self._clocked(partial(response_for, scene, *places, **options))
        tops = (response.clear.own_top, response.clear.under_surface)
        clocked = [top and replace(top, trace=partial(self._clocked, top.trace)) for top in tops]
        response = replace(response, clear=TracedWater(*clocked))
        if self.bench:
            self._kept[key] = response
            while len(self._kept) > KEPT:
                self._kept.popitem(last=False)
        return response

    @classmethod
    def _clocked(cls, make: Callable[[], Any]) -> Any:
        """What is made, in time that counts as tracing."""
        start = np.array([time.perf_counter(), time.process_time()])
        made = make()
        cls._spent += np.array([time.perf_counter(), time.process_time()]) - start
        return made


def run(trial: Trial, folder: Path) -> Row:
    """Make, diagnose, compare. A crash is an outcome too."""
    truth = trial.truth
    row: Row = {
        "seed": trial.seed, "key": trial.key, "stratum": truth.stratum, "bench": truth.bench,
        "label": truth.label,
        "hidden": sorted(truth.hidden), "any_of": sorted(truth.any_of), "unknown": truth.unknown,
        "noise_kind": trial.noise_kind, "order": trial.order, "noise": trial.noise,
    }  # fmt: skip
    return attempted(row, _run, trial, folder)


def _run(trial: Trial, folder: Path) -> Row:
    truth, bench = trial.truth, BENCHES[trial.truth.bench]
    rng = np.random.default_rng(trial.seed)
    table = table_of(bench, trial.order, rng)
    scene = scene_of(truth)
    believed = believed_scene(true_scene(bench, truth.beam), rng)
    light, light_error = light_of(truth, folder, table)
    n = len(table)
    factor = np.ones(n)
    drawn: dict[str, float] = {}
    if truth.unknown:
        factor, drawn = unknowns.draw(truth.unknown, layout_of(table), rng)
    instrument = Instrument(trial.noise, **NOISE_KINDS[trial.noise_kind])
    readings, clean = measure(
        scene, table, LightAtReadings(light[:n], light_error[:n]), instrument, rng, factor
    )
    readings = instrument.stated(readings)
    tracing = Tracing(bench.name, trial.sequence)
    found, times = timed(readings, believed, tracing)
    row = as_data(found) | times | {"n": n, "delta": 0.0}
    if truth.stratum == "null":
        return row
    sigma = instrument.sigma(clean)
    gain = float(clean.max() / light[:n].max())
    gained = instrument.plane_gain or PLANE_GAIN_PERCENT / 100
    dense = SceneForward(scene, readings).light.diffuse.dense_water(scene)
    oracle = Oracle(believed, readings, clean, sigma, gained, tracing, dense)
    row |= {
        "values": {k: v for k, v in truth.values if isinstance(v, float)},
        "drawn": drawn,
        "delta": oracle.delta,
        "render_sigma": float(np.sqrt(np.mean((light_error[:n] * gain / sigma) ** 2))),
    }
    if truth.stratum == "one" and oracle.delta > SEEN:
        row["rival"], row["D"] = oracle.nearest(truth.hidden)
    if truth.stratum in ("one", "two") and truth.bench != "colour":
        row |= follow(trial, found, clean, light[:n], Tracing(sequence=trial.sequence))
    if truth.stratum == "two":
        row["second"] = oracle.second(truth.hidden, dict(truth.values))
    if truth.stratum == "one" and found.verdict.verdict == Kind.IDENTIFIED:
        row |= _errors(trial, found, oracle, clean, light)
    return row


def timed(readings: Any, believed: Any, tracing: Tracing) -> tuple[Diagnosis, dict[str, float]]:
    """A diagnosis, and its times without that of tracing."""
    start, used = time.perf_counter(), time.process_time()
    found = diagnose(readings, believed, diffuse=tracing)
    return found, {
        "seconds": time.perf_counter() - start - tracing.seconds,
        "cpu_seconds": time.process_time() - used - tracing.cpu_seconds,
        "trace_seconds": tracing.seconds,
    }


def as_data(found: Diagnosis) -> Row:
    """What a diagnosis says, as plain data."""
    verdict = found.verdict
    explanations = [
        {
            "effects": sorted(e.effects), "families": sorted(set(e.families)), "forms": e.forms,
            "weight": round(e.weight, 4), "p": e.adequacy_p,
        }
        for e in verdict.explanations[:12]
    ]  # fmt: skip
    best = verdict.explanations[0].parameters if verdict.explanations else {}
    rival, first, last = verdict.nearest_rival, verdict.ladder[0], verdict.ladder[-1]
    return {
        "verdict": verdict.verdict,
        "effects": sorted(verdict.effects),
        "explanations": explanations,
        "nearest": [rival.effects, rival.separation_sigma] if rival else None,
        "parameters": {p: [e.value, e.stderr] for p, e in best.items() if not p.startswith("gain")},
        "coordinate": verdict.unexplained_coordinate,
        "base_p": verdict.base_p,
        "within_tolerance": verdict.within_tolerance,
        "percent": [first.error_percent, last.error_percent, verdict.noise_floor_percent],
        "held_out": [first.held_out_percent, last.held_out_percent],
    }


def _errors(
    trial: Trial, found: Diagnosis, oracle: Oracle, clean: np.ndarray, light: np.ndarray
) -> dict[str, float]:
    """Error of base, claim and the best fit there is, on the noise-free truth between the readings, in %.

    Left out where scattered light takes part: its response would have to be traced for the held-out places.
    """
    truth, n = trial.truth, len(clean)
    scene = scene_of(truth)
    right = oracle.formulas(truth.hidden, dict(truth.values))
    places = held_out_places(BENCHES[truth.bench])
    m = len(places["x_m"])
    if has_diffuse_light(scene) or has_diffuse_light(found.scene) or not m or not right:
        return {}
    last = np.full(m, float(np.nanmax(found.readings.time_s)))
    at = {**places, "medium": np.full(m, "water"), "time_s": last}
    there = found.forward.at(**at)
    # The truth's own readout, with the gain under which its readings are `clean`.
    own = SceneForward(scene, found.readings, full=float(clean.max()))
    gain = _gain(lambda g: own.reader.read(light[:n], {"gain": g}), clean)
    expected = own.at(**at).reader.read(light[n:], {"gain": gain})
    group = places["z_m"]
    top = np.array([expected[group == z].max() for z in group])
    counted = expected > BRIGHT * top
    fits = {
        "base": found.steps[0].fit.values,
        "fit": found.steps[-1].fit.values,
        "oracle": oracle.fit(right, dict(truth.values), found.prepared.problem).values,
    }
    return {
        f"error_{name}": float(100 * np.sqrt(np.mean(((there.predict(values) / expected)[counted] - 1) ** 2)))
        for name, values in fits.items()
    }


def _gain(read: Callable[[float], np.ndarray], clean: np.ndarray) -> float:
    """The gain that gives the clean readings, which rise with it."""
    place = int(clean.argmax())
    low, high = 1e-6, 1e6
    for _ in range(200):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if read(middle)[place] < clean[place] else (low, middle)
    return float(np.sqrt(low * high))
