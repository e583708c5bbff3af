"""What the server says before anybody looks."""

from __future__ import annotations

import asyncio
import signal

import numpy as np

from lightfield.errors import FitError
from lightfield.explorer.server import serve
from lightfield.explorer.session import Session
from lightfield.readings import Readings
from lightfield.scene import Scene


def told(readings: Readings | None) -> list[str]:
    """Addresses, of a server that ends with the first."""
    addresses: list[str] = []

    def opened(address: str) -> None:
        addresses.append(address)
        signal.raise_signal(signal.SIGINT)

    try:
        asyncio.run(serve(Session(Scene(), readings, diffuse=None), opened=opened))
    except FitError:
        addresses.append("refused")
    return addresses


def test_what_cannot_be_explored_is_said_before_an_address() -> None:
    """Two readings are fewer than the parameters of the base model."""
    assert told(Readings.from_arrays(value=np.ones(2), z_m=np.array([4.5, 5.5]))) == ["refused"]


def test_the_address_is_said_once() -> None:
    (address,) = told(None)
    assert address.startswith("http://127.0.0.1:")
