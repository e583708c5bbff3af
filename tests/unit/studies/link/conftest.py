"""Links are asked of few photons."""

from __future__ import annotations

from collections.abc import Iterator

import pytest


@pytest.fixture(scope="module", autouse=True)
def few_photons_for_docking() -> Iterator[None]:
    """How far an array docks in water that scatters is not asked here, and would take most of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("lightfield.studies.link.study.DOCKING_PHOTONS", 1e4)
        yield
