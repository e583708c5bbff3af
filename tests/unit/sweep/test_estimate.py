"""What a sweep is said to cost."""

from __future__ import annotations

import pytest

from lightfield.scene import Scene
from lightfield.sweep.axes import Axis
from lightfield.sweep.estimate import sweep_cost
from lightfield.sweep.sweep_plan import SweepSettings, make_plan


@pytest.mark.parametrize(("pixels", "least", "most"), [(33, 0.02, 0.06), (129, 0.12, 0.5)])
def test_evaluating_takes_what_it_took(pixels: int, least: float, most: float) -> None:
    """Of a case, s: 0.03 with 33 cells a side and 0.2 with 129, measured; a tenth of that was told."""
    scene = Scene.from_dict({"water": {"scattering_per_m": 0.1}, "detector": {"pixels": pixels}})
    axis = Axis("b", {"water.absorption_per_m": tuple(0.05 + 0.001 * k for k in range(40))})
    found = sweep_cost(make_plan(scene, [axis], SweepSettings()))
    assert least < found.block_seconds / 40 < most
