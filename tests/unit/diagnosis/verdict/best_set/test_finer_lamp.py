"""A lamp that is followed more finely than by the best set: what water would be beside it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from analytic_readings import readings

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.search.cascade import SearchResult
from lightfield.diagnosis.verdict.best_set import unnamed
from lightfield.diagnosis.verdict.best_set.finer_lamp import comparable_errors, finer_lamp
from lightfield.diagnosis.verdict.parts import Estimate, Unnamed
from lightfield.diagnosis.verdict.words.effects import unnamed_sentences
from lightfield.fitting.curves import PROFILE, field_of

ABSORPTION = "water.absorption_per_m"


def shouldered(table: Any) -> np.ndarray:
    """A lamp with shoulders at 7 degrees on the beam of the scene."""
    angle = np.degrees(np.arctan2(np.hypot(table.x_m, table.y_m), table.z_m))
    return np.asarray(1 + 0.3 * np.exp(-(((angle - 7) / 3) ** 2)))


@pytest.fixture(scope="module")
def found() -> tuple[Any, SearchResult]:
    table, scene = readings(seed=4, factor=shouldered)
    result = diagnose(table, scene, diffuse=None, only=["beam_profile", "beam_shape"], advise=False)
    assert result.verdict.best_set == ["beam_profile"]
    return table, result.finding


def functions(explanation: Any) -> int:
    return max(len(c.amplitudes) for c in explanation if field_of(c.amplitudes[0].path) == PROFILE)


def test_water_beside_a_finer_lamp_is_that_of_a_regression(found: tuple[Any, SearchResult]) -> None:
    """Of ln(light z^2), the cosines aside, on the path and on even powers of the angle."""
    table, finding = found
    finer = finding.finer_lamp
    assert finer is not None and finding.best is not None
    assert functions(finer.explanation) >= max(7, functions(finding.best.explanation) + 1)
    assert finer.fit.chi2 < finding.best.fit.chi2
    z, r = table.z_m, np.sqrt(table.x_m**2 + table.y_m**2 + table.z_m**2)
    square = np.arctan2(np.hypot(table.x_m, table.y_m), z) ** 2
    powers = np.stack([(square / square.max()) ** k for k in range(10)], axis=1)
    columns, weight = np.column_stack([powers, -r]), table.value / table.stderr
    logs = np.log(table.value * r**3 / z)
    solved = np.linalg.lstsq(columns * weight[:, None], logs * weight, rcond=None)[0]
    error = finer.fit.stderr()[ABSORPTION]
    assert finer.fit.values[ABSORPTION] == pytest.approx(solved[-1], abs=0.5 * error)


def test_the_errors_of_the_best_set_know_of_it(found: tuple[Any, SearchResult]) -> None:
    _, finding = found
    best, finer = finding.best, finding.finer_lamp
    assert best is not None and finer is not None and finer_lamp(finding) is not None
    weighing = unnamed._weighing(finding)
    assert weighing is not None
    weight = np.exp(-0.5 * max(weighing.above(finer), 0.0))
    own = best.fit.stderr(best.scale)[ABSORPTION]
    theirs = comparable_errors(weighing, finer)[ABSORPTION]
    moved = finer.fit.values[ABSORPTION] - best.fit.values[ABSORPTION]
    least = np.sqrt((own**2 + weight * (theirs**2 + moved**2)) / (1 + weight))
    assert best.errors[ABSORPTION] >= 0.999 * least


@pytest.mark.parametrize(("above", "told"), [(4.0, True), (6.0, False)])
@pytest.mark.parametrize("moved", [1.0, 3.0])
def test_what_costs_little_and_changes_much_is_told(
    found: tuple[Any, SearchResult], above: float, told: bool, moved: float
) -> None:
    """An absorption that is so many of its errors another one beside the finer lamp."""
    _, finding = found
    weighing, finer = unnamed._weighing(finding), finding.finer_lamp
    assert weighing is not None and finer is not None
    node = weighing.best
    other = dict(node.fit.values)
    other[ABSORPTION] += moved * node.fit.stderr(weighing.phi)[ABSORPTION]
    curve = next(c for c in finer.explanation if c.key not in node.key)
    fit = SimpleNamespace(values=other, chi2=node.fit.chi2, stderr=finer.fit.stderr)
    changed: Any = SimpleNamespace(explanation=(curve,), names=finer.names, fit=fit)
    stub: Any = SimpleNamespace(best=node, phi=weighing.phi, above=lambda _: above)
    records = unnamed._of_the_lamp(stub, changed)
    assert [one.changed for one in records] == ([(ABSORPTION,)] if told and moved > 2 else [])


def test_its_words() -> None:
    there = {ABSORPTION: Estimate(value=0.095, stderr=0.01, unit="1/m")}
    (said,) = unnamed_sentences(
        [Unnamed(effect="beam_profile", sigma=2.0, with_it=there, in_errors=True)],
        {ABSORPTION: Estimate(value=0.076, stderr=0.022, unit="1/m")},
    )
    assert said == (
        "beam profile in more detail does nearly as well: with it water.absorption_per_m would be "
        "0.095 ± 0.01 1/m instead of 0.076; the stated errors reach there"
    )
