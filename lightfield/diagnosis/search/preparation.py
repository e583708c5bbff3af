"""Before any test: gross outliers, standard errors, serial correlation and scale, about a model that is
close to the data.

The base model may be far from the data when a strong effect is missing, and everything judged about it would
be wrong with it. So the readings are first described by whatever one or two effects do it best. That
description is not yet a finding; it only says where the readings lie without carrying their noise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.adequacy.level import ALPHA
from lightfield.diagnosis.adequacy.robust import (
    SAME_RHO,
    Serial,
    scatter_law,
    serial_correlation,
    unstated_error,
)
from lightfield.diagnosis.adequacy.scale import STATED_COUNT_AS, noise_scale, scale_along
from lightfield.diagnosis.adequacy.score_tests import VARIANCE_EXCESS, Adequacy, AdequacyTest
from lightfield.diagnosis.adequacy.shared import shared_part
from lightfield.diagnosis.adequacy.templates import whitened_unknowns
from lightfield.diagnosis.problem.layout import Layout
from lightfield.diagnosis.problem.noise import WHITENED_WHOLE, Budget, Noise
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.diagnosis.problem.quoted import errors_stated, own_part
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.description import describe
from lightfield.diagnosis.search.kept_readings import (
    Kept,
    beside_base,
    beside_stays,
    rich_of,
    without_outliers,
)
from lightfield.diagnosis.search.own_errors import with_response_error
from lightfield.diagnosis.search.set_of_effects import FittedSet
from lightfield.fitting.least_squares import Fit

#: Replicates of the bootstrap. Derived: the smallest p is 0.001, a tenth of the level of a test.
REPLICATES = 999
#: Of errors that the scatter tells this part is a reading's own at least, whatever its place makes. Chosen.
_OWN_OF_LAW = 0.3
#: A reading's own error is this part of all at least. Derived: of squares that are equal the difference is
#: rounding.
_LEAST_OF_ALL = 1e-6
#: Serial correlation is judged beside more spare readings than this. Chosen, as `robust._FEWEST_PAIRS`.
_SPARE_FOR_SERIAL = 25
#: Seeds of generators of their own: below what 64 bits hold. Chosen.
_SEEDS = 1 << 62


@dataclass(frozen=True)
class Prepared:
    """Problem without its outliers, noise model, and the description that both were made about.

    `noise` holds the Monte Carlo error of the base model, which is zero unless the scene has diffuse light;
    explanations by diffuse light add their own. `excess` is the mean factor of the variances of `noise` over
    the stated ones, `raised` that over what is left of these without what bands share, `known` what was
    fitted on the way, `to_trace_per_m` the water whose diffuse light must be traced to say more.
    """

    problem: Problem
    noise: Noise
    serial: Serial
    reference: Fit
    explanation: Explanation
    errors_stated: bool
    excess: float = 1.0
    raised: float = 1.0
    known: tuple[FittedSet, ...] = ()
    to_trace_per_m: float | None = None
    doubted: bool = False

    @cached_property
    def whitenings(self) -> dict[float, tuple[Whitener, Mapping[str, Array]]]:
        """Whitening and whitened unknowns by tolerance, once they are made."""
        return {}

    @cached_property
    def bases(self) -> dict[float, TestedBase]:
        """The base model of many readings by tolerance, once it is tested."""
        return {}

    @cached_property
    def richest(self) -> tuple[Whitener, Fit, Array]:
        """Whitening by the quoted errors alone, the description under it, and the rich model there."""
        plain = Whitener(self.noise.alone, self.serial.rho)
        fit = self.problem.fit(self.explanation, plain, [self.reference.u])
        return plain, fit, rich_of(self.problem, plain, fit)


@dataclass(frozen=True)
class Bench:
    """Everything to test fits at one tolerance."""

    whiten: Whitener
    test: AdequacyTest
    phi: float


class TestedBase(NamedTuple):
    """The base model, fitted and tested."""

    bench: Bench
    fit: Fit
    adequacy: Adequacy


def prepare_problem(
    problem: Problem,
    quoted: Array,
    budget: Budget,
    rng: np.random.Generator,
    alpha: float = ALPHA,
    known: Sequence[FittedSet] = (),
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
    known : sequence of FittedSet
        Fits to the same readings with another trace of the diffuse light, to begin from.
    """
    rich = _prepared(problem, quoted, budget, known)
    if rich.to_trace_per_m or _base_passes(rich, rng, alpha):
        return rich
    alone = beside_base(problem, quoted, False, budget)
    kept, kept_by_rich = alone.problem.keep, rich.problem.keep
    if (kept == kept_by_rich).all() or kept.sum() < kept_by_rich.sum() - 1:
        return rich
    plain = _errors_about(alone, (), alone.fit, np.zeros_like(kept), budget, errors_stated(quoted))
    return plain if _base_passes(plain, rng, alpha) else rich


