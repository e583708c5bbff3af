"""What is under way beside the session is of one experiment, can be ended, and loses no error."""

from __future__ import annotations

import asyncio
import json
import threading
import time
from collections.abc import Awaitable, Callable
from dataclasses import replace

import beside_work
import pytest

from lightfield.errors import RenderError
from lightfield.explorer import hub as hubs
from lightfield.explorer.hub import Hub
from lightfield.explorer.session import Session

PATIENCE_S = 60.0
OWN = {
    "name": "rope",
    "stage": "path",
    "formula": "1 - depth",
    "parameters": [{"name": "depth", "low": 0, "high": 0.9, "neutral": 0}],
}
FILE = {"files": [{"name": "other.csv", "content": ""}]}


class Page:
    """A browser that remembers what it was told."""

    def __init__(self, hub: Hub) -> None:
        self.hub, self.told, self.numbers = hub, list[dict](), 0
        hub.connect(self)

    def send(self, message: str | bytes) -> None:
        if isinstance(message, bytes):
            self.numbers += 1
        else:
            self.told.append(json.loads(message))

    def ask(self, do: str, **more: object) -> None:
        self.hub.receive(self, json.dumps({"id": 1, "do": do, **more}))

    @property
    def errors(self) -> list[str]:
        return [one["message"] for one in self.told if one["type"] == "error"]

    @property
    def stages(self) -> list[str]:
        """Of jobs, as they were told."""
        return [one["job"]["stage"] for one in self.told if one["type"] == "job" and one["job"]]


async def until(condition: Callable[[], object]) -> None:
    begun = time.monotonic()
    while not condition():
        assert time.monotonic() < begun + PATIENCE_S, "this never happens"
        await asyncio.sleep(0.005)


@pytest.fixture
def quick(session: Session) -> Session:
    """A session that is begun already, surveys nothing, and takes up another experiment at once."""

    def another(*given: object) -> None:
        session.experiment, session.verdict = replace(session.experiment), None

    session.begin = lambda history=None: None
    session.survey_next = lambda ends: False
    session.drop = session._add_own = another
    return session


def served(session: Session, what: Callable[[Hub, Page], Awaitable[None]]) -> None:
    """Something happens while a hub runs."""

    async def run() -> None:
        hub = Hub(session)
        running, page = asyncio.ensure_future(hub.run()), Page(hub)
        try:
            await until(lambda: hub.ready and page.numbers)
            await what(hub, page)
            assert not running.done(), "it answers for ever"
        finally:
            running.cancel()
            hub.end_job()

    asyncio.run(run())


@pytest.mark.parametrize(("do", "more"), [("drop", FILE), ("own", OWN)])
def test_a_verdict_of_former_readings_is_not_shown_for_new_ones(
    quick: Session, monkeypatch, do: str, more: dict
) -> None:
    monkeypatch.setattr(hubs, "diagnosed", beside_work.a_verdict)

    async def what(hub: Hub, page: Page) -> None:
        page.ask("diagnose")
        await until(lambda: hub.job is not None)
        page.ask(do, **more)
        await until(lambda: hub.job is None)
        await asyncio.sleep(0.1)
        assert quick.verdict is None and quick.report is None
        assert page.errors == ["diagnosis was ended: the model is new"]

    served(quick, what)


def test_a_document_has_in_it_what_was_asked_for_before(quick: Session, monkeypatch) -> None:
    """A file that is saved in the moment after a switch: the switch waits behind another one still."""
    done, act = list[int](), quick.act

    def slowly(request: object) -> None:
        time.sleep(0.1)
        act(request)
        done.append(1)

    quick.act = slowly

    async def what(hub: Hub, page: Page) -> None:
        for hwhm in (5.0, 6.0, 7.0):
            page.ask("set", values={"lamp.hwhm_deg": hwhm}, done=True)
        saved = await hub.make(lambda session: (len(done), session.now.values["lamp.hwhm_deg"]))
        assert saved == (3, 7.0) and not page.errors

    served(quick, what)


def test_a_verdict_of_these_readings_is_shown(quick: Session, monkeypatch) -> None:
    monkeypatch.setattr(hubs, "diagnosed", beside_work.a_verdict)

    async def what(hub: Hub, page: Page) -> None:
        page.ask("diagnose")
        await until(lambda: page.told[-1]["type"] == "state" and page.told[-1]["verdict"])
        assert hub.job is None and quick.report == "of the first readings" and not page.errors

    served(quick, what)


