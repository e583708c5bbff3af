"""A comparison of maps with the formula, in a sentence."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from lightfield.studies.compare.rings import BEYOND, ERROR_LEVELS, OPEN, WITHIN
from lightfield.wording import capital

if TYPE_CHECKING:
    from lightfield.studies.compare.maps import Comparison, PlaneComparison

#: As a share is told that is next to nothing.
_NO_PERCENT = "0.0 %"


def in_a_sentence(comparison: Comparison) -> str:
    """One plain sentence: how much light the formula loses, and up to where it can be trusted; of several
    wavelengths at the brightest, and how far off it is at the worst."""
    planes = comparison.at(comparison.brightest_nm)
    lit = [plane for plane in planes if plane.is_lit]
    if not lit:
        return "No light was rendered on any plane: nothing can be compared. More photons, or planes nearer."
    dark = ", ".join(f"{plane.z_m:g}" for plane in planes if not plane.is_lit)
    unknown = f" No light was rendered at {dark} m: nothing can be compared there." if dark else ""
    first, last = lit[0], lit[-1]
    lost = _told_of_light(first, last)
    if len(comparison.wavelengths_nm) > 1:
        lost = f"at {first.wavelength_nm:g} nm, {lost}"
    there = _told_on_axis(lit, "every lit plane" if dark else "every plane")
    return f"{capital(lost)}; {there}; {_told_off_axis(last)}.{_told_of_the_worst(comparison)}{unknown}"


def _told_of_the_worst(comparison: Comparison) -> str:
    """Of several wavelengths the one at which the formula is farthest off, where it is not the brightest."""
    worst = comparison.worst[0]
    if worst.wavelength_nm == comparison.brightest_nm or not worst.surely_off:
        return ""
    side = "low" if worst.axis_error < 0 else "high"
    off = f"{_percent(abs(worst.axis_error))} too {side} on the axis at {worst.z_m:g} m"
    return f" Worst at {worst.wavelength_nm:g} nm: {off}."


def _told_of_light(first: PlaneComparison, last: PlaneComparison) -> str:
    """What the formula makes of the light on the nearest and on the farthest plane."""
    shown = [_percent(abs(plane.lost)) for plane in (first, last)]
    verbs = ["loses" if plane.lost >= 0 else "adds" for plane in (first, last)]
    beyond = f" and at {last.z_m:g} m" * (last is not first)
    if set(shown) == {_NO_PERCENT}:
        return f"the formula has the light on the plane to 0.05 % at {first.z_m:g} m{beyond}"
    if _NO_PERCENT in shown:  # nothing is neither lost nor added
        verbs = [verbs[shown.index(_NO_PERCENT) - 1]] * 2
    told = f"of the light on the plane the formula {verbs[0]} {shown[0]} at {first.z_m:g} m"
    verb = "" if verbs[0] == verbs[1] else f"{verbs[1]} "
    return told + f" and {verb}{shown[1]} at {last.z_m:g} m" * (last is not first)


def _told_on_axis(lit: Sequence[PlaneComparison], every: str) -> str:
    """Where the formula can be trusted on the axis."""
    if not (met := [plane for plane in lit if np.isfinite(plane.axis.formula[0])]):
        return "the lamp's axis meets none of the planes"
    if len(met) < len(lit):
        lit, every = met, "every plane that the lamp's axis meets"
    states = [plane.told_on_axis for plane in lit]

    def at(state: int) -> str:
        return ", ".join(f"{plane.z_m:g}" for plane, its in zip(lit, states, strict=True) if its == state)

    if set(states) == {WITHIN}:
        return f"on the axis it is within 5 % on {every}"
    if set(states) == {BEYOND}:
        return f"on the axis it is more than 5 % off on {every}"
    if set(states) == {OPEN}:
        return f"on the axis too few photons tell whether it is within 5 % on {every}"
    if not at(OPEN):
        return f"on the axis it is within 5 % at {at(WITHIN)} m only"
    known = [f"within 5 % at {at(WITHIN)} m"] if at(WITHIN) else []
    known += [f"more than 5 % off at {at(BEYOND)} m"] if at(BEYOND) else []
    return f"on the axis it is {' and '.join(known)}, and too few photons tell at {at(OPEN)} m"


def _told_off_axis(last: PlaneComparison) -> str:
    """Up to where it can be trusted on the farthest plane."""
    radius, beyond, is_left = last.within(ERROR_LEVELS[1])
    if np.isinf(radius):
        return f"off the axis it stays within 10 % to the edge of the plane at {last.z_m:g} m"
    if is_left and radius == 0:
        outwards = " from the axis outwards" * bool(np.isfinite(last.axis.formula[0]))
        return f"at {last.z_m:g} m it is more than 10 % off everywhere{outwards}"
    if is_left:
        return f"at {last.z_m:g} m it is more than 10 % off beyond {radius:.2f} m from the axis"
    known = [] if np.isnan(radius) else [f"within 10 % to {radius:.2f} m"]
    known += [] if np.isnan(beyond) else [f"more than 10 % off at {beyond:.2f} m"]
    if not known:
        return f"off the axis too few photons tell at {last.z_m:g} m"
    return f"at {last.z_m:g} m it is {' and '.join(known)} from the axis; elsewhere too few photons tell"


def _percent(part: float) -> str:
    percent = round(100 * part, 1) + 0.0  # no minus before nothing
    return f"{percent:.1f} %" if abs(percent) < 10 else f"{percent:.0f} %"
