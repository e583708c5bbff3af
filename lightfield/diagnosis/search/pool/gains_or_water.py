"""Gains of planes that water could make: by an attenuation that jumps along the tank, but never amplifies."""

from __future__ import annotations

import numpy as np

from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.search.pool.fitted_sets import Pool
from lightfield.diagnosis.search.set_of_effects import FittedSet
from lightfield.fitting.curves import PLANES, field_of
from lightfield.formula.path import attenuation_per_m
from lightfield.readings.columns import LINE_DECIMALS

#: Water between two planes amplifies where its attenuation is so many of its standard errors below zero.
#: Chosen: by chance once in 2000 scans of fifteen planes.
_AMPLIFIES = 4.0
ABSORPTION = "water.absorption_per_m"


def water_may_do_it(pool: Pool, node: FittedSet, candidate: Candidate) -> bool:
    """Could water make a function of distance that gains of planes explain?

    Between two planes it would have the attenuation K - (g_2 - g_1) / (z_2 - z_1), g the logarithm of the
    gains. Such water is possible where that is positive everywhere: then nothing tells the two apart, but
    readings in air. Planes of a single reading are not asked: what lies there may be a slip of that reading.

    Parameters
    ----------
    node : FittedSet
        A fitted set that holds the candidate.
    """
    if not any(field_of(p.path) == PLANES for p in candidate.amplitudes):
        return False
    problem, fit = pool.problem, node.fit
    if problem.layout.air.any():
        return False
    basis = problem.forward.scenes.curves.bases[PLANES]
    at = np.round(problem.layout.z_m, LINE_DECIMALS)[problem.keep > 0]
    several = np.array([np.count_nonzero(at == z) > 1 for z in basis.place])
    slopes = np.diff(basis.functions[several], axis=0) / np.diff(basis.place[several])[:, None]
    moved = np.zeros((len(slopes), len(fit.paths)))
    for k, path in enumerate(basis.paths):
        moved[:, fit.paths.index(path)] = -slopes[:, k]
    if ABSORPTION in fit.paths:
        moved[:, fit.paths.index(ABSORPTION)] = 1.0
    water = problem.forward.scenes.at(fit.values, validate=False).water
    least = float(np.min(attenuation_per_m(water, problem.forward.light.diffuse.wavelengths_nm)))
    between = least - slopes @ basis.amplitudes(fit.values)
    covariance = np.nan_to_num(fit.covariance(pool.ground.phi))
    error = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", moved, covariance, moved), 0.0))
    return not bool((between < -_AMPLIFIES * error).any())
