"""Moves from set to set: additions level by level, drops and swaps around the best."""

from __future__ import annotations

from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.search.pool.fitted_sets import Admits, Pool, Promise, begin_at
from lightfield.diagnosis.search.pool.quick import Begin
from lightfield.diagnosis.search.set_of_effects import FittedSet, SetKey
from lightfield.memory import give_back

#: Levels of additions at most: more effects than any set of readings was seen to hold (six and curves, in
#: benchmarks/many_effects).
_MOST = 9
#: A set counts as better when it costs less by this. Derived: far below what noise does to chi-square, far
#: above rounding.
_BETTER = 1e-6
#: What promises less of chi-square than this is not fitted. Derived: one parameter takes as much of noise.
_LEAST = 1.0
#: Rounds of drops and swaps; in each so many swaps are fitted, of those that promise to cost no more than
#: this above the best. Chosen: the smallest that mended sets of four effects and more.
_ROUNDS, _SWAPS, _REACH = 6, 10, 8.0
#: A curve is refined that, once it is, makes chi-square so many times smaller, and so many at least as it is:
#: 11 functions of a measured flood with a steep edge do 180 to 920 times, of flat tops with steeper ones 22
#: to 33; a ripple of the angle, which is no lamp's, they follow 2 to 15 times (`benchmarks/many_effects`,
#: `benchmarks/hidden_effects`, test_lamps.py).
_MOSTLY, _PARTLY = 20.0, 5.0


def nothing(_: Candidate) -> bool:
    """No effect."""
    return False


def forward(
    pool: Pool,
    start: FittedSet,
    beam: int,
    fits: int,
    allowed: Admits,
    most: int = _MOST,
    patience: int = 1,
    anyway: Admits = nothing,
) -> FittedSet:
    """Levels of additions: of the best sets of a level, the additions that promise most are fitted.

    Parameters
    ----------
    beam : int
        Sets of a level that are added to.
    fits : int
        Sets of a level that are fitted.
    patience : int
        Levels without a new best set after which it ends.
    anyway : callable
        Of allowed effects, those that are fitted whatever they promise.
    """
    level, lowest, stale = [start], pool.cost(start), 0
    for _ in range(most):
        give_back()
        made = fit_additions(pool, level, fits, allowed, anyway)
        if not made:
            break
        made = sorted(map(pool.finished, sorted(made, key=pool.cost)[:beam]), key=pool.cost)
        if pool.cost(made[0]) < lowest - _BETTER:
            lowest, stale = pool.cost(made[0]), 0
        else:
            stale += 1
            if stale >= patience:
                break
        level = made
    return best_of(pool, allowed)


def fit_additions(
    pool: Pool, level: list[FittedSet], fits: int, allowed: Admits, anyway: Admits = nothing
) -> list[FittedSet]:
    """Fit the additions to some sets that promise most, and some anyway."""
    new = sorted(_additions(pool, level, allowed, anyway).values(), key=lambda p: p.cost)
    chosen = [*new[:fits], *(p for p in new[fits:] if anyway(p.candidate))]
    return [pool.add(p) for p in chosen if p.key in pool.nodes or _affordable(pool, p)]


def best_of(pool: Pool, allowed: Admits) -> FittedSet:
    """The set of least cost, of allowed effects, fitted to the end."""
    while (best := pool.finished(now := pool.best(allowed))) is not now or best is not pool.best(allowed):
        pass
    return best


def _affordable(pool: Pool, promise: Promise) -> bool:
    return pool.affordable((*promise.node.explanation, promise.candidate))


def _additions(
    pool: Pool, level: list[FittedSet], allowed: Admits, anyway: Admits = nothing
) -> dict[SetKey, Promise]:
    """Sets with one effect more, each from where it promises most."""
    out: dict[SetKey, Promise] = {}
    for node in level:
        for promise in filter(lambda p: allowed(p.candidate), pool.promises(node)):
            known, candidate = out.get(promise.key), promise.candidate
            if promise.starts[0].gain < _LEAST * pool.ground.phi and not anyway(candidate):
                continue
            if known is None or promise.cost < known.cost:
                out[promise.key] = promise
    return out


