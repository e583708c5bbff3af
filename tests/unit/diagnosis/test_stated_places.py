"""Places that the table states to be off by some millimetres make no readings whose errors are too small."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.verdict.cautions.caution import Warns
from lightfield.readings import Readings
from lightfield.scene import Scene

SCENE = {
    "lamp": {"hwhm_deg": 4.0},
    "water": {"absorption_per_m": 0.13},
    "detector": {"bands_nm": [[490, 510], [550, 570]]},
}
#: Half width of the lamp, deg, absorption per m, and by how much each place is off in every direction, m.
HWHM_DEG, A_PER_M, OFF_M = 3.8, (0.12, 0.16), 0.004


def readings(seed: int, bands: int, stated_mm: float) -> Readings:
    """Five planes of a cross, by formulas of their own, 0.5 % and a floor."""
    rng = np.random.default_rng(seed)
    row = [(x, 0.0) for x in np.linspace(-0.8, 0.8, 13)] + [(0.0, y) for y in (-0.4, -0.2, 0.2, 0.4)]
    places = rng.permutation([(x, y, z) for z in (4.5, 5.5, 6.5, 7.5, 8.5) for x, y in row])
    x, y, z = (places + OFF_M * rng.standard_normal(places.shape)).T
    r = np.sqrt(x**2 + y**2 + z**2)
    beam = np.exp2(-((np.degrees(np.arccos(z / r)) / HWHM_DEG) ** 2)) * z / r**3
    light = beam[:, None] * np.exp(-np.outer(r, A_PER_M[:bands]))
    light /= light.max()
    sigma = np.hypot(0.005 * light, 5e-4)
    value = light + sigma * rng.standard_normal(light.shape)
    x, y, z = (np.repeat(axis, bands) for axis in places.T)
    return Readings.from_arrays(
        x_m=x, y_m=y, z_m=z, value=value.ravel(), stderr=sigma.ravel(),
        time_s=np.repeat(20.0 * np.arange(len(places)), bands),
        wavelength_nm=np.tile([500.0, 560.0][:bands], len(places)),
        scale="relative", plane_gain_percent=0.0, position_mm=stated_mm,
    )  # fmt: skip


def warned_of(seed: int, bands: int, stated_mm: float) -> set[Warns]:
    verdict = diagnose(
        readings(seed, bands, stated_mm),
        Scene.from_dict(SCENE),
        diffuse=None,
        only=["beam_tilt", "background", "beam_shape"],
        advise=False,
    ).verdict
    return {caution.warns for caution in verdict.cautions}


OF_ERRORS = {Warns.ERRORS_DOUBTED, Warns.SCATTER_MORE, Warns.IN_COMMON}


@pytest.mark.parametrize(("seed", "bands"), [(4, 1), (3, 2), (5, 2)])
def test_what_the_places_make_is_counted_once(seed: int, bands: int) -> None:
    """It was taken for an error that is not stated, or one that bands share, and added again."""
    assert not OF_ERRORS & warned_of(seed, bands, 1000 * OFF_M)


def test_what_unstated_places_make_is_said() -> None:
    assert Warns.SCATTER_MORE in warned_of(1, 1, 0.0)
