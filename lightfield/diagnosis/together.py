"""Before any measurement: of several effects that all act at once, which would be certain with this layout?

The readings that the effects would give are taken without noise, and the search of a diagnosis asks of each
effect what the best set without it would cost more: any other effects, curves too, one effect more, and what
is known to imitate it. The same gaps decide as in a diagnosis; noise moves them by twice their root.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy import special
from threadpoolctl import threadpool_limits

from lightfield.arrays import Array
from lightfield.diagnosis.expected import LIKELY, Expected, Together
from lightfield.diagnosis.planned import planned_in, without_photons
from lightfield.diagnosis.problem.candidates import Candidate
from lightfield.diagnosis.problem.noise import Noise
from lightfield.diagnosis.problem.problem import Explanation, Problem
from lightfield.diagnosis.problem.quoted import own_part
from lightfield.diagnosis.problem.setup import budget_of, problem_of, source_of, spectral
from lightfield.diagnosis.problem.untestable import Untestable, in_words
from lightfield.diagnosis.problem.whitening import Whitener, unwhitened
from lightfield.diagnosis.search.own_errors import with_response_error
from lightfield.diagnosis.search.pool.evidence import (
    GAP,
    NAMED_GAP,
    PLUS_GAP,
    Evidence,
    Weighing,
    contained,
    evidence,
    has,
    may_be_another_lamp,
)
from lightfield.diagnosis.search.pool.fitted_sets import Ground, Pool
from lightfield.diagnosis.search.pool.quick import Begin
from lightfield.diagnosis.search.pool.rivals import seek_rivals
from lightfield.diagnosis.search.preparation import whitened_test
from lightfield.diagnosis.search.set_of_effects import FittedSet
from lightfield.diagnosis.verdict.estimates import units_in
from lightfield.errors import UsageError
from lightfield.fitting import effects
from lightfield.fitting.curves import FIELDS, field_of
from lightfield.fitting.diffuse_light import DiffuseSource
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.parameter import FitParameter
from lightfield.progress import step, tell
from lightfield.readings import Readings
from lightfield.scene import Scene

#: Size of an effect over its typical one, where none is asked about. Chosen: the smallest that `hide` draws.
_TIMES_TYPICAL = 2.0
#: The same of a curve's first function: a tenth, as lamps depart from the Gaussian that is nearest to them
#: (11 to 50 % rms of the readings in `benchmarks/field` and `benchmarks/many_effects`).
_TIMES_OF_A_CURVE = 5.0
#: Variance of a noncentral chi-square: 4 for its shift, squared, and 2 for each of its degrees of freedom
#: (Patnaik 1949, Biometrika 36, 202, doi:10.1093/biomet/36.1-2.202).
_OF_DISTANCE, _OF_EACH = 4.0, 2.0


def together(
    readings: Readings,
    scene: Scene,
    names: Sequence[str],
    sizes: Mapping[str, float] | None = None,
    diffuse: DiffuseSource | None = None,
) -> Together:
    """What a diagnosis would know of effects that act at once.

    Parameters
    ----------
    readings : Readings
        Positions, times, media, wavelengths and, if known, standard errors; values are not used.
    scene : Scene
        Lamp, water and tank as they are but for the effects.
    names : sequence of str
        Effects of the table, or of the scene's own, and curves; "effect:form" for another form. A curve has
        as many functions as the layout tells of, where no form says less.
    sizes : mapping, optional
        Values of scene parameters; twice the typical size where none is given. Of a curve the amplitudes of
        its functions, as rms of the logarithm of light: the k-th is 1/k of the first, and they make it darker
        towards its end.
    diffuse : callable, optional
        Source of scattered and reflected light.

    Raises
    ------
    UsageError
        An effect that is unknown, cannot act here or beside the others, or a size that is none of theirs or
        that no fit reaches.
    SceneError
        A size that no scene may have.
    """
    of_scene = {path: size for path, size in (sizes or {}).items() if field_of(path) not in FIELDS}
    scene.with_values(of_scene)  # refuses what no scene may have, as where an effect is hidden
    with threadpool_limits(1, "blas"):  # many small matrices, as in a diagnosis
        return _together(readings, scene, names, sizes or {}, diffuse)


def _together(
    readings: Readings,
    scene: Scene,
    names: Sequence[str],
    sizes: Mapping[str, float],
    diffuse: DiffuseSource | None,
) -> Together:
    readings = readings.check_against(scene)
    scene = spectral(scene, readings)
    known = [*effects.all_of(scene).values(), *effects.curves().values()]
    steps = 2 + len(names)
    with step(0, steps, "light of the layout"):
        source, reason = source_of(scene, diffuse, readings)
        table, forward = planned_in(readings, scene, source)
        problem, untestable = problem_of(forward, table, known, reason)
        problem = problem.with_curves()
        chosen = _chosen(problem, untestable, names)
        values = _values(chosen, sizes)
        unlit = problem.fit((), unwhitened, [problem.model().start])  # its gain makes the brightest reading 1
        truth = {**unlit.values, **values}
        true = problem.fit(chosen, unwhitened, [_start(problem, chosen, truth)], max_steps=0)
        light = without_photons(problem, true).forward.light
        table = replace(table, value=SceneForward(scene, table, light=light).predict(truth))
        forward = SceneForward(scene, table, light=light)  # curves mean the same
        problem, _ = problem_of(forward, table, known, reason)
        problem = problem.with_curves()
    chosen = tuple(next(c for c in problem.candidates if c.key == one.key) for one in chosen)
    with step(1, steps, "all effects at once"):
        pool, node = _searched(problem, chosen, truth, readings, table)
        pool.progress = lambda _: tell(f"{pool.fits} sets fitted", 0.0)
        seen = _worth_their_price(pool, node)
    for k, candidate in enumerate(seen.explanation):
        with step(2 + k, steps, f"what could stand for {candidate.name}"):
            seek_rivals(pool, seen, candidate)
    seen = pool.nodes[seen.key]
    weighing = Weighing.of(pool, seen)
    found = {one.candidate.name: one for one in evidence(pool, seen, adequate=True)}
    expected = [
        _expected(weighing, found[c.name], values)
        if c.name in found
        else _unseen(pool, node, seen, c, values)
        for c in chosen
    ]
    budget = budget_of(replace(table, stderr=readings.stderr))
    return Together(expected, problem.layout.size, units_in(forward), budget.assumed)


def _start(problem: Problem, chosen: Explanation, values: Mapping[str, float]) -> Array:
    """Coordinates of what was chosen, at these values."""
    known = problem.model(chosen).parameters
    return np.array([p.coordinate_of(values[p.path]) if p.path in values else p.start for p in known])


def _chosen(problem: Problem, untestable: Untestable, names: Sequence[str]) -> Explanation:
    out: list[Candidate] = []
    for name in names:
        effect, form = effects.get_form(name, problem.forward.scene)
        mine = [c for c in problem.candidates if c.name == effect.name]
        if not mine:
            raise UsageError(
                "this effect cannot act here",
                found=f"{name}: {in_words(untestable.get(effect.name, ())) or 'not in this scene'}",
                remedy="change the layout or scene",
            )  # fmt: skip
        one = next((c for c in mine if c.form.name == form.name), mine[0])
        if effect.is_free_form and ":" not in name:
            one = [c for c in mine if not c.form.refines][-1]
        for other in out:
            if not effect.combines_with(other.effect):
                raise UsageError(
                    "effects that are not fitted together", found=f"{other.name}, {effect.name}",
                    rule=effects.TOGETHER,
                )  # fmt: skip
        out.append(one)
    return tuple(out)


def _values(chosen: Explanation, sizes: Mapping[str, float]) -> dict[str, float]:
    """Scene values of the effects."""
    out: dict[str, float] = {}
    for candidate in chosen:
        amplitudes = zip(candidate.amplitudes, candidate.typical, strict=True)
        for k, (parameter, typical) in enumerate(amplitudes, 1):
            # The finer, the less: a lamp is smooth. And down: functions of an angle rise without end, and a
            # lamp that is brighter there fills the tank.
            times = -_TIMES_OF_A_CURVE / k if candidate.effect.is_free_form else _TIMES_TYPICAL
            most = 0.5 * (parameter.high - parameter.start)
            size = float(np.clip(times * typical, -most, most))
            out[parameter.path] = parameter.value(parameter.start + size)
        for parameter, at in zip(candidate.shapes, candidate.grid[0], strict=True):
            out[parameter.path] = parameter.value(at)
    if other := sorted(set(sizes) - set(out)):
        whole = [path for path in out if path.rpartition(".")[0] in other]
        raise UsageError(
            "a size of an effect that is not asked about" if not whole else "a curve has a size per function",
            found=", ".join(other),
            rule=f"one of {', '.join(whole or out)}",
        )
    for parameter in (p for candidate in chosen for p in candidate.parameters):
        if parameter.path in sizes:
            _check(parameter, sizes[parameter.path])
    return {**out, **sizes}


def _check(parameter: FitParameter, size: float) -> None:
    """Refuse what a fit would not reach: the readings could not be those of the effects."""
    is_number = isinstance(size, int | float) and np.isfinite(size)
    if not is_number or not parameter.low <= parameter.coordinate_of(size) <= parameter.high:
        ends = sorted(map(parameter.value, (parameter.low, parameter.high)))
        widest = parameter.coordinate == "inverse-square"  # whose lower end stands for no limit
        rule = f"at least {ends[1]:.3g}" if widest else f"{ends[0]:.3g} to {ends[1]:.3g}"
        raise UsageError("a diagnosis seeks no such size", where=parameter.path, found=size, rule=rule)


def _searched(
    problem: Problem, chosen: Explanation, values: Mapping[str, float], readings: Readings, table: Readings
) -> tuple[Pool, FittedSet]:
    """Sets that were fitted to the noise-free readings, and the true one, which starts at the truth."""
    budget = budget_of(replace(table, stderr=readings.stderr))
    base = problem.fit((), unwhitened, [problem.model().start])
    slope = budget.position_slope(problem.forward, {**base.values, **values})
    sigma = own_part(table.stderr, problem.layout.common * table.value)
    start = _start(problem, chosen, values)
    noise = Noise(problem.layout, sigma, table.value, budget, slope)
    noise = with_response_error(problem, noise, problem.fit(chosen, unwhitened, [start], max_steps=0))
    whiten = Whitener(noise, 0.0, 1.0, 0.0)
    true = problem.fit(chosen, whiten, [start])
    test = whitened_test(problem, whiten, np.random.default_rng(0))
    ground = Ground(test, 1.0, test(true).nu)
    pool = Pool(ground)
    at = Begin(true.by_path)
    pool.finished(pool.fit((), [at]))
    return pool, pool.finished(pool.fit(chosen, [at]))


def _worth_their_price(pool: Pool, node: FittedSet) -> FittedSet:
    """The set without what nobody would see beside the rest."""
    while node.explanation:
        less = min((pool.finished(pool.drop(node, c)) for c in node.explanation), key=pool.cost)
        if pool.cost(less) >= pool.cost(node):
            break
        node = less
    return node


def _unseen(
    pool: Pool, whole: FittedSet, seen: FittedSet, candidate: Candidate, values: Mapping[str, float]
) -> Expected:
    """Of an effect that costs more than it explains."""
    mine = {p.path: values[p.path] for p in candidate.parameters}
    less = pool.finished(pool.drop(whole, candidate))
    sigma = float(np.sqrt(max(less.fit.chi2 - whole.fit.chi2, 0.0) / pool.ground.phi))
    gap = min(pool.cost(less), pool.cost(seen)) - pool.cost(whole)
    # Beside what is seen alone: noise may lift it above its price, and by the gap that a name takes.
    begin = Begin(whole.fit.by_path)
    more = pool.finished(pool.fit((*seen.explanation, candidate), [begin]))
    d, square = len(candidate.parameters), max(seen.fit.chi2 - more.fit.chi2, 0.0) / pool.ground.phi
    margin = pool.cost(seen) - pool.cost(more) + d - NAMED_GAP
    chance = float(special.ndtr(margin / _spread(square, d)))
    return Expected(candidate.name, mine, sigma, gap, chance, chance, tuple(sorted(seen.names)))


def _spread(square: float, dof: float) -> float:
    """Standard deviation of the chi-square of `dof` numbers that lie so far, squared, from nought."""
    return float(np.sqrt(_OF_DISTANCE * square + _OF_EACH * dof))


def _expected(weighing: Weighing, one: Evidence, values: Mapping[str, float]) -> Expected:
    """Of an effect that is worth its price.

    A set that misses the noise-free readings by D sigma misses those with noise by a chi-square that is,
    beside that of the true set, about normal: about D^2 less the number d of its parameters more, which noise
    feeds, with the variance 4 D^2 + 2 d. Sets are taken one by one: the worst decides.
    """
    best, name = weighing.best, one.candidate.name
    certain, named = _Worst(), _Worst()
    for node in weighing.pool.nodes.values():
        if has(name, node):
            continue
        distance = np.sqrt(max(node.fit.chi2 - best.fit.chi2, 0.0) / weighing.phi)
        noise = best.parameters - node.parameters
        spread = max(_spread(distance**2, abs(noise)), 1.0)
        contains = contained(name, node)
        margin = weighing.above(node) + noise - (GAP if contains else NAMED_GAP)
        named.meet(margin / spread, node)
        certain.meet(margin / spread, node)
        if not contains and weighing.with_one_more([node]):
            unpriced = weighing.above_unpriced(node) + noise
            certain.meet((unpriced - PLUS_GAP) / spread, node)
            named.meet((unpriced + PLUS_GAP) / spread, node)
    rival = certain.node if named.chance >= LIKELY else named.node
    another_lamp = may_be_another_lamp(weighing.pool, best, one.candidate)
    return Expected(
        name,
        {p.path: values[p.path] for p in one.candidate.parameters},
        one.sigma_to_remove,
        one.gap,
        0.0 if another_lamp else certain.chance,
        named.chance,
        () if rival is None else tuple(sorted(rival.names)),
        another_lamp,
    )


class _Worst:
    """The set that stands most in the way of an effect, and the chance that noise lets it."""

    def __init__(self) -> None:
        self._sigma = np.inf
        self.node: FittedSet | None = None

    def meet(self, sigma: float, node: FittedSet) -> None:
        """Another set, so many deviations from standing in the way."""
        if sigma < self._sigma:
            self._sigma, self.node = sigma, node

    @property
    def chance(self) -> float:
        return float(special.ndtr(self._sigma))