def polish(
    pool: Pool, allowed: Admits, rounds: int = _ROUNDS, swaps: int = _SWAPS, reach: float = _REACH
) -> FittedSet:
    """Drops, swaps and additions around the best set until nothing near is better.

    Another form of an effect is fitted whatever it promises, little beside effects that took its part.
    """
    done: set[SetKey] = set()
    for _ in range(rounds):
        best = best_of(pool, allowed)
        if best.key in done:
            break
        done.add(best.key)
        give_back()
        _other_forms(pool, best, allowed)
        around = [pool.drop(best, c) for c in best.explanation if _without(pool, best, c)]
        found = _additions(pool, [*around, best], allowed)
        new = sorted((p for key, p in found.items() if key not in pool.nodes), key=lambda p: p.cost)
        limit = pool.cost(best) + reach
        for rank, promise in enumerate(new):
            other_form = promise.candidate.name in best.names
            if (other_form or (rank < swaps and promise.cost < limit)) and _affordable(pool, promise):
                pool.add(promise)
    return best_of(pool, allowed)


def thin(pool: Pool) -> None:
    """Fit sets near the best less one of their effects, where that promises to come as near.

    Searches for rivals drop effects of the best set that they find alone: of others an effect that another
    one of the set has made superfluous would stay.
    """
    for node in sorted(pool.nodes.values(), key=pool.cost):
        limit = pool.cost(pool.best()) + _REACH
        if pool.cost(node) > limit:
            break
        for candidate in node.explanation:
            if pool.promised_without(node, candidate) < limit and _without(pool, node, candidate):
                pool.drop(node, candidate)


def _other_forms(pool: Pool, best: FittedSet, allowed: Admits) -> None:
    """Fit nested forms of the effects of a set, longer and shorter curves, from where it lies."""
    for candidate in best.explanation:
        forms = [c for c in pool.problem.candidates if _is_nested(c, candidate) and allowed(c)]
        for other in forms:
            whole = [other if c is candidate else c for c in best.explanation]
            if not other.form.refines and pool.affordable(whole):
                pool.fit(whole, [begin_at(best)])
        finer = [c for c in forms if c.form.refines and len(c.amplitudes) > len(candidate.amplitudes)]
        if finer:
            _refined(pool, best, candidate, min(finer, key=lambda c: len(c.amplitudes)))


def _is_nested(other: Candidate, candidate: Candidate) -> bool:
    paths = {p.path for p in candidate.parameters}
    return (
        other is not candidate
        and other.name == candidate.name
        and not paths.isdisjoint(p.path for p in other.parameters)
    )


def _refined(pool: Pool, best: FittedSet, curve: Candidate, finer: Candidate) -> None:
    """Fit a set with the next finer curve, from where it lies and from no curve at all, if it takes nearly
    all of the misfit then.

    The coarser curve of a steep edge is laid over a beam half as wide as the lamp's, and stays there.
    """
    rest = [c for c in best.explanation if c is not curve]
    if not pool.affordable([*rest, finer]):
        return
    without = pool.drop(best, curve).fit.chi2
    if without > _PARTLY * best.fit.chi2:
        others = {p.path for c in rest for p in c.parameters}
        kept = {path: u for path, u in best.fit.by_path.items() if path in others}
        made = pool.made([*rest, finer], [begin_at(best), Begin(kept)])
        if without > _MOSTLY * made.fit.chi2:
            pool.offered(made)


def _without(pool: Pool, node: FittedSet, candidate: object) -> bool:
    rest = [c for c in node.explanation if c is not candidate]
    return frozenset(c.key for c in rest) in pool.nodes or pool.affordable(rest)
