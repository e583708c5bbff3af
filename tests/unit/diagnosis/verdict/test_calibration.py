"""On an absolute scale the gain is known: another lamp power is an effect, and a hundredfold no "none"."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from analytic_readings import readings

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.plan import plan
from lightfield.diagnosis.verdict.cautions.caution import Warns
from lightfield.errors import MeasurementError, UsageError
from lightfield.fitting.forward import SceneForward
from lightfield.readings import read_table, write_table
from lightfield.readings.columns import ErrorBudget
from lightfield.readings.readings import Readings
from lightfield.scene import Scene
from lightfield.scene.bands import over_bands
from lightfield.studies.compare.readings import fit_readings

UNIT = "uW/cm^2/nm"


def absolute(factor: float = 1.0, seed: int = 1, **hidden: Any) -> tuple[Readings, Scene]:
    """Readings in the light of the scene's lamp, times a factor."""
    table, scene = readings(hidden, seed=seed)
    table = replace(table, scale="absolute", units=UNIT)
    truth = scene.with_values({"lamp.hwhm_deg": 4.6, "water.absorption_per_m": 0.12 * 0.87, **hidden})
    light = SceneForward(truth, table).predict({})
    gain = factor * float(light @ table.value / (table.value @ table.value))
    return replace(table, value=gain * table.value, stderr=gain * table.stderr), scene


def test_absolute_light_is_the_lamps_power_over_its_solid_angle() -> None:
    """On the axis at 2 m in clear water: E = P(lambda) / (solid angle z^2), by Planck's law and a narrow
    Gaussian's solid angle pi hwhm^2 / ln 2, in uW/cm^2/nm = 0.01 W/m^2/nm."""
    table = Readings.from_arrays(z_m=[2.0, 3.0], value=[1.0, 1.0], scale="absolute", units=UNIT)
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 2.0, "power_w": 80.0, "temperature_k": 3000.0}})
    wavelength, kelvin = 525e-9, 3000.0
    planck = 2 * math.pi * 6.62607015e-34 * 299792458.0**2 / wavelength**5
    planck /= math.expm1(6.62607015e-34 * 299792458.0 / (wavelength * 1.380649e-23 * kelvin))
    per_nm = 80.0 * planck / (5.670374419e-8 * kelvin**4) * 1e-9
    expected = per_nm / (math.pi * math.radians(2.0) ** 2 / math.log(2)) / np.array([2.0, 3.0]) ** 2 / 0.01
    light = SceneForward(scene, table.check_against(scene)).predict({})
    assert light == pytest.approx(expected, rel=2e-3), "the narrow beam's solid angle is right to hwhm^2"


@pytest.mark.parametrize("factor", [1e-3, 1e-2, 0.4, 100.0])
def test_another_lamp_power_is_found(factor: float) -> None:
    """Also where W are taken for uW: near the lower end of its range it has an error, and is no edge."""
    verdict = diagnose(*absolute(factor), diffuse=None, advise=False).verdict
    assert (verdict.verdict, verdict.effects) == ("identified", ["lamp_power"])
    power = verdict.explanations[0].parameters["lamp.power_w"]
    assert power.value == pytest.approx(50 * factor, rel=0.05)
    assert power.stderr == pytest.approx(0.1 * power.value, rel=0.05), "mostly of the calibration"
    assert verdict.base_p < 0.01
    assert "Your scene's lamp power is contradicted" in verdict.sentence
    assert any(f"{factor:.3g}"[:2] in w and "times what the scene's lamp" in w for w in verdict.warnings)
    assert not [c for c in verdict.cautions if c.warns is Warns.AT_BOUNDARY]


@pytest.mark.parametrize("percent", [3.0, 10.0])
def test_a_plan_says_which_power_would_be_seen(percent: float) -> None:
    """As the diagnosis then finds: that excess always, as it is 4.6 standard errors; half of them never."""
    table, scene = absolute()
    budget = ErrorBudget(calibration_percent=percent)
    limits = plan(replace(table, budget=budget), scene).limits
    seen = 1 + limits["lamp_power"].value / 50
    for factor, effects in ((seen, ["lamp_power"]), (seen**0.5, [])):
        readings = replace(absolute(factor)[0], budget=budget)
        assert diagnose(readings, scene, diffuse=None, advise=False).verdict.effects == effects


def test_a_plan_on_an_absolute_scale_is_that_on_a_relative_one_in_other_units() -> None:
    table, scene = absolute()
    size = len(table.x_m)
    layout = replace(table, value=np.ones(size), stderr=np.full(size, np.nan))
    one, other = (plan(replace(layout, scale=scale), scene).limits for scale in ("absolute", "relative"))
    assert set(one) == {*other, "lamp_power"}
    unit = SceneForward(scene, layout).predict({}).max()
    for name, limit in other.items():
        known = limit.value * (unit if name == "background" else 1.0)
        assert one[name].value == pytest.approx(known, rel=1e-3), name


