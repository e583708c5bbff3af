"""A set of effects that was fitted to readings, and what it scores beside others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from lightfield.diagnosis.adequacy.amplifying import cost_of_amplifying
from lightfield.diagnosis.adequacy.score_tests import Adequacy, AdequacyTest
from lightfield.diagnosis.adequacy.subspace import INDEPENDENT, beside, orthonormal
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.problem import Explanation
from lightfield.fitting.curves import PROFILE, field_of
from lightfield.fitting.effects.registry import curves
from lightfield.fitting.least_squares import Fit

SetKey = frozenset[tuple[str, str]]


@dataclass(frozen=True, eq=False)
class FittedSet:
    """A fitted set of effects."""

    explanation: Explanation
    fit: Fit

    @cached_property
    def key(self) -> SetKey:
        return frozenset(c.key for c in self.explanation)

    @cached_property
    def names(self) -> frozenset[str]:
        return frozenset(c.name for c in self.explanation)

    @cached_property
    def bounded(self) -> set[str]:
        """Paths of what lies at an end of its range; a lamp's curve that may not bend more is what it is."""
        at_bound = zip(self.fit.paths, self.fit.at_bound(), strict=True)
        return {path for path, at in at_bound if at and field_of(path) != PROFILE}

    @cached_property
    def lowest(self) -> set[str]:
        """Paths of what lies at a lowest value that is an answer: a face that reflects nothing."""
        found, own = self.fit.by_path, [p for c in self.explanation for p in c.parameters]
        return self.bounded & {p.path for p in own if p.is_answer(found[p.path])}

    @cached_property
    def edges(self) -> set[str]:
        """Paths of amplitudes that lie at a bound: no effect at all, or one beyond what is plausible.

        That an effect which the scene has is not there at all is an answer, not an edge; nor is a face that
        reflects nothing one.
        """
        found = self.fit.by_path
        return (self.bounded - self.lowest) & {
            p.path
            for c in self.explanation
            for p, off in zip(c.amplitudes, c.neutral, strict=True)
            if not (c.is_stated and p.end_near(found[p.path]) == off)
        }

    @cached_property
    def at_edge(self) -> bool:
        """Does an amplitude lie at an edge?"""
        return bool(self.edges)

    @cached_property
    def chi2(self) -> float:
        """Of the fit, and what it would cost that its water must not amplify."""
        return self.fit.chi2 + cost_of_amplifying(self.fit)

    def worse_without(self, some: Sequence[Candidate]) -> float:
        """By how much chi-square is larger with some of its effects switched off, were the model linear."""
        keys = frozenset(c.key for c in some)
        if keys not in self._worse:
            self._worse[keys] = max(self.worse_at(some, [n for c in some for n in c.neutral]), 0.0)
        return self._worse[keys]

    def worse_at(self, some: Sequence[Candidate], u: Sequence[float]) -> float:
        """The same with the amplitudes of some effects at these coordinates, and no shapes of them."""
        fit, own = self.fit, {p.path for c in some for p in c.parameters}
        free = ~fit.at_bound() & [path not in own for path in fit.paths]
        at = [fit.paths.index(p.path) for c in some for p in c.amplitudes]
        moved = fit.jacobian[:, at] @ (fit.u[at] - np.asarray(u))
        left = beside(orthonormal(fit.jacobian[:, free], INDEPENDENT), (fit.residual + moved)[:, None])
        return float((left**2).sum()) - fit.chi2

    @cached_property
    def _worse(self) -> dict[SetKey, float]:
        return {}

    @property
    def parameters(self) -> int:
        """Number of parameters of the effects."""
        return sum(len(c.parameters) for c in self.explanation)

    @property
    def is_diffuse(self) -> bool:
        return any(c.effect.diffuse for c in self.explanation)


@dataclass(frozen=True)
class ScoredSet:
    """A fitted explanation; its test is missing when it was too far behind to be worth one.

    Parameters
    ----------
    errors : mapping
        Standard errors by path that the profile over the shapes asks for.
    """

    explanation: Explanation
    fit: Fit
    bic: float
    adequacy: Adequacy | None = None
    test: AdequacyTest | None = None
    errors: Mapping[str, float] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(sorted(c.name for c in self.explanation))

    @property
    def at_edge(self) -> bool:
        """See `FittedSet.at_edge`."""
        return FittedSet(self.explanation, self.fit).at_edge

    @property
    def at_bound(self) -> bool:
        """Does any parameter of the effects lie at a bound, a shape included?"""
        known = FittedSet(self.explanation, self.fit)
        return not (known.bounded - known.lowest).isdisjoint(
            p.path for c in self.explanation for p in c.parameters
        )

    @property
    def scale(self) -> float:
        """Variance that its errors are stated with, see `scale_of_errors`; 1 where it was not tested."""
        if self.adequacy is None or self.test is None:
            return 1.0
        return scale_of_errors(self.fit, self.adequacy, self.test)

    @property
    def undetermined(self) -> bool:
        """Is the error of an amplitude wider than what is plausible of it? Of a curve, of every one: gain and
        width of the beam make up for single ones."""
        errors, lowest = self.fit.stderr(self.scale), FittedSet(self.explanation, self.fit).lowest
        wide = {
            p.path: not errors[p.path] <= p.width(u)
            for p, u in zip(self.fit.model.parameters, self.fit.u, strict=True)
            if not p.is_held and p.path not in lowest
        }
        return any(
            (all if c.name in curves() else any)(wide[p.path] for p in c.amplitudes if p.path in wide)
            for c in self.explanation
            if any(p.path in wide for p in c.amplitudes)
        )

    def reaching(self, values: Mapping[str, float], errors: Mapping[str, float]) -> ScoredSet:
        """The set as it stands, with errors that reach these values with theirs."""
        return replace(self, errors=errors_reaching(self.errors, self.fit, values, errors))

    def accepted(self, alpha: float) -> bool:
        """Does it leave nothing unexplained?"""
        return self.adequacy is not None and self.adequacy.passes(alpha)


def scale_of_errors(fit: Fit, adequacy: Adequacy, test: AdequacyTest) -> float:
    """Variance of the noise as judged beside a fit, or what the fit leaves, where that is more.

    In units of the whitening. Beside all effects together few readings are left to judge by; beside those
    that were fitted there are more.
    """
    spare = int(test.problem.keep.sum()) - len(fit.u)
    return max(adequacy.phi, fit.chi2 / max(spare, 1))


def errors_reaching(
    own: Mapping[str, float], fit: Fit, values: Mapping[str, float], errors: Mapping[str, float]
) -> dict[str, float]:
    """Errors of a fit by path, those that it has or larger ones that reach other values with theirs."""
    wider = dict(own)
    for path in fit.paths:
        if path in values:
            reach = np.hypot(np.nan_to_num(errors[path]), values[path] - fit.values[path])
            wider[path] = float(np.fmax(wider.get(path, 0.0), reach))
    return wider


def bic(fit: Fit, explanation: Explanation, phi: float, n: int) -> float:
    """Bayesian information criterion with a known variance scale (Schwarz 1978,
    doi:10.1214/aos/1176344136); ranks, never decides."""
    return (fit.chi2 + cost_of_amplifying(fit)) / phi + np.log(n) * sum(
        len(c.parameters) for c in explanation
    )


def weights(explanations: list[ScoredSet]) -> list[float]:
    """Relative evidence exp(-BIC/2), summing to one."""
    values = np.array([t.bic for t in explanations])
    relative = np.exp(-0.5 * (values - values.min()))
    return [float(w) for w in relative / relative.sum()]
