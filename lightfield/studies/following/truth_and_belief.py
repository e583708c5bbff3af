"""The light of a run, that there is and that is believed in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lightfield.arrays import Array
from lightfield.scene import Scene, Water
from lightfield.scene.bands import middles_nm
from lightfield.scene.in_tank import follower_in
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m
from lightfield.studies.follower.array_light import ArrayModel, FormulaLight, Light, Space, light_of
from lightfield.studies.follower.array_noise import PERCENT
from lightfield.studies.follower.bias import CLEAR, FITTED, RELATIVE, believed
from lightfield.studies.follower.elements import Elements

#: Room about the way, m: across, towards the lamp and away from it (chosen; a follower that believes a wrong
#: light misses its distance by up to two and a half metres in the waters of `pose bias`).
ACROSS_M, NEARER_M, FARTHER_M = 0.6, 2.5, 3.5
#: Of the distance of a dock, the part up to which the light is known.
BEFORE_DOCK = 0.5
#: Distances about the standoff, m, at which a follower fits K and gain (as in `pose bias`).
FITTED_OVER_M = 2.0
#: Waters between which light that changes is interpolated.
TURBID_STEPS = 9
#: The most turbid of several waters is so much denser than the one that is traced (as in `pose bias`).
DENSER = 2.0


def space_of_mission(scene: Scene) -> Space:
    """Where a run may lead."""
    follower = follower_in(scene.follower, scene.tank)
    mission = follower.mission
    near = max(mission.standoff_m - NEARER_M, BEFORE_DOCK * mission.standoff_m)
    if mission.task == "dock":
        near = BEFORE_DOCK * mission.dock_m
    far = max(mission.standoff_m, follower.z_m) + FARTHER_M
    across = max(ACROSS_M, abs(follower.x_m), abs(follower.y_m))
    return Space(across, min(near, follower.z_m), far)


def densest_per_m(scene: Scene) -> float:
    """Most scattering of a run, 1/m."""
    at = middles_nm(scene)[0].mean(keepdims=True)
    follower = follower_in(scene.follower, scene.tank)
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
        scene = scene.with_values({"water.scattering_per_m": most / DENSER})
    return light_of(scene, space_of_mission(scene), elements, photons=photons, seed=seed)


def belief_of(name: str, truth: Light, elements: Elements, standoff_m: float) -> tuple[ArrayModel, bool]:
    """Light that a follower believes in, and whether it knows the gain.

    Parameters
    ----------
    name : str
        field, fitted, exact, clear or relative.
    """
    if name == "field":
        return ArrayModel(truth, elements), True
    near = max(standoff_m - FITTED_OVER_M, 0.5 * standoff_m)
    space = Space(0.0, near, standoff_m + FITTED_OVER_M)
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
    """

    models: list[list[ArrayModel]]
    gains: Array

    @classmethod
    def of(cls, scene: Scene, light: Light, elements: Elements, runs: int, rng: np.random.Generator) -> Truth:
        """Draw what the follower does not know of gain and water, as far as the scene says, for every run."""
        array, follower = scene.array, follower_in(scene.follower, scene.tank)
        assert array is not None
        mismatch = 1 + PERCENT * array.gain_mismatch_percent * rng.standard_normal((runs, len(elements)))
        drift = np.exp(PERCENT * array.gain_drift_percent * rng.standard_normal((runs, 1)))
        off = np.exp(PERCENT * follower.water_known_percent * rng.standard_normal((runs, 2)))
        factor = follower.mission.turbid_factor
        steps = np.linspace(1.0, factor, TURBID_STEPS if factor != 1.0 else 1)
        known = follower.water_known_percent == 0 or scene.water.base != "none"
        waters = [(1.0, 1.0)] if known else off.tolist()
        models = [
            [ArrayModel(light.in_water_of(_water(scene, a, b * float(f))), elements) for f in steps]
            for a, b in waters
        ]
        return cls(models, drift * mismatch)

    def readings(self, poses: Array, turbid: float) -> Array:
        """Shape (runs, n_elements), at poses of shape (runs, 6); turbidity from 0 (first) to 1 (last)."""
        if len(self.models) == 1:
            return np.asarray(self.gains * _between(self.models[0], poses, turbid))
        found = [_between(m, pose[None], turbid)[0] for m, pose in zip(self.models, poses, strict=True)]
        return np.asarray(self.gains * np.array(found))


def _between(models: list[ArrayModel], poses: Array, turbid: float) -> Array:
    at = turbid * (len(models) - 1)
    low = min(int(at), len(models) - 1)
    read = models[low].readings(poses)
    if at > low:
        read = read ** (1 - (at - low)) * models[low + 1].readings(poses) ** (at - low)
    return np.asarray(read)


def _water(scene: Scene, absorption: float, scattering: float) -> Scene:
    if absorption == scattering == 1.0:
        return scene
    water = scene.water
    now = {"absorption_per_m": water.absorption_per_m, "scattering_per_m": water.scattering_per_m}
    factors = {"absorption_per_m": absorption, "scattering_per_m": scattering}
    return scene.with_values({f"water.{k}": v * factors[k] for k, v in now.items()}, validate=False)
