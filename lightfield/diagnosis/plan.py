"""Before any measurement: what a layout can detect and tell apart, and which readings would help.

Everything is linear about the scene: an effect is its template, the base model its tangent space.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from lightfield.arrays import Array
from lightfield.diagnosis.adequacy.score_tests import Adequacy, Score
from lightfield.diagnosis.adequacy.subspace import INDEPENDENT, beside, by_others, combined, orthonormal
from lightfield.diagnosis.adequacy.templates import bank
from lightfield.diagnosis.planned import planned, planned_in, without_photons
from lightfield.diagnosis.problem.assumed import Assumed
from lightfield.diagnosis.problem.noise import Noise
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.problem.quoted import own_part
from lightfield.diagnosis.problem.setup import budget_of, problem_of, source_of, spectral
from lightfield.diagnosis.problem.untestable import Hinders, Untestable, in_words
from lightfield.diagnosis.problem.whitening import Whitener, unwhitened
from lightfield.diagnosis.search.own_errors import with_response_error
from lightfield.diagnosis.search.preparation import whitened_test
from lightfield.diagnosis.search.told_apart import (
    DETECTABLE_SIGMA,
    SAME_CLASS_SIGMA,
    Isolability,
    Limit,
    at_once,
    detection_limits,
    isolability,
    unseen_effects,
)
from lightfield.diagnosis.verdict.advice import (
    ROUGH,
    Advice,
    Way,
    best_places,
    error_curve,
    error_of_mean,
    in_stays,
    of_place,
    own_error,
    possible_places,
)
from lightfield.diagnosis.verdict.calibration import power_limits
from lightfield.diagnosis.verdict.estimates import units_of
from lightfield.diagnosis.verdict.speech import in_unit
from lightfield.fitting import effects
from lightfield.fitting.diffuse_light import DiffuseSource
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.least_squares import Fit
from lightfield.readings import Readings
from lightfield.scene import Scene

#: Readings that would part two effects by less than so many times more than now are not worth advice. Chosen.
_WORTHWHILE = 1.5
#: Pieces of advice that the text shows. Chosen: words alone.
_SHOWN = 6
#: Widths of columns in the table, and decimals in the data. Chosen.
_NAMED, _COLUMN, _LAST_COLUMN, _DECIMALS = 22, 7, 10, 4


@dataclass(frozen=True)
class Helpful:
    """Readings that would part two effects which the layout cannot."""

    between: tuple[str, str]
    advice: Advice


@dataclass(frozen=True)
class LayoutPlan:
    """What a layout can do.

    Parameters
    ----------
    limits : dict of Limit
        Smallest size of each effect that is found with 95 % probability.
    isolability : Isolability
        Distances between effects, each at twice its detection limit or its typical size, whichever is larger.
    largest : float
        Reading of the scene's light, in the unit of the readings.
    """

    limits: dict[str, Limit]
    untestable: Untestable
    isolability: Isolability
    helpful: list[Helpful]
    units: dict[str, str]
    readings: int
    assumed: tuple[Assumed, ...]
    largest: float


def plan(readings: Readings, scene: Scene, diffuse: DiffuseSource | None = None) -> LayoutPlan:
    """Detectability, isolability and advice for a layout.

    Parameters
    ----------
    readings : Readings
        Positions, times, media, wavelengths and, if known, standard errors. On a relative scale values, where
        there are any, tell the unit of these and no more; without values the largest reading is 1.
    scene : Scene
        Its lamp, water and tank are taken to be true.
    diffuse : callable, optional
        Source of scattered and reflected light; without it those effects are not planned for.
    """
    with threadpool_limits(1, "blas"):  # many small matrices, as in a diagnosis
        return _plan(readings, scene, diffuse)


def _plan(readings: Readings, scene: Scene, diffuse: DiffuseSource | None) -> LayoutPlan:
    readings = readings.check_against(scene)
    scene = spectral(scene, readings)
    source, reason = source_of(scene, diffuse, readings)
    layout_table, forward = planned_in(readings, scene, source)
    problem, untestable = problem_of(forward, layout_table, list(effects.all_of(scene).values()), reason)
    budget = budget_of(replace(layout_table, stderr=readings.stderr))
    base = problem.fit((), unwhitened, [problem.model().start])
    followed = without_photons(problem, base)
    if followed is not problem:
        layout_table = planned(readings, followed.forward)
        forward = followed.forward.read_as(layout_table)  # what saturates goes by the brightest of these
        problem = replace(followed, forward=forward, value=layout_table.value)
        base = problem.fit((), unwhitened, [base.u])
    slope = budget.position_slope(problem.forward, base.values)
    sigma = own_part(layout_table.stderr, problem.layout.common * layout_table.value)
    noise = Noise(problem.layout, sigma, layout_table.value, budget, slope)
    noise = with_response_error(problem, noise, base)
    whiten = Whitener(noise, 0.0, 1.0, 0.0)
    base = problem.fit((), whiten, [base.u])
    adequacy = whitened_test(problem, whiten, np.random.default_rng(0))(base)
    untestable |= unseen_effects(adequacy.scores, adequacy.scores, Hinders.ABSORBED_IN_LAYOUT)
    by_gain = power_limits(problem, base, budget.calibration)
    untestable = {name: why for name, why in untestable.items() if name not in by_gain}
    limits = detection_limits(adequacy, 1.0) | by_gain
    found = isolability(adequacy.scores, _sizes(adequacy), 1.0)
    helpful = _helpful(problem, base, adequacy, found, noise)
    return LayoutPlan(
        limits, untestable, found, helpful, units_of(scene), problem.layout.size, budget.assumed,
        float(layout_table.value.max()),
    )  # fmt: skip


def _sizes(adequacy: Adequacy) -> dict[str, float]:
    out: dict[str, float] = {}
    for score in adequacy.scores:
        candidate = score.template.candidate
        if score.testable and candidate.name not in out:
            room = max(
                candidate.amplitudes[0].high - candidate.amplitudes[0].start,
                candidate.amplitudes[0].start - candidate.amplitudes[0].low,
            )
            out[candidate.name] = float(
                min(max(candidate.typical[0], 2 * DETECTABLE_SIGMA / score.length), room)
            )
    return out


class _Effect(NamedTuple):
    """What an effect does, a column for each amplitude of every form at every shape, whitened where readings
    are and plain at n other places; the error of its light there at its size, shape (n,); and which of
    the columns it can do together."""

    here: Array
    there: Array
    own: Array
    together: list[list[int]]


def _effects(
    problem: Problem, base: Fit, scores: Sequence[Score], sizes: Mapping[str, float], forward: SceneForward
) -> dict[str, _Effect]:
    """The effects that are seen, here and elsewhere: first of each its column that has the size."""
    at = forward.predict(base.values)
    there = replace(base, model=replace(base.model, forward=forward), prediction=at)
    elsewhere = bank(replace(problem, forward=forward, keep=np.ones(forward.size)), there, unwhitened)
    found: dict[str, list[tuple[Score, Array]]] = {}
    own: dict[str, Array] = {}
    for score, template in zip(scores, elsewhere, strict=True):
        candidate = score.template.candidate
        name = candidate.name
        if not score.testable or name not in sizes:
            continue
        found.setdefault(name, []).append((score, template.columns))
        if name in own:
            continue
        first = candidate.amplitudes[0]
        typical = candidate.typical[0] * np.sign(first.step_from(first.start))
        shape = {p.path: p.value(s) for p, s in zip(candidate.shapes, template.shape, strict=True)}
        grown = base.values | shape | {first.path: first.value(first.start + typical)}
        own[name] = own_error(forward, grown) * abs(sizes[name] / typical)
    return {name: _effect(pairs, own[name]) for name, pairs in found.items()}


def _effect(pairs: Sequence[tuple[Score, Array]], own: Array) -> _Effect:
    here, there = [s.template.columns for s, _ in pairs], [columns for _, columns in pairs]
    ends = np.cumsum([0, *(columns.shape[1] for columns in here)])
    together = [
        [c for k in some for c in range(ends[k], ends[k + 1])] for some in at_once([s for s, _ in pairs])
    ]
    return _Effect(np.hstack(here), np.hstack(there), own, together)


def _helpful(
    problem: Problem, base: Fit, adequacy: Adequacy, found: Isolability, noise: Noise
) -> list[Helpful]:
    """For each pair that is seen and not told apart: the best extra readings, best improvement first."""
    layout = problem.layout
    places = possible_places(problem, problem.forward.scene.tank)
    n = len(places.x_m)
    last = float(layout.time_s.max()) if layout.has_time else np.nan
    medium = np.where(places.air > 0, "air", "water")
    time = np.full(n, last)
    there = problem.forward.at(
        ROUGH, x_m=places.x_m, y_m=places.y_m, z_m=places.z_m, medium=medium, time_s=time
    )
    light = there.predict(base.values)
    slopes = replace(base.model, forward=there).jacobian(base.u, light)
    known = _effects(problem, base, adequacy.scores, dict(zip(found.names, found.sizes, strict=True)), there)
    sigma, place = error_curve(noise, 1.0)(light), of_place(noise.budget, there, base.values)
    out = []
    for j, one in enumerate(found.names):
        for k in range(j + 1, len(found.names)):
            two = found.names[k]
            alike = min(found.D[j, k], found.D[k, j]) < SAME_CLASS_SIGMA
            seen = min(found.delta[j], found.delta[k]) >= DETECTABLE_SIGMA
            if not (alike and seen):
                continue
            own = np.maximum(known[one].own, known[two].own)
            error = error_of_mean(sigma, light, np.hypot(own, place))
            ways = [
                in_stays(
                    _way(base, known[a], known[b], size, slopes, error), noise.budget, places, light / error
                )
                for a, b, size in ((one, two, found.sizes[j]), (two, one, found.sizes[k]))
            ]
            best = best_places(ways, places)
            if best.predicted_sigma > max(SAME_CLASS_SIGMA, _WORTHWHILE * best.now_sigma):
                out.append(Helpful((one, two), best))
    return sorted(out, key=lambda h: h.advice.now_sigma - h.advice.predicted_sigma)


def _way(base: Fit, truth: _Effect, rival: _Effect, size: float, slopes: Array, error: Array) -> Way:
    """Everything linear: a column of the truth at some size, and all that the rival can do, as `isolability`
    has it.

    Parameters
    ----------
    slopes : array, shape (n, n_parameters)
        Of the base model at the other places.
    error : array, shape (n,)
    """
    rival = _nearest(base, truth, rival)
    left = beside(orthonormal(base.jacobian, INDEPENDENT), rival.here)
    told = combined(left.T @ left)  # combinations that the readings tell apart
    column, moves = size * truth.here[:, 0], np.column_stack([base.jacobian, rival.here @ told])
    step = by_others(moves, column[:, None], INDEPENDENT)[:, 0]
    rest = column - moves @ step
    # What readings elsewhere would tell apart besides gives way to them, too.
    tangent, there = np.column_stack([base.jacobian, rival.here]), np.column_stack([slopes, rival.there])
    of_base = len(base.u)
    step = np.r_[step[:of_base], told @ step[of_base:]]
    difference = (size * truth.there[:, 0] - there @ step) / error
    information = tangent.T @ tangent
    information += np.diag(INDEPENDENT * np.diag(information))
    return Way(float(rest @ rest), difference, there / error[:, None], information)


def _nearest(base: Fit, truth: _Effect, rival: _Effect) -> _Effect:
    """The rival with those of its columns alone that together come nearest to the truth's."""

    def away(columns: list[int]) -> float:
        known = orthonormal(np.column_stack([base.jacobian, rival.here[:, columns]]), INDEPENDENT)
        return float(np.linalg.norm(beside(known, truth.here[:, :1])))

    best = rival.together[0] if len(rival.together) == 1 else min(rival.together, key=away)
    return rival._replace(here=rival.here[:, best], there=rival.there[:, best])


