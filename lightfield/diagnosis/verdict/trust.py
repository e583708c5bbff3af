"""May a verdict rest on these readings? Numbers that are no beam through water call for no effect, and rule
none out."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import TINY, Array, Mask
from lightfield.diagnosis.adequacy.slips import structure
from lightfield.diagnosis.adequacy.subspace import INDEPENDENT, beside, orthonormal
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.search.cascade import SearchResult
from lightfield.diagnosis.search.preparation import Prepared
from lightfield.diagnosis.verdict.ladder import bright, rms_over
from lightfield.diagnosis.verdict.parts import Doubt, DoubtReason, SetAside, WhyAside
from lightfield.fitting.least_squares import Fit
from lightfield.readings import Readings

#: Median error of a bright reading, per cent, beyond which readings name and exclude nothing. Chosen: what is
#: called noise up there is as likely a mistake (a beam read with eight grey levels makes 13 %).
_SANE_NOISE_PERCENT = 10.0
#: Errors may be quoted too small by this factor in variance before a scale that a misfit widens is no longer
#: believed. Chosen: half of `score_tests.VARIANCE_EXCESS`, which readings without a misfit may show.
_CREDIBLE = 2.0
#: Readings come in steps where every value is there so many times in the mean. Chosen: of readings that are
#: none hardly one comes again.
_COME_AGAIN = 2.0
#: Standard deviation of what is spread evenly over one step. Derived.
_OF_A_STEP = 12**-0.5
#: A constant that scatters no more than this times as much as the model about the readings is as good as it,
#: where the scene's own light varies by so many times the noise, or the error that the model is excused.
#: Chosen: benchmarks/garbage has constants.
_AS_GOOD, _VARIES = 1.5, 3.0
#: Readings ask for more than the bound of a parameter by so many standard deviations: of clear water, whose
#: absorption lies at 0, one table in a thousand (test_trust.py has three).
_BEYOND_SIGMA = 3.0


@dataclass(frozen=True)
class Trust:
    """What the verdict rests on.

    Parameters
    ----------
    noise_percent : float or None
        Median of standard error over reading, of bright readings; None: no reading is bright.
    off_sigma : array, shape (n,)
        (Reading - model) / standard error.
    aside : array of bool, shape (n,)
        Readings set aside as gross outliers.
    doubt : Doubt or None
        Why no effect can be named, and none ruled out.
    """

    noise_percent: float | None
    off_sigma: Array
    aside: NDArray[np.bool_]
    doubt: Doubt | None


def error_scale(prepared: Prepared, finding: SearchResult) -> float:
    """Variance of the readings' errors over the quoted one, judged beside the best explanation.

    A misfit that nothing explains is not noise: then the quoted errors have the word, if credible.
    """
    scale = finding.level.bench.phi * finding.scale
    unexplained = finding.size is None and not (finding.withheld or finding.in_part)
    return min(scale, _CREDIBLE) if unexplained and prepared.errors_stated else scale


def pure_error(finding: SearchResult) -> float:
    """Variance of the noise in units of the whitening: what nothing explains is none of it."""
    phi = finding.level.phi
    return phi if finding.size is not None else min(phi, _CREDIBLE / finding.level.bench.phi)


def standard_errors(prepared: Prepared, finding: SearchResult) -> Array:
    """Standard error of every reading as the diagnosis used it, shape (n,)."""
    return np.sqrt(prepared.noise.variance(error_scale(prepared, finding), 0.0))


def noise_floor(prepared: Prepared, finding: SearchResult) -> Array:
    """The same without errors of the lamp's table, which the readings mostly tell themselves, shape (n,)."""
    noise = replace(prepared.noise, lamp_modes=None)
    return np.sqrt(noise.variance(error_scale(prepared, finding), 0.0))


