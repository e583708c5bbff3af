"""The adequacy test against textbook regression, and its levels where nothing is missing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from toy_problem import Toy, candidate, layout, waves

from lightfield.diagnosis.adequacy import score_tests
from lightfield.diagnosis.adequacy.score_tests import ALPHA, SPANS, VARIANCE_EXCESS
from lightfield.diagnosis.adequacy.templates import whitened_unknowns
from lightfield.diagnosis.problem import noise as noise_module


def toy(one_sided: bool = False, planes: int = 5, across: int = 12) -> Toy:
    lay = layout(planes, across)
    low = 0.0 if one_sided else -1e3
    return Toy.of([candidate(name, low=low) for name in waves(lay)], waves(lay), lay)


def replicates(made: Toy, count: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((made.problem.layout.size, count))


def reached(made: Toy) -> np.ndarray:
    """All that is not pure error: base, effects, and the smooth unknowns but for the narrow ones."""
    columns = np.stack(list(made.problem.forward.columns.values()), axis=1) / made.sigma[:, None]
    unknowns = whitened_unknowns(made.problem, made.whiten)
    used = [unknowns[name] for name in (*SPANS, "step", "one plane")]
    return np.hstack([columns, *used])


def test_a_score_is_the_t_test_of_a_regression() -> None:
    """Amplitude, standard error and p as the regression of the readings on base and effect has them; the
    scale of the errors from the residual beside all that could be fitted."""
    made = toy()
    problem = made.drawn(np.random.default_rng(3), odd=2.0, dusk=-1.0)
    found = made.test(problem, replicates(made, 9), errors_stated=False)(made.fit(problem))
    columns, value = reached(made), problem.value / made.sigma
    rest = value - columns @ np.linalg.lstsq(columns, value, rcond=1e-6)[0]
    nu = len(value) - np.linalg.matrix_rank(columns, tol=1e-6 * np.linalg.norm(columns, 2))
    assert (found.nu, found.phi) == (nu, pytest.approx(rest @ rest / nu, rel=1e-6))
    assert {score.key[0] for score in found.scores} == {"odd", "dusk", "rows"}
    for score, amplitude in zip(found.scores, found.amplitudes, strict=True):
        slopes, covariance, _ = made.regression(problem, score.key[0])
        stderr = np.sqrt(covariance[-1, -1])
        assert amplitude == pytest.approx(slopes[-1:], rel=1e-6)
        assert 1 / score.length == pytest.approx(stderr, rel=1e-6)
        expected = 2 * stats.t.sf(abs(slopes[-1]) / stderr / np.sqrt(found.phi), nu)
        assert found.tests[score.key] == pytest.approx(expected, rel=1e-6)
    # Stated errors count as eight readings more that scatter as they say.
    stated = made.test(problem, replicates(made, 9))(made.fit(problem))
    assert (stated.nu, stated.phi) == (nu + 8, pytest.approx((rest @ rest + 8) / (nu + 8), rel=1e-6))


@pytest.mark.parametrize("one_sided", [False, True])
def test_the_least_p_of_all_tests_is_that_of_one_after_the_other(one_sided: bool) -> None:
    """Of noise it is worked out from the largest statistics; here each is tested as if it were readings."""
    made = toy(one_sided)
    fit, noise = made.fit(made.problem), replicates(made, 60)
    for some in (noise[:, :20], noise[:, 20:40], noise[:, 40:]):
        test = made.test(made.problem, some)
        each = [min(test(replace(fit, residual=column)).tests.values()) for column in some.T]
        assert test(fit).critical_p == pytest.approx(np.quantile(each, ALPHA), rel=1e-9)


def test_an_effect_of_one_sign_has_no_score_of_the_other() -> None:
    """Its p is that of one tail, and 1 where the readings ask for less than nothing (Chernoff 1954)."""
    made, both = toy(one_sided=True), toy()
    for size in (2.0, -2.0):
        drawn = [t.drawn(np.random.default_rng(3), odd=size) for t in (made, both)]
        one, two = (made.test(p, replicates(made, 9))(made.fit(p)).tests for p in drawn)
        key = ("odd", "linear")
        assert one[key] == pytest.approx(0.5 * two[key] if size > 0 else 1.0)


def test_what_the_base_model_does_itself_cannot_be_tested() -> None:
    lay = layout()
    columns = {**waves(lay), "copy": 100 * lay.z_m**0}
    made = Toy.of([candidate(name) for name in columns], columns, lay)
    bell = made.problem.forward.columns["level"]
    made.problem.forward.columns["toy.copy"] = bell * (1 + 1e-4 * lay.x_m)
    problem = made.drawn(np.random.default_rng(0))
    found = made.test(problem, replicates(made, 9))(made.fit(problem))
    assert {s.key[0] for s in found.scores if not s.testable} == {"copy"}
    assert ("copy", "linear") not in found.tests


def p_values(made: Toy, sets: int, count: int, factor: float = 1.0) -> list[score_tests.Adequacy]:
    """Tests of so many sets of readings of the base model, whose errors are stated where they are right."""
    noise, rng, out = replicates(made, count), np.random.default_rng(7), []
    for _ in range(sets):
        problem = made.drawn(rng, factor)
        out.append(made.test(problem, noise, errors_stated=factor == 1)(made.fit(problem)))
    return out


@pytest.mark.parametrize(("one_sided", "factor"), [(False, 1.0), (True, 1.0), (False, 1.7)])
def test_where_nothing_is_missing_p_is_uniform(one_sided: bool, factor: float) -> None:
    """Kolmogorov and Smirnov on 120 sets, at 0.1 %; also with errors assumed 1.7 times too small. Steps of p
    (1 / 300) are far below what the test sees."""
    made = toy(one_sided)
    found = p_values(made, 120, 299, factor)
    assert stats.kstest([one.p for one in found], "uniform").pvalue > 0.001
    nu = found[0].nu
    # Each scale is chi-square over nu: its mean has a standard error of sqrt(2 / nu / sets).
    assert np.mean([one.phi for one in found]) / factor**2 == pytest.approx(1, abs=4 * np.sqrt(2 / nu / 120))
    single = np.array([one.tests["dusk", "linear"] for one in found])
    if one_sided:  # half of the sets ask for less than nothing, the others have one tail
        assert stats.binomtest(int((single == 1).sum()), 120).pvalue > 0.001
        single = 2 * single[single < 1]
    assert stats.kstest(single, "uniform").pvalue > 0.001


@pytest.mark.slow
def test_the_base_model_is_given_up_at_the_stated_level() -> None:
    """1500 sets at 1 and at 5 %, within the two-sided limits of 99.9 %; one noise serves all sets, whose own
    chance (999 replicates) widens them."""
    found = p_values(toy(), 1500, 999)
    for alpha in (ALPHA, 0.05):
        spread = np.sqrt(alpha * (1 - alpha) * (1 / 1500 + 1 / 999))
        assert np.mean([one.p <= alpha for one in found]) == pytest.approx(alpha, abs=3.3 * spread)


def test_the_worst_test_falls_below_its_critical_p_at_the_level() -> None:
    """As `detection_limits` takes it, in 400 sets that are the replicates of another seed."""
    made = toy()
    problem = made.drawn(np.random.default_rng(0))
    test = made.test(problem, replicates(made, 4000))
    found = test(made.fit(problem))
    again = made.test(problem, replicates(made, 4000, seed=2))(made.fit(problem))
    # The quantile of 4000 at 1 % is good to 16 % of its chance, and that twice.
    assert again.critical_p == pytest.approx(found.critical_p, rel=4 * np.sqrt(2 / 40))
    assert found.critical_p < ALPHA / len(found.tests) ** 0.5


@pytest.mark.parametrize(("factor", "credible"), [(1.7, True), (5.0, False)])
def test_scatter_is_credible_up_to_four_times_the_stated_variance(factor: float, credible: bool) -> None:
    """`excess_p` is the chance of the scatter were the variance VARIANCE_EXCESS times the stated one."""
    made = toy()
    problem = made.drawn(np.random.default_rng(0), factor)
    found = made.test(problem, replicates(made, 9))(made.fit(problem))
    expected = stats.chi2.sf(found.nu * found.phi / VARIANCE_EXCESS, found.nu)
    assert found.excess_p == pytest.approx(expected)
    assert replace(found, p=1.0).passes(ALPHA) == credible
    unstated = made.test(problem, replicates(made, 9), errors_stated=False)(made.fit(problem))
    assert unstated.excess_p == 1.0


def test_few_readings_take_the_stated_errors() -> None:
    """Of 8 readings nothing is left to tell the noise: z and not t, whatever the scatter."""
    made = toy(planes=2, across=4)
    problem = made.drawn(np.random.default_rng(5), factor=4.0)
    found = made.test(problem, replicates(made, 9))(made.fit(problem))
    assert found.scale_taken and found.phi == 1.0 and found.excess_p == 1.0
    slopes, covariance, _ = made.regression(problem, "odd")
    expected = 2 * stats.norm.sf(abs(slopes[-1]) / np.sqrt(covariance[-1, -1]))
    assert found.tests["odd", "linear"] == pytest.approx(expected, rel=0.05, abs=1e-4)


@pytest.mark.parametrize("kind", ["plane", "step"])
def test_an_unknown_that_no_effect_describes_is_seen_by_its_own_test(kind: str) -> None:
    made = toy()
    lay, rng = made.problem.layout, np.random.default_rng(1)
    change = {"plane": 5.0 * (lay.plane == 2), "step": 4.0 * np.sign(lay.phase_of_scan - 0.1)}[kind]
    problem = made.with_value(made.base + made.sigma * (change + rng.standard_normal(lay.size)))
    found = made.test(problem, replicates(made, 199))(made.fit(problem))
    assert found.p == 1 / 200
    own = {"plane": ("~plane", "~all", "~one plane"), "step": ("~time", "~step", "~all")}[kind]
    assert min(found.tests, key=lambda name: found.tests[name]) in own


def test_noise_and_unknowns_in_single_precision_say_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """As they are kept of many readings: 500 of them, beside doubles."""
    made = toy(across=100)
    problem = made.drawn(np.random.default_rng(4), odd=0.1)
    fit, noise = made.fit(problem), replicates(made, 999)
    exact = made.test(problem, noise)(fit)
    monkeypatch.setattr(noise_module, "_MANY", 400)
    test = made.test(problem, noise.astype(np.float32))
    assert {columns.dtype for columns in test.unknowns.values()} == {np.dtype(np.float32)}
    assert made.whiten.replicates(np.random.default_rng(0), 9).dtype == np.float32
    single = test(fit)
    assert 0.01 < exact.p < 0.99 and single.p == pytest.approx(exact.p, abs=2e-3)
    assert (single.nu, single.phi) == (exact.nu, pytest.approx(exact.phi, rel=1e-5))
    for name, p in exact.tests.items():
        assert single.tests[name] == pytest.approx(p, rel=1e-3)
