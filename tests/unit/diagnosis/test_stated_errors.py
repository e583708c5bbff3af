"""Stated errors are believed where an effect explains the readings, however far the base model misses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from analytic_readings import readings, scene

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.verdict.cautions.caution import Warns
from lightfield.diagnosis.verdict.next_measurement import Asks
from lightfield.diagnosis.verdict.parts import DoubtReason
from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
from lightfield.scene import Scene
from lightfield.studies.compare.readings import fit_readings

SCENE = {"lamp": {"hwhm_deg": 6.0}, "water": {"absorption_per_m": 0.13}}


def very_lopsided(seed: int) -> Readings:
    """A beam that is a fifth wider towards 56 degrees from x: chi-square of the base model 200,000."""
    rng = np.random.default_rng(seed)
    row = [(0.0, y) for y in np.linspace(-0.5, 0.5, 11)]
    row += [(x, y) for x in (-0.3, -0.15, 0.15, 0.3) for y in np.linspace(-0.4, 0.4, 5)]
    places = np.array([(x, y, z) for z in (1.0, 1.5, 2.0, 2.8, 3.6) for x, y in row])
    rng.shuffle(places)
    often = [[*places[i : i + 12], (0.0, 0.0, 2.0)] for i in range(0, len(places), 12)]
    x, y, z = np.array([place for some in often for place in some]).T
    far = np.sqrt(x**2 + y**2 + z**2)
    wider = 1 + 0.2 * np.cos(np.arctan2(y, x) - 0.5 * np.pi + 0.6)
    beam = np.exp(-np.log(2) * (np.degrees(np.arccos(z / far)) / (6 * wider)) ** 2)
    value = beam * np.exp(0.15 * (1 - far)) * z / far**3
    sigma = np.hypot(0.004 * value, 3e-4)
    return Readings.from_arrays(
        x_m=x, y_m=y, z_m=z, value=value + sigma * rng.normal(size=len(x)), stderr=sigma, scale="relative",
        time_s=20.0 * np.arange(len(x)), plane_gain_percent=0.0, position_mm=0.0,
    )  # fmt: skip


#: The base model, which the errors were once judged about, is the same with a few effects and with all.
FEW = ["beam_asymmetry", "beam_tilt", "beam_offset", "beam_ellipticity", "background"]


@pytest.mark.parametrize(
    ("seed", "only"),
    [
        pytest.param(0, FEW, id="0, few"),
        *(pytest.param(seed, None, id=str(seed), marks=pytest.mark.slow) for seed in (0, 3)),
    ],
)
def test_errors_are_judged_about_what_explains_the_readings(seed: int, only: list[str] | None) -> None:
    """Beside the base model alone the scatter of its misfit once passed for that of the readings."""
    verdict = diagnose(
        very_lopsided(seed), Scene.from_dict(SCENE), diffuse=None, only=only, advise=False
    ).verdict
    assert verdict.best_set == ["beam_asymmetry"]
    assert 0.6 < verdict.variance_scale < 1.6
    of_errors = {Warns.ERRORS_DOUBTED, Warns.SCATTER_MORE, Warns.SCATTER_LESS}
    assert not of_errors & {caution.warns for caution in verdict.cautions}


@pytest.mark.parametrize(("times", "said"), [(1.0, False), (2.0, True)])
@pytest.mark.parametrize("seed", [0, 2, 3])
def test_errors_that_are_stated_twice_too_large_are_told(seed: int, times: float, said: bool) -> None:
    """By formulas of their own: a lamp that grows by a fifth in an hour, six planes of 9 readings."""
    rng = np.random.default_rng(seed)
    x, z = np.meshgrid(np.linspace(-0.8, 0.8, 9), (2.5, 3.5, 4.5, 5.5, 6.5, 7.5))
    order = rng.permutation(54)
    x, z = x.ravel()[order], z.ravel()[order]
    r, hour = np.hypot(x, z), np.arange(54) / 120
    value = np.exp(-np.log(2) * (np.degrees(np.arctan2(x, z)) / 6) ** 2) * z / r**3 * np.exp(-0.12 * r)
    value *= (1 + 0.2 * hour) / value.max()
    sigma = np.hypot(0.005 * value, 5e-4)
    table = Readings.from_arrays(
        x_m=x, y_m=0 * x, z_m=z, value=value + sigma * rng.standard_normal(54), stderr=times * sigma,
        time_s=3600 * hour, plane_gain_percent=0.0, position_mm=0.0,
    )  # fmt: skip
    verdict = diagnose(table, Scene.from_dict(SCENE), diffuse=None, advise=False).verdict
    assert verdict.best_set == ["lamp_drift"]
    assert (Warns.SCATTER_LESS in {caution.warns for caution in verdict.cautions}) == said


def test_two_laws_of_the_scatter_do_not_call_for_each_other_for_ever() -> None:
    """Five bands at 25 places that are off by 1 cm, errors of 0.2 % stated: what the scatter tells of them is
    told once. Each of two laws was another's contradiction, and the fit ended in a recursion."""
    rng, off_m, wave = np.random.default_rng(5), 0.01, np.array([450.0, 480.0, 510.0, 540.0, 570.0])
    bands = [[w - 5, w + 5] for w in wave.tolist()]
    water = {"base": "pure", "absorption_per_m": 0.05}
    scene = Scene.from_dict({"lamp": {"hwhm_deg": 8.0}, "water": water, "detector": {"bands_nm": bands}})
    x, z = (v.ravel() for v in np.meshgrid(np.linspace(-0.3, 0.3, 5), np.linspace(1.5, 4.5, 5)))
    place = np.repeat(np.stack([x, 0 * x, z]), 5, axis=1)
    stood = place + np.repeat(off_m * rng.standard_normal((3, 25)), 5, axis=1)
    value = direct_field(scene, *stood, np.tile(wave, 25)) * (1 + 0.002 * rng.standard_normal(125))
    table = Readings.from_arrays(
        x_m=place[0], z_m=place[2], wavelength_nm=np.tile(wave, 25), value=value, stderr=0.002 * value,
        time_s=np.repeat(20.0 * rng.permutation(25), 5), position_mm=1000 * off_m, plane_gain_percent=0.0,
        tolerance_percent=0.0,
    )  # fmt: skip
    found = fit_readings(table, scene).model.fit
    assert found.values["lamp.hwhm_deg"] == pytest.approx(8.0, abs=3.5 * found.stderr()["lamp.hwhm_deg"])


