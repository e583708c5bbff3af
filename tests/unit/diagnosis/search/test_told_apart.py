"""Distances between explanations, and what would have been seen: by regression, and at their stated rates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import special, stats
from toy_problem import Toy, candidate, layout, toy, tried, waves

from lightfield.diagnosis.adequacy.score_tests import ALPHA
from lightfield.diagnosis.problem.problem import Problem
from lightfield.diagnosis.search import told_apart
from lightfield.diagnosis.search.set_of_effects import ScoredSet, bic, weights
from lightfield.diagnosis.search.told_apart import (
    Limit,
    detection_limits,
    isolability,
    nearest_rival,
    separation,
)


def apart(made: Toy, truth: np.ndarray, *rival: str) -> float:
    """Distance of readings without noise from what a rival can produce, in standard errors."""
    return float(np.sqrt(made.regression(made.with_value(truth), *rival)[2]))


def test_the_separation_is_the_distance_to_the_rivals_nearest_readings() -> None:
    """The residual of a regression of the truth's readings on the rival; in units of the noise's scale."""
    made = toy()
    problem = made.drawn(np.random.default_rng(0), odd=3.0, dusk=2.0)
    one, two = (tried(made, problem, name) for name in ("odd", "dusk"))
    for phi in (1.0, 4.0):
        away = separation(problem, made.whiten, one.fit, two, phi)
        assert away.separation_sigma == pytest.approx(
            apart(made, one.fit.prediction, "dusk") / np.sqrt(phi), rel=1e-4
        )
    assert separation(problem, made.whiten, one.fit, one, 1.0).separation_sigma == pytest.approx(0, abs=1e-3)


def test_the_nearest_rival_is_the_nearest_of_equal_size_and_another_name() -> None:
    lay = layout()
    made = toy(near=waves(lay)["odd"] + 0.3 * waves(lay)["rows"])
    problem = made.drawn(np.random.default_rng(0), odd=3.0)
    best, *others = (tried(made, problem, *names) for names in (["odd"], ["near"], ["dusk"], ["near", "odd"]))
    rival = nearest_rival(problem, made.whiten, best, [best, *others], 1.0)
    assert rival is not None and rival.explanation.names == ("near",)
    assert rival.separation_sigma == pytest.approx(apart(made, best.fit.prediction, "near"), rel=1e-4)
    assert nearest_rival(problem, made.whiten, best, [best, others[2]], 1.0) is None


def test_a_rival_at_a_known_distance_has_the_weight_of_it() -> None:
    """On readings without noise chi-square of the rival is D^2, and of the truth 0: weights 1 to
    exp(-D^2 / 2) (Schwarz 1978, for equal numbers of parameters)."""
    made = toy()
    for size in (0.05, 0.2):
        truth = made.base + made.problem.forward.predict({"toy.odd": size})
        problem = made.with_value(truth)
        one, two = (tried(made, problem, name) for name in ("odd", "dusk"))
        ratio = np.exp(-0.5 * apart(made, truth, "dusk") ** 2)
        assert weights([one, two]) == pytest.approx([1 / (1 + ratio), ratio / (1 + ratio)])


def test_weights_by_hand() -> None:
    """exp(-BIC / 2) over its sum; only differences count."""
    made = toy()
    one = tried(made, made.problem, "odd")
    three = [ScoredSet(one.explanation, one.fit, value) for value in (710.0, 712.0, 716.0)]
    expected = np.exp([0.0, -1.0, -3.0])
    assert weights(three) == pytest.approx(expected / expected.sum())
    assert bic(one.fit, one.explanation, 2.0, 60) == pytest.approx(one.fit.chi2 / 2 + np.log(60))


def test_no_better_than_the_distance_allows() -> None:
    """Two rivals 2 sigma apart: the right one has the larger weight at most with probability Phi(D / 2), and
    with that of two normal numbers that decide it. 600 sets."""
    made, rng, right = toy(), np.random.default_rng(1), 0
    unit = apart(made, made.base + made.problem.forward.predict({"toy.odd": 1.0}), "dusk")
    size = 2.0 / unit
    for _ in range(600):
        problem = made.drawn(rng, odd=size)
        one, two = (tried(made, problem, name) for name in ("odd", "dusk"))
        right += one.bic < two.bic
    expected = _nearer(made, size)
    assert right / 600 == pytest.approx(expected, abs=4 * np.sqrt(expected * (1 - expected) / 600))
    assert right / 600 <= special.ndtr(1.0) + 4 * np.sqrt(0.16 * 0.84 / 600)


def _nearer(made: Toy, size: float) -> float:
    """Probability that the true column takes more of chi-square than the rival, in their plane beside the
    base: |z . a| > |z . b| for z normal about size a."""
    columns = {p: c / made.sigma for p, c in made.problem.forward.columns.items()}
    base = np.linalg.qr(np.stack([columns["level"], columns["slope"]], axis=1))[0]
    one, two = (columns[f"toy.{n}"] - base @ (base.T @ columns[f"toy.{n}"]) for n in ("odd", "dusk"))
    a, b = one / np.linalg.norm(one), two / np.linalg.norm(two)
    plus, minus = a + b, a - b
    # (z.a)^2 - (z.b)^2 = (z.(a+b)) (z.(a-b)), two independent normal numbers.
    p, m = (special.ndtr(size * (one @ v) / np.linalg.norm(v)) for v in (plus, minus))
    return float(p * m + (1 - p) * (1 - m))


@pytest.mark.parametrize("one_sided", [False, True])
def test_an_effect_of_its_detection_limit_is_seen_in_95_of_100_sets(one_sided: bool) -> None:
    """Its own test alone falls below the level that the worst of all must reach, also where few readings
    tell the scale; 200 sets, 4 binomial standard deviations."""
    lay, low = layout(), 0.0 if one_sided else -1e3
    made = Toy.of([candidate(name, low) for name in waves(lay)], waves(lay), lay)
    noise = np.random.default_rng(2).standard_normal((lay.size, 1999))
    empty = made.drawn(np.random.default_rng(0))
    adequacy = made.test(empty, noise, errors_stated=False)(made.fit(empty))
    limits = detection_limits(adequacy, 1.0)
    assert set(limits) == set(waves(lay))
    assert all(limit.reachable for limit in limits.values())
    rng, seen = np.random.default_rng(3), 0
    quick = made.test(empty, noise[:, :1], errors_stated=False)
    for _ in range(200):
        problem = made.drawn(rng, dusk=limits["dusk"].value)
        seen += quick(made.fit(problem)).tests["dusk", "linear"] <= adequacy.critical_p
    # The t of a known direction under the scale's own chance.
    nu, level = adequacy.nu, adequacy.critical_p / (1 if one_sided else 2)
    shift = limits["dusk"].value / np.sqrt(made.regression(empty, "dusk")[1][-1, -1])
    expected = stats.nct.sf(stats.t.isf(level, nu), nu, shift)
    assert nu < 20
    assert expected == pytest.approx(0.95, abs=1e-3)
    assert seen / 200 == pytest.approx(expected, abs=4 * np.sqrt(expected * (1 - expected) / 200))


def test_a_limit_beyond_what_is_plausible_is_not_reachable() -> None:
    lay = layout()
    made = Toy.of([candidate(name, -1e-3, 2e-3) for name in waves(lay)], waves(lay), lay)
    problem = made.drawn(np.random.default_rng(0))
    adequacy = made.test(problem, np.random.default_rng(1).standard_normal((lay.size, 99)))(made.fit(problem))
    for limit in detection_limits(adequacy, 1.0).values():
        assert (limit.reachable, limit.value) == (False, pytest.approx(2e-3))


def test_a_limit_knows_that_what_the_scene_states_may_have_another_size() -> None:
    """Beside it free, by regression: its value may have been found where the effect was left out."""
    lay = layout()
    made = toy(near=waves(lay)["odd"] + 0.3 * waves(lay)["rows"])
    problem = made.drawn(np.random.default_rng(0))
    stated = [replace(c, neutral=(-1.0,)) if c.name == "near" else c for c in problem.candidates]
    noise = np.random.default_rng(1).standard_normal((lay.size, 99))

    def limits(problem: Problem) -> dict[str, Limit]:
        return detection_limits(made.test(problem, noise)(made.fit(problem)), 1.0)

    before, now = limits(problem), limits(replace(problem, candidates=tuple(stated)))
    alone, both = (made.regression(problem, "odd", *more)[1][2, 2] for more in ((), ("near",)))
    assert now["odd"].value / before["odd"].value == pytest.approx(np.sqrt(both / alone))
    assert np.sqrt(both / alone) > 3
    assert now["near"] == before["near"]


def test_the_size_that_is_called_detectable_has_its_textbook_value() -> None:
    """Two-sided at 1 % over 25 tests, found with 95 %: z(0.0002) + z(0.05)."""
    assert pytest.approx(3.5401 + 1.6449, abs=1e-4) == told_apart.DETECTABLE_SIGMA
    assert ALPHA == 0.01


def test_isolability_is_the_distance_of_columns() -> None:
    """delta: length of an effect's column beside the base; D: beside base and rival. By regression."""
    made = toy()
    problem = made.drawn(np.random.default_rng(0))
    adequacy = made.test(problem, np.random.default_rng(1).standard_normal((60, 9)))(made.fit(problem))
    sizes = {"odd": 3.0, "dusk": -2.0, "rows": 1.0}
    found = isolability(adequacy.scores, sizes, 4.0)
    for j, one in enumerate(found.names):
        truth = made.base + made.problem.forward.predict({f"toy.{one}": sizes[one]})
        assert found.delta[j] == pytest.approx(apart(made, truth) / 2, rel=1e-6)
        for k, two in enumerate(found.names):
            expected = apart(made, truth, two) / 2 if j != k else 0.0
            assert found.D[j, k] == pytest.approx(expected, rel=1e-6, abs=1e-6)


def test_classes_are_chains_of_near_effects_that_are_seen() -> None:
    """By hand: a near b, b near c, d alone, e near a but too faint to be seen."""
    far = np.full((5, 5), 10.0)
    for j, k in ((0, 1), (2, 1), (0, 4)):
        far[j, k] = 2.0  # one way is enough: whichever is true, the other imitates it
    delta = np.array([9.0, 9.0, 9.0, 9.0, 1.0])
    found = told_apart.Isolability(("a", "b", "c", "d", "e"), np.ones(5), delta, far)
    assert found.classes() == [("a", "b", "c")]
