"""Is the lamp's table that of these readings, or does a plain beam in its place explain them with less?

A table far from the lamp leaves what no curve follows, and scattering, gradients and backgrounds stand in for
it: of readings that hide nothing, beside a table with too steep flanks, scattering was certain.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from lightfield.arrays import TINY
from lightfield.diagnosis.course import Outcome, course
from lightfield.diagnosis.knowledge import Inquiry
from lightfield.diagnosis.verdict.cautions.caution import Caution, Warns
from lightfield.fitting.beam_width import WIDTH, beam_width_deg
from lightfield.fitting.effects.free_form import BEAM_PROFILE
from lightfield.fitting.least_squares import Fit
from lightfield.scene import Lamp

#: A plain beam costs so much less, in ln of the evidence times two. Chosen: "very strong" (Kass and Raftery
#: 1995, doi:10.1080/01621459.1995.10476572).
_MARGIN = 10.0
_TABLE = "lamp.intensity_table"


def by_another_lamp(inquiry: Inquiry, found: Outcome) -> tuple[Outcome, Caution | None]:
    """The outcome, or that of a Gaussian beam in place of the scene's table, where it does better; and why.

    Asked where readings contradict the table: a curve in place of it was found, or nothing that explains
    them. Where the curve alone makes the difference, it is the answer.
    """
    finding = found.known.finding
    explained = finding.best is not None or finding.size == 0
    contradicted = finding.closest is not None and BEAM_PROFILE in finding.closest.names
    if inquiry.scene.lamp.profile != "table" or (explained and not contradicted):
        return found, None
    inquiry.progress("a Gaussian beam in place of the lamp's table")
    other = course(_with_plain_beam(inquiry))
    one = other.known.finding
    if one.best is None and one.size != 0:
        return found, None
    if contradicted and explained and _beside_the_lamp(found) == _beside_the_lamp(other):
        return found, None
    now, instead = _fit(found), _fit(other)
    cost, cost_instead = _costs(found, other, now, instead)
    if cost_instead > cost - _MARGIN:
        return found, None
    told = {"width_deg": float(instead.values.get(WIDTH, math.nan)), "better": cost - cost_instead}
    return other, Caution(warns=Warns.ANOTHER_LAMP, about=_TABLE, values=told)


def _with_plain_beam(inquiry: Inquiry) -> Inquiry:
    """What is asked, of a scene whose lamp is a Gaussian as wide as the readings show it."""
    scene, plain = inquiry.scene, Lamp()
    shape = ("profile", "intensity_table", "table_width", "profile_departure")
    values = {name: getattr(plain, name) for name in shape}
    lamp = scene.lamp.model_copy(update={**values, "hwhm_deg": beam_width_deg(scene, inquiry.readings)})
    return replace(inquiry, scene=scene.model_copy(update={"lamp": lamp}))


def _beside_the_lamp(outcome: Outcome) -> set[str]:
    """Names of what explains the readings, but for the lamp's curve."""
    best = outcome.known.finding.best
    return set() if best is None else set(best.names) - {BEAM_PROFILE}


def _fit(outcome: Outcome) -> Fit:
    """Of what explains the readings, or comes nearest."""
    finding = outcome.known.finding
    return finding.level.base if finding.closest is None else finding.closest.fit


def _costs(found: Outcome, other: Outcome, *fits: Fit) -> list[float]:
    """Chi-square and price of all that each of two fits frees, in the noise that the better one leaves."""
    known = found.known
    keep = known.prepared.problem.keep * other.known.prepared.problem.keep
    n, weight = float(keep.sum()), keep / known.prepared.noise.sigma
    squares = [float(np.sum((weight * (known.problem.value - fit.prediction)) ** 2)) for fit in fits]
    left = [square / max(n - len(fit.u), 1.0) for square, fit in zip(squares, fits, strict=True)]
    variance = max(min(left), TINY)
    return [square / variance + len(fit.u) * math.log(n) for square, fit in zip(squares, fits, strict=True)]
