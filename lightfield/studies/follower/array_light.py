"""What a follower reads, and what it believes that it reads: the traced field, or the formula."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby
from typing import Any, Protocol

import numpy as np

from lightfield.arrays import Array
from lightfield.errors import RenderError
from lightfield.formula.vector import direct_flux, flux_and_slopes, on_receivers, seen_of_back
from lightfield.render.flux.traced_field import Region, reference_for_others, traced_field
from lightfield.scene import Scene
from lightfield.scene.bands import middles_nm, refuse_unlit
from lightfield.scene.lamp.frame import has_round_section
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m
from lightfield.studies import defaults
from lightfield.studies.follower.elements import Elements
from lightfield.studies.follower.frames import POSE, placed, rotations

#: What the lamp may be tilted towards, which a follower does not know, and the axis of the scene that it is.
LAMP_TILTS = {"lamp tilt x": "x", "lamp tilt y": "y"}
#: Step of numerical derivatives, m and rad, and of a logarithm: the light changes over decimetres and
#: degrees, so the relative error of a central difference is about (step / length)^2 = 1e-6.
STEP = 1e-4
#: Relative step of the water's coefficients: their derivatives are smooth.
_WATER_STEP = 1e-2
#: An element that reads less than this part of the brightest tells nothing (rounding of derivatives).
DARK = 1e-9
#: Room around the formation space in which a search may look, m (chosen).
MARGIN_M = 0.3


class Light(Protocol):
    """Light on cosine receivers for unit radiant intensity on the lamp's axis, 1/m^2, in any water."""

    @property
    def scene(self) -> Scene: ...

    def reading(self, place_m: Array, normal: Array) -> Array: ...

    def fluxes(self, place_m: Array) -> list[tuple[Array, Array]]: ...

    def irradiance(self, place_m: Array, normal: Array) -> tuple[Array, Array]: ...

    def leave_one_out(self) -> Sequence[Light]: ...

    def in_water_of(self, scene: Scene) -> Light: ...


@dataclass(frozen=True)
class FormulaLight:
    """Gaussian beam, inverse square and Beer-Lambert: no scattered light, no walls."""

    scene: Scene

    def reading(self, place_m: Array, normal: Array) -> Array:
        """Readings, 1/m^2, shape (n,), at places and outward normals of shape (n, 3)."""
        return on_receivers(direct_flux(self.scene, place_m), normal)

    def fluxes(self, place_m: Array) -> list[tuple[Array, Array]]:
        """Flux vector of the direct light, (n, 3), and its slopes by the place, (n, 3, 3)."""
        return [flux_and_slopes(self.scene, np.asarray(place_m, float))]

    def irradiance(self, place_m: Array, normal: Array) -> tuple[Array, Array]:
        """`reading`, and errors of zero."""
        found = self.reading(place_m, normal)
        return found, np.zeros_like(found)

    def leave_one_out(self) -> list[FormulaLight]:
        """None: nothing is traced."""
        return []

    def in_water_of(self, scene: Scene) -> FormulaLight:
        return FormulaLight(scene)


@dataclass(frozen=True)
class Space:
    """Where the follower may be: |x|, |y| up to a half width, z between two distances, m."""

    half_width_m: float = defaults.HALF_WIDTH_M
    near_m: float = 4.5
    far_m: float = 8.5

    @classmethod
    def of_scene(cls, scene: Scene, half_width_m: float = defaults.HALF_WIDTH_M) -> Space:
        """From the first to the last plane of a scene's detector, or position."""
        read = scene.detector.distances_m
        return cls(half_width_m, read[0], read[-1])

    def with_pose(self, pose: Array) -> Space:
        """As far as a pose that may lie outside, shape (6,)."""
        x, y, z = map(float, pose[:3])
        wide = max(self.half_width_m, abs(x), abs(y))
        return Space(wide, min(self.near_m, z), max(self.far_m, z))


