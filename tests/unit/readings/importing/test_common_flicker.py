"""Repeats whose bands scatter together: a lamp's flicker against noise of every band by itself."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from lightfield.arrays import Array
from lightfield.errors import MeasurementError
from lightfield.readings import Readings
from lightfield.readings.importing.replicates import Stay, joined_rows

BANDS, PLACES, REPEATS = 5, 40, 3
ENTRY = SimpleNamespace(called="a", x_m=0.0, y_m=0.0, z_m=1.0, medium="water", role="signal")
SHOT = SimpleNamespace(
    entry=ENTRY, exposure_s=0.1, time_s=0.0,
    spectrum=SimpleNamespace(nonlinearity_corrected=None, electric_dark_corrected=None),
)  # fmt: skip


def rows(
    common: float, own: float, seed: int = 1, wild: float = 0.0, dim: float = 0.0
) -> tuple[Array, Array]:
    """What bands share and standard errors, in per cent of the readings, shape (places, bands)."""
    rng = np.random.default_rng(seed)
    stays, points = [], {}
    for place in range(PLACES):
        members = tuple(range(REPEATS * place, REPEATS * (place + 1)))
        stays.append(Stay(members, 0, place))
        level = np.exp(rng.uniform(3, 8))
        for k in members:
            flicker = 1 + common * rng.standard_normal() + wild * (k == 7)
            for b in range(BANDS):
                noise = own + dim * (b == BANDS - 1)
                value = level * (1 + b) * (flicker + noise * rng.standard_normal())
                points[k, b] = SimpleNamespace(
                    stated=np.nan, value=value, shot=SHOT, dark_error=0.0, saturated=False, darks=()
                )
    made = joined_rows(stays, points, BANDS)
    found = np.array([[r["common_percent"], 100 * r["stderr"] / r["value"]] for r in made])
    return found[:, 0].reshape(PLACES, BANDS), found[:, 1].reshape(PLACES, BANDS)


@pytest.mark.parametrize("seed", range(5))
def test_flicker_is_told_with_its_size_and_what_is_left_to_a_band(seed: int) -> None:
    """0.3 % of a spectrum and 0.1 % of a band, in a mean of three 0.173 and 0.058 %."""
    common, total = rows(0.003, 0.001, seed=seed)
    assert np.median(common) == pytest.approx(0.3 / np.sqrt(REPEATS), rel=0.25)
    assert np.median(np.sqrt(total**2 - common**2)) == pytest.approx(0.1 / np.sqrt(REPEATS), rel=0.35)


@pytest.mark.parametrize("seed", range(10))
def test_noise_of_every_band_by_itself_is_no_flicker(seed: int) -> None:
    common, _ = rows(0.0, 0.003, seed=seed)
    assert np.isnan(common).all()


@pytest.mark.parametrize("dim", [0.05, 0.5])
def test_a_dim_band_leaves_the_others_what_they_share(dim: float) -> None:
    """It was lost for all of them; where the dim one is negative it is told of the others alone."""
    common, total = rows(0.003, 0.001, dim=dim)
    assert np.nanmedian(common[:, :-1]) == pytest.approx(0.3 / np.sqrt(REPEATS), rel=0.25)
    assert np.median(abs(total[:, -1])) == pytest.approx(100 * dim / np.sqrt(REPEATS), rel=0.3)


def test_a_wild_spectrum_is_wild_in_all_its_bands() -> None:
    """And tells nothing of the other places."""
    common, total = rows(0.003, 0.001, wild=0.5)
    assert (common[2] > 0.95 * total[2]).all() and (total[2] > 10).all()
    assert np.median(np.delete(common, 2, axis=0)) == pytest.approx(0.3 / np.sqrt(REPEATS), rel=0.25)


def test_a_part_larger_than_the_whole_is_refused() -> None:
    table = {"z_m": [1.0, 2.0], "value": [1.0, 0.5], "stderr": [0.01, 0.01]}
    Readings.from_arrays(**table, common_percent=1.0)
    with pytest.raises(MeasurementError, match="more than the standard error that it is a part of"):
        Readings.from_arrays(**table, common_percent=[1.0, 2.5])
    with pytest.raises(MeasurementError, match="common_percent is negative"):
        Readings.from_arrays(**table, common_percent=-1.0)
