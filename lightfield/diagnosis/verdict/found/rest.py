"""What nothing explains, in words: the local unknown that describes it, and how to test what one suspects."""

from __future__ import annotations

from collections.abc import Sequence

from lightfield.diagnosis.verdict.parts import LeftOver, Misfit
from lightfield.diagnosis.verdict.speech import join, roughly

#: What formulas call the coordinates of a misfit, and their unit over that of the misfit.
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


def sentences(left: Sequence[LeftOver], misfit: Misfit | None) -> str:
    """One sentence on what describes the rest, where something does, and one on what the user can do."""
    # One that lies along another coordinate than the rest does tells of a part of it only.
    left = [one for one in left if misfit is None or one.coordinate == misfit.coordinate]
    told = [_described(left[0])] if left else []
    return " ".join([*told, _suspect(left, misfit)])


def _described(one: LeftOver) -> str:
    values = ", ".join(f"{name} = {roughly(e)}" for name, e in one.parameters.items())
    enough = ", and nothing more is missing" if one.adequate else ""
    beside = f" beside {join(one.beside)}" if one.beside else ""
    error = "" if one.error_percent is None else f": the error would be {one.error_percent:.2g} %"
    return (
        f"A {one.name.replace('_', ' ')}{beside} describes {one.removed_percent:.0f} % of what is left "
        f"({values}){error}{enough}. It says where the rest is, not what."
    )


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