def refuse_walls(scene: Scene, space: Space, elements: Elements) -> None:
    """Refuse a space in which elements of an array at rest would stand in a wall, or above the surface.

    Raises
    ------
    RenderError
        How far to either side there is room.
    """
    if scene.tank is None:
        return
    beside, above = scene.tank.room_m
    across, up, _ = np.abs(elements.place_m).max(axis=0)
    if space.half_width_m + across <= beside and up <= above:
        return
    raise RenderError(
        "the formation space reaches into a wall", where="half width of the space",
        found=f"{space.half_width_m:g} m to either side, and an array that reaches {across:.3g} m across and "
        f"{up:.3g} m up",
        rule=f"{beside:.3g} m to either side and {above:.3g} m up or down in this tank",
        remedy="a smaller half width, or a smaller array (array.size_m)",
    )  # fmt: skip


def light_of(scene: Scene, space: Space, elements: Elements, *, photons: float, seed: int = 0) -> Light:
    """The traced field of a scene wherever an array may reach from the formation space.

    Parameters
    ----------
    photons : float
        Zero: the formula.

    Raises
    ------
    RenderError
        The space reaches into a wall, or behind the lamp.
    SceneError
        No light in any band.
    """
    refuse_unlit(scene)
    if not photons:
        return FormulaLight(scene)
    reach = elements.reach_m + MARGIN_M
    across, near = space.half_width_m + reach, max(space.near_m - 2 * reach, 0.5 * space.near_m)
    far = space.far_m + 2 * reach
    step = Region(1, 1, 2).step_m
    if scene.tank is not None:
        # Whole steps, and one and a half of them between the region and every wall; along the tank, where a
        # step is up to four times as long, half of one.
        room = min(scene.tank.room_m)
        across = min(across, step * (np.floor(room / step - 0.5) - 1))
        if not across > 0:
            raise RenderError(
                "too little water about the lamp for the light of an array", where="tank",
                found=f"{room:.3g} m from its axis to the nearest wall or surface",
                rule=f"{2.5 * step:g} m at least: light is traced in steps of {step:g} m",
                remedy="a tank that is wider or deeper, or a lamp farther from its walls and surface",
            )  # fmt: skip
        far = min(far, scene.tank.box_m[2][1] - 2 * step)
    reference = reference_for_others(scene)
    return traced_field(scene, Region(across, near, far), photons=photons, seed=seed, reference=reference)


def pose_names(scene: Scene) -> tuple[str, ...]:
    """What can be known of a pose: about the axis of a round beam, tilted or not, nothing turns anything."""
    return POSE[:5] if has_round_section(scene.lamp) else POSE


