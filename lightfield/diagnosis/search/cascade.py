"""From prepared readings to the verdict: no effect, one, two, or none that is known.

Every question is asked twice. First with the noise alone: is the misfit significant, and which explanation
leaves nothing significant? Only when no explanation passes, again with the tolerance: is the misfit
relevant, and which explanation leaves nothing relevant? So an exact formula is not blurred by a tolerance,
and one that is right but for a fraction of a per cent is not rejected for it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from lightfield.diagnosis.adequacy.score_tests import Adequacy, AdequacyTest
from lightfield.diagnosis.certainty import CONVINCING, Certainty
from lightfield.diagnosis.problem.problem import FAR_BEHIND, Explanation, Problem
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.own_errors import (
    from_shapes,
    refitted,
    under_own_errors,
    with_response_error,
)
from lightfield.diagnosis.search.pool.any_number import Many
from lightfield.diagnosis.search.pool.evidence import GAP, evidence
from lightfield.diagnosis.search.preparation import Bench, Prepared, base_at, judged
from lightfield.diagnosis.search.search_progress import Progress
from lightfield.diagnosis.search.set_of_effects import FittedSet, ScoredSet, bic, scale_of_errors, weights
from lightfield.diagnosis.search.small_sets import (
    SINGLES_TESTED,
    accepted,
    at_lowest_minima,
    fit_pairs,
    fit_singles,
    searched,
)
from lightfield.fitting.least_squares import Fit, Whiten

#: Level at which an explanation is given up: by chance a true one is lost in one case of a hundred. It must
#: pass better than the base model does, by twice its p, but need not pass better than at the other. Chosen:
#: on half and twice of that no answer hangs (test_cascade.py).
_ALPHA_EXPLANATION, _EASILY = 0.01, 0.2
#: Chi-square for each reading, under errors with the tolerance, beyond which fits need not be made anew under
#: these: what passes leaves one or two. Chosen: new weights lower it by less than half.
_BEYOND_TOLERANCE = 10.0
#: Where nothing was accepted, so many of what came nearest are looked at. Chosen; with two and six ten
#: campaigns have the same verdicts.
_NEAREST = 3


@dataclass(frozen=True)
class Level:
    """All that was fitted and tested at one tolerance."""

    tolerance: float
    bench: Bench
    base: Fit
    adequacy: Adequacy

    @property
    def phi(self) -> float:
        """Pure-error variance scale of the base test, in units of the whitening."""
        return self.adequacy.phi

    @property
    def scale(self) -> float:
        """Variance that errors of the base model are stated with."""
        return scale_of_errors(self.base, self.adequacy, self.bench.test)


@dataclass(frozen=True)
class SearchResult:
    """What the readings say.

    Parameters
    ----------
    size : int or None
        Number of effects in the smallest accepted sets; 0: nothing is missing; None: nothing that is known
        explains it.
    accepted : list of ScoredSet
        Accepted sets, best first, with their `weights`; the weight that is missing to one is the base
        model's.
    tried : list of ScoredSet
        Everything fitted at the deciding level, rivals included.
    n : int
        Number of readings that were fitted.
    withheld : bool
        Whatever was found, there is no reason to believe it.
    in_part : bool
        There was an answer, but for readings that no effect reaches.
    many : Many, optional
        The best set of any number of effects, and how sure each of them is.
    unknown : sequence of str
        Local unknowns that were sought like effects: they say where the rest is, and not what.
    cheaper : FittedSet, optional
        A set that scatters and costs less than the answer, which does not, in traced light.
    finer_lamp : FittedSet, optional
        The best set with a lamp that is followed more finely.
    base_errors : mapping
        Standard errors by path of the base model, where it is the answer.
    errors_of_set : mapping
        Those of the best set as if its effects were known to be all that act.
    """

    size: int | None
    level: Level
    levels: list[Level]
    accepted: list[ScoredSet]
    weights: list[float]
    tried: list[ScoredSet]
    n: int
    withheld: bool = False
    in_part: bool = False
    many: Many | None = None
    unknown: Sequence[str] = ()
    cheaper: FittedSet | None = None
    finer_lamp: FittedSet | None = None
    base_errors: Mapping[str, float] = field(default_factory=dict)
    errors_of_set: Mapping[str, float] = field(default_factory=dict)

    def with_closest(self, change: Callable[[ScoredSet], ScoredSet]) -> SearchResult:
        """The same with another record of the best explanation, or of the best set of many effects."""
        if self.accepted:
            return replace(self, accepted=[change(self.accepted[0]), *self.accepted[1:]])
        if self.beyond_two and self.tried:
            return replace(self, tried=[change(self.tried[0]), *self.tried[1:]])
        return self

    def without_answer(self, in_no_part: bool = True) -> SearchResult:
        """The same, where no answer can rest on the readings; nor what explains a part (`in_no_part`)."""
        withheld = in_no_part or self.size is not None
        return replace(self, size=None, accepted=[], weights=[], withheld=withheld)

    def but_for_some(self) -> SearchResult:
        """The same, where some readings are beyond all effects: what was the answer is a part of it."""
        best, many = self.best, self.many
        if best is None or many is None:
            return self.without_answer(in_no_part=False)
        many = replace(many, adequate=False, evidence=evidence(many.pool, many.best, adequate=False))
        tried = [best, *(t for t in self.tried if t is not best)]
        return replace(self, size=None, accepted=[], weights=[], tried=tried, in_part=True, many=many)

    def open_beside_unknown(self, variance: float) -> SearchResult:
        """The same, unexplained where the best set holds a local unknown: what is certain beside it is so as
        far as an unexplained rest allows.

        Parameters
        ----------
        variance : float
            Of what is left, over that of the stated errors: what is more may be a part of the unknown that is
            not described.
        """
        many, first, unknown = self.many, self.accepted, self.unknown
        if self.closest is None or set(unknown).isdisjoint(self.closest.names):
            return replace(self, unknown=() if self.best is None else unknown)
        if many is not None:
            known = many.evidence if first else evidence(many.pool, many.best, adequate=False)
            left = max(1 - 1 / variance, 0.0) * (self.n - len(many.best.fit.u))
            mine = [e.in_part(left) if first else e for e in known if e.candidate.name not in unknown]
            many = replace(many, adequate=False, evidence=mine)
        tried = [*first, *(t for t in self.tried if not any(t is one for one in first))]
        return replace(self, size=None, accepted=[], weights=[], tried=tried, many=many)

    @property
    def best(self) -> ScoredSet | None:
        """The best explanation."""
        return self.accepted[0] if self.accepted else None

    def adequacy_of(self, one: ScoredSet | None) -> Adequacy:
        """Noise and tests beside a set; of one that was not tested, those of the base model."""
        return self.level.adequacy if one is None or one.adequacy is None else one.adequacy

    @property
    def is_levelled(self) -> bool:
        """Is it known how sure the effects of the best explanation are, each beside the others?"""
        known = {e.candidate.key for e in self.many.evidence} if self.many is not None else set()
        return self.best is None or {c.key for c in self.best.explanation} == known

    @property
    def beyond_two(self) -> bool:
        """Did one or two effects explain nothing?"""
        return self.many is not None and self.many.sought

    @property
    def in_doubt(self) -> ScoredSet | None:
        """Of many effects, the nearest set of others without one that is one of several: what stays open."""
        doubts = [e for e in self.many.evidence if e.level == Certainty.ONE_OF] if self.many else []
        rivals = [(e.gap, e.rival) for e in doubts if e.rival is not None and e.rival.explanation]
        if not (self.beyond_two and rivals):
            return None
        _, rival = min(rivals, key=lambda one: one[0])
        return ScoredSet(rival.explanation, rival.fit, np.inf)

    @property
    def closest(self) -> ScoredSet | None:
        """The best explanation, or the best set where it leaves something unexplained."""
        partly = (self.in_part or self.unknown or self.beyond_two) and not self.withheld
        return self.best or (self.tried[0] if partly else None)

    @property
    def explaining(self) -> ScoredSet | None:
        """Beside what nothing is missing: the best explanation, or effects with a local unknown."""
        return self.closest if self.unknown else self.best

    @property
    def scale(self) -> float:
        """Variance of the noise beside what explains the readings, see `scale_of_errors`; where nothing does,
        as judged beside the base model."""
        if self.explaining is not None:
            return self.explaining.scale
        return self.level.scale if self.size == 0 else self.level.phi

    @property
    def whiten(self) -> Whiten:
        """Whitening under which the best explanation was judged."""
        told = self.closest if self.in_part or self.unknown else self.best
        test = told.test if told else None
        return test.whiten if test is not None else self.level.bench.whiten

    @property
    def contenders(self) -> list[ScoredSet]:
        """What was accepted; failing that, what came nearest."""
        return self.accepted or sorted(self.tried, key=lambda t: t.bic)[:_NEAREST]

    @property
    def scatter(self) -> Adequacy | None:
        """Test of the base model, or of what came nearest, that asks for nothing but larger errors."""
        tested = (self.level.adequacy, *(one.adequacy for one in self.contenders))
        return next((one for one in tested if one and one.only_scatters(_ALPHA_EXPLANATION)), None)

    @property
    def determined(self) -> bool:
        """Are there more readings than the best explanation has parameters? Any curve meets as many."""
        return bool(self.accepted) and self.n > len(self.accepted[0].fit.u)

    @property
    def identified(self) -> bool:
        """Is there one answer?"""
        if not self.determined:
            return False
        if self.many is not None and self.many.sought:
            return all(e.is_claimed for e in self.many.evidence) and not self.accepted[0].undetermined
        if self.weights[0] <= CONVINCING or self._rivalled:
            return False
        return not (self.accepted[0].at_bound or self.accepted[0].undetermined)

    @property
    def _rivalled(self) -> bool:
        """Does a set of named effects, of any number, cost hardly more without one of the answer's, or one
        with a curve less?"""
        answer = {c.key for c in self.accepted[0].explanation}
        known = self.many.evidence if self.many is not None else ()
        near = (e for e in known if e.candidate.key in answer)
        return any(e.gap_named <= GAP or e.gap < -GAP for e in near)


@dataclass(frozen=True)
class OwnErrors:
    """Judges explanations by diffuse light, whose response has an error of its own size; the `main` bench,
    of the base model, sets scale and tolerance."""

    prepared: Prepared
    main: Bench
    rng: np.random.Generator

    def promise(self, fit: Fit) -> float:
        """Chi-square and growth of the log determinant where the fit lies now."""
        problem, main = self.prepared.problem, self.main.whiten
        noise = with_response_error(problem, self.prepared.noise, fit)
        whiten = Whitener(noise, main.rho, main.phi, main.tolerance)
        residual = whiten(problem.keep * (problem.value - fit.prediction))
        return float(residual @ residual) + whiten.log_determinant - main.log_determinant

    def hopeless(self, fit: Fit, best: Fit) -> bool:
        """Do many readings put it far behind the best fit even with its own errors, as a sample shows?"""
        if self.prepared.problem.sample is None:
            return False
        rows, problem = self.prepared.problem.sample
        main = self.main.whiten.of(rows)
        own = with_response_error(problem, self.prepared.noise.subset(rows), fit)
        whiten = Whitener(own, main.rho, main.phi, main.tolerance)
        mine, other = (
            float((w(problem.keep * (problem.value - f.prediction[rows])) ** 2).sum())
            for w, f in ((whiten, fit), (main, best))
        )
        behind = mine + whiten.log_determinant - main.log_determinant - other
        return behind > FAR_BEHIND * max(1.0, other / len(problem.value))

    def refit(self, explanation: Explanation, fit: Fit) -> tuple[AdequacyTest, Fit, float]:
        """Test, fit from where the last one lies, and growth of the log determinant."""
        settle = from_shapes if len(explanation) == 1 else under_own_errors
        problem = self.prepared.problem
        whiten, best = refitted(settle, problem, explanation, fit, self.main.whiten)
        growth = whiten.log_determinant - self.main.whiten.log_determinant
        return judged(self.prepared, whiten, self.rng), best, growth


def level_at(prepared: Prepared, tolerance: float, rng: np.random.Generator) -> Level:
    """The base model, fitted and tested at one tolerance."""
    return Level(tolerance, *base_at(prepared, tolerance, rng))


def level_for(level: Level) -> float:
    """Level at which explanations are given up: what passes must pass better than the base model does."""
    return max(_ALPHA_EXPLANATION, min(2 * level.adequacy.p, _EASILY))


def with_base(found: list[ScoredSet], level: Level, n: int) -> list[float]:
    """Weights of accepted sets when the base model itself is among the rivals."""
    phi = found[0].adequacy.phi if found[0].adequacy else level.phi
    base = ScoredSet((), level.base, bic(level.base, (), phi, n))
    return weights([*found, base])[:-1]


def far_beyond(problem: Problem, level: Level, fit: Fit) -> bool:
    """Does a fit miss the readings by far more than errors and tolerance?"""
    residual = level.bench.whiten(problem.keep * (problem.value - fit.prediction))
    return float(residual @ residual) > _BEYOND_TOLERANCE * level.phi * float(problem.keep.sum())


def search(
    prepared: Prepared, tolerance: float, rng: np.random.Generator, alpha: float, progress: Progress
) -> SearchResult:
    """The smallest sets of effects beside which nothing is missing.

    Parameters
    ----------
    tolerance : float
        Smooth relative misfit that is of no interest.
    progress : Progress
        Told what begins, and the best set so far.
    """
    problem, n = prepared.problem, int(prepared.problem.keep.sum())
    levels: list[Level] = []

    def began(what: str, width: float) -> None:
        progress(what + (f" within {100 * width:g} %" if width else ""))

    def tried(fits: list[FittedSet]) -> None:
        best = min(fits, key=lambda one: one.fit.chi2, default=FittedSet((), levels[-1].base))
        progress.tried(len(fits), problem, best.explanation, best.fit)

    def prepare_level(width: float) -> Level:
        began("the base model", width)
        levels.append(level_at(prepared, width, rng))
        tried([])
        return levels[-1]

    def finding(
        size: int | None, level: Level, found: list[ScoredSet], tried: list[ScoredSet]
    ) -> SearchResult:
        found = at_lowest_minima(problem, found)
        return SearchResult(size, level, levels, found, with_base(found, level, n) if found else [], tried, n)

    exact = prepare_level(0.0)
    if exact.adequacy.passes(alpha):
        return finding(0, exact, [], [])
    level_alpha = level_for(exact)

    def one_more(level: Level, known: Sequence[FittedSet]) -> tuple[list[FittedSet], list[ScoredSet]]:
        began("one effect at a time", level.tolerance)
        fits = fit_singles(problem, level.bench.test, level.base, level.adequacy, known)
        tried(fits)
        own = OwnErrors(prepared, level.bench, rng)
        return fits, searched(problem, level.bench.test, fits, own, SINGLES_TESTED)

    def two_more(
        level: Level, singles: list[ScoredSet], known: Sequence[FittedSet]
    ) -> tuple[list[FittedSet], list[ScoredSet]]:
        began("two effects at a time", level.tolerance)
        fits = fit_pairs(problem, level.bench.test, level.base, level.adequacy, singles, known)
        tried(fits)
        return fits, searched(problem, level.bench.test, fits, OwnErrors(prepared, level.bench, rng))

    fitted, singles = one_more(exact, prepared.known)
    if found := accepted(singles, level_alpha):
        return finding(1, exact, found, singles)
    tolerant = prepare_level(tolerance) if tolerance > 0 else exact
    if tolerance > 0 and tolerant.adequacy.passes(alpha):
        return finding(0, tolerant, [], [])
    fitted_pairs, pairs = two_more(exact, singles, prepared.known)
    if found := accepted(pairs, level_alpha):
        return finding(2, exact, found, pairs)
    if tolerance == 0:
        return finding(None, exact, [], pairs + singles)
    if all(far_beyond(problem, tolerant, t.fit) for t in (*singles, *pairs)):
        return finding(None, tolerant, [], pairs + singles)
    level_alpha = level_for(tolerant)
    _, singles = one_more(tolerant, fitted)
    if found := accepted(singles, level_alpha):
        return finding(1, tolerant, found, singles)
    _, pairs = two_more(tolerant, singles, fitted_pairs)
    if found := accepted(pairs, level_alpha):
        return finding(2, tolerant, found, pairs)
    return finding(None, tolerant, [], pairs + singles)
