"""The page of every effect in turn."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from benchmarks.each_effect.campaigns import CAMPAIGNS, effect_of
from benchmarks.hidden_effects.scores import Rate
from benchmarks.runs import Row
from lightfield.fitting import effects

#: What is missed by more than so many sigma ought to be found.
VISIBLE = 8.0

_HEAD = """# Every effect in turn

Written by `python -m benchmarks.each_effect`; do not edit.

Every effect of the table, and every curve but a lamp's (`benchmarks/many_effects` has those), in a campaign
chosen for it: at 2.5, 5 and 10 times its typical size, alone and beside two of what most tanks have (a
background, a lamp off its place, a drift, a saturation). The light comes from the full render, and what the
experimenter is told of width and absorption is 10 to 25 % wrong (of the measured lamp's tank it is right).
Errors of 0.5 or 1 % and a dark floor.

**sigma**: by how much the noise-free readings are missed without it, everything else that was hidden
refitted; near nought, what is always free takes it (width, absorption, a gain within the calibration's
error). **Found**: it, or a curve that contains it, is in the best set, of the sets where sigma is above 8.
**Certain**: the same, and called so. **Wrong**: names in all best sets that were not hidden (nor contain
what was), and how many of them were called certain. **Instead**: what else the sets hold where it is not
found. **Pulls**: (found - hidden) / error of its parameters, rms; 1 is right.
"""


def page(rows: Sequence[Row], planned: int) -> str:
    """The page, as Markdown."""
    versions = ", ".join(f"{v} ({n} sets)" for v, n in Counter(r["code"] for r in rows).most_common())
    failed = [r for r in rows if r["verdict"] == "error"]
    hidden = [r for r in rows if r["asked"] and r["verdict"] != "error"]
    lines = [
        _HEAD,
        f"**{len(rows)} sets** of {planned} planned; {len(failed)} ended in an error. Code: {versions}.",
        *(f"- {r['key']}: {r['error']}" for r in failed),
        "",
        _summary(hidden),
        "",
        *_nulls([r for r in rows if not r["asked"] and r["verdict"] != "error"]),
        "",
        *_effects(hidden),
    ]
    return "\n".join(lines) + "\n"


def _nulls(rows: Sequence[Row]) -> list[str]:
    claimed = sum(bool(r["certain"] or r["simplest"]) for r in rows)
    held = sum(bool(r["best_set"]) for r in rows)
    lines = [
        "## Nothing hidden",
        "",
        "| campaign | sets | a claimed name | a name in the best set |",
        "|---|---|---|---|",
    ]
    for campaign in CAMPAIGNS:
        mine = [r for r in rows if r["campaign"] == campaign.name]
        names = [n for r in mine for n in r["best_set"]]
        told = f": {', '.join(sorted(set(names)))}" if names else ""
        wrong = sum(bool(r["certain"] or r["simplest"]) for r in mine)
        with_name = sum(bool(r["best_set"]) for r in mine)
        lines.append(f"| {campaign.name} | {len(mine)} | {wrong} | {with_name}{told} |")
    return [*lines, f"| **all** | {len(rows)} | {Rate(claimed, len(rows))} | {Rate(held, len(rows))} |"]


def _effects(rows: Sequence[Row]) -> list[str]:
    lines = [
        "## What is hidden",
        "",
        "| effect | campaign | sets | sigma | found | certain | wrong, certain | instead | pulls | s |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for campaign in CAMPAIGNS:
        for name in campaign.effects:
            if mine := [r for r in rows if r["asked"] == name]:
                lines.append(_line(name, campaign.name, mine))
    asked = {r["asked"] for r in rows}
    if missing := [n for campaign in CAMPAIGNS for n in campaign.effects if n not in asked]:
        lines += ["", f"No set yet: {', '.join(missing)}."]
    return lines


def _summary(rows: Sequence[Row]) -> str:
    seen = [r for r in rows if r["delta"] > VISIBLE]
    found = sum(_is_found(r) for r in seen)
    wrong = [n for r in rows for n in r["certain"] if n in _wrong(r)]
    certain = sum(len(r["certain"]) for r in rows)
    return (
        f"**Above {VISIBLE:g} sigma {Rate(found, len(seen))} are in the best set; of all certain names "
        f"{Rate(len(wrong), certain)} were not hidden.** In brackets: 95 % Clopper-Pearson limits; sets."
    )


def _line(name: str, campaign: str, rows: Sequence[Row]) -> str:
    seen = [r for r in rows if r["delta"] > VISIBLE]
    deltas = [r["delta"] for r in rows]
    found = [r for r in seen if _is_found(r)]
    certain = [r for r in found if _known_by(r) & set(r["certain"])]
    wrong = [n for r in rows for n in _wrong(r)]
    sure = [n for r in rows for n in r["certain"] if n in _wrong(r)]
    instead = Counter(n for r in seen if not _is_found(r) for n in _wrong(r))
    told = ", ".join(n for n, _ in instead.most_common(3))
    pulls = [p for r in found for p in r["pulls"].values()]
    rms = f"{np.sqrt(np.mean(np.square(pulls))):.1f}" if pulls else "-"
    seconds = np.median([r["cpu_seconds"] for r in rows])
    return (
        f"| {name} | {campaign} | {len(rows)} | {min(deltas):.0f} to {max(deltas):.0f} | {len(found)} of "
        f"{len(seen)} | {len(certain)} | {len(wrong)}, {len(sure)} | {told} | {rms} | {seconds:.0f} |"
    )


def _known_by(row: Row) -> set[str]:
    """Names that stand for what was asked about."""
    effect, curves = effect_of(row["asked"]), effects.curves().items()
    return {effect, *(name for name, curve in curves if effect in curve.contains)}


def _is_found(row: Row) -> bool:
    return bool(_known_by(row) & set(row["best_set"]))


def _wrong(row: Row) -> set[str]:
    """Names of the best set that were not hidden, nor contain what was."""
    curves = effects.curves()
    right = {n for n in row["best_set"] if n in curves and set(curves[n].contains) & set(row["hidden"])}
    return set(row["best_set"]) - set(row["hidden"]) - right
