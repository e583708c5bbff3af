"""What a diagnosis says where a number that was chosen is half or double, and write the page.

    python -m benchmarks.chosen [--processes N] [--minutes M] [--store FILE] [--page FOLDER]

Results are kept, one line per number and factor: started again, it does only what is missing. Nothing is
asserted.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import time
import zlib
from pathlib import Path
from typing import Any

from benchmarks import runs
from benchmarks.chosen.page import first_rows, group_of_each, page
from benchmarks.chosen.sets import GROUPS, given
from benchmarks.chosen.values import FACTORS, Chosen, Used, chosen, instead, other
from lightfield.diagnosis.diagnose import diagnose

Said = dict[str, dict[str, Any]]


def said(group: str = "direct") -> Said:
    """What is said of every set of a group; a crash is an answer too."""
    out = {}
    for one in GROUPS[group]:
        readings, scene, how = given(one)
        try:
            verdict = diagnose(readings, scene, only=one.asked, **how).verdict
            sentence = {
                "verdict": verdict.verdict, "best_set": sorted(verdict.best_set),
                "certain": sorted(verdict.certain),
                "values": {
                    path: [p.value, p.stderr] for path, p in verdict.ladder[-1].parameters.items()
                },
            }  # fmt: skip
        except Exception as error:  # whatever it is, it belongs in the table
            sentence = {"verdict": "error", "error": repr(error), "best_set": [], "certain": [], "values": {}}
        out[one.name] = sentence
    return out


def as_it_is(group: str) -> tuple[Said, list[str]]:
    """What is said with every number as it is, and the numbers that it rests on."""
    used = Used()
    with used:
        now = said(group)
    return now, [one.label for one in chosen() if used.by(one)]


def with_another(one: Chosen, factor: float, group: str) -> Said:
    """What is said with another value of one number."""
    with instead(one, other(one.value, factor)):
        return said(group)


def _job(job: tuple[str, float, str]) -> tuple[str, float, str, Said, float]:
    label, factor, group = job
    (one,) = [c for c in chosen() if c.label == label]
    begun = time.process_time()
    return label, factor, group, with_another(one, factor, group), time.process_time() - begun


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.chosen", description=__doc__)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin nothing new after so long")
    parser.add_argument("--store", type=Path, default=runs.ROOT / "build" / "chosen.jsonl")
    parser.add_argument("--page", type=Path, default=Path(__file__).parent / "README.md")
    args = parser.parse_args()
    known = chosen()
    # One process for each number: what one remembers was computed with another.
    context = multiprocessing.get_context("fork")
    rows = runs.read(args.store)
    for group in GROUPS:
        if group not in first_rows(rows):
            with context.Pool(1, maxtasksperchild=1) as pool:
                now, used = pool.apply(as_it_is, (group,))
            code = runs.code_version()
            runs.append(args.store, {"label": "", "group": group, "said": now, "used": used, "code": code})
    rows = runs.read(args.store)
    groups = group_of_each(rows)
    done = {(row["label"], row.get("factor")) for row in rows}
    # In an order of their own: whenever it ends, what is done is a fair sample.
    jobs = [
        (one.label, factor, groups[one.label])
        for one in known
        for factor in FACTORS
        if one.label in groups and other(one.value, factor) is not None
        if (one.label, factor) not in done
    ]
    jobs.sort(key=lambda job: zlib.crc32(job[0].encode()))
    until = time.monotonic() + 60 * args.minutes
    with context.Pool(args.processes, maxtasksperchild=1) as pool:
        each = enumerate(pool.imap_unordered(_job, jobs, chunksize=1), 1)
        for k, (label, factor, group, sentence, seconds) in each:
            row = {"label": label, "factor": factor, "group": group, "said": sentence, "cpu_s": seconds}
            runs.append(args.store, row)
            print(f"{k} of {len(jobs)}: {label} x {factor:g}, {seconds:.0f} s", file=sys.stderr)
            if time.monotonic() > until:
                pool.terminate()
                break
    args.page.write_text(page(runs.read(args.store), known), encoding="utf-8")
    print(args.page)


if __name__ == "__main__":
    main()
