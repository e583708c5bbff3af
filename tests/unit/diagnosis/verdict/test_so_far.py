"""The best set so far, as a search tells it and as it is left when the search is stopped."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lightfield import cli
from lightfield.diagnosis import course
from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.verdict.best_set.so_far import SoFar
from lightfield.readings import read_table
from lightfield.scene import Scene

STORY = Path(__file__).parents[4] / "scenes" / "hidden_effect"


def test_the_best_set_is_told_with_its_error() -> None:
    lines: list[str] = []
    so_far = SoFar(lines.append)
    assert so_far.as_text() == ""
    readings, scene = read_table(STORY / "data.csv"), Scene.load(STORY / "scene.toml")
    found = diagnose(
        readings, scene, diffuse=None, only=["beam_tilt", "background"], advise=False, progress=so_far
    )
    assert so_far.best is not None and so_far.sets >= 2
    told = [line for line in lines if "sets of effects tried; best so far" in line]
    assert "% with " in told[0]
    model, value, z = so_far.best.fit.prediction, readings.value, readings.z_m
    bright = value > 0.05 * np.array([value[z == at].max() for at in z])
    rms = 100 * np.sqrt(np.mean((value[bright] / model[bright] - 1) ** 2))
    assert so_far.best.error_percent == pytest.approx(rms)
    assert f"error {rms:.3g} % with" in so_far.as_text()
    assert found.verdict.ladder[-1].error_percent < found.verdict.ladder[0].error_percent


def test_stopped_it_leaves_the_best_set(capsys, monkeypatch) -> None:
    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(course, "levelled", stopped)
    run = f"diagnose {STORY}/data.csv --scene {STORY}/scene.toml --effects beam_offset,background --no-trace"
    assert cli.main(run.split()) == 130
    said = capsys.readouterr()
    assert said.err.endswith("lightfield: interrupted\n")
    assert "Stopped after" in said.out and "effects may do as well" in said.out
    assert " % with " in said.out
