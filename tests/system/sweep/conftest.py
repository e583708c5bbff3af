"""The scene that tests of sweeps share, in a file."""

from __future__ import annotations

from pathlib import Path

import pytest
from sweeping import SCENE


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("scene") / "scene.toml"
    file.write_text(SCENE)
    return file
