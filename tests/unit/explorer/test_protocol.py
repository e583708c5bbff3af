"""What page and server say to each other: all that is malformed gets one clear error, and numbers survive."""

from __future__ import annotations

import json
import math
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lightfield.errors import UsageError
from lightfield.explorer import protocol


def test_a_request_is_read() -> None:
    request = protocol.read_request('{"id": 3, "do": "set", "values": {"gain": 2.5}, "done": true}')
    assert request == protocol.Set(id=3, do="set", values={"gain": 2.5}, done=True)


@pytest.mark.parametrize(
    "message",
    [
        "",
        "nonsense",
        "[]",
        "null",
        "1e999",
        '{"do": "fit"}',
        '{"id": 1, "do": "launch"}',
        '{"id": 1, "do": "fit", "more": 1}',
        '{"id": -1, "do": "fit"}',
        '{"id": 1, "do": "set", "values": {"gain": NaN}}',
        '{"id": 1, "do": "set", "values": {"gain": Infinity}}',
        '{"id": 1, "do": "set", "values": {"gain": "2"}}',
        '{"id": 1, "do": "set", "values": {"gain": 1e99}}',
        '{"id": 1, "do": "keep", "name": ""}',
        '{"id": 1, "do": "view", "plane": -1}',
        '{"id": 1, "do": "drop", "files": [{"name": "../readings.csv", "content": ""}]}',
        '{"id": 1, "do": "drop", "files": [{"name": "a/b.csv", "content": ""}]}',
        '{"id": 1, "do": "drop", "files": []}',
        '{"id": 1, "do": "drop", "files": [{"name": "a.csv", "content": "no base 64!"}]}',
        '{"id": 1, "do": "own", "name": "A b", "stage": "path", "formula": "1", "parameters": []}',
        "[" * 100_000,
        json.dumps({"id": 1, "do": "keep", "name": "x" * 200_000}),
        b"bytes",
    ],
    ids=lambda message: str(message[:40]),
)
def test_what_is_malformed_gets_one_line(message: str | bytes) -> None:
    with pytest.raises(UsageError) as caught:
        protocol.read_request(message)
    assert len(str(caught.value).splitlines()) == 1 and len(str(caught.value)) < 500


@settings(max_examples=30)
@given(st.one_of(st.text(), st.recursive(st.none() | st.integers() | st.text(), st.lists).map(json.dumps)))
def test_nothing_but_a_clear_error_comes_of_any_text(message: str) -> None:
    with pytest.raises(UsageError):
        protocol.read_request(message)
    protocol.request_id(message)


def test_the_number_of_a_malformed_request_is_answered() -> None:
    assert protocol.request_id('{"id": 7, "do": "launch"}') == 7
    assert protocol.request_id("nonsense") is None


def unpack(message: bytes) -> tuple[dict[str, object], dict[str, np.ndarray]]:
    """Head and arrays of a binary answer, as the page reads it."""
    (length,) = struct.unpack_from("<I", message)
    head = json.loads(message[4 : 4 + length])
    arrays, at = {}, 4 + length
    for name, shape in head["arrays"]:
        count = math.prod(shape)
        arrays[name] = np.frombuffer(message, "<f4", count, at).reshape(shape).astype(float)
        at += 4 * count
    return head, arrays


def test_numbers_survive_the_way_to_the_page() -> None:
    """Also those that are none: a map is dark outside the tank, a residual unknown where nothing counts."""
    arrays = {"a": np.array([[1.5, np.nan], [np.inf, -2.0]]), "b": np.zeros(0), "c": np.arange(3.0)}
    packed = protocol.pack({"type": "evaluation", "error_percent": float("nan")}, arrays)
    head, found = unpack(packed)
    assert head["error_percent"] is None and head["type"] == "evaluation"
    assert all(np.array_equal(found[name], array, equal_nan=True) for name, array in arrays.items())
    assert int.from_bytes(packed[:4], "little") % 4 == 0, "arrays of a page begin at multiples of 4"
