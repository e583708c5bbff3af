"""What the diagnosis says of a table of garbage, and the page of all."""

from __future__ import annotations

import time
from collections import Counter
from typing import Any

from benchmarks.garbage.tables import ERRORS, KINDS, Table, believed
from lightfield.diagnosis.diagnose import diagnose

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
        "claimed": [*verdict.certain, *verdict.simplest, *verdict.partial],
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
    lines += ["", *_claims(rows)]
    return "\n".join(lines) + "\n"


def _claims(rows: list[dict[str, Any]]) -> list[str]:
    """Names that a table without an answer is said to be certain of, as far as the rest allows."""
    named = [r for r in rows if r.get("claimed")]
    lines = [f"**Tables in which an effect is called certain, simplest or partial: {len(named)}.**"]
    if named:
        lines += ["", "| table | names | said |", "|---|---|---|"]
        lines += [
            f"| {r['kind']}, errors {r['errors']}, {r['draw']} | {' '.join(r['claimed'])} | {r['sentence']} |"
            for r in named
        ]
    return lines
