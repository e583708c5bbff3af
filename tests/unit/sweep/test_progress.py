"""How far traces are, as workers tell it in a thread beside the one that follows them."""

from __future__ import annotations

import threading
from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any

import pytest

from lightfield.sweep.runner import SweepProgress, _Dispatch


@pytest.fixture
def dispatch(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Without a cluster."""
    monkeypatch.setattr("distributed.as_completed", lambda jobs, loop: SimpleNamespace(add=jobs.append))
    client = SimpleNamespace(loop=None, submit=lambda *_, **__: SimpleNamespace(key="job"))
    store = SimpleNamespace(kind=SimpleNamespace(target=lambda *_: None), path=None, variables={})
    plan: Any = None
    return _Dispatch(client, plan, store, SweepProgress(1, 1), None)  # type: ignore[arg-type]


def test_of_a_trace_that_ends_meanwhile_nothing_is_told(dispatch: Any) -> None:
    """It ends in one thread just when the other has seen that it runs."""
    ends = threading.Thread(target=dispatch._finished, args=("job",))

    class Running(dict[str, tuple[bool, int]]):
        def values(self) -> Iterable[Any]:
            seen = list(super().values())
            ends.start()
            ends.join(timeout=0.1)
            return seen

    dispatch.running = Running()
    dispatch._submit(True, 7, print)
    dispatch.heard((0.0, {"trace": 7, "part": 0.5}))
    ends.join()
    assert not dispatch.running
    assert dispatch.progress.underway == {}


def test_what_runs_is_told(dispatch: Any) -> None:
    dispatch._submit(True, 7, print)
    dispatch.heard((0.0, {"trace": 7, "part": 0.5}))
    dispatch.heard((0.0, {"trace": 8, "part": 0.5}))
    assert dispatch.progress.underway == {7: 0.5}
