"""Residuals by plane where there are planes, else by bins of distance; a dark model has none in per cent."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from analytic_readings import readings

from lightfield.api.light.compare import Fit
from lightfield.diagnosis import ledger
from lightfield.diagnosis.verdict.ladder import bright, percent
from lightfield.formula.closed_form import direct_field
from lightfield.formula.scattered.scattered_field import ScatteredField
from lightfield.readings import Readings
from lightfield.render.diffuse.source import response_for
from lightfield.report.compare.readings_page import readings_page
from lightfield.scene import Scene
from lightfield.studies.compare import readings as fitting
from lightfield.studies.compare.readings import FitReport, fit_readings
from lightfield.studies.compare.residuals import MOST_PLANES, _groups
from lightfield.studies.compare.text import as_data, as_text

refitted = fitting._refit


def problem(z_m: np.ndarray) -> Any:
    n = z_m.size
    layout = SimpleNamespace(
        air=np.zeros(n, bool), z_m=z_m, x_m=np.linspace(-1, 1, n), y_m=np.zeros(n), channel=np.zeros(n, int),
        has_time=False,
    )  # fmt: skip
    return SimpleNamespace(layout=layout)


def test_planes_are_told_one_by_one():
    told = _groups(problem(np.repeat([3.0, 4.0, 5.0], 7)))
    assert [label for label, _ in told["plane"]] == ["z = 3 m", "z = 4 m", "z = 5 m"]
    assert "distance" not in told


@pytest.mark.parametrize("count", [MOST_PLANES + 1, 97])
def test_single_places_are_told_in_bins_that_hold_each_reading_once(count):
    z_m = np.random.default_rng(1).uniform(2, 9, count)
    told = _groups(problem(z_m))
    assert not told["plane"] and len(told["distance"]) == 5
    members = np.array([rows for _, rows in told["distance"]])
    assert (members.sum(axis=0) == 1).all()
    assert members.sum(axis=1).min() >= count // 5 - 1


@pytest.fixture(scope="module")
def unlit() -> FitReport:
    """What is reported of a model that is dark beside the axis, and of next to no light on it."""
    table, scene = readings({}, seed=3)
    with pytest.MonkeyPatch.context() as patch:

        def darkened(*given: Any) -> Any:
            refit, *rest = refitted(*given)
            dark = np.where(np.abs(table.x_m) > 0.05, 0.0, 1e-300)
            return replace(refit, fit=replace(refit.fit, prediction=dark)), *rest

        patch.setattr(fitting, "_refit", darkened)
        patch.setattr(fitting, "held_out", lambda p, *given: percent(p, 0 * p.value, bright(p)))
        with np.errstate(divide="raise", invalid="raise", over="raise"):
            return fit_readings(table, scene, diffuse=None)


def test_a_dark_model_has_no_errors_in_per_cent_and_is_told_as_valid_json(unlit: FitReport) -> None:
    left = unlit.residuals
    assert np.isnan(left.percent[unlit.model.fit.prediction == 0]).all() and np.isfinite(left.sigma).all()
    of_groups = [row.rms_percent for rows in left.where.values() for row in rows]
    assert of_groups and not np.isinf([*left.percent, *of_groups]).any()
    data = json.loads(json.dumps(as_data(unlit), allow_nan=False))
    assert data["error_percent"] is None and data["noise_floor_percent"] is None
    assert None in data["residual_percent"]
    assert "nan" not in as_text(unlit) and "inf" not in as_text(unlit)
    assert Fit(unlit).headline.startswith("base is dark where the readings are bright, chi-square")


@pytest.mark.usefixtures("undrawn")
def test_the_page_and_the_ledger_of_a_dark_model_have_dashes(unlit: FitReport, tmp_path: Path) -> None:
    unlit.save(tmp_path)
    (line,) = (tmp_path / ledger.NAME).read_text(encoding="utf-8").splitlines()
    assert "NaN" not in line and json.loads(line)["error_percent"] is None
    page = readings_page(unlit, ledger.entries(tmp_path), "dark")
    assert "The first model of these readings." in page and "1 models" not in page
    assert "base: error – %, noise floor – %." in page and "nan" not in re.sub("<svg.*?</svg>", "", page)


@pytest.mark.usefixtures("undrawn")
def test_the_page_says_how_to_go_on_where_something_is_missing(unlit: FitReport, tmp_path: Path) -> None:
    for _ in range(2):
        unlit.save(tmp_path)
    for p, said in ((0.001, True), (0.3, False)):
        report = replace(unlit, statistics=replace(unlit.statistics, adequacy_p=p))
        page = readings_page(report, ledger.entries(tmp_path), "again")
        assert "2 models of these readings so far" in page
        assert ("of the same readings and scene looks for what it is" in page) == said
        words = "something is missing" if said else "no sign that anything is missing"
        assert f"adequacy p        = {p:.3f}  ({words})" in as_text(report)


def test_a_fit_that_was_stopped_says_how_far_it_had_to_go() -> None:
    """One that is taken five errors beside its end: chi-square would fall by what a parabola says."""
    table, scene = readings({}, seed=3)
    whole = fit_readings(table, scene, diffuse=None)
    assert whole.model.fit.converged and as_data(whole)["converged"]
    at = whole.model.fit
    k = at.paths.index("water.absorption_per_m")
    away = 5.0 * np.sqrt(np.diag(at.covariance()))[k] * (np.arange(len(at.u)) == k)
    stopped = replace(at, u=at.u + away, residual=at.residual - at.jacobian @ away, converged=False)
    found = fitting._not_converged(stopped)
    assert found.values["gain"] == pytest.approx(float(away @ at.jacobian.T @ at.jacobian @ away), rel=0.05)
    assert "one step more would lower chi-square by" in found.sentence and "-o writes" in found.sentence


def test_the_noise_floor_knows_nothing_of_light_that_the_fit_does_not_rest_on() -> None:
    """Readings good to 0.5 % in water that scatters: the light of the search is known to 0.6 %, that which
    the fit ends with to 0.1 %."""
    scene = Scene.from_dict({
        "lamp": {"hwhm_deg": 6.0}, "water": {"absorption_per_m": 0.1, "scattering_per_m": 0.2},
    })  # fmt: skip
    x, z = (v.ravel() for v in np.meshgrid(np.linspace(-0.8, 0.8, 7), [4.5, 5.5, 6.5, 7.5]))
    light = direct_field(scene, x, 0 * x, z) + ScatteredField(x, 0 * x, z).light(scene, [None])[0]
    noise = 0.005 * light
    table = Readings.from_arrays(
        x_m=x, y_m=0 * x, z_m=z, value=light + noise * np.random.default_rng(1).standard_normal(len(x)),
        stderr=noise, time_s=20.0 * np.arange(len(x)), quantity="irradiance",
    )  # fmt: skip
    exact = replace(table.budget, plane_gain_percent=0.0, position_mm=0.0, tolerance_percent=0.0)
    made = fit_readings(replace(table, budget=exact), scene, diffuse=partial(response_for, photons=300_000))
    assert made.statistics.noise_floor_percent == pytest.approx(0.5, rel=0.15)
    assert made.residuals.sigma == pytest.approx((table.value - made.model.fit.prediction) / noise, rel=0.3)


def test_readings_that_are_said_to_be_left_out_are(tmp_path: Path) -> None:
    """Beyond the angles that the lamp's table knows: "85 of 85 used", and "4 of 85 are left out"."""
    angle = np.linspace(0, 12, 61)
    rows = "".join(f"{a},{np.exp(-np.log(2) * (a / 5) ** 2)},{0.0 if a < 9 else 0.1}\n" for a in angle)
    (tmp_path / "lamp.csv").write_text(f"angle_deg,intensity,error_1\n{rows}")
    lamp = {"profile": "table", "intensity_table": str(tmp_path / "lamp.csv")}
    scene = Scene.from_dict({"lamp": lamp, "water": {"absorption_per_m": 0.1}})
    at, z = (v.ravel() for v in np.meshgrid(np.radians(np.linspace(-10, 10, 11)), [2.0, 3.0, 4.0]))
    x, rng = z * np.tan(at), np.random.default_rng(1)
    light = direct_field(scene, x, 0 * x, z)
    value = light / light.max() * (1 + 0.005 * rng.standard_normal(x.size))
    table = Readings.from_arrays(x_m=x, z_m=z, value=value, stderr=0.005 * value, quantity="irradiance")
    told = as_text(fit_readings(table, scene))
    left_out = int((np.abs(at) > np.radians(8)).sum())
    assert f"readings used     = {33 - left_out} of 33" in told
    assert f"{left_out} of 33 readings are left out" in told
