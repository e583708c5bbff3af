"""Diagnose tables that are no measurement, write the page, and fail if an effect is named in one of them.

    python -m benchmarks.garbage [--tables N] [--trace] [--store FILE] [--page FOLDER]

Results are kept, one line per table: started again, it does only what is missing.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarks import runs
from benchmarks.garbage.judge import judge, page
from benchmarks.garbage.tables import tables

TABLES = 504


def main() -> int:
    """Run what is missing, write the page; 1 if an effect was identified or a table ended in an error."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.garbage", description=__doc__)
    parser.add_argument("--tables", type=int, default=TABLES, help=f"the first N tables (default {TABLES})")
    parser.add_argument("--trace", action="store_true", help="with scattered light, as the command line does")
    parser.add_argument("--processes", type=int, default=runs.PROCESSES)
    parser.add_argument("--store", type=Path, default=runs.ROOT / "build" / "garbage.jsonl")
    parser.add_argument("--page", type=Path, default=Path(__file__).parent)
    args = parser.parse_args()
    version, chosen = runs.code_version(), tables(args.tables)
    keys = {(t.kind, t.errors, t.draw, args.trace, version) for t in chosen}

    def done() -> list[runs.Row]:
        kept = {(r["kind"], r["errors"], r["draw"], r["trace"], r["code"]): r for r in runs.read(args.store)}
        return [row for key, row in kept.items() if key in keys]

    finished = {(r["kind"], r["errors"], r["draw"]) for r in done()}
    left = [t for t in chosen if (t.kind, t.errors, t.draw) not in finished]
    for row in runs.results("tables", judge, [(t, args.trace) for t in left], processes=args.processes):
        runs.append(args.store, row)
    rows = done()
    args.page.mkdir(parents=True, exist_ok=True)
    (args.page / "README.md").write_text(page(rows, version), encoding="utf-8")
    bad = [r for r in rows if r["verdict"] in ("identified", "error")]
    for row in bad:
        print(f"{row['kind']}, errors {row['errors']}, {row['draw']}: {row['sentence']}", file=sys.stderr)
    print(f"{len(rows)} tables of garbage, {len(bad)} identified or in error")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
