"""Run the benchmark of hidden effects and write its page.

    python -m benchmarks.hidden_effects [--quick] [--sets N] [--minutes M] [--store DIR] [--page DIR]

Results are kept, one line per set: started again, it does only what is missing, and writes the page anew.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.hidden_effects import experiment, independent, store, workers
from benchmarks.hidden_effects.catalogue import Trial, quick_trials, trials

ROOT = Path(__file__).resolve().parents[2]
#: After so many own sets comes an independent case.
BETWEEN = 6


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.hidden_effects", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="60 sets from a few renders; no page in the repository")
    parser.add_argument("--sets", type=int, help="the first N sets (default: all)")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin nothing new after so long")
    parser.add_argument("--store", type=Path, default=ROOT / "build" / "hidden_effects", help="renders and results")
    parser.add_argument("--page", type=Path, help="folder of README.md, summary and pictures")
    parser.add_argument("--fresh", action="store_true", help="diagnose again what was done by other code")
    parser.add_argument("--score", action="store_true", help="run nothing, score what is there")
    return parser.parse_args()


def _job(job: Trial | Path, folder: Path) -> dict[str, Any]:
    return independent.run(job) if isinstance(job, Path) else experiment.run(job, folder)


def _perform(chosen: Sequence[Trial], args: argparse.Namespace) -> None:
    """One set per set-up first (which traces its diffuse light), then the rest with the independent cases between."""
    until, version = time.monotonic() + 60 * args.minutes, store.code_version()
    own, other = args.store / "sets.jsonl", args.store / "independent.jsonl"
    finished = {r["seed"] for r in store.read(own) if not args.fresh or r["code"] == version}
    left = [t for t in chosen if t.seed not in finished]
    first: dict[str, Trial] = {}
    for trial in left:
        if trial.truth.stratum == "null":
            first.setdefault(trial.truth.bench, trial)
    cases = {r["case"] for r in store.read(other) if not args.fresh or r["code"] == version}
    outside = [] if args.quick else [c for c in independent.cases() if c.name not in cases]
    jobs: list[Trial | Path] = []
    for trial in (t for t in left if first.get(t.truth.bench) is not t):
        jobs.append(trial)
        if len(jobs) % BETWEEN == 0 and outside:
            jobs.append(outside.pop(0))
    pool = workers.start()
    try:
        for some in (list(first.values()), [*jobs, *outside]):
            for row in workers.results(pool, "sets", _job, [(job, args.store) for job in some], until):
                store.append(other if "case" in row else own, row | {"code": version})
    finally:
        pool.shutdown(cancel_futures=True)


def main() -> None:
    args = _arguments()
    chosen = quick_trials() if args.quick else trials()[: args.sets]
    if not args.score:
        _perform(chosen, args)
    from benchmarks.hidden_effects.page import write  # Matplotlib

    seeds = {t.seed for t in chosen}
    latest = {r["seed"]: r for r in store.read(args.store / "sets.jsonl") if r["seed"] in seeds}
    cases = {r["case"]: r for r in store.read(args.store / "independent.jsonl")}
    target = args.page or (args.store / "quick" if args.quick else Path(__file__).parent)
    print(write(list(latest.values()), [cases[k] for k in sorted(cases)], len(chosen), target))


if __name__ == "__main__":
    main()
