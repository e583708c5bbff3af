"""What is remembered of contracted tallies: each beam once, and no more than memory is set aside for."""

from __future__ import annotations

import weakref

import numpy as np
import pytest
from directed import directed
from scipy.sparse import eye_array

from lightfield.render.response import beam_tallies
from lightfield.render.response.beam_nodes import BeamNodes
from lightfield.render.response.beam_tallies import FEWEST_BEAMS, BeamTallies, Sent
from lightfield.render.response.grid import angle_nodes, positions_grid
from lightfield.render.response.symmetry import mirror_images
from lightfield.scene import Lamp, Scene


@pytest.fixture
def beams() -> BeamTallies:
    """Made-up tallies of two g in nine cells: light that was scattered, and that walls reflected."""
    x = np.linspace(-0.4, 0.4, 9)
    grid = positions_grid(x, 0 * x, 0 * x + 4.5)
    images, nodes = mirror_images(Scene.from_dict({}), grid), angle_nodes(4.0)
    rng = np.random.default_rng(0)
    tallies = [rng.random((nodes.size, 3, len(images.kept))).astype(np.float32) for _ in range(2)]
    return BeamTallies(
        directed(tallies, np.array([(1, 0, 0), (2, 0, 0), (0, 1, 0)])),
        BeamNodes(nodes, 4.0),
        Sent(np.ones(nodes.n_theta), Lamp(hwhm_deg=4.0)),
        grid.centres()[2].ravel(),
        images,
        eye_array(len(x), format="csr"),
    )


def test_a_beam_is_contracted_once_whatever_else_the_lamp_has(beams: BeamTallies) -> None:
    """Its place, power and drift change nothing; what acts on the beam does, its source behind too."""
    one = beams.contracted(0, Lamp(hwhm_deg=5.0))
    same = Lamp(hwhm_deg=5.0, offset_x_m=0.1, power_w=3.0, drift_per_hour=0.1)
    assert beams.contracted(0, same) is one
    for other in ({"tilt_x_deg": 1.0}, {"apparent_distance_m": 1.0}, {"ellipticity": 1.2}):
        found = beams.contracted(0, Lamp(hwhm_deg=5.0, **other))
        assert np.abs(beams.at_cells(found) / beams.at_cells(one) - 1).max() > 1e-3, other
    assert beams.contracted(1, Lamp(hwhm_deg=5.0)).shape == (1, 1, 9)
    assert not np.allclose(beams.contracted(0, Lamp(hwhm_deg=5.0), squares=True), one)


@pytest.mark.parametrize(("holds", "kept"), [(0.0, FEWEST_BEAMS), (12.5, 12)])
def test_contracted_tallies_keep_to_their_memory(
    beams: BeamTallies, monkeypatch: pytest.MonkeyPatch, holds: float, kept: int
) -> None:
    """So many of the largest class as the bytes hold, but some; what is forgotten is found again."""
    one = beams.contracted(0, Lamp(hwhm_deg=3.0))
    fresh = BeamTallies(*(getattr(beams, name) for name in BeamTallies.__dataclass_fields__))
    monkeypatch.setattr(beam_tallies, "KEPT_BYTES", holds * beams.at_cells(one).nbytes)
    lamps = [Lamp(hwhm_deg=3.0 + 0.1 * i) for i in range(20)]
    made = [weakref.ref(fresh.contracted(0, lamp)) for lamp in lamps]
    assert sum(ref() is not None for ref in made) == kept
    np.testing.assert_array_equal(fresh.contracted(0, lamps[0]), one)
