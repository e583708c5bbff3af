"""Renders of the benchmarks: at the places, and where it counts at the times, of their readings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.hidden_effects import lights
from benchmarks.hidden_effects.benches import bench_named, table_of
from benchmarks.hidden_effects.catalogue import Truth
from lightfield.readings import Readings
from lightfield.render import at_readings


@pytest.mark.parametrize(("drift", "renders"), [(0.0, 1), (-0.01, 2)])
def test_water_that_drifts_is_rendered_at_the_times_of_its_readings(
    drift: float, renders: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two orders of one scan share a render unless the water changes while they are read."""
    seen: list[np.ndarray] = []

    def rendered(scene: object, table: Readings, **more: object) -> tuple[np.ndarray, np.ndarray]:
        seen.append(np.asarray(table.time_s))
        return np.ones(len(table)), np.zeros(len(table))

    monkeypatch.setattr(at_readings, "rendered_light", rendered)
    values = (("water.drift_per_m_per_hour", drift), ("water.absorption_per_m", 0.2))
    truth = Truth("clean", "line", 0, "water_drift", values=values)
    rng = np.random.default_rng(0)
    tables = [table_of(bench_named("line"), order, rng) for order in ("plane", "random")]
    for table in (*tables, *tables):
        lights.light_of(truth, tmp_path, table)
    assert len(seen) == renders
    for times, table in zip(seen, tables, strict=False):
        assert np.array_equal(times[: len(table)], table.time_s)
