"""Before any test: gross outliers, standard errors, serial correlation and scale, about a model that is
close to the data.

The base model may be far from the data when a strong effect is missing, and everything judged about it would
be wrong with it. So the readings are first described by whatever one or two effects do it best. That
description is not yet a finding; it only says where the readings lie without carrying their noise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from lightfield.diagnosis.adequacy import ALPHA, VARIANCE_EXCESS, AdequacyTest
from lightfield.diagnosis.noise import Budget, Noise, Whitener, errors_stated, smooth_stderr
from lightfield.diagnosis.problem import Explanation, Problem
from lightfield.diagnosis.profile import restarted
from lightfield.diagnosis.robust import (
    Serial,
    noise_scale,
    outliers,
    rich_basis,
    scattered,
    serial_correlation,
    unstated_error,
)
from lightfield.diagnosis.search import Fitted, Tried, fit_pairs, fit_singles
from lightfield.diagnosis.subspace import orthonormal
from lightfield.diagnosis.templates import bank, smooth_unknowns
from lightfield.fit import Fit

Array = NDArray[np.float64]

REPLICATES = 999
#: Water that differs by so much, relatively, from the traced one is also looked for at the traced one.
FAR_FROM_TRACED = 0.2
#: Effects that describe the readings worse than the best one by this factor in chi-square will not do.
FAR_FROM_BEST = 4.0
#: A description by effects is used when it lowers the sum of squares per degree of freedom by this factor.
_WORTH = 1.1


@dataclass(frozen=True)
class Prepared:
    """Problem without its outliers, noise model, and the description that both were made about.

    `noise` holds the Monte Carlo error of the base model, which is zero unless the scene has diffuse light;
    explanations by diffuse light add their own. `excess` is the mean factor of the variances of `noise` over
    the stated ones, `known` what was fitted on the way, `to_trace_per_m` the water whose diffuse light must
    be traced to say more.
    """

    problem: Problem
    noise: Noise
    serial: Serial
    reference: Fit
    explanation: Explanation
    errors_stated: bool
    excess: float = 1.0
    known: tuple[Fitted, ...] = ()
    to_trace_per_m: float | None = None


@dataclass(frozen=True)
class Bench:
    """Everything to test fits at one tolerance."""

    whiten: Whitener
    test: AdequacyTest
    unknowns: Mapping[str, Array]
    phi: float


def _whitened_unknowns(problem: Problem, whiten: Whitener) -> dict[str, Array]:
    noise = whiten.noise
    raw = smooth_unknowns(problem.layout, noise.sigma, noise.prediction)
    return {name: whiten(problem.keep[:, None] * columns) for name, columns in raw.items()}


def _rich(problem: Problem, whiten: Whitener, fit: Fit, with_time: bool = True) -> Array:
    return rich_basis(fit, bank(problem, fit, whiten), _whitened_unknowns(problem, whiten), with_time)


def _plain(problem: Problem, quoted: Array, prediction: Array, more: Array | float = 0.0) -> Whitener:
    """Whitening by the smoothed quoted errors, and more of one's own, alone."""
    layout = problem.layout
    zero = np.zeros(layout.size)
    sigma = smooth_stderr(quoted, np.clip(prediction, 0, None), layout.channel)
    return Whitener(Noise(layout, np.hypot(sigma, more), prediction, Budget(0.0, 0.0, 0.0), zero))


def _without_outliers(
    problem: Problem,
    quoted: Array,
    explanation: Explanation,
    fit: Fit,
    usable: Array,
    by_effects: bool,
    more: Array | float = 0.0,
) -> tuple[Problem, Whitener, Fit]:
    problem = replace(problem, keep=usable)
    whiten = _plain(problem, quoted, fit.prediction, more)
    fit = problem.fit(explanation, whiten, [fit.u])
    for _ in range(3):
        basis = _rich(problem, whiten, fit) if by_effects else orthonormal(fit.jacobian)
        bad = outliers(fit.residual, basis, problem.keep)
        if not bad.any():
            break
        every = (usable > 0) & ((problem.keep == 0) | bad)
        left_out = scattered(every, problem.value - fit.prediction, problem.layout)
        problem = replace(problem, keep=usable * ~left_out)
        fit = problem.fit(explanation, whiten, [fit.u])
        whiten = _plain(problem, quoted, fit.prediction, more)
    return problem, whiten, fit


