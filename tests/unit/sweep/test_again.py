"""What fails for the machine's sake is no answer about a case: the same sweep tries it again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import xarray as xr

from lightfield.commands.sweep import as_text
from lightfield.errors import RenderError
from lightfield.scene import Scene
from lightfield.sweep import runner
from lightfield.sweep.axes import parse_axis
from lightfield.sweep.results import verify
from lightfield.sweep.runner import MAPS, SweepProgress, run_sweep
from lightfield.sweep.sweep_plan import SweepPlan, SweepSettings, make_plan

SCENE = {
    "water": {"absorption_per_m": 0.1, "scattering_per_m": 0.1},
    "detector": {"planes_m": [2.0], "pixels": 5},
}


@pytest.fixture
def plan() -> SweepPlan:
    axes = [parse_axis("water.absorption_per_m=0.1,0.2", "--vary")]
    return make_plan(Scene.from_dict(SCENE), axes, SweepSettings(max_photons=1e4, rel_error=0.5))


def failing(error: Exception):
    def block(*_: object) -> None:
        raise error

    return replace(MAPS, block=block)


def status(store: Path) -> list[int]:
    return xr.open_zarr(store).status.values.tolist()


@pytest.mark.parametrize("what", ["block", "trace"])
def test_without_memory_nothing_is_settled(plan, tmp_path, monkeypatch, what) -> None:
    """What the store says then is why; the next time all is done, and what was done stays done."""
    store, error = tmp_path / "s.zarr", MemoryError("no room")

    def no_trace(*_: object) -> None:
        raise error

    with monkeypatch.context() as patched:
        if what == "trace":
            patched.setattr(runner, "do_trace", no_trace)
        first = run_sweep(plan, store, kind=failing(error) if what == "block" else MAPS)
    assert (first.failed, first.again) == (2, 2) and status(store) == [2, 2]
    assert "no room" in str(xr.open_zarr(store).message.values[0])
    assert not verify(store).complete
    second = run_sweep(plan, store)
    assert (second.cases_done, second.failed, second.again) == (2, 0, 0) and status(store) == [1, 1]
    assert verify(store).complete
    assert run_sweep(plan, store).cases_done == 0


def test_what_a_scene_cannot_be_is_settled(plan, tmp_path) -> None:
    store = tmp_path / "s.zarr"
    first = run_sweep(plan, store, kind=failing(RenderError("no such light")))
    assert (first.failed, first.again) == (2, 0) and verify(store).complete
    second = run_sweep(plan, store)
    assert (second.cases_done, second.failed) == (0, 2)


def test_a_case_whose_bands_see_no_light_fails(tmp_path) -> None:
    """The other is evaluated from the trace that both share: maps of zeros are no answer."""
    lamp = {"spectrum": {"peak_nm": 525.0, "fwhm_nm": 20.0}}
    axes = [parse_axis("lamp.spectrum.peak_nm=525,900", "--vary")]
    settings = SweepSettings(max_photons=1e4, rel_error=0.5)
    store = tmp_path / "s.zarr"
    done = run_sweep(make_plan(Scene.from_dict({**SCENE, "lamp": lamp}), axes, settings), store)
    assert done.failed == 1 and status(store) == [1, 2]
    assert "no light in the bands that are seen" in str(xr.open_zarr(store).message.values[1])


def test_a_trace_that_lies_there_is_not_told_as_traced(plan, tmp_path) -> None:
    """Its photons over the time in which it is read are no rate, and nothing tells what it saves."""
    store = tmp_path / "s.zarr"
    with pytest.raises(OSError, match="interrupted"):
        run_sweep(plan, store, kind=failing(OSError("interrupted")))
    done = run_sweep(plan, store)
    assert (done.traced, done.found, done.photons, done.trace_seconds) == (1, 1, 0, 0)
    said = as_text(plan, done, store)
    assert "this run: 0 traced (0 photons), 2 evaluated" in said and "times as long" not in said


def test_what_a_shared_trace_saves_counts_the_same_evaluations_on_both_sides(plan) -> None:
    """Two cases of one trace: twice as long without evaluation, as long where it is all of the time."""
    seconds = {"trace_seconds": 3.0, "block_seconds": 1.0}
    done = SweepProgress(2, 1, cases_done=1, traced=1, **seconds)
    assert done.gain(plan) == pytest.approx((2 * 3 + 2) / (3 + 2))
    assert SweepProgress(2, 2, cases_done=1, traced=1, found=1, **seconds).gain(plan) == 0
