"""Distances up to which a pose is known, from bounds that are known to some error, against curves by hand."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from lightfield.arrays import Array
from lightfield.studies.link.text import docked
from lightfield.studies.working_range.reaches import POSE_RULES, Reach, pose_reaches
from lightfield.studies.working_range.text import distance

Z = np.linspace(2.0, 10.0, 161)
FINE = np.linspace(2.0, 10.0, 600)
#: What docking asks along the beam, m.
LIMIT = 0.3


def along(sigma_m: Array, doubt: Array, formula_m: Array | None = None) -> Reach:
    """The reach along the beam, where its bound and the relative error of that are these at `Z`."""
    columns = {}
    for axis, (_, unit, limit) in POSE_RULES.items():
        for gain in ("", "_relative"):
            bound, error = (sigma_m, doubt) if axis == "along" else (0.1 * limit + 0 * Z, 0 * Z)
            columns[f"sigma_{axis}{gain}_{unit}"] = ("z_m", bound)
            columns[f"sigma_{axis}{gain}_stderr_{unit}"] = ("z_m", bound * error)
            straight = formula_m if axis == "along" and formula_m is not None else 0.1 * limit + 0 * Z
            columns[f"sigma_{axis}{gain}_formula_{unit}"] = ("z_m", straight)
    found = pose_reaches(xr.Dataset(columns, coords={"z_m": Z}), FINE)
    return next(r for r in found if r.name == "pose_along")


def test_noise_of_the_far_end_is_no_stretch() -> None:
    """The bound leaves the limit at 6 m; from 9 m on it is below it again, and known to a factor of four."""
    sigma = LIMIT * np.exp(0.5 * np.minimum(Z - 6, 2) - 1.25 * np.clip(Z - 8.2, 0, None))
    found = along(sigma, np.where(Z > 8, 3.0, 0.01))
    assert found.z_m == pytest.approx(6.0, abs=1e-3) and np.isnan(found.from_m)
    assert found.stderr_m == pytest.approx(0.01 / 0.5, rel=0.05)
    assert distance(found) == "6.00 ± 0.02 m"


def test_a_far_stretch_that_is_known_is_told() -> None:
    """The same bound, known to a hundredth: 9.0 m is where ln(sigma / limit) = 1 - 1.25 (z - 8.2) is 0."""
    sigma = LIMIT * np.exp(0.5 * np.minimum(Z - 6, 2) - 1.25 * np.clip(Z - 8.2, 0, None))
    found = along(sigma, np.full(len(Z), 0.01), sigma)
    assert found.formula_near_m == pytest.approx(6.0, abs=1e-3) and found.formula_from_m == found.from_m
    assert found.from_m == pytest.approx(8.2 + 1 / 1.25, abs=0.01) and np.isinf(found.z_m)
    assert found.near_m == pytest.approx(6.0, abs=1e-3)
    assert distance(found) == "to 6.00 m, from 9.00 ± 0.01 m on"
    assert docked(found, 10.0, 2.0).startswith("to 6.0 m, ")


def test_where_it_begins_to_hold_has_an_error() -> None:
    """A bound known to a tenth that falls by half of itself a metre begins to hold at 5 m, to 0.2 m."""
    found = along(LIMIT * np.exp(-0.5 * (Z - 5)), np.full(len(Z), 0.1))
    assert found.from_m == pytest.approx(5.0, abs=1e-3)
    assert found.from_stderr_m == pytest.approx(0.1 / 0.5, rel=0.01)
    assert distance(found) == "from 5.00 ± 0.20 m on"


def test_what_photons_leave_in_doubt_far_away_is_told_as_far_as_it_is_sure() -> None:
    """A bound of two thirds of the limit, known to 0.05 (z - 2): with two errors more it is met up to 7 m."""
    found = along(np.full(len(Z), 2 / 3 * LIMIT), 0.05 * (Z - 2))
    assert np.isinf(found.z_m) and found.sure_m == pytest.approx(7.0, abs=0.01)
    assert distance(found) == "beyond all told (for sure to 7.00 m)"
    assert docked(found, 10.0, 2.0) == "> 10 m (7.0 m for sure)"


def test_a_bound_that_is_nowhere_sure_is_not_told() -> None:
    found = along(np.full(len(Z), 2 / 3 * LIMIT), np.ones(len(Z)))
    assert not found.is_told and found.formula_m == np.inf
    assert distance(found) == docked(found, 10.0, 2.0) == "too few photons to say"
    assert distance(Reach("pose_across", 4.73, 16.09, 3.8)) == "too few photons to say"


def test_a_bound_that_is_too_large_everywhere_holds_nowhere() -> None:
    found = along(np.full(len(Z), 2 * LIMIT), np.full(len(Z), 0.1))
    assert found.is_told and np.isnan(found.z_m) and distance(found) == "nowhere"