def as_text(made: LayoutPlan) -> str:
    """The plan for people."""
    lines = [f"{made.readings} readings. Smallest size that would be found with 95 % probability:"]
    for name, limit in sorted(made.limits.items()):
        size = in_unit(f"{limit.value:.3g}", made.units.get(limit.path, "1"))
        size = size if limit.reachable else f"not even its largest plausible size ({size})"
        lines.append(f"  {name:<20} {limit.path:<32} {size}")
    if "reading" in {made.units.get(limit.path) for limit in made.limits.values()}:
        lines.append(f"  (the largest reading of this layout is {made.largest:.3g})")
    for name, why in made.untestable.items():
        lines.append(f"  {name:<20} not testable: {in_words(why)}")
    iso = made.isolability
    lines += [
        "",
        "Distance D in sigma between effects, each at twice its detection limit or its typical size (row "
        f"true, column fitted): below {SAME_CLASS_SIGMA:g} they look alike. Last, the distance from the base "
        f"model: below {DETECTABLE_SIGMA:.1f} an effect is not sure to be seen.",
    ]
    lines.append(" " * _NAMED + "".join(f"{i + 1:>{_COLUMN}}" for i in range(len(iso.names))))
    for j, name in enumerate(iso.names):
        row = "".join(f"{'-' if j == k else f'{iso.D[j, k]:.1f}':>{_COLUMN}}" for k in range(len(iso.names)))
        lines.append(f"{j + 1:>2} {name:<19}{row}{iso.delta[j]:>{_LAST_COLUMN}.1f}")
    classes = iso.classes()
    lines.append("")
    if classes:
        lines += ["Seen but not told apart: " + ", ".join(group) for group in classes]
    else:
        lines.append("Every effect that would be seen would also be told from the others that would be.")
    for extra in made.helpful[:_SHOWN]:
        advice = extra.advice
        spots = "; ".join(
            f"x = {x:.2f}, y = {y:.2f}, z = {z:.2f} m"
            for x, y, z in zip(advice.places.x_m, advice.places.y_m, advice.places.z_m, strict=True)
        )
        at = "" if advice.places.at_nm is None else f", of {advice.places.at_nm:g} nm,"
        lines.append(
            f"Add {advice.repeats} readings each{at} at {spots}: {' and '.join(extra.between)} would part by "
            f"{advice.predicted_sigma:.1f} sigma (now {advice.now_sigma:.1f})."
        )
    lines += [f"assumed: {a}" for a in made.assumed]
    return "\n".join(lines)


