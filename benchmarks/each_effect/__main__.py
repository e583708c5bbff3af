"""Hide every effect of the table in turn, diagnose, and write the page.

    python -m benchmarks.each_effect [--minutes M] [--processes P] [--store FILE] [--only EFFECT ...]

Results are kept, one line per set: started again, it does only what is missing, and writes the page anew.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarks import runs
from benchmarks.each_effect.campaigns import CAMPAIGNS, trials
from benchmarks.each_effect.experiment import run
from benchmarks.each_effect.page import page
from lightfield.fitting import effects

#: Of a lamp's shape alone: `benchmarks/many_effects` hides sixteen of them.
ELSEWHERE = {"beam_profile"}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.each_effect", description=__doc__)
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin nothing new after so long")
    parser.add_argument("--processes", type=int, default=runs.PROCESSES)
    parser.add_argument("--only", nargs="*", metavar="EFFECT", help='these alone; "nothing" for null sets')
    folder = Path(__file__).parent
    parser.add_argument("--store", type=Path, default=runs.ROOT / "build" / "each_effect.jsonl")
    parser.add_argument("--page", type=Path, default=folder / "README.md")
    args = parser.parse_args()
    asked = {name for campaign in CAMPAIGNS for name in campaign.effects}
    if forgotten := {*effects.table(), *effects.curves()} - asked - ELSEWHERE:
        sys.exit(f"no campaign shows {', '.join(sorted(forgotten))}")
    planned = list(trials())
    done = {row["seed"] for row in runs.read(args.store)}
    jobs = [
        (t,)
        for t in sorted(planned, key=lambda t: t.seed)
        if t.seed not in done and (not args.only or (t.asked or "nothing") in args.only)
    ]
    if jobs:
        runs.do_missing(args.store, run, jobs, args.minutes, args.processes)
    known = {t.seed for t in planned}
    rows = {row["seed"]: row for row in runs.read(args.store) if row["seed"] in known}
    args.page.write_text(page(list(rows.values()), len(planned)), encoding="utf-8")
    print(args.page)


if __name__ == "__main__":
    main()
