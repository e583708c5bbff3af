"""How true is what a fit finds in scattering water? Readings by an independent walk of photons, diagnosed.

Run from the root: `python -m benchmarks.scattering_fits [--seeds N] [--modes diagnose] [--case NAME]`.
The fields of the walk are stored beside this file; `--walk` makes them again with `walk.c` (a C compiler and
half an hour of a processor).
Every row is diagnosed twice: with all light from one trace that is reweighed, as a search does, and as
`diagnose` ends. Nothing is asserted. Results are kept in `found.csv`; what is there is not done again.
"""

from __future__ import annotations

import argparse
import csv
import time

from threadpoolctl import threadpool_limits

from benchmarks.scattering_fits.cases import CASES, HERE, Case, readings_of
from benchmarks.scattering_fits.page import FOUND, MODES, page
from lightfield.diagnosis.diagnose import Diagnosis, diagnose
from lightfield.diagnosis.verdict.trust import error_scale
from lightfield.render.diffuse.source import response_for
from lightfield.storage.files import atomic_path, write_text

STORE = HERE / "found.csv"


def row_of(case: Case, seed: int, mode: str, found: Diagnosis, seconds: float) -> dict[str, str]:
    """What was found, as a row of the store."""
    row = {"case": case.name, "seed": str(seed), "mode": mode, "verdict": found.verdict.verdict,
           "effects": " + ".join(found.verdict.effects), "seconds": f"{seconds:.1f}",
           "noise": f"{found.prepared.excess * error_scale(found.prepared, found.finding):.3g}"}  # fmt: skip
    best = found.verdict.explanations[0] if found.verdict.explanations else None
    known = dict(best.parameters) if best else {}
    for path in FOUND:
        if path in known:
            row[path] = f"{known[path].value:.5g}"
            stated, of_set = known[path].stderr, known[path].stderr_of_set
            row[path + " error"] = f"{stated:.3g}" if stated is not None else ""
            row[path + " error of set"] = f"{of_set:.3g}" if of_set is not None else row[path + " error"]
    return row


def main() -> None:
    """Diagnose what is missing in the store, then write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=4, help="noise seeds of every case")
    parser.add_argument("--modes", default=",".join(MODES), help="of these two, with a comma between")
    parser.add_argument("--case", default="", help="only cases whose name begins so")
    parser.add_argument("--walk", action="store_true", help="walk the photons again")
    args = parser.parse_args()
    rows = load()
    done = {(r["case"], r["seed"], r["mode"]) for r in rows}
    for seed in range(args.seeds):
        for case in CASES:
            for mode in args.modes.split(",") if case.name.startswith(args.case) else ():
                if (case.name, str(seed), mode) in done:
                    continue
                readings = readings_of(case, seed, args.walk and seed == 0 and mode == MODES[0])
                begun = time.process_time()
                with threadpool_limits(1):
                    source = response_for if mode == "search" else "trace"
                    found = diagnose(readings, case.believed, diffuse=source, seed=seed, advise=False)
                rows.append(row_of(case, seed, mode, found, time.process_time() - begun))
                save(rows)
                print(rows[-1], flush=True)
    write_text(HERE / "README.md", page(rows))


def load() -> list[dict[str, str]]:
    """Rows of the store."""
    if not STORE.exists():
        return []
    with STORE.open(newline="") as file:
        return list(csv.DictReader(file))


def save(rows: list[dict[str, str]]) -> None:
    """Write the store whole."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    with atomic_path(STORE) as temporary, temporary.open("w", newline="") as file:
        writer = csv.DictWriter(file, names, restval="")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