@dataclass(frozen=True)
class _Description:
    """One or two effects that bring the model to the readings, if the base is not there.

    Parameters
    ----------
    known : tuple of (explanation, fit)
        All fits that were made.
    to_trace_per_m : float, optional
        Water whose diffuse light must be traced to say more.
    """

    explanation: Explanation
    fit: Fit
    known: tuple[Fitted, ...] = ()
    to_trace_per_m: float | None = None


def _describe(
    problem: Problem, whiten: Whitener, base: Fit, errors_stated: bool, known_before: Sequence[Fitted]
) -> _Description:
    n = int(problem.keep.sum())
    few = np.random.default_rng(0).standard_normal((problem.layout.size, 2))

    def misses(whiten: Whitener, fit: Fit) -> bool:
        unknowns = _whitened_unknowns(problem, whiten)
        return min(AdequacyTest(problem, whiten, unknowns, few, errors_stated)(fit).tests.values()) < 1e-4

    test = AdequacyTest(problem, whiten, _whitened_unknowns(problem, whiten), few, errors_stated)
    at_base = test(base)
    if min(at_base.tests.values()) > 1e-4:
        return _Description((), base)
    known = fit_singles(problem, test, base, at_base, known_before)
    if not known:
        return _Description((), base)
    known.sort(key=lambda s: s[1].chi2)
    ranked = [Tried(e, f, f.chi2) for e, f in known]
    # Light of few photons has large errors: which effect is the best shows only under its own.
    settled = [
        (e, _from_valleys(problem, e, f, whiten, whiten.noise) if e[0].effect.diffuse else (whiten, f))
        for e, f in known
        if f.chi2 < FAR_FROM_BEST * known[0][1].chi2
    ]
    chosen, (own, fit) = min(settled, key=lambda s: _objective(s[1]))
    best: Fitted = next(s for s in known if s[0] is chosen)
    missing = problem.forward.to_trace([fit.values])
    if misses(whiten, best[1]) and misses(own, fit):
        # When dense water is the best so far, the question is only whether a pair in clear water does better.
        first = ranked[: 1 if missing else 4]
        pairs = fit_pairs(problem, test, base, at_base, first, thorough=not missing)
        best = min([best, *pairs], key=lambda p: p[1].chi2 / stats.chi2.isf(0.5, n - len(p[1].u)))
        known += pairs
        asked = problem.forward.to_trace([_settled(problem, *best, whiten, whiten.noise)[1].values])
        missing = asked and (missing or asked)  # what one effect asks for is known better
    found = {id(e): fit for e, (_, fit) in settled}
    known = [(e, found.get(id(e), f)) for e, f in known]
    explanation, fit = best if best[1].chi2 * _WORTH < base.chi2 else ((), base)
    return _Description(explanation, fit, tuple(known), missing)


def _settled(
    problem: Problem, explanation: Explanation, fit: Fit, whiten: Whitener, noise: Noise
) -> tuple[Whitener, Fit]:
    """A fit under the errors of its own diffuse light, from where it lies; the rest as in a whitening."""
    for _ in range(2):
        whiten = Whitener(with_response_error(problem, noise, fit), whiten.rho, whiten.phi, whiten.tolerance)
        fit = problem.fit(explanation, whiten, [fit.u])
    return whiten, fit


def _from_valleys(
    problem: Problem, explanation: Explanation, fit: Fit, whiten: Whitener, noise: Noise
) -> tuple[Whitener, Fit]:
    """The same for a single effect: water between two traced ones may look right only because neither trace
    says much of it, so that dense water is looked for at the traced one as well."""
    found = [_settled(problem, explanation, fit, whiten, noise)]
    more = problem.forward.to_traced(found[0][1].values)
    if abs(more - 1) > FAR_FROM_TRACED:
        (candidate,), u = explanation, fit.u.copy()
        for i, parameter in enumerate(candidate.amplitudes, len(problem.base)):
            u[i] = np.clip(parameter.start + more * (u[i] - parameter.start), parameter.low, parameter.high)
        there = problem.fit(explanation, whiten, [u], max_steps=0)
        found.append(_settled(problem, explanation, there, whiten, noise))
    return min(found, key=_objective)


