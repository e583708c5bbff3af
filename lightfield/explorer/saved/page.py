"""The explorer as one page to mail: the response is in it, and a small kernel that evaluates it.

Every rung of the ladder, and the state that is shown, is a stop: lamp, phase function and surface are fixed
there, water, walls, gain and background move, at every wavelength. What is moved is evaluated as
`render/diffuse/portable.py` and `formula/closed_form.py` say, in JavaScript (`page/kernel.js`), held to
Python within 1e-3 by a test in a browser. Where light is not to be had so (water that changes in time,
saturation), a stop shows its numbers, moves nothing, and says why.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lightfield.arrays import jsonable
from lightfield.errors import LightfieldError
from lightfield.explorer.described import state_data
from lightfield.explorer.experiment import Experiment
from lightfield.explorer.places import SIDE
from lightfield.explorer.saved.moving_light import fixed_light, moving_light, ranges_at_stop, why_fixed
from lightfield.explorer.saved.packed_arrays import PackedArrays
from lightfield.explorer.session import Session
from lightfield.explorer.state import State
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.parameter import GAIN
from lightfield.version import __version__

PAGE = Path(__file__).parents[1] / "page"
_SCRIPTS = ("values.js", "plots.js", "maps.js", "panels.js", "kernel.js", "saved.js")
#: Every so many places of a map are in the page: 21 along a side.
_EVERY = 2
#: Of more wavelengths than these only the one that is shown has maps in the page. Chosen.
_MOST_MAPPED = 8
#: More readings than this are not whitened in the page: the matrix is their square.
_MOST_WHITENED = 500

DrawnModel = tuple[SceneForward, Mapping[str, float], Sequence[str]]


def page_html(session: Session) -> str:
    """The page."""
    session_arrays, experiment = PackedArrays(), session.experiment
    every = range(len(experiment.maps))
    shown = every if len(every) <= _MOST_MAPPED else [session.channel]
    some = [some_places(experiment, k) if k in shown else None for k in every]
    stops = [_stop(session, state, label, some, session_arrays) for state, label in _stops(session)]
    e = session.experiment_data()
    kept = np.arange(SIDE) % _EVERY == 0
    places = experiment.places
    e |= {"map_x_m": places.x_m[kept], "map_y_m": places.y_m[kept], "untestable": {}}
    n = len(experiment.readings)
    data = {
        "experiment": e,
        "stops": stops,
        "wet": np.flatnonzero(places.wet[np.ix_(kept, kept)]),
        "plane": session.plane,
        "channel": session.channel,
        "here": len(stops) - 1,
        "bright": session.fits.counted,
        "phi": experiment.phi,
        "whiten": session_arrays.add(experiment.whiten(np.eye(n))) if n <= _MOST_WHITENED else None,
        "version": __version__,
        "verdict": session.verdict,
    }
    data["arrays"] = session_arrays.text
    return _filled(json.dumps(jsonable(data), allow_nan=False))


def _stops(session: Session) -> list[tuple[State, str]]:
    """Fitted rungs, and what is shown if it is none of them."""
    out = []
    for rung in session.state_data()["ladder"]:
        effects = session.now.effects[: rung["at"]]
        fitted = session.fits.known(effects) if session.experiment.has_data else None
        values = session.now.values if fitted is None else fitted.values
        out.append((State(effects, dict(values)), str(rung["label"])))
    now = session.evaluator.values(session.now)
    if not out or any(not np.isclose(now[k], out[-1][0].values.get(k, np.nan), rtol=1e-6) for k in now):
        out.append((session.now, "as it was saved"))
    return out


def some_places(e: Experiment, channel: int = 0) -> SceneForward:
    """The model at every other place of the maps, at one of the wavelengths."""
    return e.maps[channel].subset(e.places.some(np.arange(SIDE) % _EVERY == 0))


def _stop(
    session: Session, state: State, label: str, maps: Sequence[SceneForward | None], arrays: PackedArrays
) -> dict[str, Any]:
    """One stop: what is shown there, and what is needed to move from it."""
    e, values = session.experiment, session.evaluator.values(state)
    described = state_data(session.fits, state, {})
    shown = session.evaluator.of(replace(state, values=values), 0, 0, False)
    stop: dict[str, Any] = {
        "label": label,
        "effects": list(state.effects),
        "values": values,
        "score": {k: shown.numbers[k] for k in ("error_percent", "chi2", "dof")},
        "parameters": described["parameters"],
        "base": described["base"],
        "described": [one for one in described["effects"] if one["on"]],
        "moves": {},
    }
    names = e.forward.gains.names
    first: DrawnModel = e.forward, values, names
    at_maps: list[DrawnModel | None] = []
    if session.maps_ready:
        gains = names if len(names) == len(maps) else names * len(maps)
        at_maps = [
            None if m is None else (m, {**values, GAIN: values[gain]}, (gain,))
            for m, gain in zip(maps, gains, strict=True)
        ]
    why, moves = why_fixed(e, e.forward.scenes.at(values, validate=False)), ranges_at_stop(values)
    if why is None:
        try:
            readings = moving_light(*first, moves, arrays)
            most = readings["most_per_m"]
            lit = [None if m is None else moving_light(*m, moves, arrays, most) for m in at_maps]
            ends = {path: list(both) for path, both in moves.items()}
            return stop | {"moves": ends, "sets": {"readings": readings, "maps": lit}}
        except LightfieldError as error:
            why = str(error)
    readings = fixed_light(first[0], first[1], arrays)
    lit = [None if m is None else fixed_light(m[0], m[1], arrays) for m in at_maps]
    return stop | {"why_fixed": why, "sets": {"readings": readings, "maps": lit}}


def _filled(data: str) -> str:
    """The page with style, scripts and data in it, and a policy that lets nothing else run or load."""
    style = (PAGE / "explorer.css").read_text(encoding="utf-8")
    script = "\n".join((PAGE / name).read_text(encoding="utf-8") for name in _SCRIPTS)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = f"default-src 'none'; script-src 'sha256-{digest}'; style-src 'unsafe-inline'; img-src data:"
    html = (PAGE / "index.html").read_text(encoding="utf-8")
    lines = [line for line in html.splitlines() if "<script" not in line and 'rel="stylesheet"' not in line]
    safe = data.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")
    head = f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n<style>\n{style}</style>'
    end = f'<script type="application/json" id="saved">{safe}</script>\n<script>{script}</script>\n</body>'
    text = "\n".join(lines) + "\n"
    # The data come last and are never searched: a title cannot stand for a mark.
    before, after = text.split("</head>", 1)
    body = after.rsplit("</body>", 1)
    return f"{before}{head}\n</head>{body[0]}{end}{body[1]}"
