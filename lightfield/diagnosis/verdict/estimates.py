"""How large is what was fitted, and how sure is that?"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from lightfield.diagnosis.verdict.parts import Estimate, Reason
from lightfield.fitting.curves import PROFILE, field_of
from lightfield.fitting.effects.detector import SUDDEN
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.least_squares import Fit
from lightfield.scene import Scene

#: Within what time light is switched.
_OVER: Final = "detector.background_step_over_s"
#: How many moments each number of it holds. Derived: a duration lies between two.
_MOMENTS: Final = {"detector.background_step_s": 1, "detector.background_step_for_s": 2}
#: Standard deviation of what lies anywhere in an interval, over its length. Derived.
_EVEN: Final = 12**-0.5
#: What reflects all at most, however large it is stated.
_FLOOR, _END = "tank.floor_over_walls", "tank.end_over_walls"
#: An error that is no smaller than this part of the stated one says nothing new. Chosen: words alone.
_ALIKE = 0.95


def estimates(
    fit: Fit,
    scale: float,
    units: dict[str, str],
    least: Mapping[str, float] | None = None,
    least_of_set: Mapping[str, float] | None = None,
) -> dict[str, Estimate]:
    """Fitted values with errors, or the reason why there is none.

    Parameters
    ----------
    scale : float
        Pure-error variance in units of the whitening.
    least : mapping, optional
        Smallest errors by path, from a profile.
    least_of_set : mapping, optional
        The same, were the effects that are fitted all that act; None: that is not told.
    """
    errors, bound, most = _with_moments(fit, fit.stderr(scale)), fit.at_bound(), _white_faces(fit)
    out = {}
    for i, path in enumerate(fit.paths):
        value, error = (
            most.get(path, fit.values[path]),
            np.fmax(errors[path], (least or {}).get(path, np.nan)),
        )
        of_set = np.fmax(errors[path], (least_of_set or {}).get(path, np.nan))
        reason: Reason | None = None
        if fit.model.parameters[i].is_held:
            reason = Reason.HELD
        elif bound[i] and fit.model.parameters[i].is_answer(fit.u[i]):
            reason = Reason.SUDDEN if fit.model.parameters[i].lowest == "sudden" else Reason.NONE
        elif bound[i] or path in most:
            # A lamp's curve is held from bending more than lamps do: that is no edge of what is plausible.
            reason = Reason.BENDS_NO_MORE if field_of(path) == PROFILE else Reason.AT_BOUNDARY
        elif np.linalg.norm(fit.jacobian[:, i]) == 0:
            reason = Reason.DID_NOT_MOVE
        elif not np.isfinite(error):
            reason = Reason.UNDETERMINED
        elif error > fit.model.parameters[i].width(fit.u[i]):
            reason = Reason.TOO_WIDE
        is_told = reason is None and least_of_set is not None and of_set < _ALIKE * error
        out[path] = Estimate(
            value=value,
            stderr=None if reason else error,
            stderr_of_set=of_set if is_told else None,
            unit=units.get(path, "reading"),
            reason=reason,
        )
    return out


def _with_moments(fit: Fit, errors: Mapping[str, float]) -> dict[str, float]:
    """Errors by path; of a sudden switch it is known between which readings it was, and no more."""
    out = dict(errors)
    if _OVER in fit.paths:
        at = fit.paths.index(_OVER)
        parameter, u = fit.model.parameters[at], float(fit.u[at])
        if fit.at_bound()[at] and parameter.is_answer(u):
            between_s = parameter.value(u) / SUDDEN * _EVEN
            for path, moments in _MOMENTS.items():
                if path in out:
                    out[path] = float(np.hypot(out[path], np.sqrt(moments) * between_s))
    return out


def _white_faces(fit: Fit) -> dict[str, float]:
    """Albedo over the walls' of a floor or end that reflects all, where a fit asks for more; by its path."""
    forward = fit.model.forward if {_FLOOR, _END} & set(fit.paths) else None
    tank = forward.scenes.at(fit.values, validate=False).tank if isinstance(forward, SceneForward) else None
    white = {} if tank is None else {_FLOOR: tank.floor_share, _END: tank.end_share}
    return {path: share for path, share in white.items() if share < fit.values.get(path, 0.0)}


def units_of(scene: Scene) -> dict[str, str]:
    """Unit of every scene parameter."""
    return {path: parameter.unit for path, parameter in scene.parameters().items()}


def units_in(forward: SceneForward) -> dict[str, str]:
    """Unit of every scene parameter, and of the amplitudes of curves over these readings."""
    amplitudes = forward.scenes.curves.parameters
    return units_of(forward.scene) | {path: parameter.unit for path, parameter in amplitudes.items()}
