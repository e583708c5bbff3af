"""Where to measure next so that two explanations part (T-optimal design, linear in the rival's
parameters)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lightfield.diagnosis.problem import Problem
from lightfield.diagnosis.rivals import separation
from lightfield.diagnosis.search import Tried
from lightfield.fit import Array, Fit, Forward, Whiten
from lightfield.scene import Tank

#: Relative error that no number of repeats at one place will beat.
FLOOR = 0.0025
SPOTS, READINGS = 3, 12
#: Two spots closer than this are one.
_APART_M = 0.4


@dataclass(frozen=True)
class Places:
    """Possible readings, each an array of shape (n,)."""

    x_m: Array
    y_m: Array
    z_m: Array
    air: Array


@dataclass(frozen=True)
class Advice:
    """Best places for extra readings, and the separation before and after, in sigma."""

    places: Places
    repeats: int
    now_sigma: float
    predicted_sigma: float


def possible_places(problem: Problem, tank: Tank | None) -> Places:
    """A grid over both sides of the axis, somewhat beyond the present layout, inside the tank if any."""
    lay = problem.layout
    across = max(float(np.abs(lay.x_m).max()), float(np.abs(lay.y_m).max()), 0.1 * float(lay.z_m.max()))
    x = np.linspace(-across, across, 17)
    y = np.array([-0.6 * across, 0.0, 0.6 * across]) if lay.varies("y_m") else np.array([0.0])
    z = np.linspace(0.6 * float(lay.z_m.min()), 1.15 * float(lay.z_m.max()), 12)
    media = np.unique(lay.air.astype(float))
    gx, gy, gz, air = (a.ravel() for a in np.meshgrid(x, y, z, media, indexing="ij"))
    inside = np.ones(len(gx), bool)
    if tank is not None:
        floor, end = tank.lamp_depth_m - tank.depth_m, tank.length_m - tank.behind_lamp_m
        inside = (np.abs(gx) < 0.97 * tank.width_m / 2) & (gz < 0.98 * end)
        inside &= (gy > floor + 0.03) & (gy < tank.lamp_depth_m - 0.03)
    return Places(gx[inside], gy[inside], gz[inside], air[inside])


def _gain(difference: Array, leverage: Array, repeats: float) -> Array:
    return np.asarray(repeats * difference**2 / (1 + repeats * leverage))


def _differences(
    problem: Problem,
    whiten: Whiten,
    truth: Fit,
    rival: Tried,
    there: Forward,
    sigma: Callable[[Array], Array],
    phi: float,
) -> tuple[float, Array, Array, Array]:
    """D^2 now, and at each place: difference in sigma, whitened slopes of the rival, and its information."""
    away = separation(problem, whiten, truth, rival, phi)
    imitation = away.fit
    under_truth = there.predict(truth.values)
    under_rival = there.predict(imitation.values)
    noise = sigma(under_truth)
    slopes = np.empty((len(noise), len(imitation.u)))
    for i, parameter in enumerate(imitation.model.parameters):
        moved = imitation.u.copy()
        step = parameter.step if moved[i] + parameter.step <= parameter.high else -parameter.step
        moved[i] += step
        slopes[:, i] = (there.predict(imitation.model.values(moved)) - under_rival) / step / noise
    information = imitation.jacobian.T @ imitation.jacobian / phi
    information += np.diag(1e-9 * np.diag(information) + 1e-12)
    return away.separation_sigma**2, (under_truth - under_rival) / noise, slopes, information


def where_next(
    problem: Problem,
    whiten: Whiten,
    one: Tried,
    two: Tried,
    phi: float,
    places: Places,
    there: Forward,
    sigma: Callable[[Array], Array],
) -> Advice:
    """Up to three spots, chosen one after the other, that best part two explanations whichever is true.

    Parameters
    ----------
    there : Forward
        Predicts readings at the places.
    sigma : callable
        Standard error of a reading from its prediction.
    """
    ways = [_differences(problem, whiten, a.fit, b, there, sigma, phi) for a, b in ((one, two), (two, one))]
    repeats = READINGS // SPOTS
    total = np.array([way[0] for way in ways])
    now = float(np.sqrt(total.min()))
    information = [way[3].copy() for way in ways]
    chosen: list[int] = []
    for _ in range(SPOTS):
        gains = np.stack([
            _gain(difference, np.einsum("ij,ij->i", slopes, np.linalg.solve(known, slopes.T).T), repeats)
            for (_, difference, slopes, _), known in zip(ways, information, strict=True)
        ])  # fmt: skip
        worst = (total[:, None] + gains).min(0)
        for i in chosen:
            near = np.hypot(places.x_m - places.x_m[i], places.z_m - places.z_m[i]) < _APART_M
            worst[near] = 0.0
        best = int(worst.argmax())
        chosen.append(best)
        total = total + gains[:, best]
        for (_, _, slopes, _), known in zip(ways, information, strict=True):
            known += repeats * np.outer(slopes[best], slopes[best])
    index = np.array(chosen)
    spots = Places(places.x_m[index], places.y_m[index], places.z_m[index], places.air[index])
    return Advice(spots, repeats, now, float(np.sqrt(total.min())))
