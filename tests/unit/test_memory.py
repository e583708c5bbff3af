"""What is kept to be quick is bounded."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path

import pytest

from lightfield.memory import Latest, free_bytes, kept_within


def test_the_latest_are_kept_and_what_was_used_lately_too() -> None:
    kept: Latest[str, int] = Latest(2)
    kept["a"], kept["b"] = 1, 2
    assert kept["a"] == 1
    kept["c"] = 3
    assert dict(kept) == {"a": 1, "c": 3}
    kept["a"] = 4
    kept["d"] = 5
    assert dict(kept) == {"a": 4, "d": 5} and kept.get("b") is None


def test_copies_are_as_large() -> None:
    kept: Latest[str, int] = Latest(2)
    kept["a"], kept["b"] = 1, 2
    for other in (copy.deepcopy(kept), pickle.loads(pickle.dumps(kept))):
        assert dict(other) == dict(kept)
        other["c"] = 3
        assert dict(other) == {"b": 2, "c": 3}


def test_free_memory_is_told_or_unbounded(monkeypatch: pytest.MonkeyPatch) -> None:
    assert free_bytes() > 1e6
    monkeypatch.setattr(Path, "read_text", lambda *_, **__: "MemTotal: 5 kB\nMemAvailable:   3 kB\n")
    assert free_bytes() == 3 * 1024
    monkeypatch.setattr(Path, "read_text", lambda *_, **__: "")  # a system that does not tell
    assert free_bytes() == float("inf")


def test_values_are_kept_as_far_as_there_is_room() -> None:
    made: list[int] = []

    @kept_within(100, 2, len)
    def of(size: int) -> bytes:
        made.append(size)
        return bytes(size)

    for size in (40, 50, 40, 20, 50):  # 110 together: the one that was asked for longest ago goes, 50
        assert len(of(size)) == size
    assert made == [40, 50, 20, 50]
    for size in (300, 200, 300):  # two are kept whatever they take
        of(size)
    assert made == [40, 50, 20, 50, 300, 200]