@dataclass(frozen=True)
class ArrayModel:
    """Readings of an array in some light.

    Parameters
    ----------
    light : Light
    elements : Elements
    gain : float, reading m^2
        Reading per unit of irradiance over the lamp's intensity on its axis.
    """

    light: Light
    elements: Elements
    gain: float = 1.0

    def readings(self, poses: Array, lamp_tilts: Array | None = None) -> Array:
        """Shape (m, n_elements), at poses of shape (m, 6), m and rad.

        Parameters
        ----------
        lamp_tilts : array, shape (m, 2), rad, optional
            Of the lamp, towards +x and up, beyond the scene's; all of its light turns with it.
        """
        return self._read_in([self.light], poses, lamp_tilts)

    def with_errors(self, pose: Array) -> tuple[Array, Array]:
        """Readings at one pose and the standard errors that a trace leaves them, shape (n_elements,)."""
        place, normal = placed(self.elements, pose[None])
        read, error = self.light.irradiance(place[0], normal[0])
        return self.gain * read, self.gain * error

    def leave_one_out(self) -> list[ArrayModel]:
        """The same in the light of the trace without one of its batches, for each in turn."""
        return [replace(self, light=light) for light in self.light.leave_one_out()]

    def slopes(self, pose: Array, names: Sequence[str]) -> Array:
        """Derivatives of the readings, shape (n_elements, len(names)).

        Parameters
        ----------
        pose : array, shape (6,), m and rad
        names : sequence of str
            Of `POSE`, by m and rad; "gain", "absorption" and "scattering" by their logarithms; "lamp tilt x"
            and "lamp tilt y" by rad, all of the light turned about the lamp.
        """
        wanted = [name for name in names if name in POSE]
        by_pose = dict(zip(wanted, self.by_pose(pose[None], wanted)[0].T, strict=True))
        others = [name for name in names if name not in by_pose and name != "gain"]
        by_others = dict(zip(others, self.by_nuisances(pose[None], others)[0].T, strict=True))
        by_gain = {"gain": self.readings(pose[None])[0]} if "gain" in names else {}
        return np.stack([(by_pose | by_others | by_gain)[name] for name in names], axis=1)

    def by_nuisances(self, poses: Array, names: Sequence[str]) -> Array:
        """Derivatives by what is no pose and no gain, shape (m, n_elements, len(names)), see `slopes`."""
        if not names:
            return np.zeros((len(poses), len(self.elements), 0))
        sides = self._sides(names)
        found = self._read_in([s.light for s in sides], *_at_each(sides, poses))
        return np.ascontiguousarray(np.moveaxis(_slopes_between(sides, found), 0, 2))

    def by_both(self, poses: Array, names: Sequence[str], nuisances: Sequence[str]) -> Array:
        """Derivatives of `by_nuisances` by the pose, shape (m, n_elements, len(nuisances), len(names))."""
        if not nuisances:
            return np.zeros((len(poses), len(self.elements), 0, len(names)))
        sides = self._sides(nuisances)
        at, tilts = _at_each(sides, poses)
        found = self._by_pose_in([s.light for s in sides], at, names, tilts)
        return np.ascontiguousarray(np.moveaxis(_slopes_between(sides, found), 0, 2))

    def by_pose(self, poses: Array, names: Sequence[str]) -> Array:
        """Derivatives by coordinates of the pose, shape (m, n_elements, len(names)).

        A place turns with its element's arm, the reading with the place and with the normal.
        """
        return self._by_pose_in([self.light], poses, names, None)

    def _read_in(self, lights: Sequence[Light], poses: Array, lamp_tilts: Array | None) -> Array:
        """`readings` in several lights, of as many poses each, one after the other."""
        back = _back(lamp_tilts)
        place, normal = (v @ back for v in placed(self.elements, poses))
        read = [
            light.reading(at, facing)
            for light, at, facing in _in_turn(lights, place.reshape(-1, 3), normal.reshape(-1, 3))
        ]
        return self.gain * np.concatenate(read).reshape(len(poses), len(self.elements))

    def _by_pose_in(
        self, lights: Sequence[Light], poses: Array, names: Sequence[str], lamp_tilts: Array | None
    ) -> Array:
        """`by_pose` in several lights, of as many poses each, one after the other."""
        elements, shape, turn = self.elements, (len(poses), len(self.elements)), _back(lamp_tilts)
        place, normal = (v @ turn for v in placed(elements, poses))
        turned = [POSE.index(name) for name in names if name not in POSE[:3]]
        # [angle, m, n, 3]
        arm, facing = (v @ turn for v in _by_angles(elements, poses, [k - 3 for k in turned]))
        slopes = np.zeros((*shape, len(names)))
        each = [light.fluxes(at) for light, at in _in_turn(lights, place.reshape(-1, 3))]
        for parts in zip(*each, strict=True):
            flux, by_place = (np.concatenate(v) for v in zip(*parts, strict=True))
            # What flies back, where it is known.
            back, part = flux[:, 3:].sum(axis=1).reshape(shape), seen_of_back(normal)
            back_by_place = by_place[:, 3:].sum(axis=1).reshape(*shape, 3)
            light, gradient = flux[:, :3].reshape(*shape, 3), by_place[:, :3].reshape(*shape, 3, 3)
            seen = (light * normal).sum(axis=-1) < 0
            along = -(normal[:, :, None, :] @ gradient)[:, :, 0] * seen[..., None]  # by x, y, z
            along += part[..., None] * back_by_place
            turning = 0.5 * np.sign(normal[..., 2]) * back
            lit = light * seen[..., None]
            for k, name in enumerate(names):
                if name in POSE[:3]:
                    slopes[..., k] += (along @ turn[:, POSE.index(name), :, None])[..., 0]
                else:
                    angle = turned.index(POSE.index(name))
                    slopes[..., k] += (along * arm[angle]).sum(-1) - (lit * facing[angle]).sum(-1)
                    slopes[..., k] += turning * facing[angle][..., 2]
        return self.gain * slopes

    def _sides(self, names: Sequence[str]) -> list[_Side]:
        """A little more, and a little less, of each of what is not known, in its order."""
        return [side for name in names for side in self._waters.get(name) or self._tilted(LAMP_TILTS[name])]

    def _tilted(self, axis: str) -> tuple[_Side, _Side]:
        step = STEP * np.array([axis == "x", axis == "y"], float)
        return _Side(self.light, step, 2 * STEP), _Side(self.light, -step, 2 * STEP)

    @cached_property
    def _waters(self) -> dict[str, tuple[_Side, _Side]]:
        """Water of a little more, and of a little less, absorption or scattering."""
        scene = self.light.scene
        at = middles_nm(scene)[0].mean(keepdims=True)
        found = {}
        for name, coefficient in (("absorption", absorption_per_m), ("scattering", scattering_per_m)):
            path, (now,) = f"water.{name}_per_m", coefficient(scene.water, at)
            more, less = (
                scene.with_values({path: scene.get(path) + sign * _WATER_STEP * now}, validate=False)
                for sign in (1, -1)
            )
            found[name] = self._watered(more), self._watered(less)
        return found

    def _watered(self, scene: Scene) -> _Side:
        return _Side(self.light.in_water_of(scene), np.zeros(2), 2 * _WATER_STEP)


