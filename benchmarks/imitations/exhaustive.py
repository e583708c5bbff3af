"""The sets of one and two effects that come nearest to readings, by fits of all of them from many places."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, product

import numpy as np

from benchmarks.imitations.layouts import Shown
from lightfield.diagnosis.problem.candidates import Candidate, go_together
from lightfield.diagnosis.problem.problem import Explanation
from lightfield.diagnosis.search.pool.fitted_sets import Pool
from lightfield.diagnosis.search.pool.quick import Begin, quick_fit

#: Sizes over the typical one from which fits begin, up and down; steps of each, how many are followed to the
#: end, and steps there.
_SIZES, _ROUGH, _BEST, _STEPS = (1.0, 5.0), 8, 2, 40
_LEFT = 0.01


def nearest(shown: Shown, pool: Pool) -> dict[tuple[str, ...], float]:
    """Chi-square of every set of at most two other effects, the best of its forms, by names."""
    rng = np.random.default_rng(2)
    others = [c for c in shown.problem.candidates if c.name != shown.effect.name]
    out: dict[tuple[str, ...], float] = {}
    sets: list[Explanation] = [(), *((c,) for c in others), *combinations(others, 2)]
    for whole in sets:
        if go_together(whole):
            names = tuple(sorted(c.name for c in whole))
            out[names] = min(out.get(names, np.inf), _chi2(shown, pool, whole, rng))
    return out


def _chi2(shown: Shown, pool: Pool, whole: Explanation, rng: np.random.Generator) -> float:
    problem, whiten = shown.problem, pool.ground.test.whiten
    known = pool.nodes[frozenset()].fit.by_path

    def fit(begin: dict[str, float], steps: int) -> tuple[float, dict[str, float]]:
        made = quick_fit(problem, whole, whiten, Begin({**known, **begin}), steps, _LEFT)
        return made.chi2, made.by_path

    rough = sorted((fit(begin, _ROUGH) for begin in _begins(whole, rng)), key=lambda f: f[0])
    return min(fit(begin, _STEPS)[0] for _, begin in rough[:_BEST])


def _begins(whole: Explanation, rng: np.random.Generator) -> Iterator[dict[str, float]]:
    signs = [(1.0,) if c.one_sided else (1.0, -1.0) for c in whole]
    for size in _SIZES:
        for of_each in product(*signs):
            begin: dict[str, float] = {}
            for one, sign in zip(whole, of_each, strict=True):
                begin |= _at(one, sign * size, rng)
            yield begin


def _at(one: Candidate, times: float, rng: np.random.Generator) -> dict[str, float]:
    """A place within its ranges, with a shape of the grid that is drawn."""
    out = {
        p.path: float(np.clip(p.start + times * typical, *_inside(p.low, p.high)))
        for p, typical in zip(one.amplitudes, one.typical, strict=True)
    }
    shape = one.grid[rng.integers(len(one.grid))]
    return out | {p.path: float(at) for p, at in zip(one.shapes, shape, strict=True)}


def _inside(low: float, high: float) -> tuple[float, float]:
    margin = 0.02 * (high - low)
    return low + margin, high - margin
