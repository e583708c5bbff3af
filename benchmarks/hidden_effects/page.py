"""The page of the benchmark: scores, strata, failures, independent cases; and the same as JSON."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from benchmarks.hidden_effects import judge, pictures
from benchmarks.hidden_effects.catalogue import SEQUENCES
from benchmarks.hidden_effects.scores import DELTAS, DISTANCES, of_stratum, rate, scores
from benchmarks.runs import Row
from lightfield.storage.files import write_text

_FAILURES = 60


def _table(head: Sequence[str], lines: Sequence[Sequence[Any]]) -> list[str]:
    return [
        "| " + " | ".join(head) + " |",
        "|" + "---|" * len(head),
        *("| " + " | ".join(map(str, line)) + " |" for line in lines),
        "",
    ]


def _percent(rows: Sequence[Row], test: Callable[[Row], bool]) -> str:
    return f"{100 * rate(rows, test).value:.0f} %" if rows else "-"


def _by_delta(rows: Sequence[Row]) -> list[str]:
    lines = []
    for low, high in pairwise(DELTAS):
        some = [r for r in rows if low <= r["delta"] < high]
        if some:
            told = [r for r in some if judge.size(r)]
            claims = [r for r in some if judge.claimed(r)]
            lines.append([
                f"{low:g} to {high:g}", len(some),
                _percent(some, judge.detected), _percent(some, judge.claimed),
                _percent(claims, judge.claim_right), _percent(told, judge.in_set),
                _percent(some, lambda r: r["verdict"] == "unexplained"),
            ])  # fmt: skip
    return _table(
        ["delta", "sets", "detected", "claimed", "claim right", "truth in set", "unexplained"], lines
    )


def _by_distance(rows: Sequence[Row]) -> list[str]:
    lines = []
    named = [r for r in rows if judge.size(r) == 1 and r["delta"] > judge.CLEAR_SIGMA and "D" in r]
    for low, high in pairwise(DISTANCES):
        some = [r for r in named if low <= r["D"] < high]
        if some:
            ceiling = 100 * float(np.mean(stats.norm.cdf(np.array([r["D"] for r in some]) / 2)))
            lines.append([
                f"{low:g} to {high:g}", len(some), _percent(some, lambda r: judge.is_truth(r, r["effects"])),
                f"{ceiling:.0f} %", _percent(some, judge.claimed),
                _percent([r for r in some if judge.claimed(r)], judge.claim_right),
            ])  # fmt: skip
    return _table(["D", "sets", "first name right", "ceiling", "claimed", "claim right"], lines)


def _by_truth(rows: Sequence[Row]) -> list[str]:
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        if row["stratum"] != "null":
            name = row["label"].rpartition(" x")[0] or row["label"]
            groups.setdefault((row["stratum"], name), []).append(row)
    words = ("right", "in set", "one of two", "not seen", "unexplained", "wrong", "false alarm", "error")
    lines = []
    for (stratum, name), some in sorted(groups.items()):
        found = Counter(map(judge.outcome, some))
        sigma = [r["delta"] for r in some if "delta" in r]
        reach = f"{min(sigma):.1f} to {max(sigma):.0f}" if sigma else "-"
        lines.append([stratum, name, len(some), reach, *(found[w] or "" for w in words)])
    return _table(["stratum", "hidden", "sets", "delta", *words], lines)


def _failed(row: Row) -> bool:
    bad = judge.outcome(row) in ("wrong", "error") or (
        judge.outcome(row) == "false alarm" and judge.claimed(row)
    )
    lost = (
        row["stratum"] != "unknown"
        and row.get("delta", 0) >= 8
        and judge.outcome(row) in ("not seen", "unexplained")
    )
    return bad or lost


def _failures(rows: Sequence[Row]) -> list[str]:
    failed = sorted((r for r in rows if _failed(r)), key=lambda r: (r["stratum"], r["key"]))
    lines = []
    for row in failed[:_FAILURES]:
        accepted = "; ".join(" + ".join(e["effects"]) for e in row.get("explanations", [])[:3])
        rival = f"{row['D']:.1f} ({row['rival']})" if "D" in row else "-"
        sigma = f"{row.get('delta', 0):.1f}"
        lines.append(
            [row["key"], row["seed"], sigma, rival, row["verdict"], accepted or row.get("error", "-")]
        )
    more = [f"and {len(failed) - _FAILURES} more, in summary.json.", ""] if len(failed) > _FAILURES else []
    return [*_table(["set", "seed", "delta", "D (rival)", "verdict", "accepted, best first"], lines), *more]


def _independent(cases: Sequence[Row]) -> list[str]:
    lines = []
    for r in cases:
        told = " + ".join(r["effects"]) or r.get("coordinate") or "-"
        also = ", ".join("+".join(e["effects"]) for e in r["explanations"][1:4])
        where = [r["case"], r["label"], r["layout"], r["noise"], f"{r['delta']:.1f}"]
        lines.append(
            [*where, r["verdict"], told, also or "-", judge.outcome(r), f"{r.get('seconds', 0):.1f}"]
        )
    found = Counter(judge.outcome(r) for r in cases)
    clear = [r for r in cases if judge.visible(r) and r["delta"] >= judge.CLEAR_SIGMA and not r["unknown"]]
    words = ", ".join(f"{n} {word}" for word, n in found.most_common())
    several = sum(judge.outcome(r) == "in set" for r in clear)
    head = ("case", "hidden", "layout", "noise", "delta", "verdict", "first (or coordinate)", "also accepted",
            "outcome", "s")  # fmt: skip
    return [
        f"{len(cases)} cases made by a separate Monte Carlo code that shares nothing with this project: "
        f"{words}. Of {len(clear)} with a known effect of at least 5 sigma, "
        f"{sum(map(judge.claim_right, clear))} are named exactly; in {several} the truth "
        "is one of several reported explanations.",
        "",
        *_table(head, lines),
    ]


_ABOUT = """# Hidden effects: does the diagnosis find them?

