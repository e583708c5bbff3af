"""A campaign of a spectrometer as its program leaves it."""

from __future__ import annotations

from pathlib import Path

import pytest
from campaign import two_exposures


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    return two_exposures(tmp_path)
