"""A session of the explorer, without a server."""

from __future__ import annotations

from copy import copy

import analytic_readings
import pytest

from lightfield.explorer.session import Session
from lightfield.explorer.state import History
from lightfield.scene import Scene

#: A constant of a fiftieth of the brightest reading is in the readings, and not in the scene.
HIDDEN = {"detector.background": 0.02}


@pytest.fixture(scope="module")
def given() -> tuple[object, Scene]:
    return analytic_readings.readings(HIDDEN, seed=3)


@pytest.fixture(scope="module")
def begun(given) -> Session:
    session = Session(given[1], given[0], diffuse=None)
    session.begin()
    return session


@pytest.fixture
def session(begun: Session) -> Session:
    """As it begins; fits that were made are remembered."""
    session = copy(begun)
    session.history, session.survey = History([begun.history.states[0]]), {}
    return session
