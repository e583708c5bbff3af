"""Light of a stop at some places, as arrays from which a page evaluates other water, walls, gain, background.

All wavelengths share one response; each has coefficients, and perhaps a gain, of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lightfield.arrays import Array
from lightfield.errors import FitError
from lightfield.explorer.evaluation import formula
from lightfield.explorer.experiment import Experiment
from lightfield.explorer.saved.packed_arrays import PackedArrays
from lightfield.fitting.forward import SceneForward
from lightfield.fitting.parameter import is_gain
from lightfield.formula.path import rays
from lightfield.render.diffuse.diffuse_response import DiffuseResponse
from lightfield.render.diffuse.portable import LightClass, Portable, portable
from lightfield.scene import Scene
from lightfield.scene.bands import read_nm
from lightfield.scene.listed import AT
from lightfield.scene.water.coefficients import coefficients_in

#: What moves in a saved page, and up to which multiple of what it is at a stop. Chosen.
ABSORPTION, SCATTERING, ALBEDO, BACKGROUND = (
    "water.absorption_per_m",
    "water.scattering_per_m",
    "tank.wall_albedo",
    "detector.background",
)
_TIMES, _ROOM_PER_M, _ROOM_ALBEDO, _MOST_ALBEDO = 2.0, 0.1, 0.3, 0.9
#: Doubling the light doubles a reading to this part, or the instrument is not linear.
_LINEAR = 1e-9
#: By how much a coefficient is moved to see what it moves, in 1/m; they act in proportion.
_STEP_PER_M = 0.01

Ranges = Mapping[str, tuple[float, float]]


def why_fixed(e: Experiment, scene: Scene) -> str | None:
    """Why nothing can move in a page, or None: light in water alone, shown in proportion."""
    detector = scene.detector
    if detector.saturation or detector.saturation_quadratic:
        return "the instrument saturates"
    if detector.background_drift_per_hour:
        return "the background drifts"
    if detector.background_step or detector.background_course:
        return "ambient light comes and goes"
    if detector.background_departure:
        return "the background has a colour"
    if scene.lamp.width_slope:
        return "the width of the beam has a colour"
    if detector.lag_m:
        return "the places that are read lag behind"
    if scene.effect:
        return "an effect of your own is on"
    return "some readings are in air" if e.layout.air.any() else None


def ranges_at_stop(values: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Ranges of what moves at a stop, by path."""
    out = {}
    for path, value in values.items():
        if is_gain(path):
            out[path] = (value / _TIMES, value * _TIMES)
        elif (path in (ABSORPTION, SCATTERING) or path.startswith(AT)) and value >= 0:
            out[path] = (0.0, _TIMES * value + _ROOM_PER_M)
        elif path == ALBEDO and value > 0:
            out[path] = (0.0, min(_MOST_ALBEDO, _TIMES * value + _ROOM_ALBEDO))
        elif path == BACKGROUND:
            out[path] = (-_TIMES * abs(value), _TIMES * abs(value))
    return out


def fixed_light(forward: SceneForward, values: Mapping[str, float], arrays: PackedArrays) -> dict[str, Any]:
    """Readings and formula as numbers."""
    return {"fixed": arrays.add(forward.predict(values)), "formula": arrays.add(formula(forward, values))}


def moving_light(
    forward: SceneForward,
    values: Mapping[str, float],
    gains: Sequence[str],
    moves: Ranges,
    arrays: PackedArrays,
    most_per_m: float = 0.0,
) -> dict[str, Any]:
    """Light of a stop at some places, as arrays of the page.

    Parameters
    ----------
    values : mapping
        As the forward model takes them.
    gains : sequence of str
        Path of the gain of each wavelength, or of all.
    moves : mapping
        Ranges by path.
    most_per_m : float
        Attenuation up to which reflected light will be asked for at least.

    Raises
    ------
    LightfieldError
        This light is not to be had so.
    """
    light, r = forward.light, forward.readings
    scene, channel = light.scenes.at(values, validate=False), light.diffuse.channels[1]
    direct = light.direct(scene, r)
    ray = rays(scene.lamp, *(np.asarray(v, float) for v in (r.x_m, r.y_m, r.z_m)))
    offset, once, twice = (forward.reader.read(k * direct, values) for k in (0.0, 1.0, 2.0))
    if not np.allclose(twice - once, once - offset, rtol=_LINEAR, atol=_LINEAR * float(np.abs(once).max())):
        raise FitError("readings are not in proportion to the light")
    slope = forward.reader.read(np.ones_like(direct), values) - offset
    if not np.allclose(slope * direct, once - offset, rtol=_LINEAR, atol=_LINEAR * float(np.abs(once).max())):
        raise FitError("the spectrometer mixes wavelengths (stray light or second order)")
    response = light.diffuse.solved if light.diffuse.is_in(scene) else None
    if response is not None and not isinstance(response, DiffuseResponse):
        raise FitError("this light is not a response")
    channels = _channels(forward, values, moves, response, gains)
    most = max(most_per_m, *(_most_per_m(one, values, moves) for one in channels))
    out: dict[str, Any] = {
        "channel": arrays.add(channel, "u4"),
        "channels": channels,
        "albedo": scene.reflectances[0],
        "direct": arrays.add(direct),
        "way": arrays.add(ray.water_m),
        "slope": arrays.add(slope),
        "offset": arrays.add(offset),
        "diffuse": None,
        "most_per_m": most,
    }
    if response is not None:
        most_albedo = moves[ALBEDO][1] if ALBEDO in moves else values.get(ALBEDO, _MOST_ALBEDO)
        found = portable(response, scene, most, most_albedo)
        out["diffuse"] = _diffuse(found, arrays) | {
            "offset_x": scene.lamp.offset_x_m,
            "offset_y": scene.lamp.offset_y_m,
        }
    return out


