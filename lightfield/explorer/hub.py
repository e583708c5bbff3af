"""Between the session and the browsers: one thing is computed at a time, and never what is out of date."""

from __future__ import annotations

import asyncio
import json
import threading
import traceback
from collections import deque
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Protocol

from lightfield.arrays import jsonable
from lightfield.errors import FitError, LightfieldError, UsageError
from lightfield.explorer import protocol
from lightfield.explorer.beside import EndedError, Made, Tell, Underway, Worker, in_process
from lightfield.explorer.evaluation import missing_trace
from lightfield.explorer.jobs import Diagnosed, climbed, compared, diagnosed, trace_maps
from lightfield.explorer.session import Session
from lightfield.explorer.state import History

#: Requests that wait, of all browsers, at most. Chosen.
_MOST_WAITING = 1000
#: The survey of effects is sent after every so many.
_SENT_EVERY = 4
#: Seconds of rest after which the errors of the shown map are worked out: they take half a second.
_REST_S = 0.5
#: Seconds after which a document looks again whether anything is still asked for.
_MOMENT_S = 0.01
_LIGHT = "light on the planes"
_DEFECT = "a defect of the program: what it printed says more"


class Browser(Protocol):
    """A page that is connected."""

    def send(self, message: str | bytes) -> None: ...