def test_light_that_was_ended_does_not_go_on_in_the_name_of_what_follows(quick: Session) -> None:
    """The first trace ends when it next says how far it is; the second begins then, and is told of alone."""
    begun, over = list[int](), threading.Event()

    def ready_maps() -> None:
        begun.append(len(begun))
        while begun[-1] == 0 and not over.is_set():
            quick.say("the first")
            time.sleep(0.005)
        quick.say("the second")

    quick.maps_ready, quick.ready_maps = False, ready_maps

    async def what(hub: Hub, page: Page) -> None:
        try:
            await until(lambda: "the first" in page.stages)
            page.ask("cancel")
            await until(lambda: hub.job is None)
            page.told.clear()
            page.ask("trace")
            await until(lambda: quick.maps_ready)
            await until(lambda: hub.job is None)
            assert "the first" not in page.stages and begun == [0, 1] and not page.errors
        finally:
            over.set()

    served(quick, what)


@pytest.mark.parametrize(("do", "more"), [("own", OWN), ("drop", FILE)])
def test_maps_become_ready_though_the_model_changes_while_they_are_traced(
    quick: Session, do: str, more: dict
) -> None:
    traced, first = list[object](), threading.Event()

    def ready_maps() -> None:
        experiment = quick.experiment
        first.wait(PATIENCE_S)
        traced.append(experiment)

    quick.maps_ready, quick.ready_maps = False, ready_maps

    async def what(hub: Hub, page: Page) -> None:
        await until(lambda: hub.job is not None)
        before, answered = quick.experiment, page.numbers
        page.ask(do, **more)
        await until(lambda: quick.experiment is not before and page.numbers > answered)
        assert not quick.maps_ready
        first.set()
        await until(lambda: quick.maps_ready)
        assert traced[-1] is quick.experiment and not page.errors

    served(quick, what)


@pytest.mark.parametrize("error", [RenderError("no light"), ZeroDivisionError()])
def test_an_error_of_the_survey_is_told_and_the_session_lives_on(quick: Session, error: Exception) -> None:
    raised = list[Exception]()

    def survey_next(ends: Callable[[], None]) -> bool:
        if raised:
            return False
        raised.append(error)
        raise error

    quick.survey_next = survey_next

    async def what(hub: Hub, page: Page) -> None:
        await until(lambda: page.errors)
        assert page.errors == [str(error) if isinstance(error, RenderError) else hubs._DEFECT]
        answered = page.numbers
        page.ask("undo")
        await until(lambda: page.numbers > answered)

    served(quick, what)


def test_a_survey_that_was_ended_rests_until_something_is_asked(quick: Session) -> None:
    begun = list[int]()

    def survey_next(ends: Callable[[], None]) -> bool:
        begun.append(len(begun))
        while True:
            quick.say("tracing")
            time.sleep(0.005)

    quick.survey_next = survey_next

    async def what(hub: Hub, page: Page) -> None:
        await until(lambda: hub.doing is not None)
        page.ask("cancel")
        await until(lambda: hub.doing is None)
        await asyncio.sleep(0.7)  # also the errors of the map, which come after half a second
        assert begun == [0] and not page.errors
        page.ask("undo")
        await until(lambda: begun == [0, 1])
        page.ask("cancel")
        await until(lambda: hub.doing is None)

    served(quick, what)


def test_a_survey_gives_way_to_whoever_asks_for_something(quick: Session) -> None:
    """It would go on for ever; what was asked is answered, and it is begun again."""
    begun = list[int]()

    def survey_next(ends: Callable[[], None]) -> bool:
        begun.append(len(begun))
        while True:
            ends()
            time.sleep(0.005)

    quick.survey_next = survey_next

    async def what(hub: Hub, page: Page) -> None:
        await until(lambda: begun)
        answered = page.numbers
        page.ask("undo")
        await until(lambda: page.numbers > answered and len(begun) > 1)
        assert not page.errors
        quick.survey_next = lambda ends: False
        page.ask("undo")

    served(quick, what)


def test_an_error_after_a_job_is_told(quick: Session, monkeypatch) -> None:
    """The trace is there; the model that needs it cannot be made."""
    monkeypatch.setattr(hubs, "trace_maps", beside_work.a_trace)
    monkeypatch.setattr(hubs, "missing_trace", lambda forward, values: 1.0)

    def begin(anew: Session, history: object = None) -> None:
        raise RenderError("no light")

    async def what(hub: Hub, page: Page) -> None:
        monkeypatch.setattr(Session, "begin", begin)
        page.ask("trace")
        await until(lambda: page.errors)
        assert page.errors == ["tracing anew: no light"]
        await until(lambda: hub.job is None)
        assert quick.dense_per_m is None

    served(quick, what)


def test_an_error_of_a_job_is_told(quick: Session, monkeypatch) -> None:
    monkeypatch.setattr(hubs, "diagnosed", beside_work.an_error)

    async def what(hub: Hub, page: Page) -> None:
        page.ask("diagnose")
        await until(lambda: page.errors)
        assert page.errors == ["diagnosis: no light"]
        await until(lambda: hub.job is None)

    served(quick, what)
