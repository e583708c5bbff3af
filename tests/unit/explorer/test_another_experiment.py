"""From one experiment to another, whole or not at all; what was shown stays shown."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace

import pytest
from dropped import dropped_file

from lightfield.errors import RenderError
from lightfield.explorer import protocol
from lightfield.explorer import session as sessions
from lightfield.explorer.beside import EndedError
from lightfield.explorer.fits import Fits
from lightfield.explorer.session import Session
from lightfield.explorer.state import History, State
from lightfield.readings.table.write import dumps

ROPE = {
    "name": "rope",
    "stage": "path",
    "formula": "1 - depth*exp(-(x/0.1)**2)",
    "parameters": [{"name": "depth", "low": 0, "high": 0.9, "neutral": 0}],
}


def add_own(session: Session) -> None:
    session.act(protocol.read_request(json.dumps({"id": 1, "do": "own", **ROPE})))


def drop(session: Session) -> None:
    session.drop([dropped_file("good.csv", dumps(session.readings.subset(session.readings.z_m < 7)))])


@pytest.mark.parametrize(("do", "ended_at"), [(add_own, "fitting"), (drop, "judging")])
def test_another_experiment_that_was_ended_has_changed_nothing(
    session: Session, do: Callable[[Session], None], ended_at: str
) -> None:
    """While its noise was judged, or its first fit was under way: one experiment, not halves of two."""
    session.verdict, session.report, session.maps_ready = {"kind": "here"}, "here", True

    def end(stage: str, part: float | None = None) -> None:
        if stage.startswith(ended_at):
            raise EndedError("cancelled")

    before, session.say = dict(vars(session)), end
    with pytest.raises(EndedError):
        do(session)
    after = {name: value for name, value in vars(session).items() if name != "say"}
    assert [name for name, value in after.items() if value is not before[name]] == []
    assert session.experiment.scene is session.scene


def test_a_model_that_cannot_be_made_leaves_the_readings_there_were(session: Session, monkeypatch) -> None:
    """The first fit of the new readings fails, after their model was made."""
    before = session.experiment, session.readings
    monkeypatch.setattr(sessions, "explored", lambda *given: replace(session.experiment))

    def fails(*given: object) -> None:
        raise RenderError("no light")

    monkeypatch.setattr(Fits, "of", fails)
    with pytest.raises(RenderError):
        drop(session)
    assert (session.experiment, session.readings) == before


def test_the_state_that_is_shown_stays_though_one_before_it_goes(session: Session, monkeypatch) -> None:
    """Of five states the second and the last do not suit any more, and the fourth is shown."""
    monkeypatch.setattr(sessions, "explored", lambda *given: session.experiment)
    known = session.now.values
    states = [State(("x:y",) if k in (1, 4) else (), known, str(k)) for k in range(5)]
    for at, shown in ((3, "3"), (1, "0"), (0, "0"), (4, "3")):
        session.begin(History(list(states), at))
        assert [state.did for state in session.history.states] == ["0", "2", "3"]
        assert session.now.did == shown
