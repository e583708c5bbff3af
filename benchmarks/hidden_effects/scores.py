"""The scores of the benchmark, each with its Clopper-Pearson limits and its aims."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import optimize, stats

from benchmarks.hidden_effects import judge
from benchmarks.runs import Row

Test = Callable[[Row], bool]
DELTAS = (0.0, 2.0, 3.0, 5.0, 8.0, 15.0, 30.0, 100.0, np.inf)
DISTANCES = (0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 10.0, np.inf)


def limits(hits: int, n: int, level: float = 0.95) -> tuple[float, float]:
    """Clopper-Pearson limits of a proportion (Clopper and Pearson 1934, Biometrika 26, 404)."""
    tail = (1 - level) / 2
    low = float(stats.beta.ppf(tail, hits, n - hits + 1)) if hits else 0.0
    high = float(stats.beta.isf(tail, hits + 1, n - hits)) if hits < n else 1.0
    return low, high


@dataclass(frozen=True)
class Rate:
    """A proportion."""

    hits: int
    n: int

    def __str__(self) -> str:
        if not self.n:
            return "no sets"
        low, high = limits(self.hits, self.n)
        return f"{100 * self.hits / self.n:.1f} % ({100 * low:.1f}-{100 * high:.1f}; {self.hits}/{self.n})"

    @property
    def value(self) -> float:
        return self.hits / self.n if self.n else float("nan")


def rate(rows: Sequence[Row], test: Test) -> Rate:
    return Rate(sum(map(test, rows)), len(rows))


@dataclass(frozen=True)
class Score:
    """One line of the table; `met` tells which aims the measured value itself keeps."""

    name: str
    value: str
    release: str
    world: str
    met: str


def _score(
    name: str, value: str, at: float, release: float, world: float, sense: str, unit: str = " %"
) -> Score:
    """A number beside two aims; `sense` is "<=" or ">="."""
    keeps = (lambda aim: at <= aim) if sense == "<=" else (lambda aim: at >= aim)
    met = (
        "-" if np.isnan(at) else "world class" if keeps(world) else "release" if keeps(release) else "missed"
    )
    return Score(name, value, f"{sense} {release:g}{unit}", f"{sense} {world:g}{unit}", met)


def _rate(name: str, found: Rate, release: float, world: float, sense: str) -> Score:
    return _score(name, str(found), 100 * found.value, release, world, sense)


def of_stratum(rows: Sequence[Row], *strata: str) -> list[Row]:
    return [r for r in rows if r["stratum"] in strata and r["verdict"] != "error"]


def detection_points(rows: Sequence[Row]) -> tuple[float, float]:
    """Delta at which half, and 95 %, are detected: probit regression on ln(delta)."""
    some = [r for r in rows if 0.3 < r["delta"] < 60]
    if len(some) < 20:
        return float("nan"), float("nan")
    x = np.log([r["delta"] for r in some])
    seen = np.array([judge.detected(r) for r in some])

    def loss(p: np.ndarray) -> float:
        z = (x - p[0]) * np.exp(p[1])
        return -float(np.sum(stats.norm.logcdf(np.where(seen, z, -z))))

    middle, steep = optimize.minimize(loss, [np.log(4.0), np.log(3.0)], method="Nelder-Mead").x
    return float(np.exp(middle)), float(np.exp(middle + 1.645 / np.exp(steep)))


def pulls(rows: Sequence[Row]) -> np.ndarray:
    """(estimate - truth) / error of the hidden values in right claims of clear effects."""
    out = []
    for row in rows:
        if judge.claim_right(row) and row["delta"] > judge.CLEAR_SIGMA:
            for path, true in row["values"].items():
                value, stderr = row["parameters"].get(path, (0.0, None))
                if stderr:
                    out.append((value - true) / stderr)
    return np.array(out)


def _false_alarms(rows: Sequence[Row]) -> list[Score]:
    nulls = of_stratum(rows, "null")
    out = []
    for kind in sorted({r["noise_kind"] for r in nulls}):
        found = rate([r for r in nulls if r["noise_kind"] == kind], judge.detected)
        high = 100 * limits(found.hits, found.n)[1]
        out.append(_score(f"false alarm, {kind} noise (upper limit counts)", str(found), high, 5, 5, "<="))
    out.append(_rate("named false alarm", rate(nulls, judge.claimed), 1, 0.3, "<="))
    unseen = [r for r in of_stratum(rows, "one", "other physics") if not judge.visible(r)]
    out.append(Score("detected although delta < 2", str(rate(unseen, judge.detected)), "-", "-", "-"))
    return out


def _one(rows: Sequence[Row]) -> list[Score]:
    one, other = of_stratum(rows, "one"), of_stratum(rows, "other physics")
    claims, others = [r for r in one if judge.claimed(r)], [r for r in other if judge.claimed(r)]
    out = [
        _rate("claim precision", rate(claims, judge.claim_right), 98, 99, ">="),
        _rate("other physics: claim contains truth", rate(others, judge.contains_truth), 93, 97, ">="),
        _rate("other physics: family right", rate(others, judge.family_right), 95, 98, ">="),
    ]
    for name, some, release, world in (("", one, 95, 97), (", other physics", other, 93, 96)):
        told = [r for r in some if judge.size(r) == 1 and judge.visible(r)]
        out.append(
            _rate(f"truth in set{name} (one-effect verdicts)", rate(told, judge.in_set), release, world, ">=")
        )
    told = [r for r in one if r["delta"] > judge.CLEAR_SIGMA and "D" in r and judge.size(r) == 1]
    if told:
        first = rate(told, lambda r: judge.is_truth(r, r["effects"]))
        ceiling = float(np.mean(stats.norm.cdf(np.array([r["D"] for r in told]) / 2)))
        behind = 100 * (first.value - ceiling)
        text = f"{behind:+.1f} points ({first}, ceiling {100 * ceiling:.1f} %)"
        out.append(_score("first name minus ceiling, delta > 5", text, behind, -3, -1, ">=", " points"))
    clear = [r for r in one if r["delta"] >= 8 and r.get("D", 0) >= 6]
    out.append(_rate("claims where D >= 6 and delta >= 8", rate(clear, judge.claim_right), 90, 97, ">="))
    half, most = detection_points(one)
    out.append(
        _score("detection, 95 % point", f"delta = {most:.1f} (50 %: {half:.1f})", most, 8, 6, "<=", "")
    )
    return out


def _two_and_unknown(rows: Sequence[Row]) -> list[Score]:
    two, unknown = of_stratum(rows, "two"), [r for r in of_stratum(rows, "unknown") if r["delta"] > 8]
    claims = [r for r in two if judge.claimed(r)]
    both = [r for r in two if judge.size(r) == 2]
    unexplained = [r for r in unknown if r["verdict"] == "unexplained"]
    return [
        _rate("two effects: all names of a claim true", rate(claims, judge.names_true), 93, 97, ">="),
        _rate("two effects: pair in set of two-effect verdicts", rate(both, judge.in_set), 93, 97, ">="),
        _rate("unknown, delta > 8: false named claim", rate(unknown, _falsely_named), 15, 8, "<="),
        _rate("coordinate of the unexplained", rate(unexplained, judge.coordinate_right), 85, 95, ">="),
    ]


def _falsely_named(row: Row) -> bool:
    return judge.claimed(row) and not judge.told_by_its_curve(row)


def _numbers(rows: Sequence[Row]) -> list[Score]:
    out = []
    pull = np.abs(pulls(of_stratum(rows, "one", "two")))
    if len(pull):
        inside = [100 * float(np.mean(pull < k)) for k in (1.0, 1.96)]
        off = max(abs(inside[0] - 68.3), abs(inside[1] - 95.0))
        text = f"{inside[0]:.0f} / {inside[1]:.0f} % of {len(pull)}"
        out.append(_score("parameters inside 68 / 95 % limits", text, off, 5, 3, "<=", " points off"))
    measured = [r for r in rows if "error_oracle" in r and r["error_base"] > 1.2 * r["error_oracle"]]
    if measured:
        base, fit, best = (np.array([r[f"error_{k}"] for r in measured]) for k in ("base", "fit", "oracle"))
        gain, ratio = float(np.median((base - fit) / (base - best))), float(np.median(fit / best))
        out.append(_score("error reduction over the best possible, median", f"{gain:.3f} of {len(measured)}",
                          gain, 0.95, 0.98, ">=", ""))  # fmt: skip
        out.append(
            _score("error over the best possible, median", f"{ratio:.3f}", ratio, 1.05, 1.02, "<=", "")
        )
    held = [
        r
        for r in rows
        if judge.claimed(r) and r["stratum"] != "null" and None not in r.get("held_out", [None])
    ]
    worse = rate(held, lambda r: r["held_out"][1] > r["held_out"][0])
    out.append(_rate("held-out planes worse after a claim", worse, 5, 2, "<="))
    asked = [r for r in rows if "advice" in r and judge.rival_of_truth(r) and r["advice"]["predicted"] > 5]
    out.append(_rate("predicted D > 5: rival rejected", rate(asked, judge.rival_rejected), 90, 97, ">="))
    times = [r for r in rows if r.get("n", 999) <= 400 and "seconds" in r]
    if times:
        for name, key in (("wall clock", "seconds"), ("processor", "cpu_seconds")):
            t = np.array([r[key] for r in times])
            text = f"{np.median(t):.2f} / {np.quantile(t, 0.95):.2f} / {t.max():.2f} s"
            met = [np.median(t) <= a and t.max() <= b for a, b in ((0.5, 2.0), (1.0, 5.0))]
            out.append(Score(f"{name} time, median / 95 % / max", text, "<= 1 / - / 5 s", "<= 0.5 / - / 2 s",
                             "world class" if met[0] else "release" if met[1] else "missed"))  # fmt: skip
    return out


def scores(rows: Sequence[Row]) -> list[Score]:
    """All scores."""
    return [*_false_alarms(rows), *_one(rows), *_two_and_unknown(rows), *_numbers(rows)]
