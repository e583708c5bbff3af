"""Working range: the paper's rule, the spot, and the bound on a pose, against closed forms."""

from __future__ import annotations

import json
from functools import partial

import numpy as np
import pytest
from scipy.optimize import brentq

from lightfield.errors import MeasurementError, SceneError, UsageError
from lightfield.formula.field import direct_field
from lightfield.readings import Readings
from lightfield.render.diffuse.source import response_for
from lightfield.report.working_range import range_page
from lightfield.scene import Scene
from lightfield.studies.working_range.study import WorkingRange, _bound, working_range
from lightfield.studies.working_range.text import as_data, as_text

HALF = np.radians(3.81)
C = 0.1


def scene(a: float = 0.05, b: float = 0.05, **parts) -> Scene:
    phase = {"type": "henyey-greenstein", "g": 0.92}
    water = {"absorption_per_m": a, "scattering_per_m": b, "phase": phase}
    return Scene.from_dict({"lamp": {"hwhm_deg": 3.81}, "water": water, **parts})


@pytest.fixture(scope="module")
def formula() -> WorkingRange:
    return working_range(scene(), None)


def reach(found: WorkingRange, name: str) -> float:
    return next(r.z_m for r in found.reaches if r.name == name)


def test_the_papers_rule_by_the_formula_alone(formula) -> None:
    """(4.5 / z)^2 exp(-0.1 (z - 4.5)) = 0.2 at 8.31 m; the same at 10 times a noise of 1 %."""
    for name, level in (("light", 0.2), ("signal", 0.1)):
        z = brentq(lambda z, level=level: (4.5 / z) ** 2 * np.exp(-C * (z - 4.5)) - level, 5, 16)
        assert reach(formula, name) == pytest.approx(z, abs=1e-3)
    assert reach(formula, "light") == pytest.approx(8.31, abs=0.01)


def test_radius_of_half_intensity_is_the_beams(formula) -> None:
    """exp(-ln2 (theta / h)^2) cos(theta) exp(-c (r - z)) z^2 / r^2 = 1/2 for a cosine receiver."""
    for z in (4.5, 8.5):

        def half(x: float, z: float = z) -> float:
            r, theta = np.hypot(x, z), np.arctan(x / z)
            beam = np.exp(-np.log(2) * (theta / HALF) ** 2)
            return beam * np.cos(theta) * np.exp(-C * (r - z)) * (z / r) ** 2 - 0.5

        expected = brentq(half, 0.05, 1.5)
        assert float(formula.dataset.half_radius_m.sel(z_m=z)) == pytest.approx(expected, rel=2e-3)


def test_bound_of_a_small_array_is_the_closed_form() -> None:
    """sigma_x = s z^2 / ((2 ln2 / h^2 + 3 + c z) sqrt(sum p^2)), sigma_z = s / (sqrt(N) (2 / z + c)).

    And with a free gain sigma_z = s z^3 h^2 / (2 ln2 sqrt(sum (rho^2 - mean)^2)); s is noise over reading.
    """
    side, count = 0.03, 5
    data = working_range(scene(), None, side_m=side, count=count, noise=0.01).dataset
    at = np.linspace(-0.5, 0.5, count) * side
    p2, rho2 = count * (at**2).sum(), (at[:, None] ** 2 + at**2).ravel()
    for z in (4.5, 8.5):
        s = 0.01 / float(data.light.sel(z_m=z))
        across = s * z**2 / ((2 * np.log(2) / HALF**2 + 3 + C * z) * np.sqrt(p2))
        along = s / (count * (2 / z + C))
        free = s * z**3 * HALF**2 / (2 * np.log(2) * np.sqrt(((rho2 - rho2.mean()) ** 2).sum()))
        row = data.sel(z_m=z)
        assert float(row.sigma_across_m) == pytest.approx(across, rel=0.02)
        assert float(row.sigma_along_m) == pytest.approx(along, rel=0.02)
        assert float(row.sigma_along_relative_m) == pytest.approx(free, rel=0.03)


def test_bound_of_the_papers_array_is_that_of_its_readings_one_by_one(formula) -> None:
    """25 receivers over 0.6 m: derivatives of the closed form, noise of 1 % of the reading at 4.5 m."""
    at = np.linspace(-0.3, 0.3, 5)
    x, y = (v.ravel() for v in np.meshgrid(at, at))

    def read(dx: float, dy: float, z: float) -> np.ndarray:
        return direct_field(scene(), x + dx, y + dy, np.full(25, z))

    noise, h = 0.01 * direct_field(scene(), 0.0, 0.0, 4.5), 1e-3
    for z in (5.5, 8.5):
        J = [
            read(h, 0, z) - read(-h, 0, z),
            read(0, h, z) - read(0, -h, z),
            read(0, 0, z + h) - read(0, 0, z - h),
        ]
        whole = np.stack([*(column / (2 * h) for column in J), read(0, 0, z)], axis=1) / noise
        for name, used in (("", whole[:, :3]), ("_relative", whole)):
            bound = np.sqrt(np.diag(np.linalg.inv(used.T @ used)))
            row = formula.dataset.sel(z_m=z)
            assert float(row[f"sigma_across{name}_m"]) == pytest.approx(bound[0], rel=0.02)
            assert float(row[f"sigma_along{name}_m"]) == pytest.approx(bound[2], rel=0.03)


