"""Scattered light followed without photons: what the ratio, the response and pooling do to it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from perturbed import changed

from lightfield.formula.scattered.scattered_field import ScatteredField, describes
from lightfield.render.diffuse.diffuse_response import REFLECTED, SCATTERED
from lightfield.render.diffuse.followed import _PLAIN, FollowedLight
from lightfield.render.diffuse.ratio import TRUNCATION, Ratio
from lightfield.scene import Scene
from lightfield.scene.acts import Acts
from lightfield.scene.all_parameters import PARTS, paths_on
from lightfield.scene.parameters import neutral_of

X, Z = np.array([0.0, 0.3, 0.8]), np.array([3.0, 4.0, 5.0])
PLACES = X, 0 * X, Z
NEUTRAL = {f"{part}.{name}" for part, model in PARTS.items() for name in neutral_of(model)}
SCENE = Scene.from_toml("[water]\nbase = 'none'\nabsorption_per_m = 0.1\nscattering_per_m = 0.2\n")


@dataclass(frozen=True)
class FakeResponse:
    """Reflected light of one, and scattered light in proportion to the ellipticity."""

    rows: tuple[int, ...] = (0, 1, 2)

    def light(self, scene: Scene, wavelengths_nm: list[Any], kinds: range) -> np.ndarray:
        level = {REFLECTED: 1.0, SCATTERED: scene.lamp.ellipticity}[kinds]
        return np.full((len(wavelengths_nm), len(X)), level)[:, list(self.rows)]

    def in_waters(
        self, scene: Scene, waters: list[Any], wavelengths_nm: list[Any], kinds: range
    ) -> np.ndarray:
        return np.stack([self.light(scene, wavelengths_nm, kinds) for _ in waters])

    def errors(
        self, scene: Scene, wavelengths_nm: list[Any], channel: np.ndarray, kinds: range
    ) -> tuple[np.ndarray, np.ndarray]:
        assert kinds == REFLECTED
        return np.full((len(channel), 1), 0.5), np.full(len(channel), 0.25)

    def some(self, rows: Any) -> FakeResponse:
        return FakeResponse(tuple(np.flatnonzero(rows).tolist()))


def ratio(value: float, root: float, photons: int) -> Ratio:
    """The same at every place, with one error for all."""
    return Ratio((3.0, 5.0), 0.1, (1, 1), 0, np.array([[value]]), np.array([[[root]]]), photons)


def followed(*traced: Ratio) -> FollowedLight:
    return FollowedLight.of(FakeResponse(), PLACES, [(SCENE, r) for r in traced])  # type: ignore[arg-type]


def test_light_is_what_is_known_times_the_ratio_and_what_was_reflected() -> None:
    known = ScatteredField(*PLACES).light(SCENE, [None])
    assert followed(ratio(1.02, 0.01, 100)).light(SCENE, [None]) == pytest.approx(1.02 * known + 1.0)


def test_photons_of_several_traces_are_pooled() -> None:
    """Means by photons; errors of independent traces add in squares: sqrt(0.75^2 0.02^2 + 0.25^2 0.04^2)."""
    pooled = followed(ratio(1.0, 0.02, 300), ratio(1.04, 0.04, 100))
    assert pooled.ratio == pytest.approx(np.full((1, 3), 1.01))
    known = ScatteredField(*PLACES).light(SCENE, [None])[0]
    modes, smooth = pooled.errors(SCENE, [None], np.zeros(3, int))
    assert modes.shape == (3, 3)  # one for each trace, and one of the reflected light
    assert np.linalg.norm(modes[:, :2], axis=1) == pytest.approx(known * np.hypot(0.015, 0.01))
    assert smooth == pytest.approx(np.hypot(0.25, TRUNCATION * 1.01 * known))


def test_what_is_not_followed_changes_the_light_as_the_response_says() -> None:
    light, flat = followed(ratio(1.0, 0.0, 1)), SCENE.with_values({"lamp.ellipticity": 1.3})
    here, there = (light.light(s, [None]) - 1.0 for s in (flat, SCENE))
    assert here == pytest.approx(1.3 * there)


@pytest.mark.parametrize("path", [p for p in paths_on(Acts.BEAM | Acts.RECEIVER) if p in NEUTRAL])
def test_every_effect_of_beam_and_receiver_is_followed_or_left_to_the_response(
    path: str, tmp_path: Path
) -> None:
    """What is followed changes the light that is known; of what is not there is a plain scene that is."""
    skirt = {"lamp.profile": "two-component", "lamp.skirt_fraction": 0.1}
    base = SCENE.with_values(skirt) if "skirt" in path else SCENE
    if path == "lamp.table_width":
        (tmp_path / "beam.csv").write_text("angle_deg,intensity\n0,1\n5,0.5\n12,0.05\n20,0\n")
        table = {"lamp.profile": "table", "lamp.intensity_table": str(tmp_path / "beam.csv")}
        base = SCENE.with_values(table)
    scene = changed(base, path)
    if describes(scene):
        known = ScatteredField(*PLACES)
        here, there = (known.light(s, [None]) for s in (scene, base))
        assert np.abs(here / there - 1).max() > 1e-5
    else:
        assert describes(scene.with_values(_PLAIN))


def test_some_of_the_readings_have_the_same_light() -> None:
    light, rows = followed(ratio(1.02, 0.01, 100)), np.array([True, False, True])
    some = light.some(rows)
    assert some.light(SCENE, [None]) == pytest.approx(light.light(SCENE, [None])[:, rows], rel=1e-3)
    modes, _ = some.errors(SCENE, [None], np.zeros(2, int))
    assert modes == pytest.approx(light.errors(SCENE, [None], np.zeros(3, int))[0][rows], rel=1e-3)


@pytest.mark.parametrize("change", [{}, {"lamp.ellipticity": 1.3}, {"water.base": "pure"}])
def test_several_waters_at_once_have_the_light_of_each(change: dict[str, Any]) -> None:
    """Of beams that are followed and others, and where the part of molecules is another in each."""
    light, scene = followed(ratio(1.02, 0.01, 100)), SCENE.with_values(change)
    scenes = [scene.with_values({"water.scattering_per_m": b}) for b in (0.2, 0.1, 0.0)]
    together = light.in_waters(scenes[0], [one.water for one in scenes], [None])
    for found, one in zip(together, scenes, strict=True):
        assert found == pytest.approx(light.light(one, [None]), rel=1e-12)


def test_some_places_have_the_light_of_all_and_share_what_was_worked_out() -> None:
    """The nodes are those of all places; beside nodes of their own, as near as these interpolate."""
    x, y, z = np.random.default_rng(0).uniform([-1, -1, 3], [1, 1, 8], (200, 3)).T
    rows = np.random.default_rng(1).random(200) < 0.2
    every = ScatteredField(x, y, z)
    light, some = every.light(SCENE, [None]), every.some(rows)
    np.testing.assert_array_equal(some.light(SCENE, [None]), light[:, rows])
    assert every._tables.light.cache_info().misses == 1
    own = ScatteredField(x[rows], y[rows], z[rows])
    np.testing.assert_allclose(own.light(SCENE, [None]), light[:, rows], rtol=2e-3)
