"""Confusion matrix and calibration, as pictures."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy import stats

from benchmarks.hidden_effects import judge
from benchmarks.hidden_effects.scores import DELTAS, DISTANCES, limits, of_stratum, pulls
from benchmarks.runs import Row
from lightfield.fitting import effects
from lightfield.storage.files import atomic_path

BLUE, GREY = "#2b6ca3", "#777777"
matplotlib.use("Agg")


def _save(figure: Figure, path: Path) -> None:
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=110, format="png", metadata={"Software": None})


def confusion(rows: Sequence[Row], path: Path) -> None:
    """What single effects of delta >= 5 were called: the first name, forced where several were reported."""
    some = [r for r in of_stratum(rows, "one", "other physics") if r["delta"] >= judge.CLEAR_SIGMA]
    names = [n for n in effects.table() if any(r["hidden"] == [n] for r in some)]
    curves = [n for n in effects.curves() if any(r["effects"] == [n] for r in some)]
    called = [*effects.table(), *curves, "several effects", "unexplained", "none"]
    counts = np.zeros((len(names), len(called)))
    for row in some:
        told = (
            "several effects"
            if judge.size(row) > 1
            else row["effects"][0]
            if judge.size(row)
            else row["verdict"]
        )
        counts[names.index(row["hidden"][0]), called.index(told)] += 1
    called_some = [
        k for k in range(len(called)) if counts[:, k].any() or called[k] in names or k >= len(called) - 3
    ]
    counts, called = counts[:, called_some], [called[k] for k in called_some]
    part = counts / np.maximum(counts.sum(1, keepdims=True), 1)
    figure = Figure(figsize=(9.5, 7.2), layout="constrained")
    axes = figure.add_subplot()
    axes.imshow(part, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    axes.set_xticks(range(len(called)), [c.replace("_", " ") for c in called], rotation=60, ha="right")
    axes.set_yticks(
        range(len(names)), [f"{n.replace('_', ' ')} ({counts[k].sum():.0f})" for k, n in enumerate(names)]
    )
    for (j, k), count in np.ndenumerate(counts):
        if count:
            axes.text(k, j, f"{count:.0f}", ha="center", va="center", fontsize=8,
                      color="white" if part[j, k] > 0.55 else "black")  # fmt: skip
    axes.set_ylabel("hidden (sets)")
    axes.set_xlabel("called (first name)")
    axes.set_title("One hidden effect of at least 5 sigma: what it was called", fontsize=11)
    _save(figure, path)


def _points(axes: Axes, groups: Sequence[tuple[Sequence[float], Sequence[bool]]]) -> None:
    for at, hits in groups:
        if at:
            p = float(np.mean(hits))
            low, high = limits(int(np.sum(hits)), len(hits))
            axes.errorbar(
                np.median(at), p, [[max(p - low, 0)], [max(high - p, 0)]], fmt="o", color=BLUE, ms=4, lw=1
            )


def calibration(rows: Sequence[Row], path: Path) -> None:
    """Detection against delta, first name against D, fraction right against weight, pulls."""
    one = of_stratum(rows, "one")
    figure = Figure(figsize=(9.5, 7.2), layout="constrained")
    detection, naming, weight, pull = figure.subplots(2, 2).ravel()

    groups = [[r for r in one if a <= r["delta"] < b] for a, b in pairwise((0.0, 1.0, *DELTAS[1:]))]
    _points(detection, [([max(r["delta"], 0.3) for r in g], [judge.detected(r) for r in g]) for g in groups])
    detection.set(
        xscale="log", xlim=(0.25, 400), xlabel="delta: size of the effect (sigma)", ylabel="detected"
    )

    named = [r for r in one if judge.size(r) == 1 and r["delta"] > judge.CLEAR_SIGMA and "D" in r]
    groups = [[r for r in named if a <= r["D"] < b] for a, b in pairwise(DISTANCES)]
    _points(naming, [([r["D"] for r in g], [judge.is_truth(r, r["effects"]) for r in g]) for g in groups])
    d = np.geomspace(0.1, 300, 200)
    naming.plot(d, stats.norm.cdf(d / 2), color=GREY, lw=1, label="ceiling, Phi(D/2)")
    naming.set(xscale="log", xlabel="D: distance to the nearest rival (sigma)", ylabel="first name right")
    naming.legend(frameon=False, loc="lower right")

    told = [r for r in of_stratum(rows, "one", "other physics", "two") if judge.size(r) and judge.visible(r)]
    weights = [r["explanations"][0]["weight"] for r in told]
    groups = [
        [r for r, w in zip(told, weights, strict=True) if a <= w < b]
        for a, b in pairwise((0, 0.2, 0.4, 0.6, 0.8, 0.95, 1.01))
    ]
    _points(
        weight,
        [
            ([r["explanations"][0]["weight"] for r in g], [judge.is_truth(r, r["effects"]) for r in g])
            for g in groups
        ],
    )
    weight.plot([0, 1], [0, 1], color=GREY, lw=1)
    weight.set(xlabel="weight of the first explanation", ylabel="it is the truth", xlim=(0, 1.03))

    z = np.sort(pulls(of_stratum(rows, "one", "two")))
    if len(z):
        normal = stats.norm.ppf((np.arange(len(z)) + 0.5) / len(z))
        pull.plot(normal, np.clip(z, -6, 6), ".", color=BLUE, ms=4)
    pull.plot([-3, 3], [-3, 3], color=GREY, lw=1)
    pull.set(xlabel="normal quantile", ylabel="(estimate - truth) / error", ylim=(-6.2, 6.2))
    for axes, letter in zip((detection, naming, weight), "abc", strict=True):
        axes.set_ylim(-0.03, 1.03)
        axes.set_title(letter, loc="left", fontsize=11)
        axes.grid(alpha=0.25)
    pull.set_title("d", loc="left", fontsize=11)
    pull.grid(alpha=0.25)
    _save(figure, path)
