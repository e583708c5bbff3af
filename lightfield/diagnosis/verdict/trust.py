"""May a verdict rest on these readings? Numbers that are no beam through water call for no effect, and rule
none out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array
from lightfield.diagnosis.adequacy.aside import Structure, structure
from lightfield.diagnosis.adequacy.subspace import beside, orthonormal
from lightfield.diagnosis.search.cascade import Finding
from lightfield.diagnosis.search.preparation import Prepared
from lightfield.diagnosis.verdict.ladder import bright
from lightfield.fitting.least_squares import Fit

#: Median error of a bright reading, in per cent of it, beyond which readings name and exclude nothing:
#: what is called noise up there is as likely a mistake (a beam read with eight grey levels makes 13 %).
SANE_NOISE_PERCENT = 10.0
#: Errors may be quoted too small by this factor in variance before their scale is no longer believed.
CREDIBLE = 2.0
#: A constant that scatters no more than this times as much as the model about the readings is as good as it,
#: where the scene's own light varies by so many times the noise.
_AS_GOOD, _VARIES = 1.5, 3.0
#: Readings ask for more than the bound of a parameter by so many standard deviations.
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
    doubt : str or None
        Why no effect can be named, and none ruled out.
    structure : Structure or None
        What the readings set aside have in common, if that is the doubt.
    """

    noise_percent: float | None
    off_sigma: Array
    aside: NDArray[np.bool_]
    doubt: str | None
    structure: Structure | None


def error_scale(prepared: Prepared, finding: Finding) -> float:
    """Variance of the readings' errors over the quoted one, judged beside the best explanation.

    A misfit that nothing explains is not noise: then the quoted errors have the word, if credible.
    """
    best = finding.accepted[0].adequacy if finding.accepted else None
    scale = finding.level.bench.phi * (best.phi if best is not None else finding.level.phi)
    unexplained = finding.size is None and not finding.withheld
    return min(scale, CREDIBLE) if unexplained and prepared.errors_stated else scale


def standard_errors(prepared: Prepared, finding: Finding) -> Array:
    """Standard error of every reading as the diagnosis used it, shape (n,)."""
    return np.sqrt(prepared.noise.variance(error_scale(prepared, finding), 0.0))


def trust_of(
    prepared: Prepared, finding: Finding, saturated: NDArray[np.bool_], rng: np.random.Generator
) -> Trust:
    """Noise, readings set aside, and what speaks against any verdict.

    Parameters
    ----------
    saturated : array of bool, shape (n,)
        Readings left out because they are saturated.
    """
    problem, counted = prepared.problem, bright(prepared.problem)
    fit = finding.accepted[0].fit if finding.accepted else finding.level.base
    sigma, misfit = standard_errors(prepared, finding), problem.value - fit.prediction
    aside = (problem.keep == 0) & ~saturated
    noise = float(100 * np.median(sigma[counted] / problem.value[counted])) if counted.any() else None
    rate = prepared.noise.budget.outlier_rate
    doubt, common = _doubt(prepared, finding, fit, noise), None
    if doubt is None:
        common = structure(aside, misfit, ~saturated, problem.layout, fit.prediction, rate, rng)
    if common is not None:
        lie = "they lie together" if common.coordinate else "there are"
        doubt = f"readings that no known effect reaches are no slips: {lie} {common.where}"
    return Trust(noise, misfit / sigma, aside, doubt, common)


def _doubt(prepared: Prepared, finding: Finding, fit: Fit, noise: float | None) -> str | None:
    if noise is None:
        return "these readings do not look like a beam through water: no bright one is left"
    if noise > SANE_NOISE_PERCENT:
        return (
            f"the noise is {noise:.0f} % of a typical bright reading, too much to name an effect or to rule "
            "one out; these may be no readings of a beam through water"
        )
    if _flat(prepared, finding, fit, noise):
        return (
            "these readings do not look like a beam through water: they do not change from place to place, "
            "where the lamp's light does"
        )
    if finding.size is not None and (pinned := _pinned(prepared, finding, fit)):
        return (
            "these readings do not look like a beam through water: they ask for more than "
            + " and ".join(pinned)
            + " allows, the edge of what is possible"
        )
    return None


def _flat(prepared: Prepared, finding: Finding, fit: Fit, noise: float) -> bool:
    """Does a constant per wavelength tell the readings as well as the model, where light should vary?"""
    problem, layout, kept = prepared.problem, prepared.problem.layout, prepared.problem.keep
    channels = (layout.channel[:, None] == np.unique(layout.channel)) * kept[:, None]
    spare = int(kept.sum()) - len(fit.u)
    if spare < 1:
        return False
    left = beside(orthonormal(finding.whiten(channels)), finding.whiten(kept * problem.value)[:, None])
    constant = float((left**2).sum()) / (kept.sum() - channels.shape[1])
    light = problem.forward.predict({})
    contrast = [100 * float(np.std(v) / abs(v.mean())) for c in channels.T if (v := light[c > 0]).mean()]
    return constant <= _AS_GOOD * fit.chi2 / spare and max(contrast, default=0.0) > _VARIES * noise


def _pinned(prepared: Prepared, finding: Finding, fit: Fit) -> list[str]:
    """Gains, width and absorption at a bound beyond which the readings push them."""
    out, bound = [], fit.at_bound()
    free = orthonormal(fit.jacobian[:, ~bound], 1e-9)
    for i, parameter in enumerate(prepared.problem.base):
        if not bound[i] or parameter.low == parameter.high:
            continue
        outward = -1.0 if fit.u[i] - parameter.low < parameter.high - fit.u[i] else 1.0
        column = outward * beside(free, fit.jacobian[:, i : i + 1])[:, 0]
        pull = float(column @ fit.residual) / max(float(np.linalg.norm(column)), 1e-300)
        if pull > _BEYOND_SIGMA * np.sqrt(finding.level.phi):
            out.append(f"{parameter.path} = {fit.values[parameter.path] + 0.0:.3g}")
    return out
