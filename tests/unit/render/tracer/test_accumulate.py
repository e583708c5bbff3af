"""Tracing batch after batch: what does not fit into memory is refused before it is begun."""

from __future__ import annotations

import pytest

from lightfield.errors import RenderError
from lightfield.render import limits
from lightfield.render.backend import use_backend
from lightfield.render.maps import render_scene
from lightfield.scene import Scene


def test_maps_that_do_not_fit_into_memory_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 4096 x 4096 cells in three planes, 200 GB: they took the program with them."""
    use_backend()
    small = Scene.from_dict(
        {"water": {"scattering_per_m": 0.1}, "detector": {"planes_m": [2.0], "pixels": 9}}
    )
    asked: list[float] = []
    monkeypatch.setattr(limits, "free_bytes", lambda: asked.append(1.0) or 1e5)
    with pytest.raises(RenderError, match=r"does not fit into memory.*100 kB are free.*fewer pixels"):
        render_scene(small, max_photons=1e3, rel_error=0.5, cache=False)
    assert asked
    monkeypatch.setattr(limits, "free_bytes", lambda: 1e9)
    render_scene(small, max_photons=1e3, rel_error=0.5, cache=False)
