"""Several bands of one spectrum, off together by a lamp that flickers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.problem.layout import layout_of
from lightfield.diagnosis.verdict.cautions.caution import Warns
from lightfield.readings import Readings
from lightfield.scene import Scene
from lightfield.studies.attenuation.apparent import apparent_attenuation
from lightfield.studies.attenuation.ratios import ratios_of

BANDS_NM = np.array([485.0, 505.0, 525.0, 545.0, 565.0])
K_PER_M = 0.05 + 0.0009 * (BANDS_NM - 470)
#: Standard errors over the reading: of a spectrum, and of each band by itself.
COMMON, OWN = 0.002, 0.0006


def scene() -> Scene:
    return Scene.from_dict(
        {
            "lamp": {"hwhm_deg": 6.0},
            "water": {"absorption_per_m": 0.1},
            "tank": None,
            "detector": {"bands_nm": [[480.0, 570.0]]},
        }
    )


def readings(seed: int, stated: bool = True, own: float = OWN) -> Readings:
    """Five lines across the beam, in random order, by inverse square, Gaussian beam and Beer-Lambert."""
    rng = np.random.default_rng(seed)
    grid = np.meshgrid([3.0, 4, 5, 6, 7, 8], [-0.4, -0.2, 0, 0.2, 0.4])
    z, x = np.stack([each.ravel() for each in grid])[:, rng.permutation(30)]
    r = np.hypot(x, z)
    beam = np.exp(-np.log(2) * (np.degrees(np.arctan2(np.abs(x), z)) / 6) ** 2) * z / r**3
    light = beam[:, None] * np.exp(-K_PER_M * r[:, None])
    flicker = COMMON * rng.standard_normal((len(z), 1))
    value = light * (1 + flicker + own * rng.standard_normal(light.shape))
    return Readings.from_arrays(
        x_m=np.repeat(x, 5), z_m=np.repeat(z, 5), wavelength_nm=np.tile(BANDS_NM, len(z)),
        value=value.ravel(),
        stderr=np.hypot(COMMON, own) * light.ravel(), time_s=np.repeat(60.0 * np.arange(len(z)), 5),
        common_percent=100 * COMMON if stated else None, plane_gain_percent=0.0, position_mm=0.0,
        quantity="irradiance",
    )  # fmt: skip


#: Those of the lamp and the water over time and place, which a flicker would be taken for.
FEW = ["lamp_drift", "water_drift", "beam_offset", "background", "beam_tilt", "beam_shape"]


@pytest.mark.parametrize(
    ("seed", "only"),
    [
        pytest.param(0, FEW, id="0, few"),
        *(pytest.param(seed, None, id=str(seed), marks=pytest.mark.slow) for seed in (0, 1, 2)),
    ],
)
def test_what_all_bands_share_is_no_effect(seed: int, only: list[str] | None) -> None:
    verdict = diagnose(readings(seed), scene(), diffuse=None, only=only).verdict
    assert verdict.verdict == "none" and verdict.serial_correlation < 0.35


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_bands_that_are_more_alike_than_is_held_possible_are_no_fault_of_their_errors(seed: int) -> None:
    """A tenth of their errors is each band's own, and stated so; a fifth is taken."""
    table = readings(seed, own=0.1 * COMMON)
    verdict = diagnose(table, scene(), diffuse=None, only=FEW, advise=False).verdict
    of_errors = {Warns.SCATTER_LESS, Warns.SCATTER_MORE, Warns.ERRORS_DOUBTED}
    assert verdict.verdict == "none" and not of_errors & {one.warns for one in verdict.cautions}


@pytest.mark.parametrize("stated", [True, False])
def test_the_mean_attenuation_over_bands_knows_what_they_share(stated: bool) -> None:
    """Squared pulls of 30 tables: one number that five bands share is not five, said or not."""

    def pull(seed: int) -> float:
        K, error = apparent_attenuation(ratios_of(readings(seed, stated), scene())).mean()
        return (K - float(K_PER_M.mean())) / error

    tables = 30
    squares = sum(pull(seed) ** 2 for seed in range(tables))
    assert 0.001 < stats.chi2.sf(squares, tables) < 0.999


def test_a_misfit_of_all_bands_is_an_error_of_their_mean() -> None:
    """Errors that hold each band's own scatter alone, beside a flicker three times as large."""
    pulls = []
    for seed in range(12):
        table = readings(seed, stated=False)
        small = replace(table, stderr=OWN / np.hypot(COMMON, OWN) * table.stderr)
        found = apparent_attenuation(ratios_of(small, scene()))
        K, error = found.mean()
        pulls.append((K - float(K_PER_M.mean())) / error)
        assert found.estimate.errors_times > 2
        assert error > 0.8 * found.K_stderr.min()
    assert stats.chi2.sf(float(np.square(pulls).sum()), len(pulls)) > 0.001


def test_a_spectrum_is_one_place_time_and_repeat() -> None:
    table = readings(0)
    layout = layout_of(table)
    assert (layout.spectrum.reshape(-1, 5) == layout.spectrum[::5, None]).all()
    assert len(np.unique(layout.spectrum)) == len(table) // 5
    twice = Readings.from_arrays(
        z_m=[1.0] * 4,
        wavelength_nm=[500.0, 510.0] * 2,
        value=[1.0] * 4,
        repeat=[0, 0, 1, 1],
        common_percent=1.0,
    )
    label = layout_of(twice).spectrum
    assert label[0] == label[1] != label[2] == label[3]
