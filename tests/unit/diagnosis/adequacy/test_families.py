"""A misfit that depends on one coordinate alone is found to do so, in whatever order the readings stand."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from scipy import stats
from toy_problem import Linear, Toy, layout

from lightfield.diagnosis.adequacy.families import FreeFactor, free_factors
from lightfield.diagnosis.problem.layout import Layout
from lightfield.diagnosis.problem.setup import problem_of
from lightfield.fitting.forward import SceneForward
from lightfield.readings import Readings
from lightfield.scene import Scene


def toy(in_order: bool = False) -> Toy:
    return Toy.of([], {}, layout(in_order=in_order))


def found(made: Toy, value: np.ndarray, phi: float = 1.0) -> list[FreeFactor]:
    problem = made.with_value(value)
    return free_factors(problem, made.whiten, made.fit(problem), phi)


FACTORS = {
    "x": lambda lay: 0.1 * np.isclose(lay.x_m, lay.x_m[8]),
    "plane": lambda lay: 0.1 * (lay.plane == 2),
    "time": lambda lay: 0.1 * np.cos(3 * np.pi * (lay.phase_of_scan + 0.5)),
    "angle": lambda lay: 0.1 * np.cos(20 * lay.angle_rad / lay.angle_rad.max()),
}


@pytest.mark.parametrize("name", FACTORS)
def test_the_coordinate_of_a_factor_comes_first_and_explains_it(name: str) -> None:
    """10 % beside noise of 1 %: the family takes away all of the misfit, within what noise leaves open."""
    made = toy()
    factor = 1 + FACTORS[name](made.problem.layout)
    noise = made.sigma * np.random.default_rng(0).standard_normal(len(factor))
    best, *_ = ranked = found(made, made.base * factor + noise)
    assert best.name == name
    assert best.explained == pytest.approx(1, abs=0.15)
    assert [one.score for one in ranked] == sorted(one.score for one in ranked)


def test_a_level_at_one_distance_by_hand() -> None:
    """Without noise. Base: level and slope over five distances, so that the family's five levels are free but
    for two; nothing is left of chi-square, and each term costs ln(60). It departs most where it is."""
    made = toy()
    lay = made.problem.layout
    value = made.base * (1 + 0.1 * (lay.plane == 2))
    chi2 = made.regression(made.with_value(value))[2]
    plane = next(one for one in found(made, value) if one.name == "plane" and not one.at_one)
    assert plane.terms == 4
    assert plane.score == pytest.approx(4 * np.log(60), abs=1e-3)
    assert plane.explained == pytest.approx((chi2 - 4) / (chi2 - (60 - 2)), rel=1e-6)
    assert plane.worst_at == lay.z_m[lay.plane == 2][0]


@pytest.mark.parametrize("moved", [{"z": 0.12}, {"x": 0.05}])
def test_a_plane_that_stands_elsewhere(moved: dict[str, float]) -> None:
    """By formulas of their own: one of six planes 12 cm farther, or 5 cm aside, than the table says."""
    planes, rng = (2.5, 3.5, 4.5, 5.5, 6.5, 7.5), np.random.default_rng(4)
    x, z = (axis.ravel() for axis in np.meshgrid(np.linspace(-0.8, 0.8, 17), planes))
    odd = z == 4.5
    true_x, true_z = x + moved.get("x", 0.0) * odd, z + moved.get("z", 0.0) * odd
    r = np.hypot(true_x, true_z)
    value = np.exp(-np.log(2) * (np.degrees(np.arctan2(true_x, true_z)) / 5) ** 2 - 0.09 * r) * true_z / r**3
    value /= value.max()
    sigma = np.hypot(0.005 * value, 0.0005)
    value = value + sigma * rng.standard_normal(len(value))
    readings = Readings.from_arrays(x_m=x, y_m=np.zeros(len(x)), z_m=z, value=value, stderr=sigma)
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 6.0}, "water": {"absorption_per_m": 0.11}})
    problem, _ = problem_of(SceneForward(scene, readings), readings, [], None)

    def whiten(columns: np.ndarray) -> np.ndarray:
        return (columns.T / sigma).T

    base = problem.fit((), whiten, [problem.model().start])
    best = free_factors(problem, whiten, base, 1.0)[0]
    assert (best.name, best.at_one, best.worst_at) == ("plane", True, 4.5)
    assert best.explained > 0.8


def test_the_place_of_a_dip_is_where_it_is() -> None:
    made = toy()
    x = made.problem.layout.x_m
    best = found(made, made.base * (1 - 0.2 * np.isclose(x, x[7])))[0]
    assert (best.name, best.worst_at) == ("x", x[7])


def permuted(made: Toy, order: np.ndarray) -> Toy:
    """The same readings in another order of the table."""
    lay, back = made.problem.layout, np.argsort(order)
    columns = {f.name: getattr(lay, f.name)[order] for f in fields(Layout) if f.name != "order"}
    other = Layout(**columns, order=back[lay.order])
    forward = Linear({path: column[order] for path, column in made.problem.forward.columns.items()})
    problem = replace(made.problem, layout=other, forward=forward, value=made.problem.value[order])
    return Toy(problem, made.base[order], made.sigma[order])


@pytest.mark.parametrize("name", FACTORS)
def test_the_order_of_the_table_does_not_matter(name: str) -> None:
    made, rng = toy(), np.random.default_rng(5)
    value = made.base * (1 + FACTORS[name](made.problem.layout)) + made.sigma * rng.standard_normal(60)
    order = rng.permutation(60)
    here, there = found(made, value), found(permuted(made, order), value[order])
    assert [one.name for one in here] == [one.name for one in there]
    for one, two in zip(here, there, strict=True):
        assert two.score == pytest.approx(one.score, rel=1e-6)
        assert (two.worst_at, two.terms) == (pytest.approx(one.worst_at), one.terms)


def test_where_nothing_is_missing_a_family_takes_away_what_its_terms_may() -> None:
    """60 sets of noise alone: chi-square falls by a chi-square of as many degrees of freedom as the family
    has terms (Wilks 1938), here of the distance, whose factor is linear."""
    made, falls = toy(), []
    for seed in range(60):
        value = made.base + made.sigma * np.random.default_rng(seed).standard_normal(60)
        chi2 = made.regression(made.with_value(value))[2]
        plane = next(one for one in found(made, value) if one.name == "plane" and not one.at_one)
        left = plane.score - plane.terms * np.log(60)
        falls.append(chi2 - left)
        rank = plane.terms - 1  # the slope with the distance is free in the base model
    assert stats.kstest(falls, stats.chi2(rank).cdf).pvalue > 0.001
