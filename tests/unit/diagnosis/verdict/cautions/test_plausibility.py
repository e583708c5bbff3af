"""Mistakes of a table that width and absorption would take up are named."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from analytic_readings import readings, scene

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.verdict.cautions.caution import Warns
from lightfield.diagnosis.verdict.cautions.plausibility import hints
from lightfield.diagnosis.verdict.compose import _nearly_fits
from lightfield.diagnosis.verdict.parts import Kind
from lightfield.diagnosis.verdict.terminal import as_text
from lightfield.formula.closed_form import direct_field
from lightfield.readings.readings import Readings
from lightfield.scene import Scene
from lightfield.studies.compare.readings import fit_readings


def warnings(table: Readings, believed: Scene) -> list[str]:
    verdict = diagnose(table, believed, diffuse=None, advise=False).verdict
    found = [w for w in verdict.warnings if "times the scene's" in w or "exchanged" in w]
    assert found == verdict.check_first
    told = as_text(verdict).splitlines()  # before the ladder, and once
    assert [line for line in told if any(w in line for w in found)] == [f"check first: {w}" for w in found]
    assert told[1 : 1 + len(found)] == [f"check first: {w}" for w in found]
    by_hand = [n for n in fit_readings(table, believed).notes if "times the scene's" in n]
    assert len(by_hand) == len([w for w in found if "times" in w])
    return found


def test_guesses_that_are_off_as_guesses_are_need_no_word() -> None:
    """The scene of these readings is 15 % off in the width and 13 % in the absorption."""
    for seed in range(3):
        assert warnings(*readings(seed=seed)) == []


@pytest.mark.parametrize("factor", [0.5, pytest.param(2.0, marks=pytest.mark.slow)])
def test_x_in_another_unit_shows_in_the_width(factor: float) -> None:
    """By nearly the factor: a wrong angle changes the cosine and the distance too."""
    table, believed = readings(seed=1)
    (told,) = warnings(replace(table, x_m=factor * table.x_m), believed)
    assert "the fitted width is" in told and "check the unit of x_m" in told
    (ratio,) = re.findall(r"width is ([\d.]+) times", told)
    assert float(ratio) == pytest.approx(1.15 * factor, rel=0.05)


def test_air_labelled_water_shows_in_the_absorption() -> None:
    """Without absorption the light falls by the inverse square alone."""
    table, believed = readings({"water.absorption_per_m": 0.0}, seed=2)
    (told,) = warnings(table, believed)
    assert "the fitted absorption is" in told and "taken in water" in told


def test_a_decadic_coefficient_shows_in_the_absorption() -> None:
    table, believed = readings({"water.absorption_per_m": 0.3}, seed=2)
    (told,) = warnings(table, believed)
    assert "2.5 times the scene's" in told and "decadic" in told


def test_values_of_a_set_that_misses_the_readings_are_no_hints() -> None:
    """Beside a chi-square of 36 per reading an absorption of 0.44 times the scene's asked for the medium."""
    table, believed = readings({"water.absorption_per_m": 0.3}, seed=2)
    found = diagnose(table, believed, diffuse=None, only=["background"], advise=False)
    forward, problem, fit = found.forward, found.prepared.problem, found.steps[-1].fit
    assert [one.warns for one in hints(forward, problem, fit)] == [Warns.MORE_ABSORPTION]
    assert hints(forward, problem, fit, nearly_fits=False) == []


@pytest.mark.parametrize(
    ("chi2", "kind", "scale", "stated", "nearly"),
    [
        (35.9, Kind.UNEXPLAINED, 26.0, True, False),  # a misfit is no noise
        (35.9, Kind.UNEXPLAINED, 26.0, False, True),  # of errors that nobody has stated it may be
        (35.9, Kind.IDENTIFIED, 26.0, True, True),
        (1.8, Kind.UNEXPLAINED, 1.0, True, True),
    ],
)
def test_a_set_nearly_fits_by_the_errors_that_are_credible(
    chi2: float, kind: Kind, scale: float, stated: bool, nearly: bool
) -> None:
    finding = SimpleNamespace(
        level=SimpleNamespace(bench=SimpleNamespace(phi=1.0)), scale=scale,
        size=None if kind is Kind.UNEXPLAINED else 1, withheld=False, in_part=False,
    )  # fmt: skip
    prepared, last = SimpleNamespace(errors_stated=stated), SimpleNamespace(chi2_per_dof=chi2)
    basis = SimpleNamespace(finding=finding, prepared=prepared, steps=[last])
    assert _nearly_fits(cast(Any, basis), kind) is nearly


def test_x_and_y_exchanged_show_where_the_lamp_tells_them_apart() -> None:
    """A beam 1.3 times as wide in y as in x, as the scene says; a round one is the same either way."""
    own: dict[str, Any] = {"lamp.ellipticity": 1.3}
    table, _ = readings(own, seed=3, layout="grid")
    assert warnings(table, scene(**own)) == []
    (told, *_) = warnings(replace(table, x_m=table.y_m, y_m=table.x_m), scene(**own))
    assert "with x_m and y_m exchanged" in told


def in_colours(truth: dict[str, Any], base: str) -> tuple[Readings, Scene]:
    """Readings in five bands along the axis and beside it, of a scene that states 0.05 per m and a base."""
    nm, x, z = (
        v.ravel()
        for v in np.meshgrid(
            [460.0, 500.0, 540.0, 580.0, 620.0], [0.0, 0.2, 0.4], [2.0, 3.0, 4.0, 5.0, 6.0], indexing="ij"
        )
    )
    bands = [[w - 10, w + 10] for w in np.unique(nm)]
    believed = Scene.from_dict(
        {
            "lamp": {"hwhm_deg": 4.0},
            "water": {"base": base, "absorption_per_m": 0.05},
            "detector": {"planes_m": [2.0, 6.0], "bands_nm": bands},
        }
    )
    light = direct_field(believed.with_values(truth), x, 0 * x, z, nm)
    error = np.hypot(0.005 * light, 2e-4 * light.max())
    noise = error * np.random.default_rng(1).standard_normal(len(z))
    table = Readings.from_arrays(
        x_m=x, z_m=z, wavelength_nm=nm, value=light + noise, stderr=error, quantity="irradiance"
    )
    return table.check_against(believed), believed


@pytest.mark.parametrize(
    ("truth", "base"),
    [({"water.absorption_at": [[460, 0.1], [620, 0.4]]}, "none"), ({"water.cdom_440_per_m": 0.4}, "pure")],
)
def test_a_colour_that_one_number_does_not_state_is_no_mistake(truth: dict[str, Any], base: str) -> None:
    """Another absorption in each band beside a scene's one number, and CDOM that the verdict names."""
    assert warnings(*in_colours(truth, base)) == []