def test_scattered_light_lengthens_the_range_and_widens_the_spot() -> None:
    """An independent Monte Carlo: 8.64 m with scattered light, 8.31 m without; half radius 0.583 m."""
    found = working_range(scene(), partial(response_for, photons=150_000))
    light = found.reaches[0]
    assert 0 < light.stderr_m < 0.06
    assert light.z_m == pytest.approx(8.64, abs=3 * light.stderr_m)
    assert light.formula_m == pytest.approx(8.31, abs=0.01)
    row = found.dataset.sel(z_m=8.5)
    assert 0 < float(row.half_radius_stderr_m) < 0.02
    assert float(row.half_radius_m) == pytest.approx(0.583, abs=3 * float(row.half_radius_stderr_m))


def test_readings_stand_beside_it_with_the_error_of_the_reference(formula) -> None:
    readings = Readings.from_arrays(
        z_m=[4.5, 8.5, 8.5], x_m=[0, 0, 0.3], value=[2.0, 0.46, 0.2], stderr=[0.02, 0.01, 0.01]
    )
    shown = working_range(scene(), None, readings).readings
    assert shown.value.values.tolist() == pytest.approx([1.0, 0.23])
    assert shown.stderr.values.tolist() == pytest.approx([0.0, 0.23 * np.hypot(0.01, 0.01 / 0.46)])
    assert shown.half_radius_m.values[1] == pytest.approx(0.3 * np.sqrt(np.log(2) / np.log(2.3)))
    with pytest.raises(MeasurementError, match=r"among them at the reference, 4\.5 m"):
        working_range(scene(), None, readings.subset(readings.z_m > 5))


def test_it_ends_before_the_tank_does() -> None:
    found = working_range(scene(tank={"length_m": 10.0, "behind_lamp_m": 0.5}), None)
    assert float(found.dataset.z_m.max()) == pytest.approx(9.45)
    assert np.isinf(reach(found, "pose_across")) and "beyond all asked" in as_text(found)
    with pytest.raises(SceneError, match="no distances"):
        working_range(scene(), None, to_m=4.6)


@pytest.mark.parametrize(
    "wrong", [{"share": 0.0}, {"share": 1.5}, {"noise": np.nan}, {"snr": -1.0}, {"count": 1}]
)
def test_numbers_that_make_no_sense(wrong) -> None:
    with pytest.raises(UsageError, match="impossible"):
        working_range(scene(), None, **wrong)


def test_words_data_and_page(formula) -> None:
    data = json.loads(json.dumps(as_data(formula)))
    assert data["reaches"][0]["z_m"] == pytest.approx(8.31, abs=0.01) and len(data["z_m"]) == len(
        data["light"]
    )
    assert "8.31 m" in as_text(formula)
    page = range_page(formula)
    assert "does not tell yaw" in page and page.count("<svg") == 2


def test_where_an_array_sees_nothing_of_a_direction_its_bound_is_infinite() -> None:
    """A small tank and a narrow beam: near the lamp the array is wider than all light that is known there."""
    tank = {"width_m": 1.2, "depth_m": 0.8, "length_m": 3.0, "behind_lamp_m": 0.3, "wall_albedo": 0.3}
    lamp = {"hwhm_deg": 8.0, "spectrum": "led-blue"}
    detector = {"planes_m": [0.7, 1.0, 1.4, 1.8, 2.2], "bands_nm": [[445.0, 495.0]]}
    small = Scene.from_dict({"lamp": lamp, "tank": tank, "detector": detector})
    found = working_range(small, None)
    sigma = found.dataset.sigma_along_relative_m.values
    assert (sigma > 0).all() and not np.isnan(sigma).any()
    assert as_text(found) and "</html>" in range_page(found)
    json.dumps(as_data(found), allow_nan=False)


def test_the_bound_is_that_of_the_inverse_where_there_is_one() -> None:
    rng = np.random.default_rng(1)
    J = rng.normal(size=(9, 3)) * [1.0, 1e-3, 1e4]
    np.testing.assert_allclose(_bound(J), np.sqrt(np.diag(np.linalg.inv(J.T @ J))), rtol=1e-9)
    blind = np.stack([J[:, 0], J[:, 1], 2 * J[:, 1], 0 * J[:, 1]], axis=1)
    assert np.isfinite(_bound(blind)).tolist() == [True, False, False, False]
