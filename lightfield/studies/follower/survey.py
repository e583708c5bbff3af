"""What an array can know of its pose, here and over the formation space, and which poses look alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from lightfield.arrays import jsonable
from lightfield.errors import SceneError
from lightfield.render.limits import FIELD_PHOTONS
from lightfield.scene import DetectorArray, Scene
from lightfield.studies.follower.array_light import (
    ArrayModel,
    Space,
    light_of,
    pose_names,
    refuse_walls,
)
from lightfield.studies.follower.array_noise import SensorNoise
from lightfield.studies.follower.elements import Elements, elements_of
from lightfield.studies.follower.frames import POSE, placed, pose_of, poses_on_axis
from lightfield.studies.follower.information import Bound, bound, is_told, nuisances_of, with_doubt
from lightfield.studies.follower.pose_search import box_of
from lightfield.studies.follower.rival_poses import RivalPose, rivals

#: Places across and along the formation space of a map.
_ACROSS, _ALONG = 9, 9
#: What docking asks for: 0.1 m and 5 degrees (Eren 2015, thesis, University of New Hampshire); 0.3 m along
#: the beam.
DOCKING = dict(zip(POSE, (0.1, 0.1, 0.3, *np.radians([5.0, 5.0, 5.0])), strict=True))
#: The same in words.
DOCKING_ASKS = f"{DOCKING['x']:g} m across, {DOCKING['z']:g} m along, {np.degrees(DOCKING['yaw']):g} deg"
#: What is said of an array that turns its back on the lamp.
LOOKS_AWAY = (
    "No element looks at the lamp from the scene's pose: all that they read is light that comes back. A "
    "normal of the array looks at it with nz below 0."
)

#: A bound whose error of the trace is this part of it tells of the trace, not of the array (chosen).
_NOISE = 0.5
#: Coordinates that may do the same to readings: a step aside, and a turn that way.
_ALIKE = (("x", "yaw"), ("y", "pitch"))


@dataclass(frozen=True)
class Survey:
    """An array in a scene.

    Parameters
    ----------
    scene : Scene
    elements : Elements
    here : Bound
        At the scene's pose.
    axis : list of Bound
        On the beam's axis, as far as it stays in the space: near, middle and far.
    space : xarray.Dataset
        Standard deviations over the formation space, dimensions (z_m, x_m), and `A`.
    rivals : list of RivalPose
        Of the scene's pose.
    nuisances : dict of str to float
        What was not known exactly.
    traced : bool
        With scattered and reflected light.
    tied : tuple of (str, str)
        Coordinates that are unknown somewhere for the other's sake alone.
    """

    scene: Scene
    elements: Elements
    here: Bound
    axis: list[Bound]
    space: xr.Dataset
    rivals: list[RivalPose]
    nuisances: dict[str, float]
    traced: bool
    tied: tuple[tuple[str, str], ...] = ()

    @property
    def reaches(self) -> float:
        """Part of the map where docking's demands are met, 0 to 1."""
        met = [self.space[f"sigma_{name}"].values <= DOCKING[name] for name in self.here.names]
        return float(np.mean(np.all(met, axis=0)))

    def on_axis(self, one: Bound) -> str:
        """Where one of `axis` is, in words: beside it where it leaves the space."""
        x, y, z = (float(v) + 0.0 for v in one.pose[:3])
        if np.allclose(one.pose, poses_on_axis(self.scene.lamp, one.pose[2:3])[0]):
            return f"on the axis, z = {z:g} m"
        return f"beside the axis, x {x:.3g}, y {y:.3g}, z {z:g} m"

    @property
    def looks_away(self) -> bool:
        """Does no element look at the lamp from the scene's pose?"""
        places, normals = placed(self.elements, self.here.pose[None])
        lamp = np.array([self.scene.lamp.offset_x_m, self.scene.lamp.offset_y_m, 0.0])
        return bool((((lamp - places[0]) * normals[0]).sum(axis=1) <= 0).all())

    @property
    def why_unknown(self) -> str:
        """Why coordinates are unknown together, and what parts them, as a sentence, or nothing."""
        if not self.tied:
            return ""
        (one, other), *more = self.tied
        too = "".join(f", and {a} and {b}" for a, b in more)
        return (
            f"To the readings of this array {one} and {other} do the same{too}: each is known only as far as "
            "the other is. They are parted by elements whose tilts are not in proportion to their distances "
            "from the middle, such as `array optimise` finds."
        )

    def as_data(self) -> dict[str, Any]:
        return {
            "elements": len(self.elements),
            "looks_away": self.looks_away,
            "tied": [list(pair) for pair in self.tied],
            "spacing_m": self.elements.spacing_m if len(self.elements) > 1 else None,
            "light": "traced field" if self.traced else "formula",
            "unknown": self.nuisances,
            "here": self.here.as_data(),
            "axis": [one.as_data() for one in self.axis],
            "rivals": [rival.as_data() for rival in self.rivals],
            "docking_met": self.reaches,
            "map": {
                **{name: self.space[name].values.tolist() for name in ("x_m", "z_m")},
                **{str(name): jsonable(values.values) for name, values in self.space.data_vars.items()},
            },
        }

    @property
    def rivals_in_words(self) -> str:
        """How many other poses look alike."""
        few = ("no other pose looks alike", "another pose looks alike")
        count = len(self.rivals)
        return few[count] if count < len(few) else f"{count} other poses look alike"

    def as_text(self) -> str:
        known = ", ".join(f"{name} {sigma:.3g}" for name, sigma in self.nuisances.items()) or "nothing else"
        lines = [
            f"{len(self.elements)} elements; light: {'traced' if self.traced else 'formula'}; unknown beside "
            f"the pose (standard deviation): {known}",
            "best that can be known (one reading, one standard deviation):",
            f"  {self.here.as_text()}",
            *(f"  {one.as_text()}" for one in self.axis if not np.array_equal(one.pose, self.here.pose)),
            f"docking ({DOCKING_ASKS}) is met in {100 * self.reaches:.0f} % of the space",
        ]
        if self.looks_away:
            lines.append(LOOKS_AWAY)
        if self.tied:
            lines.append(self.why_unknown)
        nearest = f"; the nearest: {self.rivals[0]}" if self.rivals else ""
        lines.append(self.rivals_in_words + nearest)
        return "\n".join(lines)


