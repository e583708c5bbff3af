"""Where does a follower believe it is that trusts the formula, in water that scatters?

Over waters, places and the four ways in which the formula is calibrated (`calibration`); see `belief`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from lightfield.arrays import Array, jsonable
from lightfield.errors import UsageError
from lightfield.render.limits import FIELD_PHOTONS
from lightfield.scene import Scene
from lightfield.studies.defaults import SCATTERING_PER_M
from lightfield.studies.follower.array_light import (
    ArrayModel,
    Light,
    Space,
    light_of,
    pose_names,
    refuse_walls,
)
from lightfield.studies.follower.array_noise import SensorNoise
from lightfield.studies.follower.belief import belief
from lightfield.studies.follower.calibration import CALIBRATIONS, believed, without_a_batch
from lightfield.studies.follower.elements import Elements, elements_of
from lightfield.studies.follower.frames import POSE, poses_on_axis
from lightfield.studies.follower.information import NOTHING_M, NOTHING_RAD, is_told
from lightfield.studies.follower.survey import array_of
from lightfield.studies.light_at import refuse_dark
from lightfield.studies.one_number import refuse_several

#: Places of a map across and along the formation space.
_ACROSS, _ALONG = 5, 5
#: An array that takes itself to be turned by less is as good as straight, deg.
_WORTH_A_WORD_DEG = 0.5


@dataclass(frozen=True)
class BiasStudy:
    """Beliefs over waters, calibrations and places.

    Parameters
    ----------
    scene : Scene
    names : tuple of str
    axis : xarray.Dataset
        `bias_x`, `sigma_x`, ... (m and rad) and `misfit`; dimensions (scattering_per_m, calibration, z_m).
    plane : xarray.Dataset
        The same in the scene's own water; dimensions (calibration, z_m, x_m).
    traced : bool
    """

    scene: Scene
    names: tuple[str, ...]
    axis: xr.Dataset
    plane: xr.Dataset
    traced: bool

    @property
    def _turned(self) -> Array:
        """By how much it takes itself to be turned on the axis where that is known, rad."""
        found = [self.axis[f"bias_{n}"].values for n in POSE[3:5] if n in self.names]
        sure = [self.axis[f"sigma_{n}"].values < NOTHING_RAD for n in POSE[3:5] if n in self.names]
        return np.concatenate([v[s] for v, s in zip(found, sure, strict=True)]) if found else np.zeros(0)

    def as_data(self) -> dict[str, Any]:
        return {"axis": _data(self.axis), "plane": _data(self.plane), "sought": list(self.names)}

    def as_text(self) -> str:
        """Bias along the beam on the axis, mm, and the worst sideways in the scene's own water."""
        z = self.axis.z_m.values
        lines = [
            "bias of the formula along the beam on the axis, mm (believed less true distance), at z = "
            + ", ".join(f"{v:g}" for v in z)
            + " m; ± noise of one reading"
        ]
        for b in self.axis.scattering_per_m.values:
            lines.append(f"scattering {b:g} 1/m")
            for name in self.axis.calibration.values:
                one = self.axis.sel(scattering_per_m=b, calibration=name)
                cells = [
                    f"{round(1e3 * v):+d} ± {1e3 * s:.0f}"
                    if is_told("z", max(abs(v), s))
                    else "not determined"
                    for v, s in zip(one.bias_z.values, one.sigma_z.values, strict=True)
                ]
                lines.append(f"  {name:<33} " + " / ".join(f"{cell:>13}" for cell in cells))
        turned = float(np.degrees(np.abs(self._turned)).max(initial=0.0))
        if turned >= _WORTH_A_WORD_DEG:
            lines.append(f"turned by up to {turned:.0f} deg, to the one side or the other alike")
        doubt = 1e3 * float(self.axis.trace_z.where(self.axis.sigma_z < NOTHING_M).fillna(0.0).max())
        lines.append(f"errors of the trace: up to {doubt:.0f} mm")
        for name in self.plane.calibration.values:
            told = told_bias(self.plane.sel(calibration=name), "x")
            worst = f"wrong by up to {1e3 * float(np.abs(told).max()):.0f} mm"
            sideways = worst if told.notnull().any() else "not determined"
            lines.append(f"in the scene's own water, {name}: sideways {sideways}")
        return "\n".join(lines)


def told_bias(found: xr.Dataset, name: str) -> xr.DataArray:
    """Bias of x, y or z, m; NaN where a reading does not tell it."""
    bias, sigma = found[f"bias_{name}"], found[f"sigma_{name}"]
    return bias.where((sigma < NOTHING_M) & (np.abs(bias) < NOTHING_M))


def _data(found: xr.Dataset) -> dict[str, Any]:
    every = {**found.coords, **found.data_vars}
    return {str(name): jsonable(one.values.tolist()) for name, one in every.items()}