def left_by_fit(floor: Array, fit: Fit, counted: Mask) -> tuple[float, float]:
    """What a fit leaves of the noise floor: rms over the model, per cent, and its spread by chance.

    What is fitted follows a part of the noise of each reading, and where few readings have large errors their
    noise is most of the rms.

    Parameters
    ----------
    floor : array, shape (n,)
        Standard errors of the readings.
    counted : array of bool, shape (n,)
        Readings that count in the error in per cent.
    """
    followed = orthonormal(fit.jacobian[:, ~fit.at_bound()], INDEPENDENT)
    left = floor * np.sqrt(np.maximum(1 - np.sum(followed**2, axis=1), 0.0))
    rms = rms_over(left[counted], fit.prediction[counted])
    if not rms > 0:
        return rms, float("nan")
    square = (100 * left[counted] / fit.prediction[counted]) ** 2
    return rms, float(np.sqrt(2 * np.sum(square**2)) / len(square) / (2 * rms))


def trust_of(
    prepared: Prepared, finding: SearchResult, saturated: NDArray[np.bool_], rng: np.random.Generator
) -> Trust:
    """Noise, readings set aside, and what speaks against any verdict.

    Parameters
    ----------
    saturated : array of bool, shape (n,)
        Readings left out because they are saturated.
    """
    problem, counted = prepared.problem, bright(prepared.problem)
    fit = finding.closest.fit if finding.closest else finding.level.base
    sigma, misfit = standard_errors(prepared, finding), problem.value - fit.prediction
    aside = (problem.keep == 0) & ~saturated
    own = noise_floor(prepared, finding)[counted]
    noise = float(100 * np.median(own / problem.value[counted])) if counted.any() else None
    rate = prepared.noise.budget.outlier_rate
    doubt = _doubt(prepared, finding, fit, noise)
    if doubt is None:
        common = structure(aside, misfit, ~saturated, problem.layout, fit.prediction, rate, rng)
        doubt = None if common is None else Doubt(reason=DoubtReason.SET_ASIDE, structure=common)
    return Trust(noise, misfit / sigma, aside, doubt)


def set_aside(readings: Readings, trust: Trust, beyond: Mask) -> list[SetAside]:
    """Outliers, farthest first, then saturated readings, of which those `beyond` the lamp's table are not."""
    far = sorted(np.flatnonzero(trust.aside).tolist(), key=lambda i: -abs(trust.off_sigma[i]))

    def entry(i: int, reason: WhyAside, sigma: float | None = None) -> SetAside:
        wavelength = float(readings.wavelength_nm[i])
        return SetAside(
            row=i, reason=reason,
            x_m=float(readings.x_m[i]), y_m=float(readings.y_m[i]), z_m=float(readings.z_m[i]),
            medium=str(readings.medium[i]), wavelength_nm=wavelength if np.isfinite(wavelength) else None,
            off_sigma=sigma,
        )  # fmt: skip

    outliers = [entry(i, WhyAside.OUTLIER, float(trust.off_sigma[i])) for i in far]
    saturated = [entry(i, WhyAside.SATURATED) for i in np.flatnonzero(readings.saturated & ~beyond).tolist()]
    return [
        *outliers,
        *saturated,
        *(entry(i, WhyAside.BEYOND_TABLE) for i in np.flatnonzero(beyond).tolist()),
    ]


def says_nothing(prepared: Prepared, finding: SearchResult) -> bool:
    """Whether `trust_of` will doubt these readings whatever explains them, so that no more need be sought."""
    if _rounding_percent(prepared) > _SANE_NOISE_PERCENT:
        return True
    problem = prepared.problem
    channels, excused = _channels(problem), finding.level.tolerance
    noise = np.median(np.sqrt(prepared.noise.variance(1.0, 0.0)) / np.maximum(np.abs(problem.value), TINY))
    varies = _VARIES * max(float(noise), excused)
    return (
        _contrast(problem.value, channels) <= excused
        and _contrast(problem.forward.predict({}), channels) > varies
    )