def array_of(scene: Scene) -> DetectorArray:
    """The array of a scene.

    Raises
    ------
    SceneError
        It has none.
    """
    if scene.array is None:
        raise SceneError(
            "the scene has no array",
            rule="a follower needs an [array]",
            remedy="add the table [array] (empty, it is a flat grid of 5 x 5 over 0.6 m)",
        )
    return scene.array


def survey(scene: Scene, space: Space, *, photons: float = FIELD_PHOTONS, seed: int = 0) -> Survey:
    """What the array of a scene can know of its pose.

    Parameters
    ----------
    scene : Scene
        With an array.
    space : Space
        Formation space: where the follower may be.
    photons : float
        Of the trace; zero: the formula, without scattered light.

    Raises
    ------
    SceneError
        No array.
    RenderError
        A space that is not in the water.
    """
    elements = elements_of(array_of(scene))
    refuse_walls(scene, space, elements)
    names, pose = pose_names(scene), pose_of(scene.follower_here)
    light = light_of(scene, space.with_pose(pose), elements, photons=photons, seed=seed)
    model, noise, nuisances = ArrayModel(light, elements), SensorNoise.of_scene(scene), nuisances_of(scene)
    parts = model.leave_one_out()
    along = poses_on_axis(scene.lamp, np.linspace(space.near_m, space.far_m, 3))
    along[:, :2] = along[:, :2].clip(-space.half_width_m, space.half_width_m)
    here, *axis = (with_doubt(model, parts, at, names, noise, nuisances) for at in (pose, *along))
    tied = tuple(
        pair
        for pair in _ALIKE
        if any(
            not any(_is_known(one, name) for name in pair) and _told_alone(one, pair, model, noise)
            for one in (here, *axis)
        )
    )
    return Survey(
        scene,
        elements,
        here,
        axis,
        bound_map(model, parts, space, names, noise, nuisances),
        rivals(model, pose, names, noise, box_of(space), nuisances=nuisances, seed=seed),
        nuisances,
        bool(photons),
        tied,
    )


def _is_known(one: Bound, name: str) -> bool:
    """Is a coordinate known, by more than noise of the trace, which looks like information?"""
    return is_told(name, one.sigma[name]) and one.doubt.get(name, 0.0) < _NOISE


def _told_alone(one: Bound, pair: tuple[str, str], model: ArrayModel, noise: SensorNoise) -> bool:
    """Would the first of two coordinates be known if the turns were?"""
    others = [name for name in one.names if name not in dict(_ALIKE).values()]
    return is_told(pair[0], bound(model, one.pose, others, noise).sigma[pair[0]])


def bound_map(
    model: ArrayModel,
    parts: Sequence[ArrayModel],
    space: Space,
    names: tuple[str, ...],
    noise: SensorNoise,
    nuisances: dict[str, float],
) -> xr.Dataset:
    """Bounds over the horizontal plane of the axis, the follower facing along the tank."""
    x = np.linspace(-space.half_width_m, space.half_width_m, _ACROSS)
    z = np.linspace(space.near_m, space.far_m, _ALONG)
    values = np.empty((len(names) + 1, _ALONG, _ACROSS))
    for i, along in enumerate(z):
        for j, across in enumerate(x):
            at = np.array([across, 0, along, 0, 0, 0.0])
            one = with_doubt(model, parts, at, names, noise, nuisances)
            values[:, i, j] = [*one.sigma.values(), one.criteria["A"]]
    dims = ("z_m", "x_m")
    found = {
        f"sigma_{name}": (dims, values[k], {"units": "m" if name in POSE[:3] else "rad"})
        for k, name in enumerate(names)
    }
    found["A"] = (dims, values[-1], {"units": "1", "long_name": "sum of variances in units of the task"})
    return xr.Dataset(found, coords={"x_m": ("x_m", x, {"units": "m"}), "z_m": ("z_m", z, {"units": "m"})})
