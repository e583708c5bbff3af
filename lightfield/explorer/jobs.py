"""Work that takes a while, in a process of its own: it reports, can be ended, and slows nothing."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection

from lightfield.diagnosis.diagnose import diagnose
from lightfield.errors import LightfieldError
from lightfield.explorer.experiment import all_lit, explored
from lightfield.readings import Readings
from lightfield.report.diagnosis.drawn import view_of
from lightfield.scene import Scene

Tell = Callable[[str], None]
#: Seconds that an ended process is waited for.
_PATIENCE_S = 5.0


@dataclass(frozen=True)
class Diagnosed:
    """What a diagnosis leaves.

    Parameters
    ----------
    verdict : mapping
        Words, explanations and ladder as the page shows them.
    report : str
        The report, HTML.
    """

    verdict: Mapping[str, object]
    report: str


def trace_maps(scene: Scene, readings: Readings | None, dense_per_m: float | None, tell: Tell) -> None:
    """Leave in the cache what the maps and the readings of an experiment need."""
    experiment = explored(scene, readings, dense_per_m=dense_per_m, progress=tell)
    tell("tracing scattered and reflected light for the maps")
    values = {p.path: p.value(p.start) for p in experiment.problem.base} | all_lit(experiment)
    experiment.maps[0].predict(values)


def diagnosed(scene: Scene, readings: Readings, traced: bool, tell: Tell) -> Diagnosed:
    """Diagnose readings, with or without traced light, and draw the report."""
    from lightfield.report.diagnosis.page import diagnosis_page

    found = diagnose(readings, scene, diffuse="trace" if traced else None, progress=tell)
    if found.steps[1:] and traced:
        tell("rendering the explained scene afresh")
        found = found.rendered()
    tell("drawing the report")
    v = found.verdict
    verdict = {
        "kind": v.verdict,
        "headline": v.headline,
        "support": v.support,
        "doubt": v.doubt,
        "explanations": [
            {
                "keys": [f"{name}:{form}" for name, form in zip(one.effects, one.forms, strict=True)],
                "label": " + ".join(name.replace("_", " ") for name in one.effects) or "nothing is missing",
                "error_percent": one.error_percent,
                "chi2_per_dof": one.chi2_per_dof,
                "weight": one.weight,
            }
            for one in v.explanations
        ],
        "rival": None
        if v.nearest_rival is None
        else {"label": " + ".join(v.nearest_rival.effects), "sigma": v.nearest_rival.separation_sigma},
        "next": None if v.next_measurement is None else v.next_measurement.sentence,
        "rendered_percent": v.ladder[-1].rendered_error_percent,
        "floor_percent": v.noise_floor_percent,
    }
    return Diagnosed(verdict, diagnosis_page(view_of(found)))


class Job:
    """Work in a process of its own.

    Parameters
    ----------
    name : str
        What is done, for people.
    work : callable
        Takes `tell`, to be called with what begins; must be importable by another process.
    """

    def __init__(self, name: str, work: Callable[..., object], *arguments: object) -> None:
        self.name, self.stage = name, "starting"
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe(duplex=False)
        self._process = context.Process(target=_run, args=(theirs, partial(work, *arguments)), daemon=True)
        self._process.start()
        theirs.close()

    def end(self) -> None:
        """End it, whatever it is doing."""
        self._process.terminate()
        self._process.join(_PATIENCE_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join(_PATIENCE_S)
        self.pipe.close()


def _run(pipe: Connection, work: Callable[[Tell], object]) -> None:
    """In the process: the stages as text, then what was found or the error."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the server's, which ends this process
    try:
        found = work(lambda stage: pipe.send(("stage", stage)))
    except LightfieldError as error:
        pipe.send(("error", str(error)))
    else:
        pipe.send(("done", found))
