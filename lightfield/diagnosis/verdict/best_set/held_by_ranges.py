"""Standard errors beside an effect at the end of its range: they reach what the others are without that end.

A range is chosen, and what it forbids one effect the sizes of the others take up.
"""

from __future__ import annotations

from lightfield.diagnosis.search.cascade import SearchResult
from lightfield.diagnosis.search.pool.beyond import at_ends, without_ends
from lightfield.diagnosis.search.set_of_effects import ScoredSet


def without_held_ranges(finding: SearchResult) -> SearchResult:
    """The finding whose best set has errors that know of it."""
    return finding.with_closest(reaching)


def reaching(tried: ScoredSet) -> ScoredSet:
    """A set with errors that reach the values that it has without the ends of ranges it lies at."""
    ends = at_ends(tried.explanation, tried.fit)
    if tried.test is None or not ends:
        return tried
    _, free = without_ends(tried.test.problem, tried.explanation, tried.fit, tried.test.whiten)
    others = {path: value for path, value in free.values.items() if path not in ends}
    return tried.reaching(others, free.stderr(tried.scale))
