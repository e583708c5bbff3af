"""Direct light at point receivers: one shadow ray from every part of the lamp's window to every receiver."""

from __future__ import annotations

import numpy as np

from lightfield.formula.own_formulas import factor, lit
from lightfield.render.backend import use_backend
from lightfield.render.response.grid import positions_grid, reference_of
from lightfield.scene import Scene
from lightfield.scene.lamp.colour import wider_in_colour
from lightfield.scene.lamp.frame import beyond_window, through_window
from lightfield.scene.water.hardening import hardening_depth

_RINGS, _SPOKES = 8, 8  # points on the window: rings of equal area, with no bias to any side


def direct_at(
    scene: Scene,
    x_m: np.ndarray,
    y_m: np.ndarray,
    z_m: np.ndarray,
    attenuation_per_m: float,
    in_air: bool = False,
    wavelength_nm: float | None = None,
) -> np.ndarray:
    """Unscattered, unreflected light of the whole lamp window, for unit on-axis radiant intensity.

    The window is covered by rings of points, each the start of a straight ray through Mitsuba's geometry; the
    error of that quadrature (below 1e-4 for windows much smaller than the distance)
    is all there is.

    Parameters
    ----------
    x_m, y_m, z_m : arrays, shape (n,), m
        Receivers, z > 0.
    attenuation_per_m : float, m^-1
        a + b of the uniform water; the scene's gradients, layer and hardening come on top.
    in_air : bool
        No water; the window no longer narrows the beam: I(theta / n) / n^2.
    wavelength_nm : float, optional
        On which the beam's width may depend, and of which a formula of the user's own may speak.

    Returns
    -------
    array, shape (n,), m^-2 (m^-2 sr^-1 for radiance)
    """
    use_backend()
    import drjit as dr
    import mitsuba as mi

    from lightfield.render.tracer.absorption import Absorption
    from lightfield.render.tracer.build import assembled

    x, y, z = (np.asarray(v, float) for v in (x_m, y_m, z_m))
    scene = lit(scene)
    setup = assembled(scene, positions_grid(x, y, z), reference_of(scene))
    emission, lamp = setup.emission, scene.lamp
    n, window = len(x), points_of_disc(lamp.radius_m)
    points = len(window[0])
    # As variables: another lamp and each wavelength of a spectrum need no kernel of their own. Nor does where
    # NumPy has put an array in memory, which Dr.Jit writes into a kernel that loads from there.
    aside_x, aside_y, behind, index, more_per_m = (
        dr.opaque(mi.Float, float(value))
        for value in (
            lamp.offset_x_m, lamp.offset_y_m, lamp.apparent_distance_m, lamp.window_index if in_air else 1.0,
            attenuation_per_m - setup.water.absorption_per_m,
        )
    )  # fmt: skip
    ray_number, receivers = dr.arange(mi.UInt32, points * n), dr.opaque(mi.UInt32, n)
    spot, place = ray_number // receivers, ray_number % receivers
    spot_x, spot_y = (dr.gather(mi.Float, mi.Float(v.tolist()), spot) for v in window)
    origin = mi.Point3f(aside_x + spot_x, aside_y + spot_y, -behind)
    target = mi.Point3f(*(dr.gather(mi.Float, mi.Float(v.tolist()), place) for v in (x, y, z)))
    ray = target - origin
    distance = dr.norm(ray)
    direction = mi.Vector3f(ray / distance)
    # In the water the ray runs from the window plane to the receiver.
    in_water = beyond_window(distance, target.z, behind)
    start = mi.Point3f(target - direction * in_water)
    theta_x, theta_y = emission.angles(direction)
    if lamp.width_slope and wavelength_nm is not None:
        narrower = dr.opaque(mi.Float, 1.0 / float(wider_in_colour(lamp, wavelength_nm)))
        theta_x, theta_y = theta_x * narrower, theta_y * narrower
    intensity = through_window(emission.intensity, theta_x, theta_y, index)
    depth = mi.Float(0)
    if not in_air:
        depth = Absorption(setup.water).depth(start, direction, in_water)
        depth += more_per_m * in_water
        depth -= hardening_depth(scene.water, in_water)
    seen = ~setup.mitsuba_scene.ray_test(mi.Ray3f(mi.Ray3f(start, direction), in_water * (1 - 1e-4)))
    to_lamp = mi.Vector3f(aside_x - target.x, aside_y - target.y, -target.z)
    response = setup.planes.point_response(direction, to_lamp)
    light = dr.select(seen, intensity * response * dr.exp(-depth) / (distance * distance), 0)
    found = np.array(light, dtype=float).reshape(points, n).mean(axis=0)
    return np.asarray(found * factor(scene, ("path",), x, y, z, wavelength_nm))


def points_of_disc(radius_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Points that stand for equal parts of a disc: centroid in its middle, the same spread in x and y."""
    if radius_m == 0:
        return np.zeros(1), np.zeros(1)
    ring, spoke = np.divmod(np.arange(_RINGS * _SPOKES), _SPOKES)
    radius, turn = radius_m * np.sqrt((ring + 0.5) / _RINGS), 2 * np.pi * (spoke + 0.5 * (ring % 2)) / _SPOKES
    return radius * np.cos(turn), radius * np.sin(turn)
