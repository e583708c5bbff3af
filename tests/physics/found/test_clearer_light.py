"""Asked again with more photons under a surface, where what is found rests on them, and nowhere else."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest

from lightfield.diagnosis import clearer_light
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
    inquiry = SimpleNamespace(
        scene=stated, source=response_for, is_settled_after=settles, progress=lambda words: None
    )
    first = outcome(fitted)
    found = clearer_light.by_clearer_light(inquiry, first)  # type: ignore[arg-type]  # stands in for one
    assert (found == "clearer") == again and (found is first) != again
    for source in asked:
        assert isinstance(source, partial) and source.func is response_for
        assert source.keywords == {"under_surface": clearer_light.UNDER_SURFACE}