def as_data(made: LayoutPlan) -> dict[str, Any]:
    """The plan for programs."""
    iso = made.isolability
    return {
        "readings": made.readings,
        "largest_reading": made.largest,
        "detection_limits": {
            name: {
                "parameter": limit.path,
                "value": limit.value,
                "unit": made.units.get(limit.path, "1"),
                "within_range": limit.reachable,
            }
            for name, limit in made.limits.items()
        },
        "untestable": {name: in_words(why) for name, why in made.untestable.items()},
        "hindrances": {name: [asdict(one) for one in why] for name, why in made.untestable.items()},
        "effects": list(iso.names),
        "sizes": [float(s) for s in iso.sizes],
        "delta_sigma": [float(d) for d in iso.delta],
        "D_sigma": np.round(iso.D, _DECIMALS).tolist(),
        "classes": [list(group) for group in iso.classes()],
        "add": [
            {
                "between": list(extra.between),
                "repeats": extra.advice.repeats,
                "wavelength_nm": extra.advice.places.at_nm,
                "now_sigma": extra.advice.now_sigma,
                "predicted_sigma": extra.advice.predicted_sigma,
                "places_m": np.stack(
                    [extra.advice.places.x_m, extra.advice.places.y_m, extra.advice.places.z_m], axis=1
                ).tolist(),
            }
            for extra in made.helpful
        ],
        "assumed": [str(a) for a in made.assumed],
        "assumptions": [a.as_data() for a in made.assumed],
    }
