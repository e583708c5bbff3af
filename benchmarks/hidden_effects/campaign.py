"""A run of the benchmark: which sets are still to be done, on which processes, and where the results go."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks import runs
from benchmarks.hidden_effects import experiment, independent
from benchmarks.hidden_effects.catalogue import Trial

#: After so many own sets comes an independent case.
BETWEEN = 2


def _job(job: Trial | Path, folder: Path) -> dict[str, Any]:
    return independent.run(job) if isinstance(job, Path) else experiment.run(job, folder)


def perform(chosen: Sequence[Trial], folder: Path, minutes: float, fresh: bool, with_cases: bool) -> None:
    """Do what was not done yet.

    One set per set-up comes first, which traces its diffuse light; then the rest, with the independent cases
    between.

    Parameters
    ----------
    folder : Path
        Renders and results.
    minutes : float
        Nothing new is begun after so long.
    fresh : bool
        Do again what was done by other code.
    """
    until, version = time.monotonic() + 60 * minutes, runs.code_version()
    own, other = folder / "sets.jsonl", folder / "independent.jsonl"
    finished = {r["seed"] for r in runs.read(own) if not fresh or r["code"] == version}
    left = [t for t in chosen if t.seed not in finished]
    first: dict[str, Trial] = {}
    for trial in left:
        if trial.truth.stratum == "null":
            first.setdefault(trial.truth.bench, trial)
    cases = {r["case"] for r in runs.read(other) if not fresh or r["code"] == version}
    outside = [c for c in runs.reference_cases("hidden_effects") if c.name not in cases] if with_cases else []
    jobs: list[Trial | Path] = []
    for trial in (t for t in left if first.get(t.truth.bench) is not t):
        jobs.append(trial)
        if len(jobs) % BETWEEN == 0 and outside:
            jobs.append(outside.pop(0))
    for some in (list(first.values()), [*jobs, *outside]):
        for row in runs.results("sets", _job, [(job, folder) for job in some], until):
            runs.append(other if "case" in row else own, row)
