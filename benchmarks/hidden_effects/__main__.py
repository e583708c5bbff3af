"""Run the benchmark of hidden effects and write its page.

    python -m benchmarks.hidden_effects [--quick] [--sets N] [--only KIND] [--minutes M] [--store DIR]

Results are kept, one line per set: started again, it does only what is missing, and writes the page anew.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks import runs
from benchmarks.hidden_effects.campaign import perform
from benchmarks.hidden_effects.catalogue import quick_trials, trials

#: Half of them without a hidden effect; the whole plan has 2368.
SETS = 1400
STRATA = ("null", "one", "other physics", "two", "unknown")


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.hidden_effects", description=__doc__)
    parser.add_argument(
        "--quick", action="store_true", help="60 sets from a few renders; no page in the repository"
    )
    parser.add_argument("--sets", type=int, default=SETS, help=f"the first N sets (default {SETS})")
    parser.add_argument("--only", choices=STRATA, help="of these only one kind")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin nothing new after so long")
    parser.add_argument(
        "--store", type=Path, default=runs.ROOT / "build" / "hidden_effects", help="renders and results"
    )
    parser.add_argument("--page", type=Path, help="folder of README.md, summary and pictures")
    parser.add_argument("--fresh", action="store_true", help="diagnose again what was done by other code")
    parser.add_argument("--score", action="store_true", help="run nothing, score what is there")
    return parser.parse_args()


def main() -> None:
    args = _arguments()
    chosen = quick_trials() if args.quick else trials()[: args.sets]
    if args.only:
        chosen = [t for t in chosen if t.truth.stratum == args.only]
    if not args.score:
        perform(chosen, args.store, args.minutes, args.fresh, with_cases=not args.quick and not args.only)
    from benchmarks.hidden_effects.page import write  # Matplotlib

    seeds = {t.seed for t in chosen}
    latest = {r["seed"]: r for r in runs.read(args.store / "sets.jsonl") if r["seed"] in seeds}
    cases = {r["case"]: r for r in runs.read(args.store / "independent.jsonl")}
    target = args.page or (args.store / "quick" if args.quick else Path(__file__).parent)
    print(write(list(latest.values()), [cases[k] for k in sorted(cases)], len(chosen), target))


if __name__ == "__main__":
    main()
