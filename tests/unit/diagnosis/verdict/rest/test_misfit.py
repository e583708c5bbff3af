"""The coordinate of what nothing explains."""

from __future__ import annotations

import numpy as np
import pytest
from analytic_readings import readings

from lightfield.diagnosis.diagnose import diagnose


@pytest.mark.parametrize(("planes", "size"), [((7.5, 8.5), 0.3), ((6.5, 8.5), 0.1)])
def test_what_lies_in_two_planes_is_not_said_to_lie_in_one(planes: tuple[float, ...], size: float) -> None:
    """Light from one side, in two of five planes: it was said that one of them "may stand elsewhere"."""
    table, scene = readings(
        seed=1, factor=lambda t: 1 + size * (t.x_m > 0.35) * np.isin(np.round(t.z_m, 2), planes)
    )
    verdict = diagnose(table, scene, diffuse=None, advise=False, only=["background"]).verdict
    assert verdict.verdict == "unexplained"
    assert verdict.misfit is None or not verdict.misfit.at_one
