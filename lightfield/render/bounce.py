"""Light after exactly one reflection and no scattering, without Monte Carlo noise.

The mirror image of the lamp in the water surface, and an integral over the walls. The transport response
holds the same light with the noise of its trace; readings lie on few small cells, so there it is noisier than
a fit can bear. Used for irradiance; what was scattered or reflected again stays with the response.
"""

from __future__ import annotations

from math import log, pi, radians

import numpy as np

from lightfield.lamps.profile import relative_intensity
from lightfield.render.beamnodes import beam_angles
from lightfield.scene import Lamp, Scene

WATER_INDEX = 1.34
MOST_PAIRS = 1_500_000  # of wall patch and reading
KEPT = 6


class SingleBounce:
    """Singly reflected light at n readings in the tank of a scene.

    Parameters
    ----------
    scene : Scene
        With a tank, and an irradiance detector.
    x_m, y_m, z_m : arrays, shape (n,), m
    """

    def __init__(self, scene: Scene, x_m: np.ndarray, y_m: np.ndarray, z_m: np.ndarray) -> None:
        self.scene = scene
        self.places = np.stack([x_m, y_m, z_m], axis=1).astype(float)
        self._walls: dict[bool, tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = {}
        self._transfers: dict[tuple[bool, float], np.ndarray] = {}

    def surface(self, scene: Scene, attenuation_per_m: float) -> np.ndarray:
        """Light mirrored once by the water surface, for unit reflectance multiplier, shape (n,), m^-2."""
        assert scene.tank is not None
        lamp = scene.lamp
        image = np.array(
            [lamp.offset_x_m, 2 * scene.tank.lamp_depth_m - lamp.offset_y_m, -lamp.apparent_distance_m]
        )
        way = self.places - image
        r = np.linalg.norm(way, axis=1)
        arriving = way / r[:, None]
        leaving = arriving * np.array([1.0, -1.0, 1.0])
        in_water = r * self.places[:, 2] / way[:, 2]
        light = _intensity(lamp, leaving) * fresnel(np.abs(arriving[:, 1])) / r**2
        return np.asarray(light * np.exp(-attenuation_per_m * in_water) * self._response(arriving))

    def walls(self, scene: Scene, attenuation_per_m: float, lid: bool) -> np.ndarray:
        """Light scattered back once by the walls, for unit albedo, shape (n,), m^-2.

        Parameters
        ----------
        scene : Scene
            Its lamp counts; the tank is that of the constructor.
        attenuation_per_m : float, m^-1
        lid : bool
            The top is a wall as well.
        """
        patches, normals, geometry, distance = self._patches(lid)
        lamp = scene.lamp
        way = patches - np.array([lamp.offset_x_m, lamp.offset_y_m, -lamp.apparent_distance_m])
        r = np.linalg.norm(way, axis=1)
        direction = way / r[:, None]
        in_water = r * patches[:, 2] / way[:, 2]
        facing = np.maximum(-(direction * normals).sum(axis=1), 0)
        lit = _intensity(lamp, direction) * facing / r**2 * np.exp(-attenuation_per_m * in_water)
        key = (lid, attenuation_per_m)
        if key not in self._transfers:
            while len(self._transfers) >= KEPT:
                self._transfers.pop(next(iter(self._transfers)))
            self._transfers[key] = geometry * np.exp(np.float32(-attenuation_per_m) * distance)
        return np.asarray(self._transfers[key] @ lit.astype(np.float32), float)

    def _patches(self, lid: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Wall patches: centres, inward normals; geometry factor and distance for every reading."""
        if lid not in self._walls:
            tank = self.scene.tank
            assert tank is not None
            half, top = 0.5 * tank.width_m, tank.lamp_depth_m
            floor = top - tank.depth_m
            # A receiver that faces the lamp sees only walls before it.
            length = float(self.places[:, 2].max())
            around = 2 * tank.depth_m + (2 if lid else 1) * tank.width_m
            step = max(0.05, np.sqrt(1.6 * around * length * len(self.places) / MOST_PAIRS))
            along = _midpoints(0.0, length, step)
            sides = [(np.array([sign * half, 0.0]), np.array([0.0, 1.0]), floor, top) for sign in (-1, 1)]
            levels = [
                (np.array([0.0, y]), np.array([1.0, 0.0]), -half, half)
                for y in ([floor, top] if lid else [floor])
            ]
            centres, normals, areas = [], [], []
            for base, across, low, high in sides + levels:
                u = _midpoints(low, high, 1.6 * step)
                at, z = np.meshgrid(u, along, indexing="ij")
                xy = base + at.reshape(-1, 1) * across
                centres.append(np.column_stack([xy, z.ravel()]))
                inward = np.array([-np.sign(base[0]), 0.0, 0.0])
                if across[0]:
                    inward = np.array([0.0, 1.0 if base[1] == floor else -1.0, 0.0])
                normals.append(np.broadcast_to(inward, centres[-1].shape))
                areas.append(np.full(len(xy), (u[1] - u[0]) * (along[1] - along[0])))
            patches, normal = np.concatenate(centres), np.concatenate(normals)
            way = self.places[:, None] - patches
            distance = np.linalg.norm(way, axis=2)
            direction = way / distance[..., None]
            leaving = np.maximum((direction * normal).sum(axis=2), 0)
            geometry = leaving * self._response(direction) * np.concatenate(areas) / (pi * distance**2)
            self._walls[lid] = (patches, normal, geometry.astype(np.float32), distance.astype(np.float32))
        return self._walls[lid]

    def _response(self, direction: np.ndarray) -> np.ndarray:
        """Irradiance response to light that flies along `direction`, shape (..., 3)."""
        detector = self.scene.detector
        tilt = radians(detector.tilt_x_deg)
        axis = np.array([np.sin(tilt), 0.0, -np.cos(tilt)])
        cosine = np.clip(-(direction @ axis), 0, 1)
        if detector.acceptance_hwhm_deg:
            ratio = np.arccos(cosine) / radians(detector.acceptance_hwhm_deg)
            return np.asarray(cosine * np.exp(-log(2) * ratio**2))
        return np.asarray(cosine)


def applies(scene: Scene) -> bool:
    """Is the singly reflected light of this scene known in closed form or by quadrature?"""
    detector = scene.detector
    return scene.tank is not None and detector.quantity == "irradiance" and detector.aim == "axis"


def fresnel(cos_incidence: np.ndarray, n: float = WATER_INDEX) -> np.ndarray:
    """Reflectance of a water surface from below, unpolarised; 1 beyond the critical angle (Fresnel)."""
    c = np.clip(cos_incidence, 0, 1)
    sine = n * np.sqrt(1 - c * c)
    t = np.sqrt(np.maximum(1 - sine * sine, 0))
    s_part, p_part = (n * c - t) / (n * c + t), (c - n * t) / (c + n * t + 1e-300)
    return np.where(sine >= 1, 1.0, 0.5 * (s_part**2 + p_part**2))


def _intensity(lamp: Lamp, direction: np.ndarray) -> np.ndarray:
    """Relative intensity in directions given in the frame of the tank, shape (n, 3)."""
    theta = np.arccos(np.clip(direction[:, 2], -1, 1))
    phi = np.arctan2(direction[:, 1], direction[:, 0])
    return np.asarray(relative_intensity(lamp, *beam_angles(lamp, theta, phi)))


def _midpoints(low: float, high: float, step: float) -> np.ndarray:
    count = max(2, int(np.ceil((high - low) / step)))
    return low + (np.arange(count) + 0.5) * ((high - low) / count)
