"""How well an array on the axis can know its pose, against distance: the bounds of `studies.follower`.

Derivatives of a trace's noise look like information, and far from the lamp there is nothing else. So
scattered light is a smooth factor on the direct light here, a few polynomials in distance and in the squared
tangent of the angle to the axis,

    F_z = D_z e^P(z, t^2),        F_rho / F_z = S(z, t^2) rho / z    of what was scattered or reflected,

fitted to the traced flux vector F about the axis; D is the direct light in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from lightfield.arrays import Array
from lightfield.formula.vector import by_place, direct_flux, flux_and_slopes, on_receivers
from lightfield.render.flux.field import Region, TracedField, traced_field
from lightfield.render.response.response import Reference
from lightfield.scene import DetectorArray, Follower, Scene
from lightfield.scene.bands import middles_nm
from lightfield.scene.lamp.frame import beam_axes
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m
from lightfield.studies.follower.elements import elements_of
from lightfield.studies.follower.information import UNKNOWN, Bound, nuisances_of, with_doubt
from lightfield.studies.follower.light import FormulaLight, Light, Model, pose_names
from lightfield.studies.follower.noise import Noise

#: The array of a scene that has none: that which the group's own later work settled on (Eren 2015, thesis,
#: University of New Hampshire, scholars.unh.edu/dissertation/2193).
ARRAY = DetectorArray(count=(5, 5), size_m=0.4, radius_m=0.32)
#: Terms in distance and in squared tangent, of the excess and of the direction.
_TERMS, _TURNING = (5, 3), (3, 2)
#: Places that are fitted to: distances, radii, directions.
_ALONG, _RADII, _AROUND = 16, 7, 8
#: Cells of the trace across the beam, m; along it they are four times as long.
_STEP_M = 0.16
#: Light is followed to so many half widths of the beam at least, and beyond the array.
_HALF_WIDTHS = 1.2
#: Room for the array beside its own reach, m: derivatives ask next to it.
_ROOM_M = 0.05
#: Least scattering to trace in, 1/m, as of the follower's light.
_LEAST_TRACED_PER_M = 0.1
#: Ratios of light are at least this, relative errors no smaller: logarithms and weights stay finite.
_DARK, _LEAST_ERROR = 1e-12, 1e-3


class Frame(NamedTuple):
    """Where the polynomials are fitted: distances, m, the largest tangent, and the largest radius, m."""

    near_m: float
    far_m: float
    tangent: float
    radius_m: float


@dataclass(frozen=True, eq=False)
class SmoothLight:
    """Light about the axis without the grain of its trace; a `Light` of the follower.

    Parameters
    ----------
    traced : TracedField
    frame : Frame
    """

    traced: TracedField
    frame: Frame

    @property
    def scene(self) -> Scene:
        return self.traced.scene

    def reading(self, place_m: Array, normal: Array) -> Array:
        """Readings of cosine receivers, 1/m^2, shape (n,), at places and outward normals of shape (n, 3)."""
        place = np.asarray(place_m, float)
        return on_receivers(direct_flux(self.scene, place) + self._diffuse(place), np.asarray(normal, float))

    def irradiance(self, place_m: Array, normal: Array) -> tuple[Array, Array]:
        """`reading` and its standard errors, by a jackknife over the batches of the trace."""
        parts = np.stack([one.reading(place_m, normal) for one in self.leave_one_out()])
        count = len(parts)
        return self.reading(place_m, normal), np.sqrt((count - 1) / count) * np.sqrt(
            ((parts - parts.mean(axis=0)) ** 2).sum(axis=0)
        )

    def batches(self, place_m: Array, normal: Array) -> Array:
        """Readings by independent parts of the trace, as the jackknife makes them of it."""
        parts = np.stack([one.reading(place_m, normal) for one in self.leave_one_out()])
        return len(parts) * self.reading(place_m, normal) - (len(parts) - 1) * parts

    def leave_one_out(self) -> list[SmoothLight]:
        """Without one of the batches of the trace, each in turn."""
        return self._parts

    def in_water_of(self, scene: Scene) -> SmoothLight:
        return SmoothLight(self.traced.in_water_of(scene), self.frame)

    @cached_property
    def _parts(self) -> list[SmoothLight]:
        return [SmoothLight(one, self.frame) for one in self.traced.leave_one_out()]

    @cached_property
    def _whole(self) -> tuple[Array, Array]:
        """Coefficients of P and of S."""
        frame, lamp = self.frame, self.scene.lamp
        z = np.linspace(frame.near_m, frame.far_m, _ALONG)
        turn = 2 * np.pi * (np.arange(_AROUND) + 0.5) / _AROUND
        share = np.sqrt(np.linspace(0, 1, _RADII))
        z, share, turn = (v.ravel() for v in np.meshgrid(z, share, turn, indexing="ij"))
        radius = np.minimum(frame.tangent * z, frame.radius_m) * share
        x0, y0 = self._axis(z)
        place = np.stack([x0 + radius * np.cos(turn), y0 + radius * np.sin(turn), z], axis=1)
        direct, diffuse = direct_flux(self.scene, place), self.traced.diffuse_flux(place)[:, :3]
        excess = np.log1p(np.maximum(diffuse[:, 2] / np.maximum(direct[:, 2], _DARK), _DARK))
        P = np.linalg.lstsq(self._terms(place, _TERMS), excess, rcond=None)[0]
        aside = place[:, :2] - [lamp.offset_x_m, lamp.offset_y_m]
        squared = (aside**2).sum(axis=1)
        # Weighed by the light and by what the direction is worth there.
        weight = np.sqrt(squared) * np.maximum(diffuse[:, 2], 0) * z
        away = (diffuse[:, :2] * aside).sum(axis=1) * z / np.maximum(squared * diffuse[:, 2], _DARK)
        terms = self._terms(place, _TURNING)
        S = np.linalg.lstsq(weight[:, None] * terms, weight * np.where(squared > 0, away, 0.0), rcond=None)[0]
        return P, S

    def _axis(self, z_m: Array) -> tuple[Array, Array]:
        lamp, (ux, uy, uz) = self.scene.lamp, beam_axes(self.scene.lamp)[2]
        return lamp.offset_x_m + ux / uz * z_m, lamp.offset_y_m + uy / uz * z_m

    def _terms(self, place_m: Array, count: tuple[int, int]) -> Array:
        """Chebyshev polynomials at places, shape (n, n_terms)."""
        x, y, z = place_m.T
        x0, y0 = self._axis(z)
        near, far, tangent, _ = self.frame
        along = 2 * (z - near) / (far - near) - 1
        aside = 2 * ((x - x0) ** 2 + (y - y0) ** 2) / (tangent * z) ** 2 - 1
        return np.asarray(chebyshev.chebvander2d(along, aside, [n - 1 for n in count]))

    def fluxes(self, place_m: Array) -> list[tuple[Array, Array]]:
        """Flux vectors of direct and of diffuse light, (n, 3), and their slopes by the place, (n, 3, 3)."""
        place = np.asarray(place_m, float)
        return [flux_and_slopes(self.scene, place), (self._diffuse(place), by_place(self._diffuse, place))]

    def _diffuse(self, place_m: Array) -> Array:
        """Flux vector of the diffuse light, 1/m^2, shape (n, 3)."""
        (P, S), lamp = self._whole, self.scene.lamp
        along = direct_flux(self.scene, place_m)[:, 2] * np.expm1(self._terms(place_m, _TERMS) @ P)
        slope = (self._terms(place_m, _TURNING) @ S / place_m[:, 2])[:, None]
        aside = slope * (place_m[:, :2] - [lamp.offset_x_m, lamp.offset_y_m])
        return np.asarray(along[:, None] * np.column_stack([aside, np.ones(len(place_m))]))


def smooth_light(scene: Scene, near_m: float, far_m: float, reach_m: float, photons: float) -> SmoothLight:
    """Trace the flux vector about the axis between two distances, and smooth it.

    Parameters
    ----------
    reach_m : float
        Of the array.
    photons : float

    Raises
    ------
    RenderError
        The array reaches into a wall.
    """
    near, end = near_m - 0.5 * reach_m, far_m + reach_m
    tangent = max((reach_m + _ROOM_M) / near_m, _HALF_WIDTHS * np.tan(np.radians(scene.lamp.hwhm_deg)))
    wide, aside = tangent * end, _aside(scene, end)
    if scene.tank is not None:
        (left, right), (low, high), (_, wall) = scene.tank.box_m
        end = min(end, wall - 4 * _STEP_M)
        wide = min(wide, min(-left, right, -low, high) - 2.5 * _STEP_M - aside)
    wide = max(wide, reach_m + _ROOM_M)
    region = Region(_STEP_M * np.floor((wide + aside) / _STEP_M), near, end, _STEP_M)
    at = middles_nm(scene)[0].mean(keepdims=True)
    (a,), (b,) = absorption_per_m(scene.water, at), scattering_per_m(scene.water, at)
    reference = Reference(float(a), max(float(b), _LEAST_TRACED_PER_M), max(scene.reflectances))
    field = traced_field(scene, region, photons=photons, reference=reference)
    return SmoothLight(field, Frame(near, end, tangent, region.half_width_m - aside))


def _aside(scene: Scene, z_m: float) -> float:
    """How far the beam's axis is from the tank's, m, as far as there."""
    lamp, (ux, uy, uz) = scene.lamp, beam_axes(scene.lamp)[2]
    return float(max(abs(lamp.offset_x_m) + abs(ux / uz) * z_m, abs(lamp.offset_y_m) + abs(uy / uz) * z_m))


@dataclass(frozen=True)
class Known:
    """Bounds at each distance, on the axis, facing the lamp.

    Parameters
    ----------
    as_stated, relative : list of Bound
        With what the scene says is unknown; and with the common gain unknown altogether.
    nuisances : dict of str to float
        What the scene says is unknown, by its standard deviation.
    array : DetectorArray
    """

    as_stated: list[Bound]
    relative: list[Bound]
    nuisances: dict[str, float]
    array: DetectorArray


def known_poses(scene: Scene, z_m: Array, *, photons: float) -> list[Known]:
    """Bounds on the axis in the scene's light, and by the formula; one and the same without photons.

    Parameters
    ----------
    scene : Scene
        Its [array] and [follower], or `ARRAY` and the defaults.
    z_m : array, shape (n,), m
    photons : float
        Zero: the formula alone.

    Returns
    -------
    list of Known
        With scattered light, and by the formula.
    """
    array = scene.array or ARRAY
    whole = scene.model_copy(update={"array": array, "follower": scene.follower or Follower()})
    elements, noise, names = elements_of(array), Noise.of_scene(whole), pose_names(whole)[:5]
    nuisances = nuisances_of(whole)
    poses = np.zeros((len(z_m), 6))
    poses[:, 2] = z_m
    x, y = whole.lamp.offset_x_m, whole.lamp.offset_y_m
    ux, uy, uz = beam_axes(whole.lamp)[2]
    poses[:, 0], poses[:, 1] = x + ux / uz * z_m, y + uy / uz * z_m
    lights: list[Light] = [FormulaLight(whole)]
    if photons:
        lights.insert(0, smooth_light(whole, float(z_m.min()), float(z_m.max()), elements.reach_m, photons))
    found = []
    for light in lights:
        model = Model(light, elements)
        parts = model.leave_one_out()
        pairs = [
            [with_doubt(model, parts, pose, names, noise, unknown) for pose in poses]
            for unknown in (nuisances, nuisances | {"gain": UNKNOWN})
        ]
        found.append(Known(pairs[0], pairs[1], nuisances, array))
    return found if photons else found * 2
