"""Asked again with more photons under a surface, where what is found rests on them, and nowhere else."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lightfield.diagnosis import clearer_light
from lightfield.diagnosis.diagnose import diagnose
from lightfield.readings import Readings
from lightfield.render.at_readings import rendered_light
from lightfield.render.diffuse.source import response_for
from lightfield.scene import Scene

WATER = {"absorption_per_m": 0.1, "scattering_per_m": 0.2}


def scene(surface: str, **water: float) -> Scene:
    return Scene.from_dict({"water": {**WATER, **water}, "tank": {"surface": surface}})


def outcome(fitted: Scene) -> Any:
    """What a course ends with, as far as it is asked of."""
    light = SimpleNamespace(
        scenes=SimpleNamespace(at=lambda values, validate: fitted),
        diffuse=SimpleNamespace(trace=True, wavelengths_nm=[525.0]),
    )
    problem = SimpleNamespace(forward=SimpleNamespace(light=light))
    fit = SimpleNamespace(values={})
    finding = SimpleNamespace(closest=SimpleNamespace(fit=fit))
    return SimpleNamespace(known=SimpleNamespace(finding=finding, prepared=SimpleNamespace(problem=problem)))


@pytest.mark.parametrize(
    ("stated", "fitted", "settles", "again"),
    [
        (scene("none"), scene("flat"), True, True),
        (scene("flat"), scene("flat"), True, False),  # traced as well as all else
        (scene("none"), scene("none"), True, False),
        (scene("none"), scene("flat", scattering_per_m=0.0), True, False),
        (scene("none"), scene("flat"), False, False),  # by a source of the caller's own
    ],
)
def test_where_it_is_asked_again(
    stated: Scene, fitted: Scene, settles: bool, again: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []

    def course(source: Any) -> str:
        asked.append(source)
        return "clearer"

    monkeypatch.setattr(clearer_light, "course", course)
    monkeypatch.setattr(clearer_light, "replace", lambda inquiry, source: source)
    inquiry: Any = SimpleNamespace(
        scene=stated, source=response_for, is_settled_after=settles, progress=lambda words: None
    )
    first = outcome(fitted)
    asked_now, found = clearer_light.by_clearer_light(inquiry, first)
    assert (found == "clearer") == again and (found is first) != again
    assert (asked_now is inquiry) != again
    for source in asked:
        assert isinstance(source, partial) and source.func is response_for
        assert source.keywords == {"under_surface": clearer_light.CLEARLY_UNDER_SURFACE}


@pytest.mark.slow
def test_scattering_that_a_full_render_hid_under_a_surface_is_found_with_its_size() -> None:
    """b = 0.25 per m and g = 0.92, of which the light of the search alone made 0.1 and 0.8."""
    rng = np.random.default_rng(5)
    across, heights, far = [-0.8, -0.3, 0.0, 0.4], [-1.0, -0.5, 0.0, 0.3], [1.5, 2.25, 3.0, 4.0, 5.0]
    x, y, z = (g.ravel() for g in np.meshgrid(across, heights, far))
    tank = {"width_m": 3.0, "depth_m": 2.0, "length_m": 12.0, "behind_lamp_m": 0.5, "lamp_depth_m": 0.5}
    phase = {"type": "henyey-greenstein", "g": 0.92}
    parts = {"lamp": {"hwhm_deg": 15.0}, "water": {"absorption_per_m": 0.1, "phase": phase}}
    believed = Scene.from_dict({**parts, "tank": {**tank, "surface": "none"}})
    truth = Scene.from_dict({**parts, "tank": {**tank, "surface": "flat"}})
    truth = truth.with_values({"water.scattering_per_m": 0.25})
    bare = Readings.from_arrays(x_m=x, y_m=y, z_m=z, value=np.ones(x.size))
    light, error = rendered_light(truth, bare, max_photons=4e7, rel_error=0.002)
    value = np.ravel(light) / light.max()
    stderr = np.hypot(0.01 * value, np.ravel(error) / light.max())
    shown = Readings.from_arrays(
        x_m=x, y_m=y, z_m=z, value=value + stderr * rng.standard_normal(x.size), stderr=stderr
    )
    verdict = diagnose(shown, believed, advise=False).verdict
    assert sorted(verdict.best_set) == ["scattering", "surface_reflection"]
    found = verdict.explanations[0].parameters
    for path, true, most in (("water.scattering_per_m", 0.25, 0.15), ("water.phase.g", 0.92, 0.08)):
        assert abs(found[path].value - true) < 3 * found[path].stderr, path
        assert found[path].stderr < most, path