@pytest.mark.parametrize("noise", [0.0, 0.005], ids=["without noise", "as of an instrument"])
def test_errors_that_no_instrument_has_give_way_to_assumed_ones(noise: float) -> None:
    """A slip of a unit made them a thousandth of the scatter, and more: the search found no end. Readings
    without noise, as of another program, were told apart to the last digit until numbers failed."""
    believed = scene()
    truth = believed.with_values({"detector.background": 2e-3, "water.absorption_per_m": 0.104})
    rng = np.random.default_rng(2)
    z, x = (a.ravel() for a in np.meshgrid(np.linspace(4.5, 8.5, 5), np.linspace(-0.9, 0.9, 13)))
    light = direct_field(truth, x, 0 * x, z)
    value = light / light.max() + 2e-3
    table = Readings.from_arrays(
        x_m=x, y_m=0 * x, z_m=z, value=value * (1 + noise * rng.standard_normal(len(x))),
        stderr=1e-6 * value, time_s=20.0 * rng.permutation(len(x)), position_mm=0.0,
    )  # fmt: skip
    verdict = diagnose(table, believed, diffuse=None).verdict
    assert verdict.effects == ["background"] and not verdict.errors_stated
    size = verdict.found[0].parameters["detector.background"]
    assert size.stderr is not None and abs(size.value - 2e-3) < 3 * size.stderr
    assert any("less than those of any instrument" in text for text in verdict.check_first)
    assert any(text.startswith("stderr = 1 % of the reading") for text in verdict.assumed)
    of_errors = {Warns.ERRORS_DOUBTED, Warns.SCATTER_MORE, Warns.SCATTER_LESS}
    assert not of_errors & {caution.warns for caution in verdict.cautions}


