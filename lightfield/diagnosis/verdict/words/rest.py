"""What is the rest like that nothing explains, and how can a suspicion be tested?"""

from __future__ import annotations

from collections.abc import Sequence

from lightfield.diagnosis.verdict.parts import Estimate, LeftOver, Misfit, Reason
from lightfield.diagnosis.verdict.speech import UNITS, join, roughly
from lightfield.fitting.effects.local import PLUME, SQUARE
from lightfield.wording import plain, rounded

#: What formulas call the coordinates of a misfit, and their unit over that of the misfit: derived.
_CALLED = {
    "x": ("x", 1.0),
    "y": ("y", 1.0),
    "plane": ("z", 1.0),
    "angle": ("theta", 1.0),
    "time": ("time", 60.0),
    "wavelength": ("wavelength", 1.0),
}
#: Where a factor over a coordinate acts.
_STAGE = {"x": "path", "y": "path", "z": "path", "theta": "source", "time": "source", "wavelength": "source"}


def about(misfit: Misfit | None) -> str:
    """What is known of a misfit that nothing explains."""
    if misfit is None:
        return "it is not a function of one coordinate"
    if misfit.like is not None and misfit.period_deg is None and misfit.period_s is None:
        if misfit.like == SQUARE:  # it is the same in four directions
            return f"it looks like a {plain(misfit.like)}"
        name, unit = misfit.coordinate, UNITS.get(misfit.coordinate, "")
        where = f"{name} = {misfit.worst_at:.3g} {unit}".rstrip()
        # It shades what passes through it: its place along x is told where that is read.
        where += " at the farthest distance" if misfit.like == PLUME else ""
        return f"it looks like a {plain(misfit.like)}, near {where}"
    if misfit.at_one:
        where = f"{misfit.worst_at:.3g} {UNITS.get(misfit.coordinate, '')}".rstrip()
        return f"it lies in the {misfit.coordinate} at {where} alone, which may stand elsewhere than stated"
    return f"it depends on {misfit.coordinate} alone, {_largest(misfit)}"


def _largest(misfit: Misfit) -> str:
    """Where an unexplained misfit is largest."""
    if misfit.period_deg is not None:
        return f"with a period of {misfit.period_deg:.2g} degrees"
    if misfit.period_s is not None:
        return f"with a period of {misfit.period_s:.3g} s"
    return f"most near {misfit.worst_at:.3g} {UNITS.get(misfit.coordinate, '')}".rstrip()


def sentences(left: Sequence[LeftOver], misfit: Misfit | None) -> str:
    """One sentence on what describes the rest, where something does, and one on what the user can do."""
    # One that lies along another coordinate than the rest does tells of a part of it only.
    left = [one for one in left if misfit is None or one.coordinate == misfit.coordinate]
    told = [_described(left[0])] if left else []
    return " ".join([*told, _suspect(left, misfit)])


def _described(one: LeftOver) -> str:
    values = ", ".join(f"{name} = {_size(e)}" for name, e in one.parameters.items())
    enough = ", and nothing more is missing" if one.adequate else ""
    beside = f" beside {join(one.beside)}" if one.beside else ""
    error = "" if one.error_percent is None else f": the error would be {rounded(one.error_percent)} %"
    return (
        f"A {plain(one.name)}{beside} describes {one.removed_percent:.0f} % of what is left "
        f"({values}){error}{enough}. It says where the rest is, not what.{_before_all(one)}"
    )


def _before_all(one: LeftOver) -> str:
    """Of a shadow that falls on all distances: what casts it may be the lamp's own window."""
    if Reason.BEFORE_ALL not in {e.reason for e in one.parameters.values()}:
        return ""
    return " It shades every distance along the same rays: dirt on the lamp's window would, too."


def _size(one: Estimate) -> str:
    """A value with its error, or why it has none."""
    return roughly(one) if one.reason is None else f"{roughly(one)} ({one.reason.short})"


def _suspect(left: Sequence[LeftOver], misfit: Misfit | None) -> str:
    """How to write a hypothesis, with the coordinate of the rest filled in."""
    if left:
        stage, formula = left[0].stage, left[0].formula
    elif misfit is not None:
        name, unit = _CALLED.get(misfit.coordinate, ("signal", 1.0))
        stage = _STAGE.get(name, "readout")
        if name == "signal":
            formula = "signal*(1 + size*signal)"
        elif misfit.period_deg is not None:
            formula = f"1 + a*cos(2*pi*{name}/{misfit.period_deg:.3g})"
        else:
            formula = f"1 - depth*exp(-(({name} - {unit * misfit.worst_at:.3g})/width)**2)"
    else:
        return (
            "What you suspect can be tested: as a formula of x, y, z, theta or time in an [[effect]] table "
            "(docs/own_effects.md)."
        )
    return (
        f'What you suspect can be tested: as an [[effect]] table with stage = "{stage}" and a formula '
        f"such as {formula} (docs/own_effects.md)."
    )
