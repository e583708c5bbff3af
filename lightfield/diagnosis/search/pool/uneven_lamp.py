"""Effects that may be one lamp: of a beam that is its own in every direction.

A tilt, a receiver that is turned or narrow, an oval and a lopsided beam change light by its direction alone.
So does a lamp whose beam has a shape of its own, which may be uneven about the axis too.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from lightfield.diagnosis.adequacy.subspace import INDEPENDENT, beside, orthonormal
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.search.pool.fitted_sets import Pool
from lightfield.diagnosis.search.set_of_effects import FittedSet
from lightfield.fitting.effects import registry
from lightfield.fitting.effects.free_form import BEAM_PROFILE
from lightfield.formula.closed_form import table_angle

#: A lamp that is oval is no Gaussian all round either: one that is brighter on one side is, to first order, a
#: tilted one, and to second order oval.
_OVAL = "beam_ellipticity"
#: Is wider on one side by itself: nothing says that it is so in the one way of the formula. Scattered light
#: that is not as in the model (in one simulation it did not move with the lamp) is taken for it too.
_LOPSIDED = "beam_asymmetry"
#: A lamp of any shape has a value of its own for every so many readings along the angle, and so many at most.
#: Chosen: as fine as its readings are, with two left to say whether it is the angle that tells.
_READINGS_EACH, _MOST_VALUES = 3, 120
#: Beside such a lamp an effect shows by so many standard errors. Chosen: as far as a name has to be ahead of
#: sets without it, and as much again for what is not linear in it.
_SHOWS = 6.0


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


def may_be_detail(pool: Pool, node: FittedSet, candidate: Candidate) -> bool:
    """Does an effect stand beside a lamp's curve that is as fine as curves go, and not show beside a lamp of
    any shape?

    Where so many functions are asked for, there may be more to the lamp, an edge or a ring, than they follow:
    what they leave out others fill. (Of 20 campaigns with kinked lamps by other formulas three had certain
    names that were wrong: a background, a lamp's size, an apparent source; of 125 with others none.)
    """
    finest = any(c.name == BEAM_PROFILE and c.form.refines for c in node.explanation)
    if not finest or candidate.name == BEAM_PROFILE:
        return False
    return sigma_beside_any_lamp(pool, node, candidate) < _SHOWS


def sigma_beside_any_lamp(pool: Pool, node: FittedSet, candidate: Candidate) -> float:
    """What an effect changes that neither the other parameters of its set nor a lamp of any shape can, in
    standard errors."""
    problem, fit, whiten = pool.problem, node.fit, pool.ground.test.whiten
    readings, scene = problem.forward.readings, problem.forward.scenes.at(fit.values, validate=False)
    places = readings.x_m, readings.y_m, readings.z_m
    angle = table_angle(scene.lamp, *places, readings.medium)
    values = min(len(angle) // _READINGS_EACH, _MOST_VALUES)
    knots = np.unique(np.quantile(angle, np.linspace(0.0, 1.0, values)))
    lamp = np.stack([np.interp(angle, knots, one) for one in np.eye(len(knots))], axis=1)
    mine = {p.path for p in candidate.parameters}
    others = fit.jacobian[:, [path not in mine for path in fit.paths]]
    free = orthonormal(
        np.hstack([others, whiten((problem.keep * fit.prediction)[:, None] * lamp)]), INDEPENDENT
    )
    off = {p.path: p.value(u) for p, u in zip(candidate.amplitudes, candidate.neutral, strict=True)}
    without = problem.forward.predict(fit.values | off)
    shown = beside(free, whiten((problem.keep * (fit.prediction - without))[:, None]))
    spare = max(int(problem.keep.sum()) - len(fit.u), 1)
    phi = max(pool.ground.phi, fit.chi2 / spare)
    return float(np.linalg.norm(shown) / np.sqrt(phi))
