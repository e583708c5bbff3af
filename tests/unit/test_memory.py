"""What is kept to be quick is bounded."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path

import pytest

from lightfield.memory import Latest, free_bytes


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