Written by `python -m benchmarks.hidden_effects`; do not edit.

Every set is a measurement with a secret. The light comes from the renderer (a fresh trace with other seeds, a
lamp window 4 cm wide, the real tank); the diagnosis has to find the secret with its fast model. Width and
absorption that it is told are 10 to 25 % wrong. One render is read several times with new noise, scan orders
(three random to one plane by plane) and noise levels (0.4 and 1 % of a bright reading, and a floor); readout
effects and unknown influences act after the render. *Other physics*: scattering after Petzold or Fournier and
Forand, where the fit knows Henyey-Greenstein; lamps of measured shape; clouds of other thickness; second
functional forms (exponential warm-up, layer, quadratic saturation).

- **delta**: distance of the noise-free readings from the refitted base model, in sigma. Below 2 nobody can
  see the effect, and the right verdict is "none".
- **D**: distance of the noise-free readings from the nearest that a single other effect can produce. Nobody
  names the right one of two more often than Phi(D/2).
- A **claim** is a single accepted explanation (or a weight above 0.95). It is right only if it is exactly the
  truth, however close the rival.
"""


def markdown(rows: Sequence[Row], cases: Sequence[Row], planned: int) -> str:
    """The whole page."""
    kinds = Counter(r["stratum"] for r in rows)
    told = ", ".join(f"{n} {word}" for word, n in sorted(kinds.items()))
    versions = Counter(r.get("code", "unknown") for r in rows)
    errors = sum(r["verdict"] == "error" for r in rows)
    one = of_stratum(rows, "one")
    noise = np.array([r["render_sigma"] for r in rows if r.get("render_sigma", 0) > 0] or [0.0])
    lines = [
        _ABOUT,
        f"**{len(rows)} sets** of {planned} planned ({told}); {errors} ended in an error. Code: "
        + ", ".join(f"{v} ({n} sets)" for v, n in versions.most_common())
        + f". Monte Carlo error of the {len(noise)} sets with diffuse light: {np.median(noise):.2f} "
        f"(median), {noise.max():.2f} (largest) of a reading's noise, rms.",
        "",
        "## Scores",
        "",
        "In brackets: 95 % Clopper-Pearson limits; sets. Sets of one render are not independent of each "
        f"other, nor are sets judged with one of the {SEQUENCES} random sequences of the transport response; "
        "so the limits are somewhat too narrow for rates that depend on the truth more than on the noise. "
        "*Reached* compares the measured value with the aims, for false alarms its upper limit; "
        "where there are few sets it says little. Times count where nothing else kept the machine busy: "
        "where wall clock time is far beyond processor time, something did.",
        "",
        *_table(["score", "measured", "release aim", "world class", "reached"],
                [[s.name, s.value, s.release, s.world, s.met] for s in scores(rows)]),
        "![What hidden effects were called](confusion.png)",
        "",
        "![Calibration](calibration.png)",
        "",
        "a: detection. b: naming, against the ceiling. c: weight of the first explanation. d: pulls of the "
        "parameters.",
        "",
        "## One effect, by delta",
        "",
        *_by_delta(one),
        "Other physics:",
        "",
        *_by_delta(of_stratum(rows, "other physics")),
        "## One effect of more than 5 sigma, by distance to the nearest rival",
        "",
        *_by_distance(one),
        "## By what was hidden",
        "",
        *_by_truth(rows),
        "## Failures",
        "",
        "Wrong claims, truth missing from the accepted explanations, and effects above 8 sigma that were not "
        "explained.",
        "",
        *_failures(rows),
    ]  # fmt: skip
    if cases:
        lines += ["## Independent cases", "", *_independent(cases)]
    return "\n".join(lines).rstrip() + "\n"


def _summary(rows: Sequence[Row], cases: Sequence[Row]) -> dict[str, Any]:
    columns = ("key", "seed", "delta", "D", "verdict", "outcome", "accepted", "seconds", "code")
    versions = sorted({r.get("code", "unknown") for r in [*rows, *cases]})

    def line(r: Row) -> list[Any]:
        number = [round(r[k], 2) if r.get(k) is not None else None for k in ("delta", "D")]
        accepted = ["+".join(e["effects"]) for e in r.get("explanations", [])[:3]]
        return [r.get("key", r.get("case")), r.get("seed"), *number, r["verdict"], judge.outcome(r), accepted,
                round(r.get("seconds", 0), 2), versions.index(r.get("code", "unknown"))]  # fmt: skip

    return {
        "scores": [asdict(s) for s in scores(rows)],
        "code": versions,
        "columns": columns,
        "sets": [line(r) for r in rows],
        "independent": [line(r) for r in cases],
    }


def write(rows: Sequence[Row], cases: Sequence[Row], planned: int, folder: Path) -> str:
    """README.md, summary.json, confusion.png and calibration.png; returns the scores as text."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = sorted(rows, key=lambda r: r["key"])
    text = markdown(rows, cases, planned)
    write_text(folder / "README.md", text)
    told = json.dumps(_summary(rows, cases), separators=(",", ":")).replace('],["', '],\n["')
    write_text(folder / "summary.json", told + "\n")
    pictures.confusion(rows, folder / "confusion.png")
    pictures.calibration(rows, folder / "calibration.png")
    wide = [f"{s.name:<58}{s.value:<44}{s.met}" for s in scores(rows)]
    return "\n".join(
        [
            f"{len(rows)} of {planned} sets, {len(cases)} independent cases",
            *wide,
            f"page: {folder / 'README.md'}",
        ]
    )
