"""Own effects in a sweep: what `render` and `compare` say of the same scene, step by step.

Rationale: a sweep evaluates many cases of one trace, `render` traces and evaluates one. Set-up: an effect at
each stage, off and large, in grey water with two bands, that scatters. Expected: where the trace is the
same photons, the same maps to single precision, and the formula of `compare`; what acts on readings alone
changes no map, in neither.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from lightfield.maps.dataset import to_dataset
from lightfield.render.maps import render_scene
from lightfield.scene import Scene
from lightfield.studies.compare.maps import compare
from lightfield.sweep.axes import parse_axis
from lightfield.sweep.runner import run_sweep
from lightfield.sweep.sweep_plan import SweepPlan, SweepSettings, make_plan

STEPS = (0.0, 0.6)
SETTINGS = SweepSettings(max_photons=2e4, rel_error=1e-3)
#: Stage, formula, and whether the light of maps follows, and is traced anew.
STAGES: dict[str, tuple[str, str, bool, bool]] = {
    "beam": ("source", "1 - a*(theta/5)**2*exp(-(theta/5)**2)", True, True),
    "hole": ("path", "1 - a*exp(-((x - 0.02)/0.05)**2)", True, False),
    "colour": ("path", "1 - a*(wavelength > 600)", True, False),
    "receiver": ("receiver", "1 - a*(x > 0)", False, False),
    "time": ("source", "1 + a*time/1000", False, False),
    "readout": ("readout", "signal*(1 - a*signal*0.5)", False, False),
}
#: Over a cell of 4 mm nothing varies by much.
TEXT = {
    "water": {"absorption_per_m": 0.1, "scattering_per_m": 0.05},
    "detector": {"planes_m": [2.0, 3.0], "width_m": 0.036, "pixels": 9, "bands_nm": [[440, 460], [640, 660]]},
}


def scene_of(what: str) -> Scene:
    stage, formula, *_ = STAGES[what]
    effect: dict[str, Any] = {"name": "hole", "stage": stage, "formula": formula}
    numbers = {"a": {"range": [0.0, 0.9], "neutral": 0.0}}
    return Scene.from_dict({**TEXT, "effect": [{**effect, "parameters": numbers}]})


def plan_of(what: str) -> SweepPlan:
    return make_plan(scene_of(what), [parse_axis("effect.hole.a=0,0.6")], SETTINGS)


@pytest.mark.parametrize("what", STAGES)
def test_what_is_traced_anew(what: str) -> None:
    assert plan_of(what).trace_of_case.tolist() == ([0, 1] if STAGES[what][3] else [0, 0])


@pytest.mark.parametrize("what", ["beam", "hole", "colour", "receiver"])
def test_maps_and_formula_are_those_of_render_and_compare(what: str, tmp_path: Path) -> None:
    plan = plan_of(what)
    run_sweep(plan, tmp_path / "s.zarr")
    data = xr.open_zarr(tmp_path / "s.zarr").load()
    assert data.status.values.tolist() == [1, 1]
    steps = data.irradiance.values
    assert np.array_equal(steps[0], steps[1]) == (not STAGES[what][2])
    if what == "colour":
        np.testing.assert_allclose(steps[1, 0], steps[0, 0], rtol=1e-5)
        red = data.isel(wavelength_nm=1)
        straight = (1 + red.formula_error_of_power[0]) * red.plane_power[0]
        np.testing.assert_allclose(red.plane_power[0] - red.plane_power[1], 0.6 * straight, rtol=1e-3)
    for number, value in enumerate(STEPS):
        trace = plan.traces[plan.trace_of_case[number]]
        rendering = render_scene(
            scene_of(what).with_values({"effect.hole.a": value}),
            rel_error=SETTINGS.rel_error,
            max_photons=SETTINGS.max_photons,
            seed=trace.seed,
            reference=trace.reference,
            cache=False,
        )
        alone, case = to_dataset(rendering), data.isel({"effect.hole.a": number})
        for name in ("irradiance", "irradiance_stderr"):
            np.testing.assert_allclose(case[name].values, alone[name].values, rtol=1e-5, err_msg=name)
        planes = compare(alone).planes
        for name, expected in (
            ("formula_error_on_axis", [plane.axis_error for plane in planes]),
            ("formula_error_of_power", [-plane.lost for plane in planes]),
        ):
            np.testing.assert_allclose(case[name].values.ravel(), expected, atol=2e-5, err_msg=name)


def test_a_formula_without_a_value_fails_its_case_alone(tmp_path: Path) -> None:
    """The logarithm of what is left of the axis is no number, where the amplitude is not zero."""
    effect = {"name": "hole", "stage": "path", "formula": "where(a > 0.5, log(x), 1 - a)",
              "parameters": {"a": {"range": [0.0, 0.9], "neutral": 0.0}}}  # fmt: skip
    scene = Scene.from_dict({**TEXT, "effect": [effect]})
    run_sweep(make_plan(scene, [parse_axis("effect.hole.a=0.3,0.6")], SETTINGS), tmp_path / "s.zarr")
    data = xr.open_zarr(tmp_path / "s.zarr")
    assert data.status.values.tolist() == [1, 2]
    assert "no finite value" in str(data.message.values[1])