def _base_passes(prepared: Prepared, rng: np.random.Generator, alpha: float) -> bool:
    return base_at(prepared, 0.0, rng).adequacy.passes(alpha)


def base_at(prepared: Prepared, tolerance: float, rng: np.random.Generator) -> TestedBase:
    """The base model, fitted and tested at one tolerance; that of many readings once."""
    if tolerance in prepared.bases:
        return prepared.bases[tolerance]
    made, problem = bench(prepared, tolerance, rng), prepared.problem
    starts = [problem.model().start, prepared.reference.u[: len(problem.base)]]
    fit = problem.fit((), made.whiten, starts)
    tested = TestedBase(made, fit, made.test(fit))
    if problem.sample is not None:
        prepared.bases[tolerance] = tested
    return tested


def _prepared(
    problem: Problem, quoted: Array, budget: Budget, known: Sequence[FittedSet] = (), by_law: bool = False
) -> Prepared:
    """Outliers judged beside the rich model; `by_law`: the errors are those that the scatter told.

    These are not asked about again: two laws may call for each other for ever.
    """
    usable, stated = problem.keep, errors_stated(quoted)
    kept = beside_base(problem, quoted, True, budget)
    problem, whiten, base = kept[:3]
    law = _law(kept) if stated and not by_law else None
    if law is not None:
        every = replace(problem, keep=usable)
        made = _prepared(every, law, budget, known, by_law=True)
        # A base model that misses the readings by far has a scatter of its own: what describes them is asked.
        again = prepare_about(every, quoted, budget, made.explanation, made.reference)
        return replace(again, known=made.known, to_trace_per_m=made.to_trace_per_m)
    # The light of another trace moves the fits by it too far to begin from there.
    same = [one for one in known if not one.is_diffuse]
    described = describe(problem, whiten, base, stated, same)
    explanation, reference = described.explanation, described.fit
    own: Array = np.zeros_like(usable, float)
    if explanation:
        own = _own_error(problem, reference)
        kept = without_outliers(problem, quoted, explanation, reference, usable, True, budget, own)
    made = _errors_about(kept, explanation, base, own, budget, stated)
    return replace(made, known=described.known, to_trace_per_m=described.to_trace_per_m)


def prepare_about(
    problem: Problem, quoted: Array, budget: Budget, explanation: Explanation, fit: Fit
) -> Prepared:
    """Outliers, smoothed errors and serial correlation about a set of effects that was found.

    Parameters
    ----------
    problem : Problem
        With all usable readings.
    quoted : array, shape (n,)
        Standard errors of the table; NaN where unknown.
    """
    usable, stated = problem.keep, errors_stated(quoted)
    own = _own_error(problem, fit)
    kept = without_outliers(problem, quoted, explanation, fit, usable, True, budget, own)
    law = _law(kept) if stated else None
    if law is not None:
        again = replace(problem, keep=usable)
        kept = without_outliers(again, law, explanation, fit, usable, True, budget, own)
    made = _errors_about(kept, explanation, kept.fit, own, budget, stated)
    return replace(made, doubted=law is not None)


