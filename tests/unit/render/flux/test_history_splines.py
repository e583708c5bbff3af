"""Half of the splines tells the other half, with components turned; a new water shares what was made."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.arrays import Array
from lightfield.render.flux.traced_field import Region, TracedField
from lightfield.render.response.response import Reference, TransportResponse
from lightfield.scene import Scene

REGION = Region(0.4, 2.0, 4.0, 0.1)
GRID = REGION.grid()
WATER = {"absorption_per_m": 0.1, "scattering_per_m": 0.2}
BATCHES = 4


def flux(place: Array) -> Array:
    """Flux vector that has both mirror images, and what flies back, shape (n, 4)."""
    x, y, z = place.T
    bright = np.exp(-(x**2 + 2 * y**2) / z) / z**2
    return np.stack([x * bright, 0.5 * y * bright, bright, 0.1 * bright], axis=1)


def field(scene: Scene) -> TracedField:
    """Of two histories, alike but for a factor of each batch."""
    z, y, x = np.meshgrid(GRID.z_m, GRID.y_m, GRID.x_m, indexing="ij")
    place = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    light = flux(place).T.ravel()
    tally = np.array([[light, 0.3 * light]] * BATCHES) * np.linspace(0.9, 1.1, BATCHES)[:, None, None]
    straight = np.tile(np.linalg.norm(place, axis=1), 4).reshape(-1, len(GRID.y_m), len(GRID.x_m))
    response = TransportResponse(
        tally.astype(np.float32),
        np.array([[1, 0, 0], [2, 0, 0]]),
        np.array([0.1, 0.2]),
        straight,
        Reference(WATER["absorption_per_m"], WATER["scattering_per_m"], 0.0),
        1,
    )
    return TracedField(scene, GRID, response)


def scene(offset_m: float = 0.0, **water: float) -> Scene:
    """In a tank without a surface, both halves of both axes tell each other; with an offset those along x."""
    return Scene.from_dict({
        "water": WATER | water, "lamp": {"hwhm_deg": 10.0, "offset_x_m": offset_m},
        "tank": {"surface": "none", "width_m": 3.0, "depth_m": 3.0},
    })  # fmt: skip


@pytest.fixture
def place() -> Array:
    rng = np.random.default_rng(5)
    across = rng.uniform(-0.4, 0.4, (40, 2))
    return np.column_stack([across, rng.uniform(2.0, 4.0, 40)])


def test_half_of_the_light_is_kept() -> None:
    whole, half = field(scene(1e-9)), field(scene())
    count = len(GRID.x_m)
    assert whole._mean.shape[1:] == (len(GRID.z_m), count // 2 + 2, count)
    assert half._mean.shape[1:] == (len(GRID.z_m), count // 2 + 2, count // 2 + 2)


@pytest.mark.parametrize("b", [0.2, 0.3])
def test_one_half_tells_the_other(place: Array, b: float) -> None:
    """Readings, their errors and slopes are those of all cells, on either side of the lamp."""
    both = [field(scene(offset, scattering_per_m=b)) for offset in (0.0, 1e-9)]
    rng = np.random.default_rng(6)
    normal = np.column_stack([rng.uniform(-1, 1, (40, 2)), -np.ones(40)])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    for mine, theirs in zip(*(one.irradiance(place, normal) for one in both), strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-5)
    np.testing.assert_allclose(*(one.diffuse_flux(place) for one in both), rtol=1e-4, atol=1e-6)
    for mine, theirs in zip(*(one.fluxes(place)[1] for one in both), strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-4, atol=1e-5)


def test_light_is_that_of_the_tally(place: Array) -> None:
    """Water as traced: what was tallied, 1.3 times, where the cells' bending is small."""
    found, expected = field(scene()).diffuse_flux(place), 1.3 * flux(place)
    assert np.abs(found - expected).max() < 2e-3 * expected.max()


def test_slopes_are_those_of_the_light(place: Array) -> None:
    """On both sides of the lamp, by differences of the light itself."""
    light, step = field(scene(scattering_per_m=0.3)), 1e-3
    slopes = light.fluxes(place)[1][1]
    for axis in range(3):
        off = step * np.eye(3)[axis]
        expected = (light.diffuse_flux(place + off) - light.diffuse_flux(place - off)) / (2 * step)
        np.testing.assert_allclose(slopes[:, :, axis], expected, rtol=2e-3, atol=1e-4)


def test_waters_share_what_was_made(place: Array) -> None:
    """Splines of the histories are made once, whichever water asks first; each has its own light."""
    first = field(scene())
    normal = np.tile([0.0, 0.0, -1.0], (len(place), 1))
    some, other = (first.in_water_of(scene(absorption_per_m=a)) for a in (0.2, 0.3))
    brighter, _ = some.irradiance(place, normal)
    darker, _ = other.irradiance(place, normal)
    assert (brighter > 1.05 * darker).all()
    assert some.histories.parts is other.histories.parts is first.histories.parts


@pytest.mark.parametrize("z_m", [1.5, 2.0, 2.05, 3.0, 3.95, 4.0, 5.0])  # the first and last beyond all
@pytest.mark.parametrize("b", [0.2, 0.3])
def test_a_few_layers_tell_what_all_tell(place: Array, z_m: float, b: float) -> None:
    """The first places asked in a new water are read from their own layers: values, errors and slopes, but
    for the nodes between which chances of paths are interpolated, 1 %."""
    near = np.column_stack([place[:, :2], z_m + 0.02 * (place[:, 2] - 3)])
    normal = np.tile([0.1, -0.2, -0.97], (len(near), 1))
    first = field(scene())
    few, whole = (first.in_water_of(scene(scattering_per_m=b)) for _ in range(2))
    whole.reading(place, normal)  # all over the region: all layers
    assert [made.z for made in whole._made] == [slice(0, len(GRID.z_m))]
    for mine, theirs in zip(few.irradiance(near, normal), whole.irradiance(near, normal), strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=2e-5)
    for mine, theirs in zip(few.fluxes(near)[1], whole.fluxes(near)[1], strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=2e-5, atol=1e-6)
    (made,) = few._made
    assert made.mean.windows.shape[0] <= 6
    elsewhere = few.reading(place, normal)
    np.testing.assert_array_equal(elsewhere, whole.reading(place, normal))


def test_without_one_batch(place: Array) -> None:
    """Factors 0.9 to 1.1 in four batches: without the first the light is that of the mean of the others."""
    whole = field(scene())
    left = whole.leave_one_out()
    mean = np.linspace(0.9, 1.1, BATCHES)
    for k, one in enumerate(left):
        expected = whole.diffuse_flux(place) * np.delete(mean, k).mean()
        np.testing.assert_allclose(one.diffuse_flux(place), expected, rtol=1e-4, atol=1e-7)


@pytest.mark.parametrize("steps", [3, 6, 7])
def test_rounding_makes_no_cell_more(steps: int) -> None:
    """0.1 m times 3, 6 and 7 is more than 0.3, 0.6 and 0.7 m: a cell more may not fit into a tank."""
    assert 0.1 * steps > steps / 10
    assert Region(0.1 * steps, 2.0, 4.0, 0.1).grid().shape == Region(steps / 10, 2.0, 4.0, 0.1).grid().shape