def bias_study(
    scene: Scene,
    space: Space,
    scattering_per_m: Sequence[float] = SCATTERING_PER_M,
    *,
    photons: float = FIELD_PHOTONS,
    seed: int = 0,
) -> BiasStudy:
    """The error of a follower that believes the formula, over waters, calibrations and places.

    Parameters
    ----------
    scene : Scene
        With an array; its own water is that of the map.
    scattering_per_m : sequence of float, 1/m
        Waters on the beam's axis.
    photons : float
        Of the trace, which all waters share.

    Raises
    ------
    SceneError
        No array; water whose scattering comes from its constituents.
    UsageError
        No light is left at the far end of the space; a space of one distance.
    RenderError
        The space reaches into a wall.
    """
    elements = elements_of(array_of(scene))
    refuse_several(
        scene, found="bias over scattering",
        rule="the bias is asked for over water.scattering_per_m, the only scattering",
    )  # fmt: skip
    z = np.linspace(space.near_m, space.far_m, 3)
    poses = poses_on_axis(scene.lamp, z)
    wide = replace(space, half_width_m=max(space.half_width_m, float(np.abs(poses[:, :2]).max())))
    refuse_walls(scene, wide, elements)
    if not space.far_m > space.near_m:
        raise UsageError(
            "one distance does not tell what K a follower fits", where="the formation space",
            found=f"{space.near_m:g} m alone", rule="from the first to the last distance of the detector",
            remedy="give detector.planes_m a second distance",
        )  # fmt: skip
    most = max(*scattering_per_m, scene.water.scattering_per_m)
    densest = scene.with_values({"water.scattering_per_m": most})
    refuse_dark(
        densest, (space.near_m, space.far_m),
        where="the formation space, from the first to the last of detector.planes_m",
        remedy="nearer detector.planes_m, or clearer water",
    )  # fmt: skip
    widest = scene.with_values({"water.scattering_per_m": 0.5 * most} if photons else {})
    light = light_of(widest, wide, elements, photons=photons, seed=seed)
    names, noise = pose_names(scene), SensorNoise.of_scene(scene)
    waters = [
        light.in_water_of(scene.with_values({"water.scattering_per_m": float(b)})) for b in scattering_per_m
    ]
    on_beam = np.array([_beliefs(one, elements, poses, names, noise, space) for one in waters])
    x = np.linspace(-space.half_width_m, space.half_width_m, _ACROSS)
    along = np.linspace(space.near_m, space.far_m, _ALONG)
    places = np.array([[u, 0, v, 0, 0, 0.0] for v in along for u in x])
    own = _beliefs(light.in_water_of(scene), elements, places, names, noise, space)
    shape = (len(CALIBRATIONS), _ALONG, _ACROSS)
    coords = {"calibration": list(CALIBRATIONS)}
    return BiasStudy(
        scene,
        names,
        _dataset(
            np.moveaxis(on_beam, -1, 0), names, ("scattering_per_m", "calibration", "z_m"),
            {"scattering_per_m": list(scattering_per_m), **coords, "z_m": z},
        ),
        _dataset(
            np.moveaxis(own, -1, 0).reshape(-1, *shape), names, ("calibration", "z_m", "x_m"),
            {**coords, "z_m": along, "x_m": x},
        ),
        bool(photons),
    )  # fmt: skip


def _beliefs(
    light: Light, elements: Elements, poses: Array, names: Sequence[str], noise: SensorNoise, space: Space
) -> Array:
    """Shape (n_calibrations, n_poses, 3 n + 1): biases, standard deviations, errors of the trace, misfit."""
    truth = ArrayModel(light, elements)
    rows = []
    for calibration in CALIBRATIONS:
        formula, prior = believed(light, elements, calibration, space)
        parts = without_a_batch(light, elements, calibration, space)
        found = [belief(truth, formula, pose, names, noise, prior, parts) for pose in poses]
        at = [POSE.index(n) for n in names]
        rows.append([[*b.bias[at], *np.sqrt(np.diag(b.covariance)), *b.trace_sigma, b.misfit] for b in found])
    return np.array(rows)


def _dataset(
    values: Array, names: Sequence[str], dims: tuple[str, ...], coords: dict[str, Any]
) -> xr.Dataset:
    n = len(names)
    units = {name: "m" if name in POSE[:3] else "rad" for name in names}
    found = {f"bias_{name}": (dims, values[k], {"units": units[name]}) for k, name in enumerate(names)}
    found |= {f"sigma_{name}": (dims, values[n + k], {"units": units[name]}) for k, name in enumerate(names)}
    found |= {
        f"trace_{name}": (dims, values[2 * n + k], {"units": units[name]}) for k, name in enumerate(names)
    }
    misfit = {"units": "1", "long_name": "chi2 of the model's error per degree"}
    found["misfit"] = (dims, values[3 * n], misfit)
    return xr.Dataset(found, coords=coords)
