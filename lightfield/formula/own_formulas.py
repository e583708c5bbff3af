"""Effects of the user's own where they act: on the beam, on straight light, on all light, on readings.

A formula of the angle at the source becomes a departure of the lamp's profile, which scattered and reflected
light has too. What acts on the path, at the receiver or in time multiplies light at the places of readings.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from lightfield.arrays import Array
from lightfield.formula.path import rays
from lightfield.scene.curve import LARGEST, value_at
from lightfield.scene.lamp.frame import beam_angles
from lightfield.scene.own.own_effect import OwnEffect, Places, Stage

if TYPE_CHECKING:
    from lightfield.scene import Scene

#: Angles at which a formula of the angle is tabulated: even ones, and ever larger to the side.
_ANGLES_DEG = np.unique(np.concatenate([np.linspace(0.0, 30.0, 301), np.linspace(30.0, 90.0, 61)]))


def lit(scene: Scene) -> Scene:
    """The scene with own effects on the beam's shape in its lamp, and no more that act among its effects."""
    beam = [effect for effect in scene.effect if effect.is_of_angle and not effect.is_off]
    if not beam:
        return scene
    nothing = np.zeros_like(_ANGLES_DEG)
    log = nothing.copy()
    for effect in beam:
        factor = effect.at(Places(nothing, nothing, nothing, nothing, _ANGLES_DEG, nothing, nothing))
        log = log + np.log(np.maximum(factor, np.exp(-LARGEST)))
    own = scene.lamp.profile_departure
    place = np.union1d(_ANGLES_DEG, [angle for angle, _ in own])
    log = np.interp(place, _ANGLES_DEG, log) + (value_at(own, place) if own else 0.0)
    nodes = tuple(zip(place.tolist(), np.clip(log, -LARGEST, LARGEST).tolist(), strict=True))
    lamp = scene.lamp.model_copy(update={"profile_departure": nodes})
    others = tuple(effect for effect in scene.effect if not effect.is_of_angle)
    return scene.model_copy(update={"lamp": lamp, "effect": others})


def places(
    scene: Scene,
    x_m: ArrayLike,
    y_m: ArrayLike,
    z_m: ArrayLike,
    wavelength_nm: ArrayLike | None = None,
    time_s: ArrayLike | None = None,
) -> Places:
    """What formulas may speak of, at readings.

    An unknown wavelength is the middle of the band, an unknown time 0.
    """
    x, y, z = np.broadcast_arrays(*(np.asarray(v, float) for v in (x_m, y_m, z_m)))
    ray = rays(scene.lamp, x, y, z)
    theta = np.degrees(np.hypot(*beam_angles(scene.lamp, ray.dx, ray.dy, ray.dz)))
    middle = 0.5 * sum(scene.detector.bands_nm[0])
    wavelength = _known(wavelength_nm, middle, x.shape)
    return Places(x, y, z, ray.r, theta, wavelength, _known(time_s, 0.0, x.shape))


def _known(value: ArrayLike | None, otherwise: float, shape: tuple[int, ...]) -> Array:
    given = np.asarray(otherwise if value is None else value, float)
    return np.broadcast_to(np.where(np.isnan(given), otherwise, given), shape)


def acting(effects: Sequence[OwnEffect], *stages: Stage) -> list[OwnEffect]:
    """Those that act at some stages; those on the beam's shape do not count, see `lit`."""
    return [e for e in effects if e.stage in stages and not (e.is_of_angle or e.is_off)]


def product(effects: Sequence[OwnEffect], here: Places) -> Array:
    """What effects make of light together, shape (n,)."""
    factors = [effect.at(here) for effect in effects]
    return np.asarray(np.prod(factors, axis=0) if len(factors) > 1 else factors[0])


def factor(scene: Scene, stages: tuple[Stage, ...], *where: Any) -> Array | float:
    """Product of what own effects at some stages make of light; `where` as `places` takes it."""
    effects = acting(scene.effect, *stages)
    return product(effects, places(scene, *where)) if effects else 1.0


def on_path(scene: Scene) -> tuple[OwnEffect, ...]:
    """Own effects that act on the path of the light that comes straight."""
    return tuple(effect for effect in scene.effect if effect.stage == "path" and not effect.is_off)


def has_own_straight_light(scene: Scene) -> bool:
    """Is straight light, in any one water, another than a trace of the lamp as it is at 550 nm tells?"""
    return bool(on_path(scene) or scene.lamp.width_slope)


def has_colours_of_its_own(scene: Scene) -> bool:
    """And does it change with the wavelength?"""
    return bool(scene.lamp.width_slope) or any(e.speaks_of("wavelength") for e in on_path(scene))


def shown(scene: Scene, reading: Array, full: float, *where: Any) -> Array:
    """Readings after own effects of the readout, see `read_through`; `where` as `places` takes it."""
    effects = acting(scene.effect, "readout")
    return read_through(effects, reading, full, places(scene, *where)) if effects else reading


def read_through(effects: Sequence[OwnEffect], reading: Array, full: float, here: Places) -> Array:
    """Readings after some effects of the readout, in this order.

    Parameters
    ----------
    full : float
        Largest reading.
    """
    for effect in effects:
        reading = full * effect.at(here, reading / full)
    return reading