@pytest.mark.parametrize("stated", [None, 1e-3])
@pytest.mark.parametrize(
    ("offset_m", "background", "found"),
    [(0.0, 0.0, []), (0.03, 0.01, ["background", "beam_offset"])],
    ids=["nothing", "two effects"],
)
def test_readings_without_noise_are_told_like_others(
    stated: float | None, offset_m: float, background: float, found: list[str]
) -> None:
    """By a formula written here, plane by plane; errors blank, or of a tenth of a per cent. Scatter of 1e-15
    was once taken for the noise: rounding asked for nine effects, or no covariance had a root."""
    x, z = (v.ravel() for v in np.meshgrid(np.linspace(-0.9, 0.9, 13), np.arange(1.5, 6.0), indexing="xy"))
    far = np.hypot(x - offset_m, z)
    beam = np.exp(-np.log(2) * (np.degrees(np.arccos(z / far)) / 9.0) ** 2)
    value = beam * np.exp(-0.12 * far) * z / far**3
    value = value / value.max() + background
    stderr = np.full(len(x), np.nan) if stated is None else stated * value
    readings = Readings.from_arrays(
        x_m=x, z_m=z, value=value, stderr=stderr, scale="relative", time_s=20.0 * np.arange(len(x))
    )
    believed = Scene.from_dict({"lamp": {"hwhm_deg": 9.5}, "water": {"absorption_per_m": 0.13}})
    only = ["background", "beam_offset", "beam_tilt", "beam_asymmetry", "water_drift", "beam_profile"]
    verdict = diagnose(readings, believed, diffuse=None, only=only, advise=False).verdict
    assert verdict.verdict == ("identified" if found else "none")
    assert sorted(verdict.best_set) == found


@pytest.mark.parametrize(
    ("times", "hidden", "found"),
    [
        (10.0, {}, []),
        (3.0, {"lamp.offset_x_m": 0.03, "detector.background": 0.01}, ["beam_offset", "background"]),
    ],
)
def test_scatter_that_no_effect_makes_is_no_structure(times: float, hidden: dict, found: list[str]) -> None:
    """Errors of a mean of many readings, say: it was laid to the angle, or to a plane, after minutes."""
    table, believed = readings(hidden, seed=1)
    verdict = diagnose(replace(table, stderr=table.stderr / times), believed, diffuse=None).verdict
    assert (verdict.verdict, verdict.best_set, verdict.unexplained_coordinate) == ("unexplained", found, None)
    assert verdict.reason_to_doubt is not None and verdict.reason_to_doubt.reason is DoubtReason.SCATTER
    assert verdict.reason_to_doubt.times == pytest.approx(times, rel=0.2)
    assert verdict.variance_scale == pytest.approx(times**2, rel=0.4)
    assert set(verdict.partial) == set(found)
    assert ("In errors as large as that no effect is missing." in verdict.sentence) == (not found)
    assert verdict.next_measurement is not None and verdict.next_measurement.asks is Asks.IN_A_ROW


def test_scatter_in_time_is_laid_to_the_time() -> None:
    """A lamp whose power wanders by 5 % within minutes, read in random order: no error of single readings."""
    rng = np.random.default_rng(8)

    def wandering(table: Readings) -> np.ndarray:
        order, walk = np.argsort(table.time_s), np.empty(len(table))
        state, kept = 0.0, np.exp(-np.diff(np.sort(table.time_s), prepend=0.0) / 100.0)
        for at, part in zip(order, kept, strict=True):
            state = part * state + np.sqrt(1 - part**2) * rng.standard_normal()
            walk[at] = state
        return np.exp(0.05 * walk)

    table, believed = readings(seed=1, factor=wandering)
    verdict = diagnose(table, believed, diffuse=None).verdict
    assert (verdict.verdict, verdict.unexplained_coordinate) == ("unexplained", "time")
