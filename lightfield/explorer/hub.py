"""Between the session and the browsers: one thing is computed at a time, and never what is out of date."""

from __future__ import annotations

import asyncio
import json
import threading
import traceback
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any, Protocol

from lightfield.arrays import jsonable
from lightfield.errors import FitError, LightfieldError, UsageError
from lightfield.explorer import protocol
from lightfield.explorer.beside import Aside, Job, Made, Worker
from lightfield.explorer.evaluation import missing_trace
from lightfield.explorer.jobs import Diagnosed, climbed, compared, diagnosed, trace_maps
from lightfield.explorer.session import Session
from lightfield.explorer.state import History

#: Requests that wait, of all browsers, at most. Chosen.
MOST_WAITING = 1000
#: The survey of effects is sent after every so many.
_SENT_EVERY = 4
#: Seconds of rest after which the errors of the shown map are worked out: they take half a second.
_REST_S = 0.5
_DEFECT = "a defect of the program: see the terminal"


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
    """

    def __init__(self, session: Session, history: History | None = None) -> None:
        self.session, self._history = session, history
        self.browsers: set[Browser] = set()
        self.ready, self.failed = False, ""
        self.job: Job | Aside | None = None
        #: What keeps the session busy, and which part of it is done; None while it answers at once.
        self.doing: tuple[str, float | None] | None = ("starting", None)
        self._stopped = threading.Event()
        session.say = self._say
        self._worker, self._beside, self._awake = Worker(), Worker(), asyncio.Event()
        self._waiting: deque[tuple[Browser, protocol.Request]] = deque()
        self._loop = asyncio.get_running_loop()
        self._unsure = True  # the errors of the shown map are not sent yet
        self._errors: asyncio.Task[None] | None = None

    # -- browsers ------------------------------------------------------------------------------

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
            if len(self._waiting) >= MOST_WAITING:
                raise UsageError("too many requests wait", found=len(self._waiting), remedy="ask again later")
            if not self.ready:
                found = self.doing[0] if self.doing else self.failed
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
            self._stopped.set()
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

    # -- work ----------------------------------------------------------------------------------

    async def run(self) -> None:
        """Begin, then answer for ever."""
        try:
            await self._do(partial(self.session.begin, self._history))
        except LightfieldError as error:
            self.failed, self.doing = str(error), None
            self._everyone(self._job_message())
            raise
        self.ready, self.doing = True, None
        self._new_experiment()
        if not self.session.maps_ready:
            self._trace_maps()
        counted = 0
        while True:
            if self._waiting:
                await self._answer(*self._next())
            elif await self._do(self.session.survey_next):
                counted += 1
                self._busy(None)
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

    async def _do(self, what: Callable[[], Made]) -> Made:
        return await self._worker.do(what)

    def _say(self, stage: str, part: float | None = None) -> None:
        """Called in a thread that computes; ends what it does once somebody cancels it."""
        job = self.job
        if threading.current_thread() is self._beside.thread:
            if not isinstance(job, Aside) or job.ended:
                raise FitError("cancelled", found=stage, remedy="trace anew")
            job.stage, job.part = stage, part
            self._loop.call_soon_threadsafe(lambda: self._everyone(self._job_message()))
            return
        if self._stopped.is_set():
            self._stopped.clear()
            raise FitError("cancelled", found=stage, remedy="nothing has changed")
        self._loop.call_soon_threadsafe(self._busy, (stage, part))

    def _busy(self, doing: tuple[str, float | None] | None) -> None:
        if doing != self.doing:
            self.doing = doing
            self._everyone(self._job_message())

    async def _answer(self, browser: Browser, request: protocol.Request) -> None:
        session = self.session
        self._stopped.clear()  # what was cancelled before is not this
        try:
            if isinstance(request, protocol.Plain) and request.do in ("diagnose", "report", "trace"):
                self._on_job(request.do)
            elif isinstance(request, protocol.Drop):
                await self._do(partial(session.drop, request.files, request.units))
                self._new_experiment(retrace=True)
            elif not (isinstance(request, protocol.Plain) and request.do == "survey"):
                await self._do(partial(session.act, request))
                if isinstance(request, protocol.Own):
                    self._new_experiment()
            evaluation = await self._do(session.evaluation)
        except LightfieldError as error:
            browser.send(_text("error", id=request.id, message=str(error)))
            return
        except Exception:  # a defect must not cost anybody an afternoon's work
            traceback.print_exc()
            browser.send(_text("error", id=request.id, message=_DEFECT))
            return
        finally:
            self._loop.call_soon(self._busy, None)
        head = {"type": "evaluation", "plane": session.plane, **evaluation.numbers}
        for one in list(self.browsers):
            one.send(protocol.pack({**head, "id": request.id if one is browser else None}, evaluation.arrays))
        self._unsure = True
        if not (isinstance(request, protocol.Set) and not request.done):
            self._send_state()

    def _send_state(self) -> None:
        self._everyone(_text("state", **self.session.state_data()))

    def _new_experiment(self, retrace: bool = False) -> None:
        self._everyone(_text("experiment", **self.session.experiment_data()))
        self._everyone(self._job_message())
        self._send_state()
        for browser in list(self.browsers):
            self._ask(browser, protocol.Plain(id=0, do="survey"))
        if retrace and not self.session.maps_ready:
            self._trace_maps()

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
        """A document of the session."""
        return await self._do(partial(document, self.session))

    # -- jobs ----------------------------------------------------------------------------------

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
            self._start("diagnosis", diagnosed, self._diagnosed, *given)
            return
        if do == "report":
            self._report()
            return
        dense = missing_trace(session.experiment.forward, session.evaluator.values(session.now))
        if dense is None:  # the light on the planes was cancelled before
            self._trace_maps()
            return
        done = partial(self._traced, dense=dense)
        self._start("tracing anew", trace_maps, done, session.scene, session.readings, dense)

    def _report(self) -> None:
        session = self.session
        e, now = session.experiment, session.now
        if not e.has_data:
            scene = e.forward.scenes.at(session.evaluator.values(now))
            self._start("report", compared, self._reported, scene)
            return
        ladder = session.state_data()["ladder"]
        rungs = [{"effects": [*now.effects[: rung["at"]]], **rung} for rung in ladder]
        plain, traced = e.forward.scene, session.diffuse is not None
        self._start("report", climbed, self._reported, plain, e.readings, now.effects, rungs, traced)

    def _start(self, name: str, work: Callable[..., object], done: Callable[[Any], Any], *given: Any) -> None:
        self.end_job()
        self.job = Job(name, work, *given)
        self._loop.add_reader(self.job.pipe.fileno(), self._heard, self.job, done)
        self._everyone(self._job_message())

    def _heard(self, job: Job, done: Callable[[Any], Any]) -> None:
        """Something comes from the process of a job."""
        if job is not self.job:
            return
        try:
            kind, what = job.pipe.recv()
        except (EOFError, OSError):
            kind, what = "error", f"{job.name} ended unexpectedly; see the terminal"
        if kind == "stage":
            job.stage, job.part = what
            self._everyone(self._job_message())
            return
        self.end_job()
        if kind == "error":
            self._everyone(_text("error", id=None, message=what))
        else:
            self._task = self._loop.create_task(_awaited(done(what)))

    def end_job(self) -> None:
        """End what is under way, if anything is."""
        if self.job is not None:
            job, self.job = self.job, None
            if isinstance(job, Job):
                self._loop.remove_reader(job.pipe.fileno())
            job.end()
            self._everyone(self._job_message())

    def _trace_maps(self) -> None:
        self.end_job()
        self.job = Aside("light on the planes")
        self._everyone(self._job_message())
        self._mapping = self._loop.create_task(self._ready_maps(self.job))

    async def _ready_maps(self, job: Aside) -> None:
        session, experiment = self.session, self.session.experiment
        try:
            await self._beside.do(session.ready_maps)
        except LightfieldError as error:
            if self.job is job:
                self._everyone(_text("error", id=None, message=str(error)))
        else:
            if session.experiment is experiment:
                session.maps_ready = True
                self._new_experiment()
        finally:
            if self.job is job:
                self.end_job()

    async def _traced(self, _: None, dense: float) -> None:
        session = self.session
        session.dense_per_m = dense
        await self._do(partial(session.begin, session.history))
        self._new_experiment()
        self._trace_maps()

    async def _diagnosed(self, found: Diagnosed) -> None:
        self.session.verdict, self.session.report = found.verdict, found.report
        self._send_state()

    async def _reported(self, html: str) -> None:
        self.session.comparison = html
        self._everyone(_text("made", name="comparison.html"))

    def _job_message(self) -> str:
        job, doing = self.job, self.doing
        return _text(
            "job",
            ready=self.ready,
            failed=self.failed,
            job=None if job is None else {"name": job.name, "stage": job.stage, "part": job.part},
            doing=None if doing is None else {"stage": doing[0], "part": doing[1]},
        )


async def _awaited(found: Any) -> None:
    await found


def _text(kind: str, **content: object) -> str:
    return json.dumps(jsonable({"type": kind, **content}), allow_nan=False)
