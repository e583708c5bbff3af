"""Everything at once, in the model linearised at a set, the cheapest out one by one: a proposal of sets that
no single move leads to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lightfield.arrays import TINY, Array
from lightfield.diagnosis.adequacy.subspace import INDEPENDENT, beside, orthonormal
from lightfield.diagnosis.problem.candidates import Candidate, go_together
from lightfield.diagnosis.search.pool.fitted_sets import Admits, Pool, begin_at, joins
from lightfield.diagnosis.search.pool.quick import with_effect
from lightfield.diagnosis.search.set_of_effects import FittedSet

#: Stages that are fitted, of at most so many effects. Chosen: time; half and twice of it alike in ten
#: campaigns.
_FITS, _MOST = 4, 8
#: Keeps the normal equations of templates that are one solvable; makes a wrong sign the first to go. Chosen.
_RIDGE, _WRONG = 1e-6, 1e3


@dataclass(frozen=True)
class _Block:
    """Columns of one effect: its removal and the slopes of its shapes, or the template at its best shape."""

    candidate: Candidate
    columns: Array
    shape: tuple[float, ...] | None = None


def _removal(pool: Pool, node: FittedSet, candidate: Candidate) -> Array:
    """What the readings lose without one of the effects, all else as fitted, whitened, shape (n,)."""
    problem, fit = pool.problem, node.fit
    values = fit.values | {p.path: p.value(p.start) for p in candidate.amplitudes}
    without = problem.forward.predict(values)
    return np.asarray(pool.ground.test.whiten(problem.keep * (fit.prediction - without)))


def _blocks(pool: Pool, node: FittedSet, allowed: Admits) -> tuple[list[_Block], Array]:
    """Blocks of all effects, and what they are to meet: the residual and all that is removed."""
    place = {path: i for i, path in enumerate(node.fit.paths)}
    target, out = node.fit.residual.copy(), []
    for candidate in node.explanation:
        removal = _removal(pool, node, candidate)
        target = target + removal
        own = [node.fit.jacobian[:, place[p.path]] for p in candidate.parameters[1:]]
        out.append(_Block(candidate, np.stack([removal, *own], axis=1)))
    best: dict[str, tuple[float, _Block]] = {}
    for score, amplitudes in zip(*pool.scores(node), strict=True):
        candidate = score.template.candidate
        usable = score.testable and allowed(candidate) and not candidate.effect.is_free_form
        if not usable or not joins(candidate, node):
            continue
        gain = float(np.linalg.norm(score.direction.T @ node.fit.residual))
        if candidate.one_sided and amplitudes[0] <= 0:
            gain = 0.0
        if candidate.name not in best or gain > best[candidate.name][0]:
            block = _Block(candidate, score.template.columns, score.template.shape)
            best[candidate.name] = (gain, block)
    new = [block for _, block in best.values()]
    if any(b.candidate.effect.diffuse for b in new):  # what cannot stand beside it is met by single moves
        new = [b for b in new if not b.candidate.effect.direct_only]
    return [*out, *new], target


def linear_backward(pool: Pool, node: FittedSet, allowed: Admits, fits: int = _FITS) -> None:
    """Fit the best stages of an elimination that begins with everything."""
    blocks, target = _blocks(pool, node, allowed)
    # Where light is no number, no order holds among sets: nothing is proposed from there.
    blocks = [b for b in blocks if np.isfinite(b.columns).all()]
    if not blocks or not np.isfinite(target).all():
        return
    base = node.fit.jacobian[:, : len(pool.problem.base)]
    free = orthonormal(base, INDEPENDENT)
    columns = beside(free, np.hstack([b.columns for b in blocks]))
    length = np.linalg.norm(columns, axis=0) + TINY
    columns, target = columns / length, beside(free, target[:, None])[:, 0]
    gram = columns.T @ columns + _RIDGE * np.eye(len(length))
    drawn, square = columns.T @ target, float(target @ target)
    ends = np.cumsum([b.columns.shape[1] for b in blocks])
    live = [(b, np.arange(e - b.columns.shape[1], e)) for b, e in zip(blocks, ends.tolist(), strict=True)]
    stages: list[tuple[float, list[tuple[_Block, Array]]]] = []
    while live:
        rows = np.concatenate([at for _, at in live])
        inverse = np.linalg.inv(gram[np.ix_(rows, rows)])
        found = inverse @ drawn[rows]
        cost = (square - float(found @ drawn[rows])) / pool.ground.phi
        cost += sum(pool.ground.price(b.candidate) for b, _ in live)
        worth, sizes, first = [], [], 0
        for block, at in live:
            mine = slice(first, first := first + len(at))
            size, price = found[mine], pool.ground.price(block.candidate)
            saved = float(size @ np.linalg.solve(inverse[mine, mine], size)) / pool.ground.phi - price
            wrong = block.shape is not None and block.candidate.one_sided and size[0] < 0
            worth.append(saved - (_WRONG if wrong else 0.0))
            sizes.append((block, size / length[at]))
        stages.append((cost, sizes))
        live.pop(int(np.argmin(worth)))
    near = sorted((s for s in stages if len(s[1]) <= _MOST), key=lambda s: s[0])
    for cost, sizes in near[:fits]:
        _fit(pool, node, sizes, cost)


def _fit(pool: Pool, node: FittedSet, sizes: list[tuple[_Block, Array]], promised: float) -> None:
    candidates = [block.candidate for block, _ in sizes]
    if not go_together(candidates) or not pool.affordable(candidates):
        return
    begin = begin_at(node)
    for block, size in sizes:
        if block.shape is not None:
            begin = with_effect(begin, block.candidate, size, block.shape, block.columns)
    pool.fit(candidates, [begin], promised)
