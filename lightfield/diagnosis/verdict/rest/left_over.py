"""What nothing explains, as far as a local unknown describes it: a dip, a plume, a step or a ripple.

They say where the rest is, how wide and how large; not what it is. So none of them is an explanation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from lightfield.arrays import TINY, Array, finite
from lightfield.diagnosis.adequacy.level import ALPHA
from lightfield.diagnosis.certainty import Certainty
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.local_unknowns import with_unknowns
from lightfield.diagnosis.problem.problem import MANY, Explanation, Problem
from lightfield.diagnosis.problem.whitening import Whitener
from lightfield.diagnosis.search.cascade import SearchResult
from lightfield.diagnosis.search.pool.fitted_sets import Ground, Pool
from lightfield.diagnosis.search.pool.quick import Begin
from lightfield.diagnosis.search.preparation import Prepared, whitened_test
from lightfield.diagnosis.search.set_of_effects import FittedSet, ScoredSet
from lightfield.diagnosis.verdict.ladder import bright, percent
from lightfield.diagnosis.verdict.parts import Estimate, LeftOver
from lightfield.diagnosis.verdict.rest.located import parameters_of
from lightfield.diagnosis.verdict.trust import error_scale
from lightfield.fitting.effects.local import ALONG, AMPLITUDES, CLOUD, PLUME, SQUARE
from lightfield.fitting.least_squares import Fit, Whiten
from lightfield.readings import Readings
from lightfield.scene.lamp.frame import angle_from_axis
from lightfield.scene.own.own_effect import OwnEffect, Places

#: A parameter of ripples: by so many of its errors, or such a part of it, it may be off in a file. By chance
#: it is farther off once in two million; the part is chosen.
_PERIOD, _PERIOD_SIGMA, _PERIOD_PART = "period", 5.0, 0.05
#: Part of what the best set leaves, in per cent, that an unknown removes before it is told. Chosen.
_LEAST_REMOVED_PERCENT = 20.0
#: Points of a curve, and the step of a parameter, as part of its range, by which its error is found. Chosen:
#: half of the digits are rounding.
_POINTS, _STEP = 121, 1e-5
#: So many effects are left out, and so many added, of those of which a linear model promises most. Chosen.
_TRIED = 2
#: What goes round the beam's axis is drawn at the angle within which such a part of the bright readings lies,
#: beside those whose angles differ from it by this part at most. Chosen: far out, where it is large.
_RING, _RING_WIDTH = 0.75, 0.15
#: Times are told in minutes. Chosen: words alone.
_UNIT = {"time": 1 / 60}


@dataclass(frozen=True)
class Local:
    """A local unknown, beside effects of the best set."""

    record: LeftOver
    explanation: Explanation
    fit: Fit


def left_over(prepared: Prepared, finding: SearchResult, readings: Readings) -> list[Local]:
    """Local unknowns beside the best set or what is certain of it, the best first; none of many readings."""
    if prepared.problem.layout.size > MANY:
        return []
    if finding.unknown:
        return _in_set(prepared, finding)
    pool, node, local = _pool(prepared, finding, readings)
    noise = pool.ground.phi
    spare = max(int(pool.problem.keep.sum()) - len(node.fit.u), 1)
    rest = max(node.fit.chi2 - noise * spare, 0.0)
    known = [node, *_certain(pool, finding, node)]
    best: dict[str, FittedSet] = {}
    for start in known:
        for promise in pool.promises(start):
            if promise.candidate in local and pool.affordable((*start.explanation, promise.candidate)):
                made = _fitting(pool, pool.finished(pool.add(promise)), promise.candidate, node.explanation)
                name = promise.candidate.name
                best[name] = min(made, best.get(name, made), key=pool.cost)
    out = []
    for name, made in sorted(best.items(), key=lambda item: pool.cost(item[1])):
        share = 100 * (node.fit.chi2 - made.fit.chi2) / rest if rest > 0 else 0.0
        if share > _LEAST_REMOVED_PERCENT:
            passes = bool(pool.ground.test(made.fit).passes(ALPHA))
            beside = sorted(n for n in made.names if n != name)
            whiten = pool.ground.test.whiten
            record = _record(pool.problem, made.fit, whiten, beside, name, share, noise, passes)
            out.append(Local(record, made.explanation, made.fit))
    return out


def _in_set(prepared: Prepared, finding: SearchResult) -> list[Local]:
    """Local unknowns of the best set, and of others that explain the readings as it does."""
    out: dict[str, Local] = {}
    for one in finding.tried:
        if one.adequacy is None or not (one is finding.closest or one.adequacy.passes(ALPHA)):
            continue
        for name in set(finding.unknown) & set(one.names) - set(out):
            out[name] = _of_set(prepared.problem, one, name, finding.whiten)
    return list(out.values())


def _of_set(problem: Problem, one: ScoredSet, name: str, whiten: Whiten) -> Local:
    assert one.adequacy is not None
    fit, phi = one.fit, one.adequacy.phi
    rest = tuple(c for c in one.explanation if c.name != name)
    without = problem.fit(rest, whiten, [problem.model(rest).at(fit.by_path)])
    left = max(without.chi2 - phi * max(int(problem.keep.sum()) - len(fit.u), 1), TINY)
    share = 100 * (without.chi2 - fit.chi2) / left
    beside, passes = sorted(c.name for c in rest), one.adequacy.passes(ALPHA)
    record = _record(problem, fit, whiten, beside, name, share, phi, passes)
    return Local(record, one.explanation, fit)


def _pool(
    prepared: Prepared, finding: SearchResult, readings: Readings
) -> tuple[Pool, FittedSet, Explanation]:
    """Sets on the ground on which the finding was judged, the best of them, and the local unknowns."""
    level, (problem, local) = finding.level, with_unknowns(prepared.problem, readings)
    closest = finding.closest
    explanation = closest.explanation if closest else ()
    fit = closest.fit if closest else level.base
    # What was set aside as slips may be the very place where something stands.
    keep = np.where(np.asarray(readings.saturated), 0.0, 1.0)
    wider = replace(problem, keep=keep, candidates=(*explanation, *local), curves=())
    # A misfit without any smoothness was taken for noise: what is noise is here for the quoted errors to say.
    test = whitened_test(wider, Whitener(prepared.noise, 0.0, 1.0, 0.0), np.random.default_rng(0))
    pool = Pool(Ground(test, error_scale(prepared, finding), level.adequacy.nu))
    begin = Begin(fit.by_path)
    return pool, pool.finished(pool.fit(explanation, [begin])), local


def _certain(pool: Pool, finding: SearchResult, node: FittedSet) -> list[FittedSet]:
    """The base model, and with what is certain all the same: the rest of the best set may only imitate."""
    begin = Begin(node.fit.by_path)
    known = finding.many.evidence if finding.many else ()
    partial = [e.candidate.key for e in known if e.level == Certainty.PARTIAL]
    sure = tuple(c for c in node.explanation if c.key in partial)
    return [pool.finished(pool.fit(some, [begin])) for some in {(), sure} if some != node.explanation]


def _fitting(whole: Pool, node: FittedSet, kept: Candidate, known: Explanation) -> FittedSet:
    """The set with those effects of the best one that are worth their price beside the unknown."""
    problem = replace(whole.problem, candidates=(*known, kept))
    ground = whole.ground
    pool = Pool(Ground(ground.test.on(problem), ground.phi, ground.nu), {node.key: node})
    while True:
        there = [c for c in node.explanation if c is not kept]
        less = sorted(there, key=partial(pool.promised_without, node))[:_TRIED]
        more = sorted(pool.promises(node), key=lambda p: p.cost)[:_TRIED]
        made = [*(pool.drop(node, c) for c in less), *map(pool.add, more)]
        best = min(map(pool.finished, made), key=pool.cost, default=node)
        if pool.cost(best) >= pool.cost(node):
            return node
        node = best


def _record(
    problem: Problem,
    fit: Fit,
    whiten: Whiten,
    beside: list[str],
    name: str,
    share: float,
    phi: float,
    adequate: bool,
) -> LeftOver:
    forward = problem.forward
    own = next(e for e in forward.scene.effect if e.name == name)
    scale = max(phi, fit.chi2 / max(int(problem.keep.sum()) - len(fit.u), 1))
    mine = parameters_of(own, problem, fit, whiten, scale)
    at, places, signal = _along(ALONG[name], forward.readings, _ring_deg(problem))
    factor, stderr = _curve(own, fit, scale, places, signal)
    read_at, read = _read(problem, forward.readings, fit, name)
    return LeftOver(
        name=name, formula=own.formula, stage=own.stage, coordinate=ALONG[name],
        beside=beside, parameters=mine, removed_percent=min(share, 100.0),
        error_percent=finite(percent(problem, fit.prediction, bright(problem))),
        adequate=adequate,
        at=(at * _UNIT.get(ALONG[name], 1.0)).tolist(), factor=factor.tolist(), stderr=stderr.tolist(),
        read_at=(read_at * _UNIT.get(ALONG[name], 1.0)).tolist(), read=read.tolist(),
    )  # fmt: skip


def _read(problem: Problem, readings: Readings, fit: Fit, name: str) -> tuple[Array, Array]:
    """Where along its coordinate an unknown acts on bright readings, and these over the model without it."""
    values, without = fit.values, without_it(fit, name)
    shown = np.asarray(bright(problem), bool) & (without > 0)
    x, y, z, t = (np.asarray(getattr(readings, k), float) for k in ("x_m", "y_m", "z_m", "time_s"))
    angle, signal = np.degrees(angle_from_axis(x, y, z)), without / np.abs(without).max()
    around = np.degrees(np.arctan2(y, x))
    along = {"x": x, "y": y, "time": t, "angle": angle, "signal": signal, "azimuth": around}[ALONG[name]]
    if name == SQUARE:
        ring = _ring_deg(problem)
        shown = shown & (np.abs(angle - ring) <= _RING_WIDTH * ring)
    if name in (PLUME, CLOUD):  # they shade what passes through them
        shown = shown & (z > values[f"effect.{name}.z0"])
    if name == PLUME:  # drawn at the farthest plane
        along = x * z.max() / z
        shown = shown & (along >= x.min()) & (along <= x.max())
    return along[shown], problem.value[shown] / without[shown]


def _ring_deg(problem: Problem) -> float:
    """The angle from the axis at which what goes round it is drawn, degrees."""
    angle = np.degrees(problem.layout.angle_rad[bright(problem)])
    return float(np.quantile(angle, _RING)) if angle.size else 0.0


def without_it(fit: Fit, name: str) -> Array:
    """Readings as a fit has them, but for a local unknown, shape (n,)."""
    sizes = {f"effect.{name}.{key}" for key in AMPLITUDES}
    neutral = {p.path: p.value(0.0) for p in fit.model.parameters if p.path in sizes}
    return fit.model.forward.predict(fit.values | neutral)


def _along(coordinate: str, readings: Readings, ring_deg: float) -> tuple[Array, Places, Array]:
    """Points along a coordinate within the readings, on the axis of the farthest plane otherwise, and the
    readings there over the largest."""
    x, y, z, t = (np.asarray(getattr(readings, k), float) for k in ("x_m", "y_m", "z_m", "time_s"))
    theta = np.degrees(angle_from_axis(x, y, z))
    zero, one, far = np.zeros(_POINTS), np.ones(_POINTS), np.full(_POINTS, z.max())
    places = Places(zero, zero, far, far, zero, zero, zero)
    if coordinate == "signal":
        value = np.asarray(readings.value, float)
        at = np.geomspace(value[value > 0].min() / value.max(), 1.0, _POINTS)
        return at, places, at
    if coordinate == "azimuth":
        turn, out = np.linspace(-np.pi, np.pi, _POINTS), far * np.tan(np.radians(ring_deg))
        x, y = out * np.cos(turn), out * np.sin(turn)
        return np.degrees(turn), places._replace(theta=ring_deg * one, x=x, y=y), one
    whole = {"x": x, "y": y, "time": t, "angle": theta}[coordinate]
    at = np.linspace(whole.min(), whole.max(), _POINTS)
    if coordinate == "angle":
        return at, places._replace(theta=at, x=far * np.tan(np.radians(at))), one
    return at, places._replace(**{coordinate: at}), one


def _curve(own: OwnEffect, fit: Fit, scale: float, places: Places, signal: Array) -> tuple[Array, Array]:
    """The factor along the coordinate, and its error by those of its parameters, which go together."""

    def factor(at: Mapping[str, float]) -> Array:
        parameters = {k: p.model_copy(update={"value": at[k]}) for k, p in own.parameters.items()}
        found = own.model_copy(update={"parameters": parameters}).at(places, signal)
        return found / signal if own.stage == "readout" else found

    mine = {k: fit.paths.index(f"effect.{own.name}.{k}") for k in own.parameters}
    here = {k: float(fit.u[i]) for k, i in mine.items()}
    middle, rows = factor(here), list(mine.values())
    steps = {k: _STEP * (p.range[1] - p.range[0]) for k, p in own.parameters.items()}
    slopes = np.stack([(factor(here | {k: here[k] + h}) - middle) / h for k, h in steps.items()], axis=1)
    covariance = np.nan_to_num(fit.covariance(scale)[np.ix_(rows, rows)])  # none at the end of a range
    return middle, np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", slopes, covariance, slopes), 0.0))


def ranked(unknowns: Sequence[OwnEffect], left: Sequence[LeftOver]) -> list[OwnEffect]:
    """Local unknowns for a file, those that describe the rest best first.

    The period of a ripple is looked for near the one that was found: between others there is no way to it.
    """
    place, found = {one.name: k for k, one in enumerate(left)}, {one.name: one.parameters for one in left}
    near = [_near(own, found.get(own.name, {}).get(_PERIOD)) for own in unknowns]
    return sorted(near, key=lambda own: place.get(own.name, len(place)))


def _near(own: OwnEffect, period: Estimate | None) -> OwnEffect:
    if period is None:
        return own
    stated = own.parameters[_PERIOD]
    off = max(_PERIOD_SIGMA * (period.stderr or 0.0), _PERIOD_PART * period.value)
    low, high = np.clip([period.value - off, period.value + off], *stated.range).tolist()
    narrow = stated.model_copy(update={"range": (low, high)})
    return own.model_copy(update={"parameters": {**own.parameters, _PERIOD: narrow}})