@dataclass(frozen=True)
class _Side:
    """Light with a little more, or a little less, of what is not known.

    Parameters
    ----------
    light : Light
    tilt : array, shape (2,), rad
        Of the lamp.
    apart : float
        From the other side.
    """

    light: Light
    tilt: Array
    apart: float


def _at_each(sides: Sequence[_Side], poses: Array) -> tuple[Array, Array]:
    """All poses on each side, one side after the other, and the lamp's tilts there."""
    return np.tile(poses, (len(sides), 1)), np.repeat([side.tilt for side in sides], len(poses), axis=0)


def _slopes_between(sides: Sequence[_Side], found: Array) -> Array:
    """Derivatives, shape (k, m, ...), of what was found at all poses on 2 k sides, shape (2 k m, ...)."""
    both = found.reshape(len(sides) // 2, 2, -1, *found.shape[1:])
    apart = np.array([side.apart for side in sides[::2]])
    return np.asarray((both[:, 0] - both[:, 1]) / apart.reshape(-1, *[1] * found.ndim))


def _in_turn(lights: Sequence[Light], *rows: Array) -> Iterator[tuple[Any, ...]]:
    """Lights with their parts of arrays, alike long; one that comes several times in a row but once."""
    each, first = len(rows[0]) // len(lights), 0
    for _, same in groupby(lights, key=id):
        light, *more = same
        last = first + each * (1 + len(more))
        yield light, *(array[first:last] for array in rows)
        first = last


def _back(lamp_tilts: Array | None) -> Array:
    """What turns places and normals, as rows, as tilted lamps see them, shape (m, 3, 3), or (1, 3, 3).

    A lamp that turns is a follower that turns the other way about it. Forward of an array is -z, of the lamp
    z: +yaw turns the lamp's light towards -x, +pitch down.
    """
    if lamp_tilts is None:
        return np.eye(3)[None]
    return rotations(np.pad(lamp_tilts, ((0, 0), (0, 1)))).swapaxes(-1, -2)


def _by_angles(elements: Elements, poses: Array, angles: Sequence[int]) -> tuple[Array, Array]:
    """Slopes of places and normals by yaw, pitch or roll, m/rad and 1/rad, shape (len(angles), m, n, 3)."""
    step = STEP * np.eye(3)[list(angles)][:, None]
    both = rotations(np.concatenate([poses[:, 3:] + step, poses[:, 3:] - step]))
    turns = np.swapaxes((both[: len(angles)] - both[len(angles) :]) / (2 * STEP), -1, -2)
    return elements.place_m @ turns, elements.normal @ turns
