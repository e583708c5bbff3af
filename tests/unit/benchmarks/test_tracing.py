"""What the benchmark of hidden effects keeps in memory between its trials is bounded."""

from __future__ import annotations

from collections import OrderedDict
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks.hidden_effects import experiment
from benchmarks.hidden_effects.experiment import KEPT, Tracing
from lightfield.render.diffuse import source
from lightfield.render.diffuse.traced import TracedLight, TracedWater
from lightfield.scene import Scene

SCENE = Scene.from_dict({"lamp": {"hwhm_deg": 4.0}})
PLACES = (np.zeros(3), np.zeros(3), np.array([4.5, 5.5, 6.5]))


@pytest.fixture
def traced(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Water, by its scattering, of every response that was made."""
    made: list[float] = []

    def response_for(scene: Scene, *places: Any, dense_per_m: float, seed: int) -> Any:
        made.append(dense_per_m)
        return SimpleNamespace(clear=TracedWater(TracedLight(object, (), None, None), None))

    monkeypatch.setattr(source, "response_for", response_for)
    monkeypatch.setattr(experiment, "replace", lambda record, **values: SimpleNamespace(**values))
    monkeypatch.setattr(Tracing, "_kept", OrderedDict())
    return made


def test_the_newest_responses_are_kept_and_no_more(traced: list[float]) -> None:
    tracing = Tracing("line")
    first = tracing(SCENE, *PLACES, dense_per_m=0.0)
    for k in range(1, KEPT + 5):
        tracing(SCENE, *PLACES, dense_per_m=float(k))
        # One that every trial asks for stays, however many others come.
        assert tracing(SCENE, *PLACES, dense_per_m=0.0) is first
        assert len(Tracing._kept) <= KEPT
    assert traced == [float(k) for k in range(KEPT + 5)]
    tracing(SCENE, *PLACES, dense_per_m=1.0)
    assert traced[-1] == 1.0 and len(traced) == KEPT + 6


def test_without_a_set_up_nothing_is_kept(traced: list[float]) -> None:
    for _ in range(2):
        Tracing()(SCENE, *PLACES, dense_per_m=0.3)
    assert traced == [0.3, 0.3] and not Tracing._kept