class Hub:
    """Takes requests of browsers, and sends them what the session makes of them.

    Parameters
    ----------
    session : Session
        Not begun yet.
    history : History, optional
        To go on with.

    Attributes
    ----------
    begun : Event
        Scene and readings go together as far as that is seen at once: there is something to look at.
    """

    def __init__(self, session: Session, history: History | None = None) -> None:
        self.session, self._history = session, history
        self.browsers: set[Browser] = set()
        self.ready, self.failed, self.begun = False, "", asyncio.Event()
        #: What is done beside all else, for the experiment that is explored.
        self.job: Underway | None = None
        #: What keeps the session busy; None while it answers at once.
        self.doing: Underway | None = Underway("session", self._busy)
        self._surveying = True  # until somebody ends it; what is asked next begins it again
        session.say = self._say
        self._worker, self._beside, self._awake = Worker(), Worker(), asyncio.Event()
        self._waiting: deque[tuple[Browser, protocol.Request]] = deque()
        self._loop = asyncio.get_running_loop()
        self._unsure = True  # the errors of the shown map are not sent yet
        self._errors: asyncio.Task[None] | None = None

    def connect(self, browser: Browser) -> None:
        """A page is there: it gets everything that is known."""
        self.browsers.add(browser)
        browser.send(self._job_message())
        if self.ready:
            browser.send(_text("experiment", **self.session.experiment_data()))
            browser.send(_text("state", **self.session.state_data()))
            self._unsure = True
            self._ask(browser, protocol.Plain(id=0, do="survey"))

    def disconnect(self, browser: Browser) -> None:
        """A page is gone; what it asked for too."""
        self.browsers.discard(browser)
        self._waiting = deque(pair for pair in self._waiting if pair[0] is not browser)

    def receive(self, browser: Browser, message: str | bytes) -> None:
        """A page asks for something; what cannot be understood is answered at once."""
        try:
            request = protocol.read_request(message)
            if len(self._waiting) >= _MOST_WAITING:
                raise UsageError("too many requests wait", found=len(self._waiting), remedy="ask again later")
            if not self.ready:
                found = self.doing.stage if self.doing else self.failed
                raise UsageError("the model is not ready yet", found=found, remedy="wait")
        except LightfieldError as error:
            browser.send(_text("error", id=protocol.request_id(message), message=str(error)))
            return
        if isinstance(request, protocol.Plain) and request.do == "cancel":
            self._cancel()
        else:
            self._ask(browser, request)

    def _cancel(self) -> None:
        """End what keeps the session busy, or else the job."""
        if self.doing is not None:
            self.doing.end()
        else:
            self.end_job()

    def _ask(self, browser: Browser, request: protocol.Request) -> None:
        self._waiting.append((browser, request))
        self._awake.set()

    def _next(self) -> tuple[Browser, protocol.Request]:
        """The next request; of values that follow each other the newest, with what the older ones set."""
        browser, request = self._waiting.popleft()
        while isinstance(request, protocol.Set) and not request.done and self._waiting:
            other, newer = self._waiting[0]
            if other is not browser or not isinstance(newer, protocol.Set):
                break
            self._waiting.popleft()
            request = newer.model_copy(update={"values": {**request.values, **newer.values}})
        return browser, request

    def _everyone(self, message: str | bytes) -> None:
        for browser in list(self.browsers):
            browser.send(message)

    async def run(self) -> None:
        """Begin, then answer for ever."""
        try:
            await self._do(partial(self.session.begin, self._history))
        except LightfieldError as error:
            self.failed, self.doing = str(error), None
            self._tell_jobs()
            raise
        self.ready, self.doing = True, None
        self.begun.set()
        self._new_experiment()
        counted = 0
        while True:
            if self._waiting:
                await self._answer(*self._next())
            elif self._surveying and await self._survey():
                counted += 1
                if counted % _SENT_EVERY == 0:
                    self._send_state()
            else:
                if counted:
                    counted = 0
                    self._send_state()
                self._awake.clear()
                if not self._waiting:
                    await self._rest()

    async def _rest(self) -> None:
        """Until something is asked; after a moment the errors of the map are worked out, beside all else."""
        idle = self._errors is None or self._errors.done()
        if self._unsure and idle and self.session.maps_ready:
            try:
                await asyncio.wait_for(self._awake.wait(), _REST_S)
                return
            except asyncio.TimeoutError:
                self._unsure = False
                self._errors = self._loop.create_task(self._send_errors())
        await self._awake.wait()

    async def _survey(self) -> bool:
        """One effect more; False where none is left, or whoever looks on wants no more."""
        try:
            return await self._do(partial(self.session.survey_next, self._give_way))
        except EndedError:
            self._surveying = False
        except Exception as error:
            self._everyone(_text("error", id=None, message=_in_words(error)))
            return isinstance(error, LightfieldError)  # a defect may come again and again
        return False

    def _give_way(self) -> None:
        """Called in the session's thread: what nobody asked for ends where somebody asks for something."""
        if self._waiting:
            raise EndedError("something else is asked for")

    async def _do(self, what: Callable[[], Made]) -> Made:
        """What is made in the session's thread, where alone the session changes."""
        one = Underway("session", self._busy)
        try:
            return await self._worker.do(what, one.tell)
        finally:
            if self.doing is one:
                self.doing = None
                self._tell_jobs()

    def _say(self, stage: str, part: float | None = None) -> None:
        """Called in a thread that computes: what it does is told of, and ends once somebody ended it."""
        here = threading.current_thread()
        (self._beside if here is self._beside.thread else self._worker).tell(stage, part)
        self._loop.call_soon_threadsafe(self.begun.set)

    def _busy(self, one: Underway) -> None:
        self.doing = one
        self._tell_jobs()

    def _tell_jobs(self) -> None:
        self._everyone(self._job_message())

    async def _answer(self, browser: Browser, request: protocol.Request) -> None:
        session = self.session
        self._surveying = True
        try:
            if isinstance(request, protocol.Plain) and request.do in ("diagnose", "report", "trace"):
                self._on_job(request.do)
            elif isinstance(request, protocol.Drop):
                await self._do(partial(session.drop, request.files, request.units))
                self._new_experiment()
            elif not (isinstance(request, protocol.Plain) and request.do == "survey"):
                await self._do(partial(session.act, request))
                if isinstance(request, protocol.Own):
                    self._new_experiment()
            evaluation = await self._do(session.evaluation)
        except Exception as error:  # a defect must not cost anybody an afternoon's work
            browser.send(_text("error", id=request.id, message=_in_words(error)))
            return
        head = {"type": "evaluation", "plane": session.plane, **evaluation.numbers}
        for one in list(self.browsers):
            one.send(protocol.pack({**head, "id": request.id if one is browser else None}, evaluation.arrays))
        self._unsure = True
        if not (isinstance(request, protocol.Set) and not request.done):
            self._send_state()

    def _send_state(self) -> None:
        self._everyone(_text("state", **self.session.state_data()))

    def _send_experiment(self) -> None:
        self._everyone(_text("experiment", **self.session.experiment_data()))
        self._tell_jobs()
        self._send_state()
        for browser in list(self.browsers):
            self._ask(browser, protocol.Plain(id=0, do="survey"))

    def _new_experiment(self) -> None:
        """What was under way was of the one before."""
        if self.job is not None and self.job.name != _LIGHT:  # that is begun again
            self._everyone(_text("error", id=None, message=f"{self.job.name} was ended: the model is new"))
        self.end_job()
        self._send_experiment()
        if not self.session.maps_ready:
            self._light_planes()

    async def _send_errors(self) -> None:
        session = self.session
        state, plane, channel = session.now, session.plane, session.channel
        try:
            found = await self._beside.do(partial(session.evaluator.map_stderr, state, plane, channel))
        except LightfieldError:
            return
        finally:
            self._awake.set()  # what was painted meanwhile has errors too
        if (session.now, session.plane, session.channel) == (state, plane, channel):
            self._everyone(protocol.pack({"type": "errors", "plane": plane}, {"map_stderr": found}))

    async def make(self, document: Callable[[Session], Made]) -> Made:
        """A document of the session, with all that was asked for before."""
        while self._waiting:
            await asyncio.sleep(_MOMENT_S)
        return await self._do(partial(document, self.session))

    def _on_job(self, do: str) -> None:
        session = self.session
        if self.job is not None:
            raise UsageError(
                "something is under way", found=self.job.name, remedy="wait for it, or cancel it"
            )
        if do == "diagnose":
            if session.readings is None:
                raise FitError(
                    "there are no readings to diagnose", remedy="drop a reading table into the page"
                )
            given = session.scene, session.readings, session.diffuse is not None
            work = partial(in_process, partial(diagnosed, *given))
            self._start("diagnosis", work, self._diagnosed, self._send_state)
        elif do == "report":
            self._start("report", partial(in_process, self._report()), self._reported, self._send_made)
        else:
            self._trace()

    def _trace(self) -> None:
        session = self.session
        dense = missing_trace(session.experiment.forward, session.evaluator.values(session.now))
        if dense is None:  # the light on the planes was cancelled before
            self._light_planes()
            return
        work = partial(in_process, partial(trace_maps, session.scene, session.readings, dense))
        self._start("tracing anew", work, lambda _: session.trace_at(dense), self._new_experiment)

    def _report(self) -> Callable[..., str]:
        session = self.session
        e, now = session.experiment, session.now
        if not e.has_data:
            return partial(compared, e.forward.scenes.at(session.evaluator.values(now)))
        ladder = session.state_data()["ladder"]
        rungs = [{"effects": [*now.effects[: rung["at"]]], **rung} for rung in ladder]
        scene = e.forward.scenes.at(e.held(now.effects))
        return partial(climbed, scene, e.readings, now.effects, rungs, session.diffuse is not None)

    def _light_planes(self) -> None:
        def work(tell: Tell) -> Awaitable[None]:
            return self._beside.do(self.session.ready_maps, tell)

        self._start(_LIGHT, work, self._lit, self._send_experiment)

    def _start(
        self,
        name: str,
        work: Callable[[Tell], Awaitable[Made]],
        take: Callable[[Made], None],
        told: Callable[[], None],
    ) -> None:
        """Begin what is done beside all else.

        Parameters
        ----------
        take : callable
            Gives the session what was made, in the session's thread.
        told : callable
            Tells the browsers then.
        """
        one, experiment = Underway(name, lambda _: self._tell_jobs()), self.session.experiment
        one.work = made = asyncio.ensure_future(work(one.tell))

        def taken(made: Made) -> bool:
            wanted = not one.ended and self.session.experiment is experiment
            if wanted:
                take(made)
            return wanted

        self.job = one
        self._following = self._loop.create_task(self._follow(one, made, taken, told))
        self._tell_jobs()

    async def _follow(
        self, one: Underway, work: Awaitable[Made], taken: Callable[[Made], bool], told: Callable[[], None]
    ) -> None:
        """To its end; what was ended, or is of another experiment than the session's, is not taken."""
        wanted = False
        try:
            wanted = await self._do(partial(taken, await work))
        except asyncio.CancelledError:
            pass  # somebody ended it
        except Exception as error:
            self._everyone(_text("error", id=None, message=f"{one.name}: {_in_words(error)}"))
        if self.job is one:
            self.end_job()
        if wanted:
            told()

    def end_job(self) -> None:
        """End what is under way, if anything is."""
        if self.job is not None:
            job, self.job = self.job, None
            job.end()
            self._tell_jobs()

    def _diagnosed(self, found: Diagnosed) -> None:
        self.session.verdict, self.session.report = found.verdict, found.report

    def _reported(self, html: str) -> None:
        self.session.comparison = html

    def _send_made(self) -> None:
        self._everyone(_text("made", name="comparison.html"))

    def _lit(self, _: None) -> None:
        self.session.maps_ready = True

    def _job_message(self) -> str:
        job, doing = self.job, self.doing
        return _text(
            "job",
            ready=self.ready,
            failed=self.failed,
            job=None if job is None else {"name": job.name, "stage": job.stage, "part": job.part},
            doing=None if doing is None else {"stage": doing.stage, "part": doing.part},
        )


def _in_words(error: Exception) -> str:
    """What people are told of an error; a defect is printed in the terminal."""
    if isinstance(error, LightfieldError):
        return str(error)
    traceback.print_exception(error)
    return _DEFECT


def _text(kind: str, **content: object) -> str:
    return json.dumps(jsonable({"type": kind, **content}), allow_nan=False)
