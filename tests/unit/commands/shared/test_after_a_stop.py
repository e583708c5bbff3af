"""What Python ignores on the way out is told, unless the program was stopped."""

from __future__ import annotations

import signal
import sys
import time

import pytest

from lightfield import cli
from lightfield.commands.shared.progress import status_lines


class HalfMade:
    """As an object whose making was stopped."""

    def __del__(self) -> None:
        raise AttributeError("was never set")


@pytest.mark.parametrize("stops", [[], [signal.SIGINT]])
def test_objects_complain_only_while_nothing_was_stopped(
    stops: list[int], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(cli, "_stops", stops)
    monkeypatch.setattr(sys, "unraisablehook", cli._not_swallowed)
    thing = HalfMade()
    del thing
    assert ("was never set" in capsys.readouterr().err) == (not stops)


def test_how_far_it_is_is_told_only_while_nothing_was_stopped(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Workers may take ten seconds to end: lines come while the work goes on, and none after a stop."""
    monkeypatch.setattr(cli, "_stops", [])
    with status_lines("sweep", every_s=0.01):
        deadline = time.monotonic() + 10.0
        while not capsys.readouterr().err and time.monotonic() < deadline:
            time.sleep(0.01)
        assert time.monotonic() < deadline
        with pytest.raises(KeyboardInterrupt):
            cli._raise(signal.SIGINT, None)
        time.sleep(0.05)  # a line may be under way
        capsys.readouterr()
        time.sleep(0.2)
        assert capsys.readouterr().err == ""