def _doubt(prepared: Prepared, finding: SearchResult, fit: Fit, noise: float | None) -> Doubt | None:
    if noise is None:
        return Doubt(reason=DoubtReason.NOTHING_BRIGHT)
    if (coarse := _rounding_percent(prepared)) > _SANE_NOISE_PERCENT:
        return Doubt(reason=DoubtReason.COARSE, noise_percent=coarse)
    if noise > _SANE_NOISE_PERCENT:
        return Doubt(reason=DoubtReason.NOISE, noise_percent=noise)
    if (reason := _no_better_than_a_constant(prepared, finding, fit, noise)) is not None:
        return Doubt(reason=reason)
    if finding.size is not None and (pinned := _pinned(prepared, finding, fit)):
        return Doubt(reason=DoubtReason.PINNED, pinned=pinned)
    return None


def _rounding_percent(prepared: Prepared) -> float:
    """Standard error that the steps of readings give a typical bright one, where most values come again.

    A model with enough curves follows steps: then neither the scatter nor stated errors tell of them.
    """
    problem, channel = prepared.problem, prepared.problem.layout.channel
    rounding, counted = np.zeros(len(problem.value)), bright(problem)
    for one in np.unique(channel):
        levels, mine = np.unique(problem.value[channel == one]), channel == one
        if 1 < len(levels) <= mine.sum() / _COME_AGAIN:
            rounding[mine] = np.diff(levels).min() * _OF_A_STEP
    return float(100 * np.median(rounding[counted] / problem.value[counted]))


def _no_better_than_a_constant(
    prepared: Prepared, finding: SearchResult, fit: Fit, noise: float
) -> DoubtReason | None:
    """Does a constant per wavelength tell the readings as well as the model, where light should vary?

    Within the error that the model is excused it does, too: that many effects follow noise is no merit.
    Readings that vary are no constant for it: the model misses them as much.
    """
    problem, kept, channels = prepared.problem, prepared.problem.keep, _channels(prepared.problem)
    spare = int(kept.sum()) - len(fit.u)
    if spare < 1:
        return None
    left = beside(orthonormal(finding.whiten(channels)), finding.whiten(kept * problem.value)[:, None])
    constant = float((left**2).sum()) / (kept.sum() - channels.shape[1])
    excused = finding.level.tolerance
    varies = _VARIES * max(noise / 100, excused)
    if _contrast(problem.forward.predict({}), channels) <= varies:
        return None
    contrast = _contrast(problem.value, channels)
    if constant > _AS_GOOD * fit.chi2 / spare and contrast > excused:
        return None
    return DoubtReason.FLAT if contrast <= varies else DoubtReason.NO_BETTER


def _channels(problem: Problem) -> Array:
    """Which readings that are kept are of which channel, shape (n, n_channels)."""
    channel = problem.layout.channel
    return np.asarray((channel[:, None] == np.unique(channel)) * problem.keep[:, None])


def _contrast(values: Array, channels: Array) -> float:
    """Relative spread of values, shape (n,), in the channel, a column of (n, k), where they vary most."""
    of_each = (values[one > 0] for one in channels.T)
    return max((float(np.std(v) / abs(v.mean())) for v in of_each if v.mean()), default=0.0)


def _pinned(prepared: Prepared, finding: SearchResult, fit: Fit) -> dict[str, float]:
    """Gains, width and absorption at a bound beyond which the readings push them."""
    out, bound = {}, fit.at_bound()
    free = orthonormal(fit.jacobian[:, ~bound], INDEPENDENT)
    for i, parameter in enumerate(prepared.problem.base):
        if not bound[i] or parameter.low == parameter.high:
            continue
        outward = -1.0 if fit.u[i] - parameter.low < parameter.high - fit.u[i] else 1.0
        column = outward * beside(free, fit.jacobian[:, i : i + 1])[:, 0]
        pull = float(column @ fit.residual) / max(float(np.linalg.norm(column)), TINY)
        if pull > _BEYOND_SIGMA * np.sqrt(finding.level.phi):
            out[parameter.path] = fit.values[parameter.path]
    return out
