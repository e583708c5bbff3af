"""What can be saved: the scene, the readings with their residuals, the session, the reports, the page."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Mapping
from operator import attrgetter
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from lightfield.errors import UsageError
from lightfield.explorer.dropped import table_dropped
from lightfield.explorer.saved.page import page_html
from lightfield.explorer.session import Session
from lightfield.explorer.state import MOST_SNAPSHOTS, MOST_STATES, History, State
from lightfield.fitting.diffuse_light import DiffuseSource
from lightfield.readings.table.write import dumps
from lightfield.scene import Scene
from lightfield.storage.inputs import MEGABYTE, FileKind, read_bytes
from lightfield.version import __version__

#: A session: scene, readings and states.
SESSION = FileKind("session", 60 * MEGABYTE, UsageError)
_FORMAT = "lightfield session 1"
#: Letters that say what led to a state, at most: a session that is saved can be opened.
_MOST_WORDS = 500
#: Digits of residuals: more than any instrument has.
_DIGITS = ".9g"


def scene_toml(session: Session) -> str:
    """The scene with the values that are shown."""
    return session.experiment.forward.scenes.at(session.evaluator.values(session.now)).to_toml()


def residuals_csv(session: Session) -> str:
    """Readings, model, formula and residuals."""
    e, shown = session.experiment, session.evaluation().arrays
    r = e.readings
    numbers = {
        "x_m": r.x_m, "y_m": r.y_m, "z_m": r.z_m, "wavelength_nm": r.wavelength_nm, "time_s": r.time_s,
        "value": r.value, "sigma": e.sigma, "model": shown["model"], "formula": shown["formula"],
        "residual_sigma": shown["residual"],
        "residual_percent": 100 * (r.value - shown["model"]) / shown["model"],
    }  # fmt: skip
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["medium", *numbers, "counted"])
    for k in range(len(r)):
        row = [
            "" if not np.isfinite(column[k]) else format(float(column[k]), _DIGITS)
            for column in numbers.values()
        ]
        writer.writerow([str(r.medium[k]), *row, int(e.problem.keep[k] > 0)])
    return out.getvalue()


class _State(BaseModel):
    model_config = ConfigDict(extra="forbid")
    effects: Annotated[list[Annotated[str, Field(max_length=120)]], Field(max_length=40)]
    values: Annotated[dict[str, Annotated[float, Field(allow_inf_nan=False)]], Field(max_length=400)]
    did: Annotated[str, Field(max_length=_MOST_WORDS)]


class _Session(BaseModel):
    model_config = ConfigDict(extra="forbid")
    format: Literal["lightfield session 1"]
    version: str
    scene: str
    readings: str | None
    dense_per_m: Annotated[float, Field(gt=0, le=100)] | None
    states: Annotated[list[_State], Field(min_length=1, max_length=MOST_STATES)]
    at: Annotated[int, Field(ge=0, lt=MOST_STATES)]
    snapshots: Annotated[dict[str, _State], Field(max_length=MOST_SNAPSHOTS)]


def session_json(session: Session) -> str:
    """Everything that is needed to go on another day: scene, readings, states, snapshots."""
    history = session.history

    def plain(state: State) -> dict[str, object]:
        did = state.did[:_MOST_WORDS]  # what moved many values at once names them all
        return {"effects": list(state.effects), "values": dict(state.values), "did": did}

    return json.dumps(
        {
            "format": _FORMAT,
            "version": __version__,
            "scene": session.scene.to_toml(),
            "readings": None if session.readings is None else dumps(session.readings),
            "dense_per_m": session.dense_per_m,
            "states": [plain(state) for state in history.states],
            "at": history.at,
            "snapshots": {name: plain(state) for name, state in history.snapshots.items()},
        },
        indent=1,
        allow_nan=False,
    )


def open_session(path: Path, diffuse: DiffuseSource | str | None = "trace") -> tuple[Session, History]:
    """The session of a file, not begun yet, and its history.

    Parameters
    ----------
    diffuse : "trace", None or callable
        As `Session` takes it.

    Raises
    ------
    LightfieldError
        Not a session, or its scene or readings are not usable.
    """
    try:
        given = _Session.model_validate_json(read_bytes(path, SESSION))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise UsageError(
            "not a session",
            where=str(path),
            found=".".join(map(str, first["loc"]))[:100] or None,
            rule=first["msg"],
            remedy="give a file that the explorer saved, a scene (.toml) or readings (.csv)",
        ) from error
    scene = Scene.from_toml(given.scene, where=f"{path}: scene")
    table, name = given.readings, f"{path.name}-readings.csv"
    readings = None if table is None else table_dropped(table.encode(), name, scene)

    def state(plain: _State) -> State:
        return State(tuple(plain.effects), plain.values, plain.did)

    history = History(
        [state(s) for s in given.states], given.at, {n: state(s) for n, s in given.snapshots.items()}
    )
    return Session(scene, readings, diffuse, given.dense_per_m), history


#: What can be asked for, by file name: its kind, and what makes it; None where there is none yet.
DOCUMENTS: Mapping[str, tuple[str, Callable[[Session], str | None]]] = {
    "scene.toml": ("application/toml", scene_toml),
    "residuals.csv": ("text/csv", residuals_csv),
    "session.json": ("application/json", session_json),
    "report.html": ("text/html", attrgetter("report")),
    "comparison.html": ("text/html", attrgetter("comparison")),
    "page.html": ("text/html", page_html),
}
