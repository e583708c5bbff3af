"""The spot in a tank that is narrower than the beam is wide at its end, against a closed form; far light."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from lightfield.render.diffuse.source import response_for
from lightfield.scene import Scene
from lightfield.studies.working_range.study import working_range
from lightfield.studies.working_range.text import as_text

HALF = np.radians(9.0)
C = 0.23


def expected(z: float) -> float:
    """Where exp(-ln2 (theta / h)^2) cos(theta) exp(-c r) / r^2 is half of what it is on the axis."""

    def light(rho: float) -> float:
        r, theta = np.hypot(rho, z), np.arctan2(rho, z)
        return float(np.exp(-np.log(2) * (theta / HALF) ** 2 - C * r) * z / r**3)

    return brentq(lambda rho: light(rho) - 0.5 * light(0.0), 0.0, 2 * z)


@pytest.mark.parametrize("offset_m", [0.0, 0.3])
def test_the_spot_is_told_as_far_as_the_tank_has_room_for_it(offset_m: float) -> None:
    """Beside a wall that the beam meets at the tank's end no spot was told at all, not even near the lamp."""
    tank = {"width_m": 2.0, "depth_m": 1.5, "length_m": 7.0}
    water = {"absorption_per_m": 0.08, "scattering_per_m": 0.15}
    lamp = {"hwhm_deg": 9.0, "offset_x_m": offset_m}
    scene = Scene.from_dict(
        {"lamp": lamp, "water": water, "tank": tank, "detector": {"planes_m": [1.0, 2.0, 3.5, 5.0]}}
    )
    spot = working_range(scene, None).dataset.half_radius_m
    told = spot.dropna("z_m")
    assert float(told.z_m[-1]) > 5.5 and len(told) > 0.8 * len(spot)
    for z in (1.0, 2.0, 3.5, 5.0):
        assert float(spot.sel(z_m=z)) == pytest.approx(expected(z), rel=1e-3)


def test_the_spot_of_a_ring_ends_at_half_of_its_brightest_part(tmp_path: Path) -> None:
    """As that of `sweep` and `diagnose` does; half of what is on its axis lies 23 % farther out."""
    angle = np.linspace(0.0, 20.0, 401)
    beam = np.exp(-(((angle - 4.0) / 3.0) ** 2)) + np.exp(-(((angle + 4.0) / 3.0) ** 2))
    (tmp_path / "ring.csv").write_text(
        "angle_deg,intensity\n" + "".join(f"{a:.4f},{i:.8f}\n" for a, i in zip(angle, beam, strict=True))
    )
    lamp = {"profile": "table", "intensity_table": str(tmp_path / "ring.csv")}
    scene = Scene.from_dict({"lamp": lamp, "detector": {"planes_m": [1.0, 3.0]}})
    tangent = np.linspace(0.0, np.tan(np.radians(15.0)), 200_001)
    light = np.interp(np.degrees(np.arctan(tangent)), angle, beam) * np.cos(np.arctan(tangent)) ** 3
    half = tangent[np.flatnonzero(light >= 0.5 * light.max())[-1]]
    spot = working_range(scene, None).dataset.half_radius_m
    for z in (1.0, 3.0):
        assert float(spot.sel(z_m=z)) == pytest.approx(z * half, rel=2e-3)
    assert tangent[np.flatnonzero(light >= 0.5 * light[0])[-1]] > 1.1 * half


@pytest.mark.slow
def test_far_light_that_no_photon_tells_is_not_told() -> None:
    """Coastal water of 2.5 per m, asked about as far as a clear tank: the curve rose to 1e69 at 6.5 m.

    An independent Monte Carlo says 4.06 m.
    """
    phase = {"type": "henyey-greenstein", "g": 0.92}
    water = {"absorption_per_m": 0.435, "scattering_per_m": 2.04, "phase": phase}
    parts = {"lamp": {"hwhm_deg": 3.81}, "water": water, "detector": {"planes_m": [3.0, 5.0, 7.0]}}
    murky = Scene.from_dict(parts)
    found = working_range(murky, partial(response_for, photons=60_000), photons=1e5)
    assert 3.3 < float(found.dataset.z_m[-1]) < found.dataset.asked_to_m == 14.0
    assert float(found.dataset.light.max()) < 1.5 and "too few photons arrive" in as_text(found)
    light = found.reaches[0]
    assert 0.05 < light.stderr_m < 1.0 and light.z_m == pytest.approx(4.06, abs=3 * light.stderr_m)
