"""Once more with more photons, where what is found rests on light that a search knows badly."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from lightfield.diagnosis.course import Inquiry, Outcome, course
from lightfield.diagnosis.search.followed import scatters

#: Photons for what was reflected under a surface, over those in clear water. Measured on independent light
#: (90 readings of 1 %, b = 0.25 per m, g = 0.92 under a surface that the scene does not state): with 0.6 it
#: was found as 0.11 +- 0.02 and 0.80 +- 0.02, with 2 as 0.21 +- 0.03 and, noisier, 0.07 +- 0.02, with these
#: as 0.23 +- 0.05 and 0.24 +- 0.08.
UNDER_SURFACE = 6.0


def by_clearer_light(inquiry: Inquiry, found: Outcome) -> Outcome:
    """The outcome, or that of a clearer trace where water scatters under a surface the scene does not state.

    What was scattered and mirrored is traced apart there, with few photons: most tanks have no such light.
    """
    closest, problem = found.known.finding.closest, found.known.prepared.problem
    if closest is None or inquiry.source is None or not inquiry.is_settled_after:
        return found
    scene = problem.forward.light.scenes.at(closest.fit.values, validate=False)
    if inquiry.scene.surface_reflects or not scene.surface_reflects or not scatters(problem, closest.fit):
        return found
    inquiry.progress("the same with more photons under the surface")
    return course(replace(inquiry, source=partial(inquiry.source, under_surface=UNDER_SURFACE)))
