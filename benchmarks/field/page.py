"""The page of cases that were diagnosed: scores, and case by case."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from benchmarks.field.cases import explained, found, wrong
from benchmarks.runs import Row


def _part(count: int, whole: int) -> str:
    return f"{count} of {whole}" + (f" ({100 * count / whole:.0f} %)" if whole else "")


def _of(values: Sequence[float]) -> str:
    return f"{np.median(values):.0f}, {max(values):.0f}" if values else "-"


def _scores(rows: Sequence[Row]) -> list[str]:
    hidden = sum(len(r["hidden"]) for r in rows)
    best = sum(len(r["best_set"]) for r in rows)
    certain = [n for r in rows for n in r["certain"]]
    simplest = [n for r in rows for n in r["simplest"]]
    partial = [n for r in rows for n in r["partial"]]
    seconds = np.array([r["cpu_seconds"] for r in rows])
    return [
        _part(sum(map(explained, rows)), len(rows)),
        _part(sum(len(found(r)) for r in rows), hidden),
        _part(sum(len(wrong(r, r["best_set"])) for r in rows), best),
        _part(sum(len(wrong(r, r["certain"])) for r in rows), len(certain)),
        _part(sum(len(wrong(r, r["simplest"])) for r in rows), len(simplest)),
        _part(sum(len(wrong(r, r["partial"])) for r in rows), len(partial)),
        f"{np.median(seconds):.0f}, {seconds.max():.0f}",
        _of([r["cpu_seconds"] / r["unit_seconds"] for r in rows if "unit_seconds" in r]),
        _of([r["peak_mb"] for r in rows if "peak_mb" in r]),
    ]


_NAMES = (
    "explained", "hidden names in the best set", "other names in the best set", "wrong among certain",
    "wrong among simplest", "wrong among partial", "processor seconds, median and most",
    "the same over 1e8 exponentials by NumPy", "peak memory in MB, median and most",
)  # fmt: skip


def page(rows: Sequence[Row], head: str, kinds: Mapping[str, Sequence[Row]]) -> str:
    """The page, as Markdown: scores of kinds of cases side by side, and every case."""
    lines = [head, f"{len(rows)} cases.", "", f"| | {' | '.join(kinds)} |", "|---|" + "---|" * len(kinds)]
    columns = [_scores(mine) if mine else ["-"] * len(_NAMES) for mine in kinds.values()]
    for k, name in enumerate(_NAMES):
        lines.append(f"| {name} | {' | '.join(column[k] for column in columns)} |")
    lines += [
        "", "Certain, simplest, partial: the levels that `lightfield diagnose` gives every effect. A name is",
        "wrong when it was not hidden; the curve of a beam profile is right where the lamp is no Gaussian.",
        "",
        "## Case by case", "",
        "| case | hidden | verdict | certain | simplest | one of | partial | missed | error in % | s |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    return "\n".join([*lines, *map(_line, rows)]) + "\n"


def _line(row: Row) -> str:
    hidden = " + ".join([*([f"lamp: {row['lamp']}"] if row["lamp"] else []), *row["hidden"]])

    def told(names: Sequence[str]) -> str:
        return ", ".join(f"**{n}**" if wrong(row, [n]) else n for n in names)

    first, last, floor = row["percent"]
    cells = [
        row["case"], hidden, row["verdict"], told(row["certain"]), told(row["simplest"]),
        "; ".join(map("/".join, row["slots"])), told(row["partial"]),
        ", ".join(n for n in row["hidden"] if n not in row["best_set"]),
        f"{first:.3g} → {last:.3g} (noise {floor:.2g})", f"{row['cpu_seconds']:.0f}",
    ]  # fmt: skip
    return "| " + " | ".join(cells) + " |"
