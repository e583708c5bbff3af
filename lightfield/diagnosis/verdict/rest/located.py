"""Where a local unknown lies of which slopes tell nothing, or too much: a step may be anywhere between two
readings, so chi-square is asked on both sides."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.search.profile_likelihood import ONE_SIGMA, TWO_SIGMA
from lightfield.diagnosis.verdict.estimates import estimates, units_of
from lightfield.diagnosis.verdict.parts import Estimate, Reason
from lightfield.fitting.effects.local import AMPLITUDES, PLUME
from lightfield.fitting.least_squares import Fit, Whiten, least_squares
from lightfield.fitting.parameter import Model
from lightfield.scene.own.own_effect import OwnEffect

#: First step away from where a fit lies, as part of the range, and how much longer the next one is. Chosen: a
#: range is crossed in seven.
_FIRST, _LONGER = 1e-3, 3.0
#: Halvings of the step that goes too far, and steps of a fit with one parameter held. Chosen: a hundredth of
#: it; what is refitted hardly moves.
_HALVINGS, _STEPS = 7, 4


def parameters_of(
    own: OwnEffect, problem: Problem, fit: Fit, whiten: Whiten, scale: float
) -> dict[str, Estimate]:
    """The parameters of a local unknown by their names, with the errors of a profile where it has places.

    What lies at the end of its range is told without an error, and stays there while the others are asked:
    a shadow from before all readings has its place and width beside the distance that is told.
    """
    prefix = f"effect.{own.name}."
    told = {path: e for path, e in estimates(fit, scale, units_of(problem.forward.scene)).items()
            if path.startswith(prefix)}  # fmt: skip
    ends = {path for path, e in told.items() if e.reason is Reason.AT_BOUNDARY}
    stay = [
        p.held(float(u)) if p.path in ends else p for p, u in zip(fit.model.parameters, fit.u, strict=True)
    ]
    there = replace(fit, model=Model(fit.model.forward, tuple(stay)))
    out = {
        path.removeprefix(prefix): one
        if path.removeprefix(prefix) in AMPLITUDES
        else located(problem, there, whiten, scale, path, one)
        for path, one in told.items()
    }
    if own.name == PLUME and prefix + "z0" in ends:
        distance = fit.model.parameters[i := fit.paths.index(prefix + "z0")]
        if distance.end_near(float(fit.u[i])) == distance.low:
            out["z0"] = out["z0"].model_copy(update={"reason": Reason.BEFORE_ALL})
    return out


def located(
    problem: Problem, fit: Fit, whiten: Whiten, scale: float, path: str, estimate: Estimate
) -> Estimate:
    """An estimate whose error is that of a profile: one of it covers all that lies within 1, two of it all
    within 4 of the least chi-square, everything else fitted again, about the middle of what lies within 1.

    Slopes at a step that takes about as long as the readings are apart know it by the one reading in its
    middle, or not at all: two of their errors held 74 % of 112 such steps in noise. Unchanged where
    chi-square has no end on either side, or where it lies at a bound.

    Parameters
    ----------
    scale : float
        Variance of a reading in units of the whitening.
    """
    if estimate.reason not in (None, Reason.DID_NOT_MOVE, Reason.UNDETERMINED, Reason.TOO_WIDE):
        return estimate
    i = fit.paths.index(path)
    parameter = fit.model.parameters[i]

    @cache  # where one and two errors end is sought along the same way
    def worse(u: float) -> float:
        held = (*fit.model.parameters[:i], parameter.held(u), *fit.model.parameters[i + 1 :])
        there = Model(fit.model.forward, held)
        found = least_squares(there, problem.value, whiten, fit.u, problem.keep, _STEPS)
        return (found.chi2 - fit.chi2) / scale

    def end(side: float, bound: float, most: float) -> float:
        inside, step = float(fit.u[i]), _FIRST * (parameter.high - parameter.low)
        while (outside := inside + side * step) * side < bound * side and worse(outside) < most:
            inside, step = outside, _LONGER * step
        if outside * side >= bound * side:
            if worse(bound) < most:
                return bound
            outside = bound
        for _ in range(_HALVINGS):
            middle = 0.5 * (inside + outside)
            inside, outside = (middle, outside) if worse(middle) < most else (inside, middle)
        return inside

    def ends(most: float) -> tuple[float, float]:
        return end(-1.0, parameter.low, most), end(1.0, parameter.high, most)

    near = ends(ONE_SIGMA)
    if near == (parameter.low, parameter.high):
        return estimate
    value = 0.5 * sum(map(parameter.value, near))
    one, two = (max(abs(parameter.value(u) - value) for u in of) for of in (near, ends(TWO_SIGMA)))
    stderr = max(one, 0.5 * two)
    return estimate.model_copy(update={"value": value, "stderr": stderr, "reason": None})
