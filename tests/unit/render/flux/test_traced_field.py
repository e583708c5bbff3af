"""The light of a region: what is refused before it is traced."""

from __future__ import annotations

import pytest

from lightfield.errors import RenderError
from lightfield.render import limits
from lightfield.render.flux import traced_field as module
from lightfield.render.flux.traced_field import Region, traced_field
from lightfield.scene import Scene


def test_a_region_that_does_not_fit_into_memory_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """The system ended the program for it, with 13.9 GB at a half width of 4 m."""
    scene = Scene.from_dict({"water": {"absorption_per_m": 0.05, "scattering_per_m": 0.05}})
    monkeypatch.setattr(limits, "free_bytes", lambda: 4e9)
    monkeypatch.setattr(module.response_cache, "recall", lambda key: pytest.fail("it was looked for"))
    with pytest.raises(RenderError, match=r"does not fit into memory; found 'about 1.* GB'"):
        traced_field(scene, Region(4.5, 4.0, 9.0))
