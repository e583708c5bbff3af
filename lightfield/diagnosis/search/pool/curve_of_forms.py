"""The curve of a lamp that named forms of its beam make, as a place for fits to begin.

Of a lamp that no formula describes two named forms together may take nearly all. Its curve is then far from
the beam without them, where slopes do not lead: it is laid over the forms themselves.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.search.pool.fitted_sets import Pool, begin_at
from lightfield.diagnosis.search.pool.quick import Begin
from lightfield.diagnosis.search.set_of_effects import FittedSet
from lightfield.fitting.beam_width import WIDTH
from lightfield.fitting.curves import PROFILE, field_of
from lightfield.fitting.parameter import is_gain
from lightfield.fitting.smooth_functions import Basis
from lightfield.scene.lamp.profile import radial_intensity

#: Angles count by their light, and in the dark as if they had this part of that on the axis. Chosen.
_DIM = 1e-3


def try_curves(pool: Pool, best: FittedSet, names: Collection[str]) -> None:
    """Fit the lamp's curve in place of the forms of its beam, if one of them has one of these names."""
    for curve in pool.problem.candidates:
        contains = curve.effect.contains
        of_lamp = field_of(curve.amplitudes[0].path) == PROFILE
        if not of_lamp or set(contains).isdisjoint(names) or curve.form.refines:
            continue
        whole = [*(c for c in best.explanation if c.name not in contains), curve]
        if pool.affordable(whole):
            # Begun at the forms it is worth a fit, however far away one from elsewhere left it.
            pool.fit(whole, [laid_over(pool, best, curve)], promised=pool.cost(pool.best()))


def laid_over(pool: Pool, best: FittedSet, curve: Candidate) -> Begin:
    """Where the curve makes the beam that the forms of a set make."""
    problem, known = pool.problem, best.fit.by_path
    basis: Basis = problem.forward.scenes.curves.bases[PROFILE]
    lamp = problem.forward.scenes.at(best.fit.values, validate=False).lamp
    squared = np.radians(basis.place) ** 2
    light = np.maximum(radial_intensity(lamp, squared), np.finfo(float).tiny)
    ends = {p.path: p for p in best.fit.model.parameters}
    width = ends.get(WIDTH)
    functions = basis.functions[:, : len(curve.amplitudes)]
    columns = np.column_stack([np.ones(len(squared)), *([] if width is None else [squared]), functions])
    weight = np.sqrt(light + _DIM)
    solved = np.linalg.lstsq(columns * weight[:, None], np.log(light) * weight, rcond=None)[0]
    amplitudes = solved[-len(curve.amplitudes) :]
    paths = {p.path for c in best.explanation if c.name in curve.effect.contains for p in c.parameters}
    u = {path: at for path, at in known.items() if path not in paths}
    if width is not None and solved[1] < 0:
        u[WIDTH] = width.coordinate_of(float(np.degrees(np.sqrt(np.log(2.0) / -solved[1]))))
    for p, amplitude in zip(curve.amplitudes, amplitudes, strict=True):
        u[p.path] = float(np.clip(p.coordinate_of(float(amplitude)), p.low, p.high))
    slopes = {path: s for path, s in begin_at(best).slopes.items() if path in u}
    return Begin(_as_bright(pool, best, curve, u), slopes)


def _as_bright(pool: Pool, best: FittedSet, curve: Candidate, u: dict[str, float]) -> dict[str, float]:
    """The same with gains that make the readings as bright as the set does."""
    problem = pool.problem
    whole = tuple(c for c in best.explanation if c.name not in curve.effect.contains)
    model = problem.model((*whole, curve))
    now, wanted = model.predict(model.at(u)), best.fit.prediction
    ratio = float(wanted @ wanted) / max(float(wanted @ now), np.finfo(float).tiny)
    more = float(np.log(ratio)) if np.isfinite(ratio) and ratio > 0 else 0.0
    return {path: x + more if is_gain(path) else x for path, x in u.items()}
