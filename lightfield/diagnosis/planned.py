"""A layout with the light of a scene as its values: what a plan is made of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lightfield.arrays import Array
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.problem.quoted import ASSUMED_FLOOR, ASSUMED_RELATIVE
from lightfield.diagnosis.search.followed import can_follow, following, scattering
from lightfield.errors import FitError
from lightfield.fitting.diffuse_light import DiffuseSource
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.least_squares import Fit
from lightfield.readings import Readings
from lightfield.scene import Scene

#: Readings of so much of the brightest light tell in which unit a table is. Chosen: a scene may miss others.
_BRIGHT = 0.1
#: Seed of the trace of scattered light. Chosen: another than a diagnosis has.
_SEED = 8000


def planned(readings: Readings, forward: SceneForward) -> Readings:
    """A layout with the light of a scene as values and assumed errors where there are none.

    On a relative scale in the unit of its own values, where it has any; else the largest is 1.
    """
    light = forward.predict({})
    brightest = float(light.max())
    if not 0 < brightest < np.inf:
        raise FitError(
            "no light of the scene reaches this layout", where=readings.source or None, found=brightest,
            rule="light above 0 somewhere", remedy="read nearer to the lamp, or check lamp and water",
        )  # fmt: skip
    part = light / brightest
    value = light if readings.scale == "absolute" else _largest(readings, part) * part
    stderr = np.asarray(readings.stderr, float)
    guess = np.hypot(ASSUMED_RELATIVE * value, ASSUMED_FLOOR * value.max())
    return replace(readings, value=value, stderr=np.where(np.isfinite(stderr), stderr, guess))


def _largest(readings: Readings, light: Array) -> float:
    """The largest reading in the unit of a table's values, by those that are bright; 1 where it has none.

    Parameters
    ----------
    light : array, shape (n,)
        Of the scene, 1 at most.
    """
    bright = (light >= _BRIGHT) & ~readings.saturated & (readings.value > 0)
    if (readings.value == 1.0).all() or not bright.any():
        return 1.0
    return float(np.median(readings.value[bright] / light[bright]))


def planned_in(
    readings: Readings, scene: Scene, diffuse: DiffuseSource | None
) -> tuple[Readings, SceneForward]:
    """A layout with all light of a scene as values, and what predicts it.

    Photons are sent in a beam as wide as its direct light shows.
    """
    direct = planned(readings, SceneForward(scene, readings))
    forward = SceneForward(scene, direct, diffuse)
    table = planned(readings, forward)
    return table, forward.read_as(table)


def without_photons(problem: Problem, fit: Fit) -> Problem:
    """The problem in light that is followed where a fit lies, if anything scatters there or beside it.

    Slopes with the noise of photons in them would pass for information.
    """
    turbid = scattering(problem, fit)
    return problem if turbid is None or not can_follow(problem) else following(problem, turbid, _SEED)
