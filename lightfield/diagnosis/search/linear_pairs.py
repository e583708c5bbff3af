"""Pairs of effects by linear least squares on both their templates: finds two that hide each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.adequacy.score_tests import Score

#: What lowers chi-square by so much: two effects, each at one shape, with the amplitudes it then has.
Pair = tuple[float, tuple[tuple[Score, Array], tuple[Score, Array]]]

#: Keeps the normal equations of two templates that are one solvable. Chosen; on a thousandth and a thousand
#: times of it no answer hangs (test_cascade.py).
_RIDGE = 1e-8


def linear_pairs(scores: Sequence[Score], residual: Array) -> list[Pair]:
    """Pairs of effects that may act together, each at its best shapes, the greatest gain first.

    Parameters
    ----------
    residual : array, shape (n,)
        Whitened, of the fit that the scores belong to.
    """
    if not scores:
        return []
    columns = np.hstack([score.direction for score in scores])
    gram = columns.T @ columns + _RIDGE * np.eye(columns.shape[1])
    drawn = columns.T @ residual
    widths = [score.direction.shape[1] for score in scores]
    rows = np.split(np.arange(sum(widths)), np.cumsum(widths)[:-1])
    best: dict[frozenset[tuple[str, str]], Pair] = {}
    for j, two in enumerate(scores):
        for i, one in enumerate(scores[:j]):
            first, second = one.template.candidate, two.template.candidate
            if not first.effect.combines_with(second.effect):
                continue
            at = np.r_[rows[i], rows[j]]
            weights = np.linalg.solve(gram[np.ix_(at, at)], drawn[at])
            a, b = one.to_amplitude @ weights[: widths[i]], two.to_amplitude @ weights[widths[i] :]
            if (first.one_sided and a[0] <= 0) or (second.one_sided and b[0] <= 0):
                continue
            gain, key = float(weights @ drawn[at]), frozenset((one.key, two.key))
            if key not in best or gain > best[key][0]:
                best[key] = gain, ((one, a), (two, b))
    return sorted(best.values(), key=lambda found: -found[0])