def _channels(
    forward: SceneForward,
    values: Mapping[str, float],
    moves: Ranges,
    response: DiffuseResponse | None,
    gains: Sequence[str],
) -> list[dict[str, Any]]:
    """Each wavelength's coefficients, what of them a change of each path changes, and its gain's path."""
    light = forward.light
    share = 0.0 if response is None else response.clear.own_top.reference.molecular_share

    def coefficients(at: Mapping[str, float]) -> Array:
        scene = light.scenes.at(at, validate=False)
        shift = scene.detector.wavelength_shift_nm
        w = read_nm(scene, light.diffuse.wavelengths_nm) if shift else light.diffuse.wavelengths_nm
        return np.array(coefficients_in(scene.water, w, share))

    now = coefficients(values)
    paths = [p for p in moves if p.startswith("water.")]
    by = {p: (coefficients({**values, p: values[p] + _STEP_PER_M}) - now) / _STEP_PER_M for p in paths}
    return [
        {
            "absorption": float(now[0, k]),
            "scattering": float(now[1, k]),
            "of_absorption": {p: float(d[0, k]) for p, d in by.items() if d[0, k]},
            "of_scattering": {p: float(d[1, k]) for p, d in by.items() if d[1, k]},
            "gain": gains[k] if len(gains) > 1 else gains[0],
        }
        for k in range(now.shape[1])
    ]


def _most_per_m(one: Mapping[str, Any], values: Mapping[str, float], moves: Ranges) -> float:
    """Largest attenuation of a wavelength that can be asked for."""
    more = sum(
        part * (moves[path][1] - values[path])
        for kind in ("of_absorption", "of_scattering")
        for path, part in one[kind].items()
    )
    return float(one["absorption"] + one["scattering"] + more)


def _diffuse(p: Portable, arrays: PackedArrays) -> dict[str, Any]:
    near, terms = _rows(p.shift.terms.tocsr(), 6)
    reflected = p.reflections
    return {
        "a0": p.absorption_per_m,
        "b0": p.scattering_per_m,
        "rho0": p.wall_albedo,
        "surface": p.surface / p.surface_reflectance,
        "lengths": {
            "nodes": p.lengths.nodes,
            "below": arrays.add(p.lengths.below, "u4"),
            "part": arrays.add(p.lengths.part),
        },
        "straight": arrays.add(p.straight_m),
        "through": arrays.add(p.through),
        "classes": [_class(c, arrays) for c in p.classes],
        "smoother": _sparse(p, arrays) if any(c.wanted is not None for c in p.classes) else None,
        "cell": arrays.add(p.shift.cell, "u4"),
        "dx": arrays.add(p.shift.dx_m),
        "dy": arrays.add(p.shift.dy_m),
        "vx": p.shift.variance_x,
        "vy": p.shift.variance_y,
        "which": arrays.add(p.shift.which.ravel(), "u4"),
        "weight": arrays.add(p.shift.weight.ravel()) if len(p.shift.which) > 1 else None,
        "scale": arrays.add(p.shift.scale) if len(p.shift.which) > 1 else None,
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


def _class(c: LightClass, arrays: PackedArrays) -> dict[str, Any]:
    return {
        "counts": c.counts,
        "excess": c.excess_m,
        "open": c.open_ended,
        "mean": arrays.add(c.mean, "f2"),
        "wanted": None if c.wanted is None else arrays.add(c.wanted, "f2"),
    }


def _sparse(p: Portable, arrays: PackedArrays) -> dict[str, Any]:
    s = p.smoother.tocsr()
    return {
        "starts": arrays.add(s.indptr, "u4"),
        "cells": arrays.add(s.indices, "u4"),
        "weights": arrays.add(s.data),
    }
