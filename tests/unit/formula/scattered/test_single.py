"""Light that was scattered once, by a table of the beam."""

from __future__ import annotations

import numpy as np
import pytest

from lightfield.formula.scattered.quadrature import EmissionTable
from lightfield.formula.scattered.single import TabledPaths, single_paths
from lightfield.scene.water.phase.spec import HenyeyGreenstein


@pytest.mark.parametrize("behind_m", [0.0, 1.0])
def test_light_by_the_table_is_that_of_the_paths(behind_m: float) -> None:
    """Of one length together or not, of a beam that is no Gaussian."""
    width, z = 0.07, np.array([2.0, 3.0, 4.0])
    table = EmissionTable.of(width)
    paths = TabledPaths.of(table, single_paths(HenyeyGreenstein(g=0.9), width, 0.1 * z, z, behind_m))
    beam = 1 / (1 + (table.theta / width) ** 4)
    assert paths.by_table(0.1, 0.2) @ beam == pytest.approx(paths.lit(beam).light(0.1, 0.2), rel=1e-6)
