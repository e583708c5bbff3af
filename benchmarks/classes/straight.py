"""Direct light of the scenes without photons: inverse square and Beer-Lambert, integrated over cells."""

from __future__ import annotations

import numpy as np

from benchmarks.classes.scenes import Case

#: Nodes along a side of a cell; from the middle to the rim of a window, and turns about it.
IN_CELL, TO_RIM, TURNS = 8, 8, 24


def direct_light(case: Case) -> np.ndarray:
    """Mean irradiance of cells by light that meets nothing, for unit radiant intensity on the axis.

    Returns
    -------
    array, shape (n_planes, n_y, n_x), 1/m^2
    """
    nodes, weights = np.polynomial.legendre.leggauss(IN_CELL)
    n, side = case.cells, case.parts["detector"]["width_m"] / case.cells
    middles = (np.arange(n) - 0.5 * (n - 1)) * side
    places = (middles[:, None] + 0.5 * side * nodes).ravel()
    share = np.tile(0.5 * weights, n)
    x, y = np.meshgrid(places, places)
    found = []
    for z in case.planes_m:
        light = sum(part * _irradiance(case, x - at, y - up, z) for at, up, part in _window(case))
        found.append((light * np.outer(share, share)).reshape(n, IN_CELL, n, IN_CELL).sum(axis=(1, 3)))
    return np.array(found)


def _window(case: Case) -> list[tuple[float, float, float]]:
    """Points of the window, x and y in m, and their parts of its area."""
    lamp = case.parts["lamp"]
    at, up, radius = lamp.get("offset_x_m", 0.0), lamp.get("offset_y_m", 0.0), lamp.get("radius_m", 0.0)
    if not radius:
        return [(at, up, 1.0)]
    nodes, weights = np.polynomial.legendre.leggauss(TO_RIM)
    turns = 2 * np.pi * np.arange(TURNS) / TURNS
    # Even in the square of the distance from the middle.
    rings = zip(radius * np.sqrt(0.5 + 0.5 * nodes), 0.5 * weights / TURNS, strict=True)
    return [(at + r * np.cos(t), up + r * np.sin(t), part) for r, part in rings for t in turns]


def _irradiance(case: Case, x: np.ndarray, y: np.ndarray, z: float) -> np.ndarray:
    """At places as seen from a point of the window, of any shape, m."""
    water, lamp = case.parts["water"], case.parts["lamp"]
    behind = lamp.get("apparent_distance_m", 0.0)
    deep = z + behind
    length = np.sqrt(x**2 + y**2 + deep**2)
    tilts = (np.tan(np.radians(lamp.get(f"tilt_{axis}_deg", 0.0))) for axis in "xy")
    along_x, along_y = tilts
    cosine = (x * along_x + y * along_y + deep) / (length * np.sqrt(1 + along_x**2 + along_y**2))
    theta = np.arccos(np.minimum(cosine, 1.0))
    light = np.exp(-np.log(2) * (theta / np.radians(lamp["hwhm_deg"])) ** 2) * deep / length**3
    if view := case.parts["detector"].get("acceptance_hwhm_deg", 0.0):
        light = light * np.exp(-np.log(2) * (np.arccos(deep / length) / np.radians(view)) ** 2)
    grown = water.get("gradient_per_m2", 0.0) * (0.5 * z - water.get("gradient_centre_m", 0.0))
    attenuation = water["absorption_per_m"] + grown + water["scattering_per_m"]
    return np.asarray(light * np.exp(-attenuation * length * z / deep))