def _own_error(problem: Problem, fit: Fit) -> Array:
    """Error of the predicted readings by their light, shape (n,): neither noise nor an outlier."""
    modes, smooth = problem.forward.errors(fit.values)
    lamp = problem.forward.lamp_errors(fit.values)
    return np.asarray(np.sqrt((modes**2).sum(axis=1) + (lamp**2).sum(axis=1) + smooth**2))


def _errors_about(
    kept: Kept,
    explanation: Explanation,
    lit: Fit,
    own: Array,
    budget: Budget,
    stated: bool,
) -> Prepared:
    """Standard errors and serial correlation about a description without the outliers.

    Parameters
    ----------
    kept : Kept
        The description, whitened by the smoothed quoted errors, and its own.
    lit : Fit
        The fit whose diffuse light has the error that the noise states.
    own : array, shape (n,)
        Error of the description by its diffuse light.
    """
    problem, whiten, reference = kept[:3]
    layout = problem.layout
    whole = whiten.noise.sigma
    beside = np.hypot(own, kept.place)
    quoted_sigma = sigma = np.sqrt(np.maximum(whole**2 - beside**2, (_LEAST_OF_ALL * whole) ** 2))
    if stated:
        rich, total = kept.rich, whiten.noise.sigma
        relative = np.clip(reference.prediction, 0, None) / total
        factor = unstated_error(reference.residual, rich, problem.keep, relative, VARIANCE_EXCESS)
        sigma = np.hypot(quoted_sigma, np.sqrt(factor**2 - 1) * total)
        whiten = Whitener(replace(whiten.noise, sigma=factor * total))
        reference = problem.fit(explanation, whiten, [reference.u])
    slope = budget.position_slope(problem.forward, reference.values)
    layout = _with_common(kept, reference, whiten, budget.position_m * slope, stated)
    excess = float(((sigma / quoted_sigma) ** 2)[problem.keep > 0].mean())
    shared = layout.common * np.clip(reference.prediction, 0, None)
    whole, sigma = sigma, own_part(sigma, shared)
    left = np.maximum(whole**2 - shared**2, (_LEAST_OF_ALL * whole) ** 2)
    raised = float((sigma**2 / left)[problem.keep > 0].mean())
    plain = Noise(layout, sigma, reference.prediction, budget, slope)
    still = beside_stays(problem, whiten, reference, budget, with_time=False)
    serial = Serial()
    if problem.keep.sum() - still.shape[1] > _SPARE_FOR_SERIAL:
        rows = np.column_stack([still, reference.residual])
        if not layout.one_channel and plain.of_moments:
            # Bands that are off together are no evidence of so many scans that are alike.
            rows = _apart(
                replace(plain, budget=replace(budget, plane_gain=0.0)), problem.keep, whiten.coloured(rows)
            )
        expected = 1.0 if stated else None
        serial = serial_correlation(rows[:, -1], rows[:, :-1], problem.keep, layout, expected)
    noise = with_response_error(problem, plain, lit)
    return Prepared(problem, noise, serial, reference, explanation, stated, excess, raised)


def _with_common(kept: Kept, reference: Fit, whiten: Whitener, by_place: Array, stated: bool) -> Layout:
    """The layout with what the bands of a spectrum share beside the place: as stated, or as they scatter."""
    problem, layout, every = kept.problem, kept.problem.layout, whiten.noise.sigma
    if layout.one_channel or layout.common.any():
        return layout
    whole = np.sqrt(np.maximum(every**2 - kept.place**2, (_LEAST_OF_ALL * every) ** 2))
    rich = kept.rich * (kept.whiten.noise.sigma / whole)[:, None]
    relative = np.clip(reference.prediction, 0, None) / whole
    part = shared_part(
        reference.residual * (every / whole),
        rich,
        problem.keep,
        layout.spectrum,
        relative,
        by_place / whole,
        stated,
    )
    return replace(layout, common=np.full(layout.size, part))


def _apart(noise: Noise, keep: Array, columns: Array) -> Array:
    """Whitened columns of the readings that are not left out; zeros elsewhere."""
    out, kept = np.zeros_like(columns), keep > 0
    out[kept] = Whitener(noise.subset(kept))(columns[kept])
    return out


