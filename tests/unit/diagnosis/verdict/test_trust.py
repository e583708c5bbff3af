"""No effect is named, and none ruled out, in numbers that are no measurement of a beam."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from analytic_readings import readings

from benchmarks.garbage.judge import page
from benchmarks.garbage.tables import ERRORS, KINDS, Table, believed, tables
from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.verdict.ladder import rms_over
from lightfield.diagnosis.verdict.terminal import as_text
from lightfield.diagnosis.verdict.trust import left_by_fit
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.readings import Readings
from lightfield.scene import Scene

#: Tables that were once called "identified" or "none".
MISTAKEN = (
    ("uniform", "10 times too large", 0), ("lognormal", "none", 0), ("permuted", "none", 0),
    ("constant", "as a spectrometer states them", 1), ("constant", "10 times too small", 3),
    ("constant", "3 times too large", 0), ("quantised", "3 times too small", 1), ("quantised", "none", 0),
    ("two lamps mixed", "none", 0),
)  # fmt: skip

#: Of these some that no explanation can make sense of: a third of a reading is rounding, or all are alike.
SAY_NOTHING = (
    ("quantised", "none", 0),
    ("constant", "3 times too large", 0),
    ("constant", "10 times too small", 3),
)
#: One of every kind but one that takes long.
QUICK = (
    ("uniform", "10 times too large", 0), ("lognormal", "none", 0), ("constant", "3 times too large", 0),
    ("quantised", "none", 0), ("two lamps mixed", "none", 0),
)  # fmt: skip


def verdict_on(table, scene, **options) -> Verdict:
    return diagnose(table, scene, diffuse=None, advise=False, **options).verdict


def unstated(table):
    return replace(table, stderr=np.full(len(table), np.nan))


@pytest.mark.parametrize(
    "sort",
    [pytest.param(sort, marks=[] if sort in QUICK else [pytest.mark.slow]) for sort in MISTAKEN],
    ids=lambda sort: f"{sort[0]}, errors {sort[1]}",
)
def test_nothing_is_said_of_garbage(sort: tuple[str, str, int]) -> None:
    found = diagnose(Table(*sort).readings(), believed(), diffuse=None, advise=False)
    verdict = found.verdict
    assert (verdict.verdict, verdict.effects, verdict.explanations) == ("unexplained", [], [])
    assert verdict.found == [], "nor is anything certain so far"
    assert verdict.doubt is not None and verdict.doubt in verdict.sentence
    if sort in SAY_NOTHING:
        many = found.finding.many
        assert many is None or not many.sought, "half a minute's search would find what is not believed"


@pytest.mark.slow
@pytest.mark.timeout(1200)  # 168 tables
def test_no_effect_is_named_in_any_sort_of_garbage() -> None:
    """Four of every sort; benchmarks/garbage has twelve."""
    for table in tables(4 * len(KINDS) * len(ERRORS)):
        verdict = verdict_on(table.readings(), believed())
        assert verdict.verdict != "identified", table
        assert not (verdict.certain or verdict.partial), table


@pytest.mark.parametrize("stated", [True, False])
def test_noise_decides_whether_anything_can_be_said(stated: bool) -> None:
    for noise, kind in ((0.03, "none"), (0.2, "unexplained")):
        table, scene = readings(seed=1, noise=noise)
        verdict = verdict_on(table if stated else unstated(table), scene)
        assert verdict.verdict == kind
        assert verdict.noise_percent == pytest.approx(100 * noise, rel=0.3)
        assert (verdict.doubt is not None) == (kind == "unexplained")


def test_none_says_what_would_have_been_seen_at_which_noise() -> None:
    """And names another effect where scattering and background are not asked for."""
    table, scene = readings(seed=1, noise=0.01)
    verdict = verdict_on(table, scene)
    sentence, fitted = verdict.sentence, verdict.ladder[-1].parameters["water.absorption_per_m"]
    (told,) = [line for line in as_text(verdict).splitlines() if line.startswith("fitted: ")]
    assert f"water.absorption_per_m = {fitted.value:.4g} ± {fitted.stderr:.2g}" in told
    assert "gain" not in told
    assert "At a noise of 1.1 % of a bright reading (its own part as stated), background above" in sentence
    tilt = verdict_on(unstated(table), scene, only=["beam_tilt"]).sentence
    assert "(its own part estimated from the scatter), beam tilt above" in tilt
    # A table that states 0.2 % of each reading and 1 % of each stay states no 1 % of each reading.
    quiet, scene = readings(seed=1, noise=0.002)
    stays = replace(quiet, budget=replace(quiet.budget, plane_gain_percent=1.0, position_mm=0.0))
    of_stays = verdict_on(stays, scene)
    assert of_stays.noise_percent is not None and of_stays.noise_percent > 0.9
    assert f"{of_stays.noise_percent:.2g} % of a bright reading (its own part " in of_stays.sentence
    nothing = verdict_on(table, scene, only=["beam_ellipticity"]).sentence
    assert "these readings say nothing of any" in nothing


@pytest.mark.parametrize(("levels", "kind"), [(3, "unexplained"), (400, "identified")])
def test_readings_in_few_steps_say_nothing(levels: int, kind: str) -> None:
    """Whatever error is stated: curves follow the steps, with gaps as large as one likes."""
    table, scene = readings({"detector.background": 0.03}, seed=1)
    step = table.value.max() / levels
    verdict = verdict_on(replace(table, value=np.round(table.value / step) * step), scene)
    assert verdict.verdict == kind
    if kind == "identified":
        assert verdict.effects == ["background"]
    else:
        assert verdict.found == [] and len(verdict.ladder) == 1 and "come in steps" in verdict.headline


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_places_across_in_centimetres_are_no_crash() -> None:
    """A gradient that is tried a hundred metres aside lets the light grow beyond all numbers."""
    x, y, z = np.meshgrid(np.linspace(-1.2, 1.2, 9), [-1.05, 0.0, 1.05], [1.0, 2.0, 4.0, 6.0], indexing="ij")
    x, y, z = x.ravel(), y.ravel(), z.ravel()
    far = np.sqrt(x**2 + y**2 + z**2)
    angle = np.degrees(np.arccos(z / far))
    value = np.exp(-np.log(2) * (angle / 16.0) ** 2 - 0.09 * far) * z / far**3
    table = Readings.from_arrays(
        x_m=100 * x,
        y_m=100 * y,
        z_m=z,
        value=value,
        stderr=0.005 * value + 1e-4 * value.max(),
        scale="relative",
    )
    believed = Scene.from_dict({"lamp": {"hwhm_deg": 16.5}, "water": {"absorption_per_m": 0.09}})
    verdict = verdict_on(table, believed, only=["water_gradient", "beam_tilt"])
    assert verdict.verdict == "unexplained" and "do not look like a beam" in verdict.headline


def test_readings_that_are_the_same_everywhere_show_no_lamp() -> None:
    """Constant to 1 %: a detector that is stuck, though a saturated one would explain it too."""
    table, scene = readings(seed=1)
    value = 1 + 0.01 * np.random.default_rng(2).standard_normal(len(table))
    verdict = verdict_on(replace(table, value=value, stderr=np.full(len(table), 0.01)), scene)
    assert verdict.verdict == "unexplained"
    assert "do not change from place to place" in verdict.sentence


def test_values_that_vary_are_not_said_to_be_the_same_everywhere() -> None:
    """Drawn at random over a factor of a hundred: no beam, and no constant either."""
    table, scene = readings(seed=1)
    value = np.exp(np.random.default_rng(2).standard_normal(len(table)))
    few = ["background", "beam_tilt", "saturation"]
    verdict = verdict_on(replace(table, value=value, stderr=0.005 * value), scene, only=few)
    assert verdict.verdict == "unexplained"
    assert "do not change" not in verdict.sentence
    assert "everywhere tells them as well as the model" in verdict.sentence


def test_water_that_amplifies_is_no_water() -> None:
    """Light that grows by 0.5 % per metre: nothing is ruled out at an absorption that cannot be less."""
    clear = {"water.absorption_per_m": 0.0}
    table, scene = readings(clear, seed=1, factor=lambda t: np.exp(0.005 * (t.z_m - 4.5)))
    verdict = verdict_on(table, scene, only=["beam_tilt"])
    assert verdict.verdict == "unexplained"
    assert "water.absorption_per_m = 0" in verdict.sentence


@pytest.mark.parametrize("seed", [0, 4, 5])
def test_clear_water_is_water(seed: int) -> None:
    """No absorption: half of the fits end at the bound, and nothing is wrong with that."""
    verdict = verdict_on(*readings({"water.absorption_per_m": 0.0}, seed=seed))
    assert verdict.verdict == "none"
    assert verdict.ladder[0].parameters["water.absorption_per_m"].reason == "at boundary"


def test_the_page_of_the_benchmark_counts_what_was_said() -> None:
    row = {"kind": "uniform", "errors": "none", "draw": 0, "verdict": "identified", "sentence": "A beam."}
    text = page([row, row | {"verdict": "unexplained", "draw": 1}], "0")
    assert "**2 tables: 1 identified, 0 ambiguous, 0 none, 1 unexplained, 0 error.**" in text
    assert "| uniform, errors none, 0 | A beam. |" in text


@pytest.mark.parametrize(("large", "followed"), [(0.01, 0.07), (0.1, 0.01)])
def test_what_a_fit_leaves_of_the_floor_is_what_fits_leave(large: float, followed: float) -> None:
    """Of eight numbers, to readings of which some may have large errors: as of many draws of the noise."""
    rng = np.random.default_rng(1)
    model, counted = np.ones(60), np.arange(60) < 50
    floor = np.where(np.arange(60) % 20, 0.01, large)
    slopes = rng.standard_normal((60, 8)) / floor[:, None]
    fit = SimpleNamespace(jacobian=slopes, at_bound=lambda: np.zeros(8, bool), prediction=model)
    noise = rng.standard_normal((60, 4000))
    basis = np.linalg.qr(slopes)[0]
    left = floor[:, None] * (noise - basis @ (basis.T @ noise))
    drawn = 100 * np.sqrt(np.mean(left[counted] ** 2, axis=0))
    rms, chance = left_by_fit(floor, cast(Any, fit), counted)
    assert rms == pytest.approx(np.sqrt(np.mean(drawn**2)), rel=0.05)
    assert chance == pytest.approx(drawn.std(), rel=0.25)
    assert 1 - rms / rms_over(floor[counted], model[counted]) == pytest.approx(followed, rel=0.3)
