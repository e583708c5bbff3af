"""Run sets of many effects, and write the page.

    python -m benchmarks.many_effects [--every N] [--only STRATUM ...] [--minutes M] [--store DIR] [--score]

Results are kept, one line per set: started again, it does only what is missing, and writes the page anew.
Every N-th set is a fair sample of all; choose N odd.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks import runs
from benchmarks.many_effects.catalogue import trials
from benchmarks.many_effects.experiment import run
from benchmarks.many_effects.page import page

STRATA = ("clean", "lamp", "misspecified", "unknown", "later", "campaign")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.many_effects", description=__doc__)
    parser.add_argument("--every", type=int, default=1, metavar="N", help="every N-th set (default: all)")
    parser.add_argument("--first", type=int, default=0, metavar="K", help="beginning with the K-th, from 0")
    parser.add_argument("--only", nargs="*", choices=STRATA, help="of these strata only")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin nothing new after so long")
    parser.add_argument("--processes", type=int, default=runs.PROCESSES)
    parser.add_argument(
        "--store", type=Path, default=runs.ROOT / "build" / "many_effects", help="renders and results"
    )
    parser.add_argument("--page", type=Path, default=Path(__file__).parent / "README.md")
    parser.add_argument("--score", action="store_true", help="run nothing, score what is there")
    args = parser.parse_args()
    planned = [t for t in trials() if not args.only or t.truth.stratum in args.only]
    kept, chosen = args.store / "sets.jsonl", planned[args.first :: args.every]
    done = {row["seed"] for row in runs.read(kept)}
    left = [t for t in chosen if t.seed not in done]
    if left and not args.score:
        # The order of the seeds: whenever it ends, what is done is a fair sample.
        jobs = [(trial, args.store) for trial in sorted(left, key=lambda t: t.seed)]
        runs.do_missing(kept, run, jobs, args.minutes, args.processes)
    known = {t.seed for t in planned}
    rows = {row["seed"]: row for row in runs.read(kept) if row["seed"] in known}
    args.page.write_text(page(sorted(rows.values(), key=lambda r: r["key"]), len(planned)), encoding="utf-8")
    print(args.page)


if __name__ == "__main__":
    main()
