"""Effects of real tanks, each against a value worked out here, and found where it is hidden."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from analytic_readings import readings

from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.formula.field import predict
from lightfield.scene import Scene


def places(**columns: Any) -> Any:
    """Readings on the axis, as `predict` takes them."""
    n = max(np.size(v) for v in columns.values())
    given = {"x_m": 0.0, "y_m": 0.0, "z_m": 4.0} | columns
    return SimpleNamespace(**{k: np.broadcast_to(v, n) for k, v in given.items()})


def diagnosed(hidden: dict[str, float], **how: Any) -> Verdict:
    table, scene = readings(hidden, **how)
    return diagnose(table, scene, diffuse=None, advise=False).verdict


def found(verdict: Verdict, hidden: dict[str, float]) -> None:
    """The first explanation has the hidden values within four of its errors."""
    parameters = verdict.explanations[0].parameters
    for path, value in hidden.items():
        assert parameters[path].stderr is not None
        assert abs(parameters[path].value - value) < 4 * parameters[path].stderr, path


# -- immersion -----------------------------------------------------------------------------------------


def test_a_collector_in_water_reads_less_by_its_immersion_factor() -> None:
    """4 m from the lamp: in air 1/16, in water of 0.1 per m exp(-0.4)/16 / 1.38; then the background."""
    scene = Scene.from_dict(
        {"water": {"absorption_per_m": 0.1}, "detector": {"immersion_factor": 1.38, "background": 0.001}}
    )
    air, water = predict(scene, places(medium=np.array(["air", "water"])))
    assert air == pytest.approx(1 / 16 + 0.001, rel=1e-12)
    assert water == pytest.approx(np.exp(-0.4) / 16 / 1.38 + 0.001, rel=1e-12)


def test_immersion_is_found_from_readings_in_air_and_water_only() -> None:
    hidden = {"detector.immersion_factor": 1.38}
    verdict = diagnosed(hidden, seed=2, layout="air")
    assert (verdict.verdict, verdict.effects) == ("identified", ["immersion"])
    found(verdict, hidden)
    assert "air" in diagnosed({}, seed=2).untestable["immersion"]


def test_immersion_is_told_from_the_window_beside_it() -> None:
    """A tank has both; the window widens the beam in air, immersion dims all that is in water."""
    hidden = {"detector.immersion_factor": 1.35, "lamp.window_index": 1.336}
    verdict = diagnosed(hidden, seed=3, layout="air")
    assert set(verdict.effects) == {"immersion", "window_refraction"}
    found(verdict, hidden)
