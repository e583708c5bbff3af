"""Once more with more photons, where what is found rests on light that a search knows badly."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from lightfield.diagnosis.course import Outcome, course
from lightfield.diagnosis.knowledge import Inquiry
from lightfield.diagnosis.search.followed import scatters

#: Photons for what was reflected under a surface, over those in clear water, where all hangs on it. Chosen:
#: b = 0.25 per m that a full render hid under a surface was found 3.5 of its errors too small (rms beside
#: four noises) with the usual 0.6, 2.2 with 6, 1.0 with 12: noise of what was scattered and mirrored is one
#: of what is fitted with (`tests/physics/found/test_clearer_light.py` has one of the four).
CLEARLY_UNDER_SURFACE = 12.0


def by_clearer_light(inquiry: Inquiry, found: Outcome) -> tuple[Inquiry, Outcome]:
    """The inquiry and its outcome, or both with a clearer trace where water scatters under a surface that
    the scene does not state.

    What was scattered and mirrored is traced apart there, with few photons: most tanks have no such light.
    """
    closest, problem = found.known.finding.closest, found.known.prepared.problem
    if closest is None or inquiry.source is None or not inquiry.is_settled_after:
        return inquiry, found
    scene = problem.forward.light.scenes.at(closest.fit.values, validate=False)
    if inquiry.scene.surface_reflects or not scene.surface_reflects or not scatters(problem, closest.fit):
        return inquiry, found
    inquiry.progress("the same with more photons under the surface")
    source = partial(inquiry.source, under_surface=CLEARLY_UNDER_SURFACE)
    clearer = replace(inquiry, source=source)
    return clearer, course(clearer)
