"""What tests of the tracer share."""

import pytest


@pytest.fixture(scope="module")
def backend() -> None:
    """Mitsuba's variant, and our plugins in it."""
    from lightfield.render.backend import use_backend

    use_backend()