def _from_shapes(
    problem: Problem, explanation: Explanation, fit: Fit, whiten: Whitener, noise: Noise
) -> tuple[Whitener, Fit]:
    """The same, at every shape: errors that grow with an effect move the valleys of its shapes."""
    best = _from_valleys(problem, explanation, fit, whiten, noise)
    other = restarted(problem, explanation, best[1], best[0])
    if other is not best[1]:
        best = min(best, _settled(problem, explanation, other, whiten, noise), key=_objective)
    return best


def _objective(found: tuple[Whitener, Fit]) -> float:
    """Twice the negative logarithm of the likelihood, up to a constant."""
    whiten, fit = found
    return fit.chi2 + whiten.log_determinant


def prepare(
    problem: Problem,
    quoted: Array,
    budget: Budget,
    rng: np.random.Generator,
    alpha: float = ALPHA,
    known: Sequence[Fitted] = (),
) -> Prepared:
    """Outliers, smoothed errors and serial correlation.

    A reading that stands out beside the base model may carry an effect; so outliers are what even the rich
    model misses. But what one reading alone calls for is a slip, not an effect: when the base model passes
    with at most one outlier more, judged beside it alone, the readings are described so.

    Parameters
    ----------
    quoted : array, shape (n,)
        Standard errors of the table; NaN where unknown.
    alpha : float
        Level of the test of the base model.
    known : sequence of (explanation, fit)
        Fits to the same readings with another trace of the diffuse light, to begin from.
    """
    rich = _prepared(problem, quoted, budget, True, known)
    if rich.to_trace_per_m or _base_passes(rich, rng, alpha):
        return rich
    alone = _prepared(problem, quoted, budget, False)
    if (alone.problem.keep == rich.problem.keep).all():
        return rich
    few = alone.problem.keep.sum() >= rich.problem.keep.sum() - 1
    return alone if few and _base_passes(alone, rng, alpha) else rich


def _base_passes(prepared: Prepared, rng: np.random.Generator, alpha: float) -> bool:
    made = bench(prepared, 0.0, rng)
    problem = prepared.problem
    starts = [problem.model().start, prepared.reference.u[: len(problem.base)]]
    return made.test(problem.fit((), made.whiten, starts)).passes(alpha)


def _prepared(
    problem: Problem, quoted: Array, budget: Budget, by_effects: bool, known: Sequence[Fitted] = ()
) -> Prepared:
    """Outliers judged beside the rich model (`by_effects`) or beside the base model alone."""
    usable, layout = problem.keep, problem.layout
    stated = errors_stated(quoted)
    first = _plain(problem, quoted, np.clip(problem.value, 0, None))
    base = problem.fit((), first, [problem.model().start])
    problem, whiten, base = _without_outliers(problem, quoted, (), base, usable, by_effects)
    described = _Description((), base)
    if by_effects:
        # The light of another trace moves the fits by it too far to begin from there.
        same = [f for f in known if not any(c.effect.diffuse for c in f[0])]
        described = _describe(problem, whiten, base, stated, same)
    explanation, reference = described.explanation, described.fit
    own = np.zeros(layout.size)
    if explanation:
        # The error of the light in the description is neither noise of the readings nor makes outliers.
        modes, smooth = problem.forward.errors(reference.values)
        own = np.sqrt((modes**2).sum(axis=1) + smooth**2)
        problem, whiten, reference = _without_outliers(
            problem, quoted, explanation, reference, usable, True, own
        )
    quoted_sigma = sigma = np.sqrt(whiten.noise.sigma**2 - own**2)
    if stated:
        rich, total = _rich(problem, whiten, reference), whiten.noise.sigma
        relative = np.clip(reference.prediction, 0, None) / total
        factor = unstated_error(reference.residual, rich, problem.keep, relative, VARIANCE_EXCESS)
        sigma = np.hypot(quoted_sigma, np.sqrt(factor**2 - 1) * total)
        whiten = Whitener(replace(whiten.noise, sigma=factor * total))
        reference = problem.fit(explanation, whiten, [reference.u])
    still = _rich(problem, whiten, reference, with_time=False)
    serial = Serial()
    if problem.keep.sum() - still.shape[1] > 25:
        serial = serial_correlation(reference.residual, still, problem.keep, layout, 1.0 if stated else None)
    forward, values = problem.forward, reference.values
    slope = forward.position_slope(values) if budget.position_m > 0 else np.zeros(layout.size)
    plain = Noise(layout, sigma, reference.prediction, budget, slope)
    noise = with_response_error(problem, plain, base)
    excess = float(((sigma / quoted_sigma) ** 2)[problem.keep > 0].mean())
    fitted, missing = described.known, described.to_trace_per_m
    return Prepared(problem, noise, serial, reference, explanation, stated, excess, fitted, missing)


