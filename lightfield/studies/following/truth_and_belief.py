"""The light of a run, that there is and that is believed in."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lightfield.arrays import Array
from lightfield.scene import Scene, Water
from lightfield.scene.bands import middles_nm
from lightfield.scene.water.coefficients import absorption_per_m, molecular_per_m, scattering_per_m
from lightfield.studies.follower.array_light import ArrayModel, FormulaLight, Light, Space, light_of
from lightfield.studies.follower.array_noise import PERCENT
from lightfield.studies.follower.calibration import CLEAR, FITTED, RELATIVE, believed
from lightfield.studies.follower.elements import Elements

#: Room about the way, m: across, towards the lamp and away from it (chosen; a follower that believes a wrong
#: light misses its distance by up to two and a half metres in the waters of `pose bias`).
_ACROSS_M, _NEARER_M, _FARTHER_M = 0.6, 2.5, 3.5
#: Of the distance of a dock, the part up to which the light is known.
_BEFORE_DOCK = 0.5
#: Distances about the standoff, m, at which a follower fits K and gain (as in `pose bias`).
_FITTED_OVER_M = 2.0
#: Waters between which light that changes is interpolated.
_TURBID_STEPS = 9
#: The most turbid of several waters is so much denser than the one that is traced (as in `pose bias`).
_DENSER = 2.0
#: Light is known so many standard deviations of the lamp's direction to the side, up to an angle, degrees.
_TILTED, _WIDEST_DEG = 3.0, 45.0


def space_of_mission(scene: Scene) -> Space:
    """Where a run may lead."""
    follower = scene.follower_here
    mission = follower.mission
    near = max(mission.standoff_m - _NEARER_M, _BEFORE_DOCK * mission.standoff_m)
    if mission.task == "dock":
        near = _BEFORE_DOCK * mission.dock_m
    far = max(mission.standoff_m, follower.z_m) + _FARTHER_M
    across = max(_ACROSS_M, abs(follower.x_m), abs(follower.y_m))
    return Space(across, min(near, follower.z_m), far)


def densest_per_m(scene: Scene) -> float:
    """Most scattering of a run, 1/m."""
    at = middles_nm(scene)[0].mean(keepdims=True)
    follower = scene.follower_here
    return float(scattering_per_m(scene.water, at)[0]) * max(1.0, follower.mission.turbid_factor)


def light_of_mission(
    scene: Scene, elements: Elements, *, photons: float, seed: int = 0, densest: float | None = None
) -> Light:
    """Light from which that of every water of a run is weighed.

    Parameters
    ----------
    densest : float, 1/m, optional
        Most scattering of several scenes that share one trace; this scene's own by default.
    """
    most = densest_per_m(scene) if densest is None else densest
    if photons and most > scene.water.scattering_per_m and scene.water.base == "none":
        scene = scene.with_values({"water.scattering_per_m": most / _DENSER})
    space = space_of_mission(scene)
    tilt = scene.follower_here.lamp_tilt_known_deg
    aside = space.far_m * np.tan(np.radians(min(_TILTED * tilt, _WIDEST_DEG)))
    wider = replace(space, half_width_m=space.half_width_m + float(aside))
    return light_of(scene, wider, elements, photons=photons, seed=seed)


def belief_of(name: str, truth: Light, elements: Elements, standoff_m: float) -> tuple[ArrayModel, bool]:
    """Light that a follower believes in, and whether it knows the gain.

    Parameters
    ----------
    name : str
        field, fitted, exact, clear or relative.
    """
    if name == "field":
        return ArrayModel(truth, elements), True
    near = max(standoff_m - _FITTED_OVER_M, 0.5 * standoff_m)
    space = Space(0.0, near, standoff_m + _FITTED_OVER_M)
    if name == "exact":
        at = middles_nm(truth.scene)[0].mean(keepdims=True)
        c = float(absorption_per_m(truth.scene.water, at)[0] + scattering_per_m(truth.scene.water, at)[0])
        plain = truth.scene.model_copy(update={"water": Water(absorption_per_m=c)})
        return ArrayModel(FormulaLight(plain), elements), True
    model, gain = believed(
        truth, elements, {"fitted": FITTED, "clear": CLEAR, "relative": RELATIVE}[name], space
    )
    return model, not np.isinf(gain)


@dataclass(frozen=True)
class Truth:
    """What the arrays of several runs read.

    Parameters
    ----------
    models : list of list of ArrayModel
        By run and by level of turbidity; one list where all runs have the same water.
    gains : array, shape (runs, n_elements)
        Of every element, its mismatch included.
    tilts : array, shape (runs, 2), rad
        Of the lamp, towards +x and up, beyond what the scene says.
    """

    models: list[list[ArrayModel]]
    gains: Array
    tilts: Array

    @classmethod
    def of(cls, scene: Scene, light: Light, elements: Elements, runs: int, rng: np.random.Generator) -> Truth:
        """Draw what the follower does not know, as far as the scene says (`nuisances_of`), for every run."""
        array, follower = scene.array, scene.follower_here
        assert array is not None
        mismatch = 1 + PERCENT * array.gain_mismatch_percent * rng.standard_normal((runs, len(elements)))
        drift = np.exp(PERCENT * array.gain_drift_percent * rng.standard_normal((runs, 1)))
        off = np.exp(PERCENT * follower.water_known_percent * rng.standard_normal((runs, 2)))
        factor = follower.mission.turbid_factor
        steps = np.linspace(1.0, factor, _TURBID_STEPS if factor != 1.0 else 1)
        waters = off.tolist() if follower.water_known_percent else [(1.0, 1.0)]
        models = [
            [ArrayModel(light.in_water_of(_water(scene, a, b * float(f))), elements) for f in steps]
            for a, b in waters
        ]
        tilts = np.zeros((runs, 2))
        if follower.lamp_tilt_known_deg:
            tilts = np.radians(follower.lamp_tilt_known_deg) * rng.standard_normal((runs, 2))
        return cls(models, drift * mismatch, tilts)

    def readings(self, poses: Array, turbid: float) -> Array:
        """Shape (runs, n_elements), at poses of shape (runs, 6); turbidity from 0 (first) to 1 (last)."""
        if len(self.models) == 1:
            return np.asarray(self.gains * _between(self.models[0], poses, self.tilts, turbid))
        each = zip(self.models, poses, self.tilts, strict=True)
        found = [_between(model, pose[None], tilt[None], turbid)[0] for model, pose, tilt in each]
        return np.asarray(self.gains * np.array(found))


def _between(models: list[ArrayModel], poses: Array, tilts: Array, turbid: float) -> Array:
    at = turbid * (len(models) - 1)
    low = min(int(at), len(models) - 1)
    lamp = tilts if tilts.any() else None
    read = models[low].readings(poses, lamp)
    if at > low:
        read = read ** (1 - (at - low)) * models[low + 1].readings(poses, lamp) ** (at - low)
    return np.asarray(read)


def _water(scene: Scene, absorption: float, scattering: float) -> Scene:
    """The scene in water of so many times its coefficients, all in all; molecules scatter as ever."""
    if absorption == scattering == 1.0:
        return scene
    water, at = scene.water, middles_nm(scene)[0].mean(keepdims=True)
    (a,), (b,), (molecules,) = (f(water, at) for f in (absorption_per_m, scattering_per_m, molecular_per_m))
    values = {
        "water.absorption_per_m": water.absorption_per_m + (absorption - 1.0) * a,
        "water.scattering_per_m": water.scattering_per_m + max(scattering * b, molecules) - b,
    }
    return scene.with_values({path: float(value) for path, value in values.items()}, validate=False)
