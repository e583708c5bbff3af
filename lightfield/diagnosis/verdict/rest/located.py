"""Where a local unknown lies of which no slope tells: a step may be anywhere between two readings, so
chi-square is asked on both sides."""

from __future__ import annotations

from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.verdict.parts import Estimate, Reason
from lightfield.fitting.least_squares import Fit, Whiten, least_squares
from lightfield.fitting.parameter import Model

#: First step away from where a fit lies, as part of the range, and how much longer the next one is. Chosen: a
#: range is crossed in seven.
_FIRST, _LONGER = 1e-3, 3.0
#: Halvings of the step that goes too far, and steps of a fit with one parameter held. Chosen: a hundredth of
#: it; what is refitted hardly moves.
_HALVINGS, _STEPS = 7, 4
#: Chi-square, in units of the scale, by which what lies beyond one error is worse. Derived: a parabola.
_WORSE = 1.0


def located(
    problem: Problem, fit: Fit, whiten: Whiten, scale: float, path: str, estimate: Estimate
) -> Estimate:
    """An estimate with an error, where it had none because no slope, or none of its own, moves the model.

    Its value is the middle, and its error half, of the range within which chi-square, all else fitted again,
    is worse by no more than one; unchanged where that has no end on either side.

    Parameters
    ----------
    scale : float
        Variance of a reading in units of the whitening.
    """
    if estimate.reason not in (Reason.DID_NOT_MOVE, Reason.UNDETERMINED, Reason.TOO_WIDE):
        return estimate
    i = fit.paths.index(path)
    parameter = fit.model.parameters[i]
    limit = fit.chi2 + _WORSE * scale

    def is_within(u: float) -> bool:
        held = (*fit.model.parameters[:i], parameter.held(u), *fit.model.parameters[i + 1 :])
        there = Model(fit.model.forward, held)
        return least_squares(there, problem.value, whiten, fit.u, problem.keep, _STEPS).chi2 < limit

    def end(side: float, bound: float) -> float:
        inside, step = float(fit.u[i]), _FIRST * (parameter.high - parameter.low)
        while (outside := inside + side * step) * side < bound * side and is_within(outside):
            inside, step = outside, _LONGER * step
        if outside * side >= bound * side:
            if is_within(bound):
                return bound
            outside = bound
        for _ in range(_HALVINGS):
            middle = 0.5 * (inside + outside)
            inside, outside = (middle, outside) if is_within(middle) else (inside, middle)
        return inside

    low, high = end(-1.0, parameter.low), end(1.0, parameter.high)
    if low == parameter.low and high == parameter.high:
        return estimate
    first, last = parameter.value(low), parameter.value(high)
    value, stderr = 0.5 * (first + last), 0.5 * abs(last - first)
    return estimate.model_copy(update={"value": value, "stderr": stderr, "reason": None})
