"""How large is what was fitted, and how sure is that?"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lightfield.diagnosis.verdict.parts import Estimate, Reason
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.least_squares import Fit
from lightfield.scene import Scene


def estimates(
    fit: Fit, scale: float, units: dict[str, str], least: Mapping[str, float] | None = None
) -> dict[str, Estimate]:
    """Fitted values with errors, or the reason why there is none.

    Parameters
    ----------
    scale : float
        Pure-error variance in units of the whitening.
    least : mapping, optional
        Smallest errors by path, from a profile.
    """
    errors, bound = fit.stderr(scale), fit.at_bound()
    out = {}
    for i, path in enumerate(fit.paths):
        value, error = fit.values[path], np.fmax(errors[path], (least or {}).get(path, 0.0))
        reason: Reason | None = None
        if fit.model.parameters[i].is_held:
            reason = Reason.HELD
        elif bound[i]:
            reason = Reason.AT_BOUNDARY
        elif np.linalg.norm(fit.jacobian[:, i]) == 0:
            reason = Reason.DID_NOT_MOVE
        elif not np.isfinite(error):
            reason = Reason.UNDETERMINED
        elif error > fit.model.parameters[i].width(fit.u[i]):
            reason = Reason.TOO_WIDE
        out[path] = Estimate(
            value=value, stderr=None if reason else error, unit=units.get(path, "reading"), reason=reason
        )
    return out


def units_of(scene: Scene) -> dict[str, str]:
    """Unit of every scene parameter."""
    return {path: parameter.unit for path, parameter in scene.parameters().items()}


def units_in(forward: SceneForward) -> dict[str, str]:
    """Unit of every scene parameter, and of the amplitudes of curves over these readings."""
    amplitudes = forward.scenes.curves.parameters
    return units_of(forward.scene) | {path: parameter.unit for path, parameter in amplitudes.items()}
