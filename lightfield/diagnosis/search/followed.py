"""Light without the noise of photons for fits by scattered light: followed but for a smooth ratio, which is
traced where a fit lies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.problem.whitening import unwhitened
from lightfield.fitting.least_squares import Fit
from lightfield.fitting.light_source import LightSource
from lightfield.formula.scattered.scattered_field import describes
from lightfield.render.diffuse.diffuse_response import DiffuseResponse
from lightfield.render.diffuse.followed import FollowedLight
from lightfield.render.diffuse.ratio import Ratio, traced_ratio
from lightfield.scene import Scene
from lightfield.scene.water.coefficients import molecular_per_m, scattering_per_m

#: Photons of a first trace. Chosen: time against precision.
PHOTONS = 1e6
#: Water whose particles scatter less, in 1/m, is clear. Derived: of that many photons a thousand are
#: scattered on 10 m. What molecules scatter is 0.17 % of bright readings at most, measured in pure water
#: at 2 to 6 m.
_CLEAR_PER_M = 1e-4


def can_follow(problem: Problem) -> bool:
    """Is the scattered light traced, of a kind that knows what was reflected apart?"""
    light = problem.forward.light.diffuse
    return light.trace is not None and light.part_of is None and isinstance(light.traced, DiffuseResponse)


def scatters(problem: Problem, fit: Fit) -> bool:
    """Does what was fitted scatter light, of the kind that is followed?"""
    scene = _turbid(problem, fit)
    return scene is not None and describes(scene)


def is_of_the_search_alone(problem: Problem, fit: Fit) -> bool:
    """Does it scatter light of another kind, of which the trace of the search is all that is known?"""
    scene = _turbid(problem, fit)
    return scene is not None and not describes(scene)


def _turbid(problem: Problem, fit: Fit) -> Scene | None:
    """The scene of a fit whose scattered light is traced; None of clear water."""
    light = problem.forward.light
    if light.diffuse.trace is None:
        return None
    scene = light.scenes.at(fit.values, validate=False)
    waves = light.diffuse.wavelengths_nm
    by_particles = scattering_per_m(scene.water, waves) - molecular_per_m(scene.water, waves)
    return scene if float(by_particles.max()) > _CLEAR_PER_M else None


def is_followed(problem: Problem, values: Mapping[str, float]) -> bool:
    """Is all scattered light followed, and so a matter of milliseconds? What walls reflect is not."""
    light = problem.forward.light
    if light.diffuse.trace is None or not isinstance(light.diffuse.solved, FollowedLight):
        return False
    return not light.scenes.at(values, validate=False).reflects


def scattering(problem: Problem, base: Fit) -> Fit | None:
    """A base model that scatters; else beside the first effect by which it would, at its typical size.

    None without such an effect.
    """
    if scatters(problem, base):
        return base
    for candidate in problem.candidates:
        if candidate.effect.diffuse:
            start = problem.default_start(base.u, (candidate,))
            typical = problem.fit((candidate,), unwhitened, [start], max_steps=0)
            if scatters(problem, typical):
                return typical
    return None


def ratio_at(
    light: LightSource, values: Mapping[str, float], photons: float, seed: int
) -> tuple[Scene, Ratio]:
    """Trace where a fit lies."""
    scene, r = light.scenes.at(values, validate=False), light.readings
    wet = (np.asarray(r.medium) != "air") & (np.asarray(r.z_m) > 0)
    x, y, z = (np.asarray(v, float)[wet] for v in (r.x_m, r.y_m, r.z_m))
    return scene, traced_ratio(scene, x, y, z, light.diffuse.wavelengths_nm, photons=photons, seed=seed)


def with_light(problem: Problem, traced: Sequence[tuple[Scene, Ratio]]) -> Problem:
    """The problem with the light that these traces tell."""
    forward, r = problem.forward, problem.forward.readings
    before = forward.light.diffuse.solved
    response = before.response if isinstance(before, FollowedLight) else before
    field = before.field if isinstance(before, FollowedLight) else forward.light.diffuse.field
    assert isinstance(response, DiffuseResponse)
    followed = FollowedLight.of(response, (r.x_m, r.y_m, r.z_m), traced, field)
    return replace(problem, forward=forward.with_light(forward.light.following(followed)))


def following(problem: Problem, fit: Fit, seed: int, photons: float = PHOTONS) -> Problem:
    """The problem with light traced where a fit lies."""
    return with_light(problem, [ratio_at(problem.forward.light, fit.values, photons, seed)])
