"""Distances that studies ask about by themselves."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from lightfield.errors import SceneError
from lightfield.scene import Scene
from lightfield.studies.band.study import best_band
from lightfield.studies.follower.array_light import Space
from lightfield.studies.working_range.study import working_range

C = 0.1


def scene(*positions: list[float]) -> Scene:
    water = {"absorption_per_m": C}
    return Scene.from_dict({"water": water, "detector": {"positions_m": list(positions)}})


def test_they_are_those_of_single_positions_where_a_scene_lists_them() -> None:
    """Not those of the planes that it does not have: 4.5 to 8.5 m are their default."""
    listed = scene([0, 0, 3.0], [0.1, 0, 1.5], [0, 0, 1.5], [0, 0, 2.0])
    found = working_range(listed, None)
    assert found.reference_m == 1.5 and float(found.dataset.z_m[-1]) == 6.0
    assert {1.5, 2.0, 3.0} <= set(found.dataset.z_m.values.tolist())
    z = brentq(lambda z: (1.5 / z) ** 2 * np.exp(-C * (z - 1.5)) - 0.2, 1.6, 6)
    assert found.reaches[0].z_m == pytest.approx(z, abs=1e-3)
    assert best_band(listed, traced=False).spectrum.z_m.values.tolist() == [1.5, 3.0]
    assert Space.of_scene(listed) == Space(0.4, 1.5, 3.0)
    with pytest.raises(SceneError, match=r"first of detector\.positions_m, to 2\.1 m, as asked for"):
        working_range(scene([0, 0, 2.0]), None, to_m=2.1)