def _law(kept: Kept) -> Array | None:
    """Standard errors in place of stated ones that the scatter contradicts, see `scatter_law`."""
    keep, noise = kept.problem.keep, kept.whiten.noise
    layout, bands = kept.problem.layout, 1.0
    if layout.common.any():
        bands = layout.size / (1 + layout.spectrum.max())
    law = scatter_law(
        kept.fit.residual, kept.rich, keep, noise.sigma, noise.prediction, VARIANCE_EXCESS, bands
    )
    # What the places make of it is no part of what is stated in its place.
    return None if law is None else np.sqrt(np.maximum(law**2 - kept.place**2, (_OWN_OF_LAW * law) ** 2))


def whitened_test(problem: Problem, whiten: Whitener, rng: np.random.Generator) -> AdequacyTest:
    """The adequacy test under a given noise, for readings that are planned rather than measured."""
    noise = whiten.replicates(rng, REPLICATES)
    return AdequacyTest(problem, whiten, whitened_unknowns(problem, whiten), lambda: noise, False)


def bench(prepared: Prepared, tolerance: float, rng: np.random.Generator) -> Bench:
    """Whitening, noise scale and adequacy test at one tolerance."""
    if tolerance not in prepared.whitenings:
        whiten = whitening(prepared, tolerance)
        prepared.whitenings[tolerance] = whiten, whitened_unknowns(prepared.problem, whiten)
    return _bench(prepared, *prepared.whitenings[tolerance], rng)


def whitening(prepared: Prepared, tolerance: float) -> Whitener:
    """By all errors, the quoted ones scaled to the scatter beside the richest model."""
    problem, noise = prepared.problem, prepared.noise
    plain, reference, rich = prepared.richest
    about = with_response_error(problem, noise, reference)
    count_as = STATED_COUNT_AS if prepared.errors_stated else 0.0
    if problem.layout.size <= WHITENED_WHOLE:
        phi = noise_scale(reference.residual, rich, plain, about.extra(tolerance), problem.keep, count_as)
    else:
        phi = scale_along(reference.residual, rich, plain, about, tolerance, problem.keep, count_as)
    return Whitener(noise, plain.rho, phi, tolerance)


def _bench(
    prepared: Prepared,
    whiten: Whitener,
    unknowns: Mapping[str, Array],
    rng: np.random.Generator,
    kept: bool = True,
) -> Bench:
    """Bench of one whitening; its replicates are kept for the next fit, or drawn again."""
    problem = prepared.problem
    # Passed over now, drawn when tested: what is drawn must not depend on what was tested before.
    if problem.sample is None:
        drawn = deepcopy(rng)
        whiten.replicates(rng, REPLICATES)
    else:  # of many readings they are not drawn twice
        drawn = np.random.default_rng(rng.integers(_SEEDS))

    def noise() -> Array:
        return _with_serial(whiten, prepared.serial, whiten.replicates(deepcopy(drawn), REPLICATES))

    scale = whiten.phi * prepared.excess
    often = cache(noise) if kept else noise
    test = AdequacyTest(problem, whiten, unknowns, often, prepared.errors_stated, scale)
    return Bench(whiten, test, whiten.phi)


def judged(prepared: Prepared, whiten: Whitener, rng: np.random.Generator) -> AdequacyTest:
    """The adequacy test of an explanation under errors of its own."""
    unknowns = whitened_unknowns(prepared.problem, whiten)
    return _bench(prepared, whiten, unknowns, rng, kept=False).test


def _with_serial(whiten: Whitener, serial: Serial, white: Array) -> Array:
    """Whitened noise, given the uncertainty of the serial correlation in place, shape (n, REPLICATES)."""
    for i, rho in enumerate(serial.levels):
        if abs(rho - whiten.rho) > SAME_RHO:
            mine = slice(i, None, len(serial.levels))
            other = Whitener(whiten.noise, rho, whiten.phi, whiten.tolerance)
            white[:, mine] = whiten(other.coloured(white[:, mine]))
    return white
