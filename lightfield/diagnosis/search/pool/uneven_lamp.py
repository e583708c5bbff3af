"""Effects that may be one lamp: of a beam that is its own in every direction.

A tilt, a receiver that is turned or narrow, an oval and a lopsided beam change light by its direction alone.
So does a lamp whose beam has a shape of its own, which may be uneven about the axis too.
"""

from __future__ import annotations

from collections.abc import Iterable

from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.fitting.effects import registry
from lightfield.fitting.effects.free_form import BEAM_PROFILE

#: A lamp that is oval is no Gaussian all round either: one that is brighter on one side is, to first order, a
#: tilted one, and to second order oval.
_OVAL = "beam_ellipticity"
#: Is wider on one side by itself: nothing says that it is so in the one way of the formula. Scattered light
#: that is not as in the model (in one simulation it did not move with the lamp) is taken for it too.
_LOPSIDED = "beam_asymmetry"


def of_an_uneven_lamp(explanation: Iterable[Candidate]) -> list[Candidate]:
    """Effects of a set that an uneven lamp of its own shape would do alone.

    Two or more of them; a pose or a receiver beside a lamp's curve, which says that no formula describes it;
    and a lopsided beam in scattered light, of which what comes straight is all that is known exactly.
    """
    explanation = tuple(explanation)
    shapes = {BEAM_PROFILE, *registry.get(BEAM_PROFILE).contains}
    directed = [c for c in explanation if c.effect.of_direction]
    others = [c for c in directed if c.name not in shapes]
    names = {c.name for c in directed}
    if _LOPSIDED in names and any(c.effect.diffuse for c in explanation):
        return others
    uneven = {_LOPSIDED, _OVAL}
    if BEAM_PROFILE in names and any(c.name not in uneven for c in others):
        return others
    return others if names & (shapes | uneven) and len(others) > 1 else []


def beside_finest_curve(explanation: Iterable[Candidate]) -> list[Candidate]:
    """Effects of a set beside a lamp's curve that is as fine as curves go.

    Where so many functions are asked for, there may be more to the lamp, an edge or a ring, than they follow:
    what they leave out others fill. (Of 20 campaigns with kinked lamps by other formulas three had certain
    names that were wrong: a background, a lamp's size, an apparent source; of 125 with others none.)
    """
    explanation = tuple(explanation)
    finest = any(c.name == BEAM_PROFILE and c.form.refines for c in explanation)
    return [c for c in explanation if finest and c.name != BEAM_PROFILE]
