"""The best set so far, as a search tells it and as it is left when the search is stopped."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from analytic_readings import readings

from lightfield import cli
from lightfield.diagnosis import knowledge
from lightfield.diagnosis.diagnose import diagnose
from lightfield.diagnosis.verdict.best_set.so_far import SoFar
from lightfield.readings import write_table

HIDDEN = {"detector.background": 0.01}


def test_the_best_set_is_told_with_its_error() -> None:
    """With the effect that is hidden nothing but the noise is left, whose size is stated rightly here: its
    rms scatters by 1/sqrt(2 n) of itself. Readings of less than a twentieth of their plane's do not count."""
    lines: list[str] = []
    so_far = SoFar(lines.append)
    assert so_far.as_text() == ""
    table, believed = readings(HIDDEN, seed=2)
    few = ["beam_tilt", "background"]
    diagnose(table, believed, diffuse=None, only=few, advise=False, progress=so_far)
    assert so_far.best is not None and so_far.sets >= 2
    told = [line for line in lines if "sets of effects tried; best so far" in line]
    assert "% with " in told[0]
    counted = table.value > 0.05 * np.array([table.value[table.z_m == z].max() for z in table.z_m])
    noise = 100 * np.sqrt(np.mean((table.stderr / table.value)[counted] ** 2))
    best = so_far.best.error_percent
    assert best == pytest.approx(noise, rel=3 / np.sqrt(2 * counted.sum()))
    assert f"error {best:.3g} % with background (without any" in so_far.as_text()


def test_a_search_that_is_far_behind_does_not_replace_the_best() -> None:
    """One of its own that is worse does, as fewer effects are; light that was traced anew changes little."""
    so_far = SoFar()
    layout = SimpleNamespace(plane_and_channel=np.zeros(3, int), channel=np.zeros(3, int))
    forward = SimpleNamespace(readings=SimpleNamespace(stderr=np.full(3, np.nan)))
    one, other = (
        SimpleNamespace(layout=layout, value=np.ones(3), keep=np.ones(3), forward=forward) for _ in range(2)
    )

    def best_after(problem: Any, off: float) -> float:
        so_far.tried(1, problem, (), SimpleNamespace(prediction=np.full(3, 1 / (1 + off))))
        return so_far.best.error_percent if so_far.best else np.nan

    tried = [(one, 0.02), (one, 0.03), (other, 0.2), (other, 0.031), (other, 0.1)]
    assert [best_after(*each) for each in tried] == pytest.approx([2, 3, 3, 3.1, 10])


def test_stopped_it_leaves_the_best_set(tmp_path: Path, capsys, monkeypatch) -> None:
    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    table, believed = readings(HIDDEN, seed=2)
    write_table(table, tmp_path / "data.csv")
    believed.save(tmp_path / "scene.toml")
    monkeypatch.setattr(knowledge, "levelled", stopped)
    run = f"diagnose {tmp_path}/data.csv --scene {tmp_path}/scene.toml --effects beam_offset,background"
    assert cli.main([*run.split(), "--no-trace", "--json", f"{tmp_path}/v.json"]) == 130
    said = capsys.readouterr()
    assert said.err.endswith("lightfield: interrupted\n")
    assert "Stopped after" in said.out and "effects may do as well" in said.out
    assert " % with background" in said.out
    written = json.loads((tmp_path / "v.json").read_text())
    assert written["interrupted"] and "verdict" not in written
    best = written["best_so_far"]
    assert best["effects"] == ["background"] and best["error_percent"] < best["error_percent_without"]
    assert f"detector.background = {best['parameters']['detector.background']:.4g}" in said.out
    assert f"Stopped after {written['sets_tried']} sets" in said.out
