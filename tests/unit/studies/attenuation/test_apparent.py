"""Lines through the logarithms: what is set aside, and places beside the beam."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lightfield.errors import MeasurementError
from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
from lightfield.scene import Scene
from lightfield.studies.attenuation.apparent import apparent_attenuation
from lightfield.studies.attenuation.ratios import ratios_of
from lightfield.studies.attenuation.remark import Studied
from lightfield.studies.attenuation.study import attenuation
from lightfield.studies.attenuation.text import as_text

SCENE = Scene.from_dict({"lamp": {"hwhm_deg": 4.0}, "water": {"absorption_per_m": 0.1}})
COLOURS = np.array([450.0, 500.0, 600.0])
NOISE = 0.001


def campaign(columns: tuple[float, ...] = (0.0,), seed: int = 0, **given: Any) -> Readings:
    """Direct light at places beside each other, in water and in air, with noise."""
    grid = np.meshgrid([4.5, 5.5, 6.5, 7.5, 8.5], columns, COLOURS, [False, True], indexing="ij")
    z, x, colour, air = (v.ravel() for v in grid)
    light = direct_field(SCENE, x, 0 * z, z, colour, air)
    value = light * np.exp(NOISE * np.random.default_rng(seed).standard_normal(len(z)))
    rest = {"wavelength_nm": colour, "medium": np.where(air, "air", "water"), "x_m": x}
    stated = {"stderr": NOISE * value, "plane_gain_percent": 0.0, "position_mm": 0.0}
    return Readings.from_arrays(**{"z_m": z, "value": value, **rest, **stated, **given})


def scaled(readings: Readings, factor: np.ndarray) -> Readings:
    """Readings and errors times a factor each."""
    return Readings.from_arrays(
        z_m=readings.z_m, x_m=readings.x_m, value=factor * readings.value, stderr=factor * readings.stderr,
        wavelength_nm=readings.wavelength_nm, medium=readings.medium, plane_gain_percent=0.0, position_mm=0.0,
    )  # fmt: skip


def test_a_ratio_that_alone_is_on_no_line_is_set_aside_and_named() -> None:
    """And nothing is where all are as stated: K and its errors are those of the rest."""
    good = campaign()
    assert not attenuation(good, SCENE).apparent[0].set_aside
    factor = np.ones(len(good))
    factor[-1] = 1.3
    found = attenuation(scaled(good, factor), SCENE)
    (one,) = found.apparent
    said = as_text(found)
    assert "note: one ratio of readings is left out" in said and "Without one ratio of readings (thr" in said
    assert one.set_aside == "through 8.5 m of water at 600 nm, 23 % below the line of the rest"
    assert one.estimate.errors_times == 1.0
    assert np.abs((one.K_per_m - 0.1) / one.K_stderr).max() < 3.5
    rest = good.subset(~((good.z_m == 8.5) & (good.wavelength_nm == 600.0)))
    assert one.K_per_m == pytest.approx(apparent_attenuation(ratios_of(rest, SCENE)).K_per_m, rel=1e-9)


def test_what_is_left_has_the_errors_that_it_states() -> None:
    """Beside a wild reading anywhere, but for the one of a hundred whose rest does not fit by chance; of as
    many good campaigns none is set aside."""
    pulls = []
    for seed in range(60):
        good = campaign(seed=seed)
        assert not apparent_attenuation(ratios_of(good, SCENE)).set_aside
        factor = np.ones(len(good))
        factor[np.random.default_rng(1000 + seed).integers(len(good))] = 1.3
        found = apparent_attenuation(ratios_of(scaled(good, factor), SCENE))
        if found.set_aside:
            pulls.append((found.K_per_m - 0.1) / found.K_stderr)
    assert len(pulls) >= 57
    assert 0.85 < np.sqrt(np.mean(np.square(pulls))) < 1.15


def test_two_wild_ratios_are_not_set_aside_but_widen_all_errors() -> None:
    good = campaign()
    factor = np.ones(len(good))
    factor[[0, -1]] = 1.3
    (one,) = attenuation(scaled(good, factor), SCENE).apparent
    assert not one.set_aside and one.estimate.errors_times > 10


def test_what_may_be_a_line_that_bends_is_not_set_aside() -> None:
    """Of one colour nothing else is read at the distance of the ratio that strays: it is named alone."""
    good = campaign()
    one = good.subset(good.wavelength_nm == 500.0)
    factor = np.where((one.z_m == 8.5) & (one.medium == "water"), 1.1, 1.0)
    (found,) = attenuation(scaled(one, factor), SCENE).apparent
    assert not found.set_aside and found.stray.startswith("through 8.5 m of water at 500 nm")
    assert found.estimate.errors_times > 5


def test_beside_the_beam_K_is_that_of_the_places_on_its_axis() -> None:
    """Light beside it that falls as scattered light does: half of what is read at one half width."""
    good = campaign((0.0, 0.3, 0.6))
    aside = (good.x_m / (good.z_m * np.tan(np.radians(4.0)))) ** 2
    grown = np.where(good.medium == "water", 1 + aside * np.exp(0.08 * good.z_m), 1.0)
    found = attenuation(scaled(good, grown), SCENE)
    (one,) = found.apparent
    assert one.on_line.sum() == 5 and not one.ratios.x_m[one.on_line].any()
    assert one.path_m.max() == 8.5 and "Of the 5 of 15 places nearest to the beam's axis: chi" in as_text(
        found
    )
    alone = apparent_attenuation(ratios_of(good.subset(good.x_m == 0), SCENE))
    assert one.K_per_m == pytest.approx(alone.K_per_m, rel=1e-9)
    assert [n.count for n in found.notes if n.studied is Studied.BESIDE_BEAM] == [5]
    # Where all lie on lines all of them count.
    assert attenuation(good, SCENE).apparent[0].on_line.all()


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"stderr": 1e-3}, "15 of 15 pairs are fainter than 12 of their errors.*read nearer, or longer"),
        ({"wavelength_nm": 3.0}, "have none in air at their place and wavelength.*in the same bands"),
    ],
)  # fmt: skip
def test_it_says_why_there_are_too_few_distances(given: dict[str, float], says: str) -> None:
    good, more = campaign(), {}
    if "stderr" in given:
        more["stderr"] = 0.1 * good.value
    else:
        more["wavelength_nm"] = good.wavelength_nm + given["wavelength_nm"] * (good.medium == "water")
    with pytest.raises(MeasurementError, match=says):
        attenuation(campaign(**more), SCENE)


def test_a_reading_below_zero_is_named() -> None:
    """Not as a faint one: its place, and what may be wrong; within its errors it is faint."""
    good = campaign()
    value = good.value.copy()
    value[0] = -value[0]
    (note,) = [n for n in ratios_of(campaign(value=value, stderr=good.stderr), SCENE).notes if n.first]
    assert note.studied is Studied.NEGATIVE and note.count == 1
    assert f"z = {good.z_m[0]:g} m" in str(note) and "below zero" in str(note) and "sign" in str(note)
    value[0] = -2 * good.stderr[0]
    (note,) = [n for n in ratios_of(campaign(value=value, stderr=good.stderr), SCENE).notes if n.first]
    assert note.studied is Studied.FAINT


def test_a_reading_of_nothing_with_an_error_is_faint() -> None:
    good = campaign()
    value = good.value.copy()
    value[0] = 0.0
    notes = ratios_of(campaign(value=value, stderr=good.stderr), SCENE).notes
    assert [n.count for n in notes if n.studied is Studied.FAINT] == [1]
    assert not [n for n in notes if n.studied is Studied.STDERR_ASSUMED]
