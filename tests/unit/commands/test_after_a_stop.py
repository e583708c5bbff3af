"""What Python ignores on the way out is told, unless the program was stopped."""

from __future__ import annotations

import signal
import sys

import pytest

from lightfield import cli


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
