"""Where does a follower believe it is that trusts the formula, in water that scatters?

    p0 = argmin over p of  sum (mu(truth) - G E_formula(p))^2 / variance              (bias: p0 - truth)
    spread of the estimates  A^-1 B A^-1,   B = J^T W J,   A = B - sum of residuals times second derivatives

p0 is what the maximum likelihood estimate tends to, and the spread is the misspecified Cramer-Rao bound
(Vuong 1986, Caltech working paper 652; Fortunati et al. 2017, IEEE Signal Process. Mag. 34, 142,
doi:10.1109/MSP.2017.2738017). The formula is calibrated in one of four ways (`calibration`).
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
    STEP,
    ArrayModel,
    Light,
    Space,
    light_of,
    pose_names,
    refuse_walls,
)
from lightfield.studies.follower.array_noise import SensorNoise
from lightfield.studies.follower.calibration import CALIBRATIONS, believed, without_a_batch
from lightfield.studies.follower.elements import Elements, elements_of
from lightfield.studies.follower.frames import POSE, poses_on_axis
from lightfield.studies.follower.information import NOTHING_M, inverse, is_told
from lightfield.studies.follower.pose_search import find_minima
from lightfield.studies.follower.survey import array_of
from lightfield.studies.light_at import refuse_dark
from lightfield.studies.one_number import refuse_several

#: Places of a map across and along the formation space.
ACROSS, ALONG = 5, 5


@dataclass(frozen=True)
class Belief:
    """What a follower takes its pose for.

    Parameters
    ----------
    pose, believed : array, shape (6,), m and rad
    covariance : array, shape (n, n), m and rad
        Spread of the estimates by noise about `believed`, of the coordinates that are sought;
        infinite on its diagonal, and zero beside it, where the readings tell nothing.
    trace_sigma : array, shape (n,), m and rad
        Standard error of the bias by the trace's photons, in the readings and in what was fitted to them.
    misfit : float
        Sum of the squared residuals that noise did not make, over the degrees of freedom.
    """

    pose: Array
    believed: Array
    covariance: Array
    trace_sigma: Array
    misfit: float

    @property
    def bias(self) -> Array:
        """Believed less true pose, m and rad, shape (6,)."""
        return np.asarray(self.believed - self.pose)


def belief(
    truth: ArrayModel,
    formula: ArrayModel,
    pose: Array,
    names: Sequence[str],
    noise: SensorNoise,
    gain_sigma: float = 0.0,
    parts: Sequence[tuple[ArrayModel, ArrayModel]] = (),
) -> Belief:
    """Bias and spread of the pose from the wrong model, at one pose.

    Parameters
    ----------
    truth, formula : ArrayModel
        The readings, and what explains them.
    pose : array, shape (6,), m and rad
    names : sequence of str
        Coordinates that are sought; the rest is known.
    gain_sigma : float
        Of the formula's gain beforehand; infinite: only relative readings count.
    parts : sequence of (ArrayModel, ArrayModel)
        The same two without one of the batches of the trace, for each in turn, see `without_a_batch`.
    """
    readings = truth.readings(pose[None])[0]
    variance = noise.variance(readings)
    unknown = {"gain": gain_sigma} if gain_sigma > 0 else {}
    found = find_minima(formula, readings, variance, names, pose[None], nuisances=unknown)
    best, gain = found.poses[0], float(found.gains[0])
    covariance, lever = _spread(formula, readings, 1 / variance, best, gain, names, gain_sigma)
    trace = np.zeros(len(names))
    if parts:
        # What photons do to the readings, and to what is believed of them, moves the belief as noise would;
        # of a jackknife, without one batch in turn (Efron 1982, section 2).
        expected = formula.readings(best[None])[0]
        moved = [
            lever
            @ (true.readings(pose[None])[0] - readings - gain * (other.readings(best[None])[0] - expected))
            for true, other in parts
        ]
        trace = np.sqrt(len(parts) - 1) * np.std(moved, axis=0)
    free = len(readings) - len(names) - (gain_sigma > 0)
    return Belief(pose, best, covariance, trace, float(found.chi2[0]) / max(free, 1))


def _spread(
    model: ArrayModel,
    readings: Array,
    weight: Array,
    pose: Array,
    gain: float,
    names: Sequence[str],
    prior: float,
) -> tuple[Array, Array]:
    """A^-1 B A^-1 of the pose, with the logarithm of the gain unknown where it is sought; and A^-1 J^T W.

    Infinite of what readings of so few elements do not tell at all.
    """
    at, free = [POSE.index(name) for name in names], prior > 0
    size = len(at) + free

    def slopes_and_gradient(poses: Array, gains: Array) -> tuple[Array, Array]:
        read = gains[:, None] * model.readings(poses)
        slopes = gains[:, None, None] * model.by_pose(poses, names)
        if free:
            slopes = np.concatenate([slopes, read[:, :, None]], axis=2)
        gradient = -np.einsum("snk,n,sn->sk", slopes, weight, readings - read)
        if free:
            gradient[:, -1] += np.log(gains) * prior**-2.0
        return slopes, gradient

    poses, gains = np.tile(pose, (2 * size, 1)), np.full(2 * size, gain)
    # The gradient is itself a difference with `STEP`: its own step is larger, so that rounding stays small.
    step = 10 * STEP
    for k in range(size):
        for row, sign in ((k, 1), (size + k, -1)):
            if k < len(at):
                poses[row, at[k]] += sign * step
            else:
                gains[row] *= np.exp(sign * step)
    _, gradients = slopes_and_gradient(poses, gains)
    a = (gradients[:size] - gradients[size:]) / (2 * step)
    slopes, _ = slopes_and_gradient(pose[None], np.array([gain]))
    b = np.einsum("nk,n,nl->kl", slopes[0], weight, slopes[0])
    if free:
        b[-1, -1] += prior**-2.0
    back = np.linalg.pinv(0.5 * (a + a.T), hermitian=True)
    lever = back @ (slopes[0] * weight[:, None]).T
    spread = (back @ b @ back)[: len(at), : len(at)]
    untold = ~np.isfinite(np.diag(inverse(b)))[: len(at)]
    spread[untold, :] = spread[:, untold] = 0.0
    spread[untold, untold] = np.inf
    return spread, lever[: len(at)]


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
    x = np.linspace(-space.half_width_m, space.half_width_m, ACROSS)
    along = np.linspace(space.near_m, space.far_m, ALONG)
    places = np.array([[u, 0, v, 0, 0, 0.0] for v in along for u in x])
    own = _beliefs(light.in_water_of(scene), elements, places, names, noise, space)
    shape = (len(CALIBRATIONS), ALONG, ACROSS)
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
