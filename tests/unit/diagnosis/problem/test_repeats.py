"""Gain errors between visits, estimated from readings repeated at one place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from analytic_readings import readings, scene

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.problem.layout import layout_of
from lightfield.diagnosis.problem.repeats import plane_gain_error, repeats_of
from lightfield.diagnosis.problem.setup import PLANE_GAIN_PERCENT, budget_of
from lightfield.readings import Readings

ASSUMED = PLANE_GAIN_PERCENT / 100


def repeated(gain: float, visits: int, seed: int, drift: float = 0.0, error: float = 0.001) -> Readings:
    """A reference position read `visits` times, with another plane read in between."""
    rng = np.random.default_rng(seed)
    n = 2 * visits
    here = np.arange(n) % 2 == 0
    true = np.where(here, 1.0, 0.4) * (1 + gain * rng.standard_normal(n) + drift * np.linspace(0, 1, n))
    return Readings.from_arrays(
        z_m=np.where(here, 4.5, 6.5), value=true * (1 + error * rng.standard_normal(n)), stderr=error * true,
        time_s=60.0 * np.arange(n), role=np.where(here, "reference", "signal"),
    )  # fmt: skip


def estimate(table: Readings) -> float:
    found = repeats_of(table)
    assert found is not None and found.reference
    return plane_gain_error(found, ASSUMED)


@pytest.mark.parametrize("gain", [0.002, 0.01])
def test_the_gain_is_found_beyond_the_stated_errors(gain: float) -> None:
    """Variances are unbiased but for the pull of one degree of freedom (here of 11) to the assumed 0.3 %."""
    found = np.array([estimate(repeated(gain, 12, seed)) for seed in range(60)])
    dof = 11
    expected = (dof * gain**2 + ASSUMED**2) / (dof + 1)
    # A variance from 10 degrees of freedom scatters by sqrt(2/10); the reading error adds its own.
    scatter = np.sqrt(2 / 10) * (gain**2 + 0.001**2) / np.sqrt(60)
    assert abs((found**2).mean() - expected) < 4 * scatter


def test_repeats_that_agree_lower_the_assumed_gain() -> None:
    found = np.array([estimate(repeated(0.0, 12, seed)) for seed in range(20)])
    assert np.sqrt((found**2).mean()) < ASSUMED / 2


def test_a_drift_of_the_lamp_is_not_called_repositioning() -> None:
    """1 % in a straight line over ten visits: an effect to be found, which must not widen the errors."""
    found = [estimate(repeated(0.0, 10, seed, drift=0.01)) for seed in range(20)]
    assert np.median(found) < 0.0015


def test_water_that_drifts_is_not_called_repositioning() -> None:
    """A near and a far reference, of which the far one falls by 10 % and the near one by 3 %."""
    found = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        near, part = np.arange(12) % 2 == 0, np.linspace(0, 1, 12)
        true = np.where(near, 1.0, 0.2) * np.exp(-np.where(near, 0.03, 0.10) * part)
        table = Readings.from_arrays(
            z_m=np.where(near, 1.5, 5.0), value=true * (1 + 0.001 * rng.standard_normal(12)),
            stderr=0.001 * true, time_s=600 * np.arange(12), role=np.full(12, "reference"),
        )  # fmt: skip
        found.append(estimate(table))
    assert np.median(found) < 0.0015


@pytest.mark.parametrize("drift", [0.0, 0.1])
def test_three_visits_tell_a_drift_from_repositioning(drift: float) -> None:
    """At start, in the middle and at the end, as one is advised to: 10 % in a straight line is the lamp."""
    found = np.array([estimate(repeated(0.0, 3, seed, drift=drift)) for seed in range(40)])
    assert np.sqrt((found**2).mean()) < ASSUMED


def test_a_lamp_that_warms_up_is_not_called_repositioning() -> None:
    """12 % in a tenth of the time, over ten visits."""
    found = []
    for seed in range(20):
        table = repeated(0.002, 10, seed)
        warm = 1 - 0.12 * np.exp(-np.linspace(0, 1, len(table)) / 0.15)
        found.append(estimate(replace(table, value=table.value * warm, stderr=table.stderr * warm)))
    assert 0.0015 < np.sqrt(np.mean(np.square(found))) < 0.004


def test_repeats_without_errors_count_beside_others_that_state_them() -> None:
    """A reading of one spectrum has no error of its own; those of two spectra say how large it is."""
    table = repeated(0.01, 12, 3)
    stderr = np.where(np.arange(len(table)) % 6 == 0, table.stderr, np.nan)
    assert estimate(replace(table, stderr=stderr)) == pytest.approx(estimate(table), rel=0.2)
    found = repeats_of(replace(table, stderr=stderr))
    assert found is not None and found.visits == 12


def test_one_bad_reading_does_not_set_the_gain() -> None:
    table = repeated(0.002, 12, 1)
    value = np.array(table.value)
    value[4] *= 1.2
    assert estimate(replace(table, value=value)) < 0.004


def test_two_visits_say_nothing_and_a_stated_gain_is_kept() -> None:
    table = repeated(0.01, 2, 0)
    assert repeats_of(table) is None
    assert "plane_gain_percent = 0.3 for every stay" in str(budget_of(table).assumed[0])
    three = repeated(0.01, 3, 0)
    told = budget_of(three)
    assert told.gain_stated and told.plane_gain == pytest.approx(estimate(three))
    shown = f"plane_gain_percent = {100 * estimate(three):.2g} from 3 repeats of the reference position"
    assert str(told.assumed[0]) == shown
    stated = replace(three, budget=replace(three.budget, plane_gain_percent=0.1))
    assert budget_of(stated).plane_gain == pytest.approx(0.001)


@pytest.mark.parametrize(("known", "named"), [(0, True), (3, True), (4, False)])
def test_too_few_standard_errors_are_as_good_as_none(known: int, named: bool) -> None:
    table = repeated(0.01, 3, 0)
    stderr = np.where(np.arange(len(table.value)) < known, table.stderr, np.nan)
    assumed = budget_of(replace(table, stderr=stderr)).assumed
    assert any(str(one).startswith("stderr = 1 %") for one in assumed) is named


def test_readings_of_one_visit_are_not_repeats_of_it() -> None:
    """Four readings in a row share the visit's gain and cannot show it; a visit column decides."""
    table, _ = readings(seed=3)
    assert repeats_of(table) is None, "every position is read once"
    n = 8
    columns = {"z_m": np.full(n, 4.5), "value": np.ones(n), "stderr": np.full(n, 0.01)}
    in_a_row = Readings.from_arrays(**columns, time_s=np.arange(n) * 10.0)
    assert repeats_of(in_a_row) is None
    named = Readings.from_arrays(**columns, time_s=np.arange(n) * 10.0, visit=np.arange(n) // 2)
    found = repeats_of(named)
    assert found is not None and found.visits == 4


def three_at_once(seed: int, apart_s: float) -> Readings:
    """A lamp 4 cm aside, read three times at every place at times so far apart: by a formula of its own."""
    rng = np.random.default_rng(seed)
    x, z = (a.ravel() for a in np.meshgrid(np.linspace(-0.9, 0.9, 11), np.arange(4.5, 9.0), indexing="ij"))
    at = rng.permutation(len(x)).repeat(3)
    x, z, repeat = x[at], z[at], np.tile(np.arange(3), 55)
    r = np.hypot(x - 0.04, z)
    light = np.exp2(-((np.degrees(np.arctan2(x - 0.04, z)) / 4) ** 2)) * z / r**3 * np.exp(-0.12 * r)
    value = light / light.max()
    stderr = np.hypot(0.005 * value, 8e-4)
    return Readings.from_arrays(
        x_m=x, z_m=z, value=value + stderr * rng.standard_normal(len(x)), stderr=stderr, repeat=repeat,
        time_s=60.0 * np.arange(55).repeat(3) + apart_s * repeat, quantity="irradiance",
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(3))
def test_repeats_of_one_time_tell_as_much_as_those_of_three(seed: int) -> None:
    """Each has noise of its own, also where the noise of neighbours in the scan goes together a little."""
    sizes = []
    for apart_s in (0.0, 2.0):
        table = three_at_once(seed, apart_s)
        verdict = diagnose(table, scene(), diffuse=None, only=["beam_offset", "background"]).verdict
        assert (verdict.verdict, verdict.effects) == ("identified", ["beam_offset"])
        assert verdict.ladder[-1].chi2_per_dof == pytest.approx(1, abs=4 * np.sqrt(2 / len(table)))
        sizes.append(verdict.found[0].parameters["lamp.offset_x_m"])
    one, other = sizes
    assert one.value == pytest.approx(other.value, abs=0.05 * other.stderr)
    assert one.stderr == pytest.approx(other.stderr, rel=0.1) and abs(one.value - 0.04) < 4 * one.stderr


def test_no_two_readings_of_a_band_share_a_place_in_the_scan_and_bands_of_a_spectrum_do() -> None:
    n = 4
    table = Readings.from_arrays(
        x_m=[0.1, 0.2] * 2 * n, z_m=4.0, value=[1.0] * 16, stderr=0.01, repeat=[0, 0, 1, 1] * n,
        wavelength_nm=np.repeat([450.0, 550.0], 2 * n), time_s=np.tile(np.repeat([0.0, 9.0], 4), 2),
    )  # fmt: skip
    layout = layout_of(table)
    # At one time by place, there by repeat: 0.1 m and its repeat, 0.2 m and its repeat.
    one = np.array([0, 2, 1, 3, 4, 6, 5, 7])
    np.testing.assert_array_equal(layout.position, np.r_[one, one])


@pytest.mark.parametrize("visits", [5, 6, 8])
@pytest.mark.parametrize("wild", [1, 2, 3])
def test_a_wild_visit_of_few_does_not_set_the_gain(visits: int, wild: int) -> None:
    """By 16 of its errors, among visits that agree: least squares bent to it, and 3 to 5 % were told."""
    found = []
    for seed in range(20):
        table = repeated(0.0, visits, seed, error=0.006)
        value = np.array(table.value)
        value[2 * wild] *= 0.9
        found.append(estimate(replace(table, value=value)))
    assert np.median(found) < ASSUMED
