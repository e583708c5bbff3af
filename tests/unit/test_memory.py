"""What is kept to be quick is bounded."""

from __future__ import annotations

import copy
import pickle

from lightfield.memory import Latest


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
