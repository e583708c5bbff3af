"""The explorer as one page to mail: the response is in it, and a small kernel that evaluates it.

Every rung of the ladder, and the state that is shown, is a stop: lamp, phase function and surface are fixed
there, water, walls, gain and background move. What is moved is evaluated as `render/diffuse/portable.py` and
`formula/field.py` say, in JavaScript (`page/kernel.js`), held to Python within 1e-3 by a test in a browser.
Where light is not to be had so (several wavelengths, water that changes in time, saturation), a stop shows
its numbers and moves nothing.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from lightfield import __version__
from lightfield.arrays import Array
from lightfield.errors import LightfieldError
from lightfield.explorer.described import state_data
from lightfield.explorer.experiment import Experiment
from lightfield.explorer.places import SIDE
from lightfield.explorer.protocol import plain
from lightfield.explorer.session import Session
from lightfield.explorer.state import State
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.light_source import has_diffuse_light
from lightfield.formula.path import rays
from lightfield.render.diffuse.portable import Histories, Portable, portable
from lightfield.render.diffuse.response import DiffuseResponse
from lightfield.scene import Scene
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m

PAGE = Path(__file__).parents[1] / "page"
SCRIPTS = ("values.js", "plots.js", "maps.js", "panels.js", "kernel.js", "saved.js")
#: Every so many places of a map are in the page: 21 along a side.
EVERY = 2
#: What moves in a saved page, and up to which multiple of what it is at a stop. Chosen.
GAIN, ABSORPTION, SCATTERING, ALBEDO, BACKGROUND = (
    "gain",
    "water.absorption_per_m",
    "water.scattering_per_m",
    "tank.wall_albedo",
    "detector.background",
)
_TIMES, _ROOM_PER_M, _ROOM_ALBEDO, _MOST_ALBEDO = 2.0, 0.1, 0.3, 0.9
#: More readings than this are not whitened in the page: the matrix is their square.
MOST_WHITENED = 500
#: Doubling the light doubles a reading to this part, or the instrument is not linear.
_LINEAR = 1e-9


class Arrays:
    """Arrays of a page: their bytes one after the other, and where each lies."""

    def __init__(self) -> None:
        self.bytes = bytearray()

    def add(self, array: Any, kind: str = "f4") -> list[Any]:
        """Keep an array of 32-bit floats (f4), 16-bit ones scaled row by row (f2), or whole numbers (u4)."""
        array = np.asarray(array)
        scale = None
        if kind == "f2":
            top = np.abs(array).max(axis=-1, keepdims=True, initial=0)
            scale = np.where(top > 0, top / 60000.0, 1.0)
            array = array / scale
        at = len(self.bytes)
        self.bytes += np.ascontiguousarray(array, f"<{kind}").tobytes()
        self.bytes += bytes(-len(self.bytes) % 4)
        scales = None if scale is None else self.add(scale.ravel())
        return [kind, at, list(array.shape), scales]

    @property
    def text(self) -> str:
        """All of them, base 64."""
        return base64.b64encode(bytes(self.bytes)).decode("ascii")


def page_html(session: Session) -> str:
    """The page."""
    session_arrays, experiment = Arrays(), session.experiment
    some = some_places(experiment)
    stops = [_stop(session, state, label, some, session_arrays) for state, label in _stops(session)]
    e = session.experiment_data()
    kept = np.arange(SIDE) % EVERY == 0
    e |= {"map_x_m": experiment.places.x_m[kept], "map_y_m": experiment.places.y_m[kept], "untestable": {}}
    n = len(experiment.readings)
    data = {
        "experiment": e,
        "stops": stops,
        "plane": session.plane,
        "here": len(stops) - 1,
        "bright": session.fits.counted,
        "phi": experiment.phi,
        "whiten": session_arrays.add(experiment.whiten(np.eye(n))) if n <= MOST_WHITENED else None,
        "version": __version__,
        "verdict": session.verdict,
    }
    data["arrays"] = session_arrays.text
    return _filled(str(e["title"]), json.dumps(plain(data), allow_nan=False))


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


def some_places(e: Experiment) -> SceneForward:
    """The model at every other place of the maps."""
    kept = np.arange(SIDE) % EVERY == 0
    return e.maps[0].subset(np.tile(np.outer(kept, kept).ravel(), len(e.places.z_m)))


@dataclass(frozen=True)
class _Moves:
    """Ranges of what moves at a stop, by path."""

    values: Mapping[str, float]
    scene: Scene

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        out = {}
        for path, value in self.values.items():
            if path == GAIN:
                out[path] = (value / _TIMES, value * _TIMES)
            elif path in (ABSORPTION, SCATTERING) and value >= 0:
                out[path] = (0.0, _TIMES * value + _ROOM_PER_M)
            elif path == ALBEDO and value > 0:
                out[path] = (0.0, min(_MOST_ALBEDO, _TIMES * value + _ROOM_ALBEDO))
            elif path == BACKGROUND:
                out[path] = (-_TIMES * abs(value), _TIMES * abs(value))
        return out


def _stop(session: Session, state: State, label: str, maps: SceneForward, arrays: Arrays) -> dict[str, Any]:
    """One stop: what is shown there, and what is needed to move from it."""
    e, values = session.experiment, session.evaluator.values(state)
    scene = e.forward.scene_at(values, validate=False)
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
        "sets": {},
    }
    one = session.maps_ready and len(e.maps) == 1
    sets = {"readings": e.forward} | ({"maps": maps} if one else {})
    moves = _Moves(values, scene).ranges if _is_simple(e, scene) else {}
    try:
        stop["sets"] = {name: _set(forward, values, moves, arrays) for name, forward in sets.items()}
        stop["moves"] = {path: list(ends) for path, ends in moves.items()}
    except LightfieldError:
        moves = {}
    if not moves:
        stop["sets"] = {name: _numbers(forward, values, arrays) for name, forward in sets.items()}
    return stop


def _is_simple(e: Experiment, scene: Scene) -> bool:
    """One wavelength, water alone around the readings, and an instrument that shows light in proportion."""
    detector = scene.detector
    steady = not (detector.saturation or detector.saturation_quadratic or detector.background_drift_per_hour)
    return steady and len(e.forward.gain_names) == 1 and not scene.effect and not e.layout.air.any()


def _numbers(forward: SceneForward, values: Mapping[str, float], arrays: Arrays) -> dict[str, Any]:
    return {"fixed": arrays.add(forward.predict(values)), "formula": arrays.add(_formula(forward, values))}


def _set(
    forward: SceneForward,
    values: Mapping[str, float],
    moves: Mapping[str, tuple[float, float]],
    arrays: Arrays,
) -> dict[str, Any]:
    """Light of a stop at some places, as arrays of the page."""
    if not moves:
        return _numbers(forward, values, arrays)
    light, r = forward.light, forward.readings
    scene = light.scene_at(values, validate=False)
    at = light.wavelengths_nm
    a, b = float(absorption_per_m(scene.water, at)[0]), float(scattering_per_m(scene.water, at)[0])
    direct = light.direct(scene, r)
    ray = rays(scene.lamp, *(np.asarray(v, float) for v in (r.x_m, r.y_m, r.z_m)))
    offset, once, twice = (forward.read(k * direct, values) for k in (0.0, 1.0, 2.0))
    if not np.allclose(twice - once, once - offset, rtol=_LINEAR, atol=_LINEAR * float(np.abs(once).max())):
        raise LightfieldError("readings are not in proportion to the light")
    out: dict[str, Any] = {
        "absorption": a,
        "scattering": b,
        "albedo": scene.reflectances[0],
        "direct": arrays.add(direct),
        "way": arrays.add(ray.r),
        "slope": arrays.add(forward.read(np.ones_like(direct), values) - offset),
        "offset": arrays.add(offset),
        "diffuse": None,
    }
    if light.trace is not None and has_diffuse_light(scene):
        response = light.diffuse
        if not isinstance(response, DiffuseResponse):
            raise LightfieldError("this light is not a response")
        ends = {path: high for path, (_, high) in moves.items()}
        most = (
            a
            + b
            + sum(ends.get(p, values.get(p, 0.0)) - values.get(p, 0.0) for p in (ABSORPTION, SCATTERING))
        )
        found = portable(response, scene, most, ends.get(ALBEDO, _MOST_ALBEDO))
        out["diffuse"] = _diffuse(found, arrays) | {
            "offset_x": scene.lamp.offset_x_m,
            "offset_y": scene.lamp.offset_y_m,
        }
    return out


def _diffuse(p: Portable, arrays: Arrays) -> dict[str, Any]:
    near, terms = _rows(p.shift.terms.tocsr(), 6)
    reflected = p.reflections
    return {
        "a0": p.absorption_per_m,
        "b0": p.scattering_per_m,
        "rho0": p.wall_albedo,
        "surface": p.surface / p.surface_reflectance,
        "mean_straight": p.mean_straight_m,
        "straight": arrays.add(p.straight_m),
        "through": arrays.add(p.through),
        "classes": [_class(c, arrays) for c in p.classes],
        "smoother": _sparse(p, arrays) if any(c.wanted is not None for c in p.classes) else None,
        "cell": arrays.add(p.shift.cell, "u4"),
        "dx": arrays.add(p.shift.dx_m),
        "dy": arrays.add(p.shift.dy_m),
        "vx": p.shift.variance_x,
        "vy": p.shift.variance_y,
        "which": arrays.add(p.shift.which, "u4"),
        "near": arrays.add(near, "u4"),
        "terms": arrays.add(terms),
        "reflected": None
        if reflected is None
        else {
            "image": arrays.add(reflected.image),
            "way": arrays.add(reflected.way_m),
            "step": reflected.step_per_m,
            "albedos": reflected.albedos,
            "walls": arrays.add(reflected.walls),
        },
    }


def _rows(terms: Any, kinds: int) -> tuple[Array, Array]:
    """Sparse rows of equal pattern as dense: neighbours (n, k), weights (kinds, n, k); 0 for missing ones."""
    n = terms.shape[0] // kinds
    blocks = [terms[t * n : (t + 1) * n] for t in range(kinds)]
    assert all(np.array_equal(block.indices, blocks[0].indices) for block in blocks)
    sizes = np.diff(blocks[0].indptr)
    inside = np.arange(sizes.max()) < sizes[:, None]
    near, weights = np.zeros(inside.shape, int), np.zeros((kinds, *inside.shape))
    near[inside] = blocks[0].indices
    for block, w in zip(blocks, weights, strict=True):
        w[inside] = block.data
    return near, weights


def _class(c: Histories, arrays: Arrays) -> dict[str, Any]:
    return {
        "counts": c.counts,
        "excess": c.excess_m,
        "open": c.open_ended,
        "mean": arrays.add(c.mean, "f2"),
        "wanted": None if c.wanted is None else arrays.add(c.wanted, "f2"),
    }


def _sparse(p: Portable, arrays: Arrays) -> dict[str, Any]:
    s = p.smoother.tocsr()
    return {
        "starts": arrays.add(s.indptr, "u4"),
        "cells": arrays.add(s.indices, "u4"),
        "weights": arrays.add(s.data),
    }


def _formula(forward: SceneForward, values: Mapping[str, float]) -> Array:
    light = forward.light
    return forward.read(light.direct(light.scene_at(values, validate=False), forward.readings), values)


def _filled(title: str, data: str) -> str:
    """The page with style, scripts and data in it, and a policy that lets nothing else run or load."""
    style = (PAGE / "explorer.css").read_text(encoding="utf-8")
    script = "\n".join((PAGE / name).read_text(encoding="utf-8") for name in SCRIPTS)
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
