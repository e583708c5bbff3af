"""Diagnose the field cases and write the page.

    python -m benchmarks.field [--only CASE ...] [--store FILE] [--score]

Results are kept, one line per case: started again, it does only what is missing, and writes the page anew.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks import runs
from benchmarks.field.cases import kept, run_and_keep
from benchmarks.field.page import page

_HEAD = """# Field cases: many effects at once

Readings as a real campaign gives them, from a Monte Carlo code of its own that shares nothing with this
program: three to five effects at once, pairs of scattering with a moved lamp, and lamps that no Gaussian
describes ("flood", "ringed"), alone and with up to three effects. The scenes are what the experimenter
believes: half width and absorption 10 to 25 % off. Written by `python -m benchmarks.field`.
"""


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.field", description=__doc__)
    parser.add_argument("--only", nargs="*", help="of these cases only")
    parser.add_argument("--store", type=Path, default=runs.ROOT / "build" / "field.jsonl", help="results")
    parser.add_argument("--score", action="store_true", help="run nothing, score what is there")
    args = parser.parse_args()
    rows = kept(args.store)
    for case in runs.reference_cases("hidden_effects_field") if not args.score else []:
        if case.name in rows or (args.only and case.name not in args.only):
            continue
        rows[case.name] = run_and_keep(case, args.store)
    target = Path(__file__).parent / "README.md"
    done = [rows[name] for name in sorted(rows)]
    kinds = {
        "all": done,
        "Gaussian lamp": [r for r in done if not r["lamp"]],
        "other lamp": [r for r in done if r["lamp"]],
    }
    target.write_text(page(done, _HEAD, kinds), encoding="utf-8")
    print(target)


if __name__ == "__main__":
    main()
