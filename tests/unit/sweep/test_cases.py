"""Parameters of a sweep that change no map are named, and no others are."""

from __future__ import annotations

import numpy as np
import pytest
from perturbed import FIELDS, changed, scenes_of_every_field

from lightfield.scene import Scene
from lightfield.scene.acts import TRACED, Acts
from lightfield.scene.all_parameters import only
from lightfield.scene.bands import over_band
from lightfield.studies.compare.maps import closed_form
from lightfield.sweep.axes import parse_axis
from lightfield.sweep.cases import UNSEEN, Cases, idle

PLACE = (np.array([0.1]), np.array([-0.2]), np.array([2.0]))


def told(scene: Scene, *ranges: str) -> list[str]:
    return [line.split()[0] for line in idle(Cases(scene, tuple(parse_axis(text) for text in ranges)))]


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> list[Scene]:
    return scenes_of_every_field(tmp_path_factory.mktemp("tables"))


@pytest.mark.parametrize("path", [p for p in FIELDS if not Cases(Scene(), ()).acts(p) & ~UNSEEN])
def test_what_is_unseen_changes_no_light_of_a_map(scenes: list[Scene], path: str) -> None:
    """Neither the formula's, nor what a trace depends on."""
    for scene in scenes:
        other = changed(scene, path)
        low, high = scene.detector.bands_nm[0]
        before, after = (
            closed_form(s, *PLACE, over_band(s.lamp, low, high, s.detector)) for s in (scene, other)
        )
        assert np.array_equal(before, after)
        assert only(scene, TRACED | Acts.PLACES) == only(other, TRACED | Acts.PLACES)


def test_a_number_beside_the_wrong_choice_is_named() -> None:
    assert told(Scene(), "lamp.table_width=1,2") == ["lamp.table_width"]
    assert told(Scene(), "lamp.temperature_k=2000,3000") == []
    other = Scene().with_values({"lamp.spectrum": "cie-a"})
    assert told(other, "lamp.temperature_k=2000,3000", "lamp.hwhm_deg=2,3") == ["lamp.temperature_k"]
    assert told(other, "lamp.temperature_k=2000,3000", "lamp.spectrum=cie-a,planck") == []


def test_numbers_of_readings_alone_are_named() -> None:
    found = told(Scene(), "lamp.drift_per_hour=0,0.1", "water.attenuation_per_m=0.1,0.2")
    assert found == ["lamp.drift_per_hour"]