def whitened_test(
    problem: Problem, whiten: Whitener, rng: np.random.Generator, replicates: int = REPLICATES
) -> AdequacyTest:
    """The adequacy test under a given noise, for readings that are planned rather than measured."""
    noise = whiten.replicates(rng, replicates)
    return AdequacyTest(problem, whiten, _whitened_unknowns(problem, whiten), noise, False)


def with_response_error(problem: Problem, noise: Noise, fit: Fit) -> Noise:
    """The noise with the error that the response of the diffuse light has at a fit."""
    modes, smooth = problem.forward.errors(fit.values)
    return replace(noise, photon_modes=modes, response_error=smooth)


def bench(prepared: Prepared, tolerance: float, rng: np.random.Generator) -> Bench:
    """Whitening, noise scale and adequacy test at one tolerance."""
    problem, noise, rho = prepared.problem, prepared.noise, prepared.serial.rho
    quoted_alone = replace(noise, budget=Budget(0.0, 0.0, 0.0), photon_modes=None, response_error=None)
    plain = Whitener(quoted_alone, rho)
    reference = problem.fit(prepared.explanation, plain, [prepared.reference.u])
    rich = _rich(problem, plain, reference)
    about = with_response_error(problem, noise, reference)
    phi = noise_scale(reference.residual, rich, plain, about.extra(tolerance), problem.keep)
    return _bench(prepared, Whitener(noise, rho, phi, tolerance), rng)


def _bench(prepared: Prepared, whiten: Whitener, rng: np.random.Generator) -> Bench:
    problem = prepared.problem
    unknowns = _whitened_unknowns(problem, whiten)
    replicates = _replicates(whiten, prepared.serial, rng)
    scale = whiten.phi * prepared.excess
    test = AdequacyTest(problem, whiten, unknowns, replicates, prepared.errors_stated, scale)
    return Bench(whiten, test, unknowns, whiten.phi)


def _replicates(whiten: Whitener, serial: Serial, rng: np.random.Generator) -> Array:
    """Whitened noise that carries the uncertainty of the serial correlation, shape (n, REPLICATES)."""
    white = whiten.replicates(rng, REPLICATES)
    for i, rho in enumerate(serial.levels):
        if abs(rho - whiten.rho) > 1e-3:
            mine = slice(i, None, len(serial.levels))
            factor = np.linalg.cholesky(whiten.noise.covariance(rho, whiten.phi, whiten.tolerance))
            white[:, mine] = whiten(factor @ white[:, mine])
    return white


@dataclass(frozen=True)
class OwnErrors:
    """Judges explanations by diffuse light, whose response has an error of its own size.

    Parameters
    ----------
    main : Bench
        Of the base model; sets scale and tolerance.
    """

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

    def refit(self, explanation: Explanation, fit: Fit) -> tuple[AdequacyTest, Fit, float]:
        """Test, fit from where the last one lies, and growth of the log determinant."""
        settle = _from_shapes if len(explanation) == 1 else _settled
        problem, noise = self.prepared.problem, self.prepared.noise
        whiten, best = settle(problem, explanation, fit, self.main.whiten, noise)
        growth = whiten.log_determinant - self.main.whiten.log_determinant
        return _bench(self.prepared, whiten, self.rng).test, best, growth
