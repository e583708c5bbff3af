"""A render from the cache is the render that was traced; a damaged or foreign entry is traced again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from perturbed import FIELDS, changed

from lightfield.experiments.layouts import scan
from lightfield.render.at_readings import rendered_light
from lightfield.render.backend import limited_threads, use_backend
from lightfield.render.maps import Rendering, render_scene, transport_key
from lightfield.render.response.grid import scene_grid
from lightfield.render.response.response import Reference
from lightfield.render.response.response_cache import digest_of
from lightfield.render.settings import Settings
from lightfield.scene import Scene
from lightfield.scene.acts import TRACED, Acts
from lightfield.scene.all_parameters import acts_on

SCENE = Scene.from_dict(
    {
        "water": {"absorption_per_m": 0.1, "scattering_per_m": 0.1},
        "tank": {"wall_albedo": 0.2},
        "detector": {"planes_m": [4.5], "width_m": 1.0, "pixels": 5},
    }
)


def rendered() -> Rendering:
    return render_scene(SCENE, rel_error=1e-2, max_photons=5e4)


def test_damaged_entries_are_traced_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LIGHTFIELD_CACHE", str(tmp_path))
    first = rendered()
    (entry,) = (tmp_path / "transport").glob("*.npz")
    again = rendered()
    assert again.response.tally.tobytes() == first.response.tally.tobytes()
    assert again.energy == first.energy and again.reached == first.reached
    entry.write_bytes(entry.read_bytes()[:2000])
    rebuilt = rendered()
    np.testing.assert_allclose(rebuilt.response.tally, first.response.tally, rtol=1e-5, atol=1e-9)
    assert entry.stat().st_size > 2000


def test_light_at_readings_is_rendered_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another seed, place, colour, scene or precision is another render."""
    monkeypatch.setenv("LIGHTFIELD_CACHE", str(tmp_path))
    asked = []

    def render(scene: Scene, x: np.ndarray, *_: Any, **settings: Any) -> tuple[np.ndarray, np.ndarray]:
        asked.append(settings["seed"])
        return np.full(len(x), float(len(asked))), np.full(len(x), 0.5)

    monkeypatch.setattr("lightfield.render.at_readings._render", render)
    table = scan(SCENE, "line", "random", np.random.default_rng(0))
    first = rendered_light(SCENE, table)
    again = rendered_light(SCENE, table)
    assert len(asked) == 1
    for one, other in zip(first, again, strict=True):
        np.testing.assert_array_equal(one, other)
    ageing = SCENE.with_values({"water.drift_per_m_per_hour": 0.01})
    others: list[tuple[Scene, Any, dict[str, Any]]] = [
        (SCENE, table, {"seed": 2}), (SCENE, table, {"symmetry": True}), (SCENE, table, {"rel_error": 0.1}),
        (SCENE, table, {"max_photons": 10.0}), (SCENE.with_values({"lamp.hwhm_deg": 4.0}), table, {}),
        (SCENE, replace(table, x_m=table.x_m + 0.01), {}),
        (SCENE, replace(table, wavelength_nm=np.full(len(table), 600.0)), {}),
        (SCENE, replace(table, medium=np.full(len(table), "air")), {}),
        (ageing, table, {}), (ageing, replace(table, time_s=table.time_s + 600.0), {}),
    ]  # fmt: skip
    for scene, readings, options in others:
        rendered_light(scene, readings, **options)
    assert len(asked) == 1 + len(others)


def key(scene: Scene) -> str:
    """Name of the scene's cache entry, traced in one and the same reference water."""
    return digest_of(transport_key(scene, scene_grid(scene), Reference(0.1, 0.1, 0.2)))


def test_the_key_of_places_is_that_of_the_cells_they_lie_in() -> None:
    """The same grid of cells, of which other ones are asked for. Every field is in test_acts."""
    corners = (0.0, 0.0, 4.5), (0.2, 0.2, 4.5), (0.0, 0.2, 4.5), (0.2, 0.0, 4.5)
    asked = [SCENE.with_values({"detector.positions_m": corners[:count]}) for count in (2, 3, 4)]
    assert len({key(scene) for scene in asked}) == 3


def test_what_the_key_leaves_out_does_not_change_the_trace() -> None:
    """One photon after the other goes the same way, whatever any other field says."""
    use_backend()
    from lightfield.render.tracer.accumulate import trace_until

    reference = Reference(0.1, 0.2, 0.2, 0.5)
    lit = SCENE.with_values({"tank.surface_reflectance": 0.5, "lamp.warmup_fraction": 0.1})

    def tally(scene: Scene) -> np.ndarray:
        with limited_threads(1):  # one order of summation
            return trace_until(scene, scene_grid(scene), reference, Settings(1.0, 2e3, 1, False))[0].tally

    expected = tally(lit)
    others = [path for path in FIELDS if not acts_on(path) & (TRACED | Acts.PLACES)]
    left_out = [path for path in others if key(changed(lit, path)) == key(lit)]
    assert set(others) - set(left_out) == {"tank.surface"}, "whether it reflects is in the key"
    numbers = {"lamp.power_w", "water.absorption_per_m", "tank.wall_albedo", "detector.saturation"}
    assert numbers | {"lamp.spectrum", "water.base", "detector.response"} < set(left_out)
    for path in left_out:
        np.testing.assert_array_equal(tally(changed(lit, path)), expected, path)
    assert not np.array_equal(tally(lit.with_values({"lamp.hwhm_deg": 4.0})), expected)
