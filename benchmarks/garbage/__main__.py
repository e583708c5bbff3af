"""Diagnose tables that are no measurement, write the page, and fail if an effect is named in one of them.

    python -m benchmarks.garbage [--tables N] [--trace] [--store FILE] [--page FOLDER]

Results are kept, one line per table: started again, it does only what is missing.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

from benchmarks.garbage.tables import ERRORS, KINDS, Table, believed, tables
from benchmarks.hidden_effects import store, workers
from lightfield.diagnose import diagnose

ROOT = Path(__file__).resolve().parents[2]
TABLES = 504
VERDICTS = ("identified", "ambiguous", "none", "unexplained", "error")


def judge(table: Table, trace: bool = False) -> dict[str, Any]:
    """What the diagnosis says of one table. A crash is an outcome too.

    Parameters
    ----------
    trace : bool
        Also test scattering, as the command line does; otherwise what the closed form can say.
    """
    row: dict[str, Any] = {"kind": table.kind, "errors": table.errors, "draw": table.draw, "trace": trace}
    began = time.perf_counter()
    try:
        source = "trace" if trace else None
        verdict = diagnose(table.readings(), believed(), diffuse=source, advise=False).verdict
    except Exception as error:  # whatever it is, it belongs in the table
        return row | {"verdict": "error", "sentence": repr(error)}
    return row | {
        "verdict": verdict.verdict,
        "effects": verdict.effects,
        "sentence": verdict.sentence,
        "doubt": verdict.doubt,
        "noise_percent": verdict.noise_percent,
        "seconds": time.perf_counter() - began,
    }


def page(rows: list[dict[str, Any]], version: str) -> str:
    """What was said of each sort, as Markdown."""
    counts = Counter((r["kind"], r["errors"], r["verdict"]) for r in rows)
    lines = [
        "# Garbage: does the diagnosis name an effect where there is no measurement?",
        "",
        "Written by `python -m benchmarks.garbage`; do not edit.",
        "",
        "Six sorts of numbers at the places of real layouts (105, 55 or 245 readings; lamp of 4 degrees,",
        "five planes), each with seven sorts of standard errors: none, what a spectrometer would state, the",
        "scatter of the values itself, and that wrong by 3 and by 10 either way. No effect must be",
        f"identified in any of them; the run fails if one is. Code: {version}.",
        "",
        f"**{len(rows)} tables: "
        + ", ".join(f"{sum(r['verdict'] == v for r in rows)} {v}" for v in VERDICTS)
        + ".**",
        "",
        "| numbers | " + " | ".join(VERDICTS) + " |",
        "|---|" + "---|" * len(VERDICTS),
    ]
    for kind in KINDS:
        said = [sum(counts[kind, errors, v] for errors in ERRORS) for v in VERDICTS]
        lines.append(f"| {kind} | " + " | ".join(str(n or "") for n in said) + " |")
    lines += ["", "| standard errors | " + " | ".join(VERDICTS) + " |", "|---|" + "---|" * len(VERDICTS)]
    for errors in ERRORS:
        said = [sum(counts[kind, errors, v] for kind in KINDS) for v in VERDICTS]
        lines.append(f"| {errors} | " + " | ".join(str(n or "") for n in said) + " |")
    answered = [r for r in rows if r["verdict"] != "unexplained"]
    if answered:
        lines += ["", "Not unexplained:", "", "| table | said |", "|---|---|"]
        lines += [f"| {r['kind']}, errors {r['errors']}, {r['draw']} | {r['sentence']} |" for r in answered]
    return "\n".join(lines) + "\n"


def main() -> int:
    """Run what is missing, write the page; 1 if an effect was identified or a table ended in an error."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.garbage", description=__doc__)
    parser.add_argument("--tables", type=int, default=TABLES, help=f"the first N tables (default {TABLES})")
    parser.add_argument("--trace", action="store_true", help="with scattered light, as the command line does")
    parser.add_argument("--processes", type=int, default=workers.PROCESSES)
    parser.add_argument("--store", type=Path, default=ROOT / "build" / "garbage.jsonl")
    parser.add_argument("--page", type=Path, default=Path(__file__).parent)
    args = parser.parse_args()
    version, chosen = store.code_version(), tables(args.tables)
    keys = {(t.kind, t.errors, t.draw, args.trace, version) for t in chosen}

    def done() -> list[dict[str, Any]]:
        kept = {(r["kind"], r["errors"], r["draw"], r["trace"], r["code"]): r for r in store.read(args.store)}
        return [row for key, row in kept.items() if key in keys]

    finished = {(r["kind"], r["errors"], r["draw"]) for r in done()}
    left = [t for t in chosen if (t.kind, t.errors, t.draw) not in finished]
    pool = workers.start(args.processes)
    try:
        for row in workers.results(pool, "tables", judge, [(t, args.trace) for t in left]):
            store.append(args.store, row | {"code": version})
    finally:
        pool.shutdown(cancel_futures=True)
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