def test_it_stands_beside_what_is_missing() -> None:
    few = ["lamp_power", "beam_tilt", "beam_offset", "background"]
    table, scene = absolute(30.0, **{"lamp.tilt_x_deg": 0.25})
    verdict = diagnose(table, scene, diffuse=None, only=few, advise=False).verdict
    assert (verdict.verdict, sorted(verdict.effects)) == ("identified", ["beam_tilt", "lamp_power"])
    assert [rung.label for rung in verdict.ladder] == ["base", "+ lamp_power", "+ beam_tilt"]
    assert "Beam tilt is missing" in verdict.sentence


@pytest.mark.parametrize("factor", [0.85, 1.0, 1.2])
def test_the_calibration_may_be_off_by_its_error(factor: float) -> None:
    verdict = diagnose(*absolute(factor), diffuse=None, advise=False).verdict
    assert verdict.verdict == "none"
    (lamp,) = verdict.stated
    assert (lamp.effect, lamp.judgement) == ("lamp_power", "supported")
    assert "calibration_percent = 10" in verdict.assumed


def test_a_better_calibration_says_more() -> None:
    table, scene = absolute(1.2)
    stated = replace(table, budget=ErrorBudget(calibration_percent=3.0))
    verdict = diagnose(stated, scene, diffuse=None, advise=False).verdict
    assert verdict.effects == verdict.best_set == verdict.simplest == ["lamp_power"]
    assert not any("calibration" in a for a in verdict.assumed)


def test_a_relative_scale_knows_no_power() -> None:
    table, scene = absolute(100.0)
    verdict = diagnose(replace(table, scale="relative"), scene, diffuse=None, advise=False).verdict
    assert (verdict.verdict, verdict.stated) == ("none", [])
    assert verdict.untestable["lamp_power"] == "the readings are on a relative scale"


def test_light_that_no_lamp_makes_is_an_error_of_the_unit() -> None:
    with pytest.raises(MeasurementError, match="check the units"):
        diagnose(*absolute(1e6), diffuse=None, advise=False)


@pytest.mark.slow
def test_by_hand_with_and_without() -> None:
    table, scene = absolute(100.0)
    free = fit_readings(table, scene)
    assert any("100 times what the scene's lamp" in note for note in free.notes)
    power = fit_readings(table, scene, ["lamp_power"])
    assert power.estimates["lamp.power_w"].value == pytest.approx(5000, rel=0.05)
    assert power.estimates["gain"].reason == "held"
    assert power.statistics.error_percent == pytest.approx(free.statistics.error_percent, rel=1e-3)
    with pytest.raises(UsageError, match="relative scale"):
        fit_readings(replace(table, scale="relative"), scene, ["lamp_power"])


def test_the_calibration_is_a_term_of_the_head(tmp_path) -> None:
    path = tmp_path / "r.csv"
    head = f'# scale = "absolute"\n# units = "{UNIT}"\n# calibration_percent = '
    path.write_text(head + "4\nz_m,value\n1,2\n")
    table = read_table(path)
    assert table.budget.calibration_percent == 4
    write_table(table, tmp_path / "again.csv")
    assert read_table(tmp_path / "again.csv").budget == table.budget
    path.write_text(head + "-1\nz_m,value\n1,2\n")
    with pytest.raises(MeasurementError, match="calibration_percent is impossible"):
        read_table(path)


def test_readings_of_a_band_are_means_over_it_and_not_of_its_middle() -> None:
    """A line of 5 nm at the middle of a band of 50: its mean there is a tenth of its peak, by the Gaussian's
    area over the width, sqrt(pi / ln 2) / 2 * 5 / 50."""
    table, scene = absolute()
    described = scene.to_dict()
    described["lamp"] = {**described.get("lamp", {}), "spectrum": {"peak_nm": 525.0, "fwhm_nm": 5.0}}
    described["detector"] = {**described.get("detector", {}), "bands_nm": [[500.0, 550.0]]}
    scene = Scene.from_dict(described)
    without = replace(table, wavelength_nm=np.full(len(table), np.nan), of_band=False)
    peak = replace(table, wavelength_nm=np.full(len(table), 525.0), of_band=False)
    mean, top = (SceneForward(scene, t.check_against(scene)).predict({}) for t in (without, peak))
    share = math.sqrt(math.pi / math.log(2)) / 2 * 5 / 50
    assert mean / top == pytest.approx(np.full(len(table), share), rel=1e-3)

    described["detector"] |= {"response": {"peak_nm": 527.0, "fwhm_nm": 8.0}}
    behind = Scene.from_dict(described)
    filtered = SceneForward(behind, without.check_against(behind)).predict({})
    own = over_bands(behind).intensity.mean() / over_bands(scene).intensity.mean()
    assert filtered / mean == pytest.approx(np.full(len(table), own), rel=1e-6), "as the maps of that band"

    read = replace(without, value=mean, stderr=0.004 * mean + 1e-6 * mean.max())
    assert diagnose(read, scene, diffuse=None, advise=False).verdict.verdict == "none"
    misread = replace(read, wavelength_nm=peak.wavelength_nm)
    told = diagnose(misread, scene, diffuse=None, advise=False).verdict
    assert told.effects == ["lamp_power"]
    assert any("if these readings are such, leave wavelength_nm out" in w for w in told.warnings)
