"""Ask of every named effect which others can stand for it, and write the page.

python -m benchmarks.imitations [--page FILE]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.imitations.exhaustive import nearest
from benchmarks.imitations.layouts import FLOOR, LAYOUTS, OWN, SIGMA, Shown, shown
from lightfield.diagnosis.problem.noise import Budget, Noise
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.pool.fitted_sets import Ground, Pool
from lightfield.diagnosis.search.pool.quick import Begin
from lightfield.diagnosis.search.pool.rivals import seek_rivals
from lightfield.diagnosis.search.preparation import whitened_test

#: Sets within so many sigma cannot be told apart by such readings, nor does the search miss one by less.
NEAR, MISSED = 3.0, 1.0

_HEAD = f"""# Which effects can stand for which

Written by `python -m benchmarks.imitations`; do not edit.

Readings of one named effect at a time, without noise, upwards and downwards, so large that without it they
would be missed by about {SIGMA:.0f} of their errors ({100 * OWN:g} % of each, {FLOOR:g} of the brightest;
width, absorption and the gain are free), or as large as it gets. Then every other set of at most two named
effects of direct light, in all their forms, is fitted to them from up to eight places, and what remains is
told in errors, the root of chi-square; of the two directions the one that is imitated better. Beside it
stands what the search for rivals of a diagnosis finds of sets so small. Light is that of the model itself:
the question is what its own effects can do for each other. What remains of less than {NEAR:g} is bold: these
readings cannot tell them apart. Missed is what the search leaves {MISSED:g} more of.
"""


class Line(NamedTuple):
    """What comes nearest to one effect: names, and what remains in sigma."""

    effect: str
    form: str
    sigma: float
    one: tuple[tuple[str, ...], float]
    two: tuple[tuple[str, ...], float]
    found: tuple[tuple[str, ...], float]
    near: list[tuple[str, ...]]


def _line(one: Shown) -> Line:
    problem, chosen = one.problem, (one.effect,)

    table = one.readings
    budget = Budget(plane_gain=0.0, position_m=0.0, tolerance=0.0)
    noise = Noise(problem.layout, table.stderr, table.value, budget, np.zeros(problem.layout.size))
    whiten = Whitener(noise, 0.0, 1.0, 0.0)
    test = whitened_test(problem, whiten, np.random.default_rng(0))
    known = problem.model(chosen).parameters
    start = np.array([p.coordinate_of(one.values.get(p.path, p.value(p.start))) for p in known])
    true = problem.fit(chosen, whiten, [start])
    pool = Pool(Ground(test, 1.0, test(true).nu))
    pool.finished(pool.fit((), [Begin(true.by_path)]))
    node = pool.finished(pool.fit(chosen, [Begin(true.by_path)]))
    every = {names: np.sqrt(chi2) for names, chi2 in nearest(one, pool).items()}
    seek_rivals(pool, node, one.effect)
    small = [n for n in pool.nodes.values() if len(n.explanation) <= 2 and one.effect.name not in n.names]
    found = min(small, key=lambda n: n.fit.chi2)
    singles = {names: left for names, left in every.items() if len(names) <= 1}
    of_one, of_two = min(singles, key=singles.__getitem__), min(every, key=every.__getitem__)
    near = [
        n
        for n, left in every.items()
        if left < NEAR and not any(set(m) < set(n) and every[m] < NEAR for m in every)
    ]
    return Line(
        one.effect.name, one.effect.form.name, every[()], (of_one, singles[of_one]), (of_two, every[of_two]),
        (tuple(sorted(found.names)), float(np.sqrt(found.fit.chi2))), near,
    )  # fmt: skip


def _told(names: tuple[str, ...], left: float) -> str:
    mark = "**" if left < NEAR else ""
    return f"{mark}{' + '.join(names) or 'no effect'} ({left:.1f}){mark}"


def _lines(layout: str) -> list[Line]:
    """Of every form of every effect that the layout may tell, the direction that is imitated better."""
    lines: dict[tuple[str, str], Line] = {}
    for each in shown(layout):
        line = _line(each)
        print(layout, line, file=sys.stderr, flush=True)
        known = lines.setdefault((line.effect, line.form), line)
        if line.two[1] < known.two[1]:
            lines[line.effect, line.form] = line
    return list(lines.values())


def _told_near(line: Line) -> str:
    return "; ".join(" + ".join(n) or "no effect" for n in line.near)


def _page() -> Iterator[str]:
    every = {layout: _lines(layout) for layout in LAYOUTS}
    missed = [
        f"{line.effect} ({layout})"
        for layout, lines in every.items()
        for line in lines
        if line.found[1] > line.two[1] + MISSED
    ]
    yield _HEAD
    yield f"**Missed by the search: {', '.join(missed) or 'none'}.** Cannot be told from each other:"
    for layout, lines in every.items():
        alike = "; ".join(f"{line.effect} from {_told_near(line)}" for line in lines if line.near)
        yield f"- {layout}: {alike or 'none'}."
    for layout, lines in every.items():
        yield f"\n## {layout.capitalize()}\n"
        yield "| effect | form | sigma | nearest one | nearest two | by the search | cannot be told from |"
        yield "|---|---|---|---|---|---|---|"
        for line in lines:
            told = " | ".join(_told(*of) for of in (line.one, line.two, line.found))
            yield f"| {line.effect} | {line.form} | {line.sigma:.0f} | {told} | {_told_near(line)} |"


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.imitations", description=__doc__)
    parser.add_argument("--page", type=Path, default=Path(__file__).parent / "README.md")
    args = parser.parse_args()
    with threadpool_limits(1, "blas"):
        args.page.write_text("\n".join(_page()) + "\n", encoding="utf-8")
    print(args.page)


if __name__ == "__main__":
    main()
