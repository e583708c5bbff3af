"""How far traces are, as workers tell it in a thread beside the one that follows them."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from lightfield.sweep.runner import SweepProgress, _Dispatch

TRACES, ROUNDS = 300, 100


@pytest.fixture
def dispatch(monkeypatch: pytest.MonkeyPatch) -> Iterator[_Dispatch]:
    """Without a cluster; threads take turns as often as they can."""
    monkeypatch.setattr("distributed.as_completed", lambda jobs, loop: SimpleNamespace(add=jobs.append))
    numbers = iter(range(10**9))
    client = SimpleNamespace(loop=None, submit=lambda *_, **__: SimpleNamespace(key=str(next(numbers))))
    store = SimpleNamespace(kind=SimpleNamespace(target=lambda *_: None), path=None, variables={})
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    made: Any = _Dispatch(client, None, store, SweepProgress(1, TRACES), lambda progress: str(progress.part))  # type: ignore[arg-type]
    yield made
    sys.setswitchinterval(before)


def test_what_is_told_while_jobs_come_and_go(dispatch: _Dispatch) -> None:
    """Of a trace that has ended nothing is told any more, and nobody trips over one that begins."""
    problems: list[BaseException] = []
    over = threading.Event()

    def worker() -> None:
        try:
            while not over.is_set():
                for number in range(0, TRACES, 7):
                    dispatch.heard((0.0, {"trace": number, "part": 0.5}))
        except BaseException as error:
            problems.append(error)

    thread = threading.Thread(target=worker)
    thread.start()
    for _ in range(ROUNDS):
        for number in range(TRACES):
            dispatch._submit(True, number, print)
        for key in list(dispatch.running):
            dispatch._finished(key)
    over.set()
    thread.join()
    assert not problems
    assert dispatch.progress.underway == {}
