"""How far a lamp can be used: by the paper's 20 % rule, by signal to noise, and by the accuracy of a pose.

    light      E(z) / E(z0) > 20 % of that at the nearest plane (the paper's rule)
    signal     E(z) > k sigma, sigma the noise of one reading
    pose       x, y, z, yaw and pitch that the follower's array can know, by its Cramer-Rao bound

The bound is that of `studies.follower.information`, with gain and water unknown as far as the scene says
(`poses`). Light and its derivatives are those of the render, scattered light included, or of the formula.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import xarray as xr
from scipy.interpolate import CubicSpline

from lightfield.arrays import TINY, Array
from lightfield.errors import MeasurementError, SceneError, UsageError
from lightfield.fitting.diffuse_light import DiffuseSource
from lightfield.formula.own_formulas import lit
from lightfield.progress import step
from lightfield.readings import Readings
from lightfield.render.limits import AXIS_PHOTONS, check_photons
from lightfield.scene import DetectorArray, Scene
from lightfield.scene.lamp.frame import axis_at, is_tilted
from lightfield.scene.lamp.width import stated_width_deg
from lightfield.scene.parameters import told
from lightfield.studies import defaults
from lightfield.studies.light_at import FARTHEST_M, LightAt, light_at, refuse_dark
from lightfield.studies.working_range.around_axis import RADII, SmoothField, smooth_excess, told_to_m
from lightfield.studies.working_range.poses import known_poses, sides_met_m
from lightfield.studies.working_range.reaches import (
    POSES,
    SCAN,
    Reach,
    last_place,
    logarithm,
    place_error,
    pose_reaches,
    pose_sigmas,
)

#: Where an axis meets planes, x and y, m.
AxisPlaces = Callable[[Array], tuple[Array, Array]]
#: Distances that light is asked at, and how far beyond the last plane.
_DISTANCES, _BEYOND = 13, 2.0
#: So many times the nearest distance is far: steps are then equal ratios.
_FAR = 10.0
#: Readings so close to the axis, as a part of the distance, are on it.
_ON_AXIS = 0.005
#: Distances that are answered at.
_SHOWN = 61
#: Step of derivatives, m.
_STEP_M = 1e-3
#: Light of a wider beam is asked for as of one of this width, degrees: there the inverse square leaves half.
_WIDEST_DEG = 45.0
#: Kept free before the end of a tank, m.
_BEFORE_WALL_M = 0.05
#: How sharply the width of the beam gives way to that of the tank, as a power of both.
_BETWEEN = 4.0


@dataclass(frozen=True, eq=False)
class WorkingRange:
    """The answer.

    Parameters
    ----------
    dataset : xarray.Dataset
        Over `z_m`: `light`, `formula` (both over those at the reference), `half_radius_m` of both, and
        `sigma_across_m`, `sigma_along_m`, `sigma_turned_deg` of poses with `..._stderr`; with `_relative`
        where the gain is unknown altogether, with `_formula` by direct light alone.
    reaches : tuple of Reach
    readings : xarray.Dataset, optional
        Over `z_m`: `value` and `stderr` of readings on the axis over that at the reference, and
        `half_radius_m` where there are some beside it.
    share, noise, snr : float
        Part of the light that must be left; noise of a reading over the reading at the reference; signal over
        noise that is asked for.
    array : DetectorArray
        Whose poses were asked about.
    nuisances : dict of str to float
        What the follower does not know exactly, by its standard deviation.
    """

    dataset: xr.Dataset
    reaches: tuple[Reach, ...]
    readings: xr.Dataset | None
    scene: Scene
    share: float
    noise: float
    snr: float
    array: DetectorArray
    nuisances: dict[str, float]

    @property
    def reference_m(self) -> float:
        """Distance that everything is normalised at, m."""
        return float(self.dataset.attrs["reference_m"])

    @property
    def traced(self) -> bool:
        """Is there scattered light in it? If not, all is the formula's."""
        return bool(self.dataset.attrs["traced"])


def working_range(
    scene: Scene,
    trace: DiffuseSource | None,
    readings: Readings | None = None,
    *,
    share: float = defaults.PAPER_SHARE,
    noise: float = defaults.NOISE,
    snr: float = defaults.SNR,
    to_m: float | None = None,
    photons: float = AXIS_PHOTONS,
) -> WorkingRange:
    """Light, spot and accuracy of a pose against distance, and how far each of them suffices.

    Parameters
    ----------
    scene : Scene
        Its first plane, or position, is the reference; light is the mean over its first band. Its [array]
        and [follower] say what reads and what is unknown; without, `array_for` it and the defaults.
    trace : callable, optional
        `lightfield.render.diffuse.source.response_for`; None: direct light alone.
    readings : Readings, optional
        Those of the first band in water on the lamp's axis are shown beside it.
    share : float
        Part of the light at the reference that must be left.
    noise : float
        Of one reading, over the reading at the reference.
    snr : float
        Signal over noise that must be left.
    to_m : float, optional, m
        Farthest distance; default: twice that of the last plane, or the end of the tank.
    photons : float
        Traced for the accuracy of poses.

    Raises
    ------
    UsageError, RenderError
        Numbers that make no sense.
        No light is left at the farthest distance.
    SceneError
        No room in the tank.
    """
    _check(share=(share, 0.0, 1.0), noise=(noise, 0.0, 1.0), snr=(snr, 0.0, 1e9))
    check_photons(photons)
    first, last, end = _ends(scene, to_m)
    with step(0, 2, "light"):
        nodes, field, light = _as_far_as_told(scene, trace, first, last)
    asked, last = last, float(nodes[-1])
    z = np.unique(np.concatenate([_steps(first, last, _SHOWN), _read(scene, last)]))
    plain, _ = _field(scene, None, nodes)
    # A spot lies about the beam's own axis.
    spot, spot_light, plain_spot = field, light, plain
    if is_tilted(scene.lamp):
        about = partial(axis_at, lit(scene).lamp)
        (spot, spot_light), (plain_spot, _) = (_field(scene, t, nodes, about) for t in (trace, None))
    fine = _steps(first, last, SCAN)
    axis = [f.at(np.zeros(len(z)), z) for f in (field, plain)]
    at = _steps(first, last, POSES if trace is not None else _SHOWN)  # the formula is asked at once
    with step(1, 2, "poses"):
        known = known_poses(scene, at, photons=0.0 if trace is None else photons)
    modes = light.relative_modes[:: len(RADII)]
    relative = np.interp(z, nodes, np.linalg.norm(modes - modes[:1], axis=1))
    ratio, formula = (there / there[0] for there in axis)
    half = np.array([[f.half_radius(at) for at in z] for f in (spot, plain_spot)])
    half_error = np.interp(z, nodes, _half_error(spot_light, spot, nodes))
    dataset = xr.Dataset(
        {
            "light": ("z_m", ratio, {"long_name": "light on the axis over that at the reference"}),
            "light_stderr": ("z_m", ratio * relative, {"long_name": "its standard error"}),
            "formula": ("z_m", formula, {"long_name": "the same by direct light alone"}),
            "half_radius_m": ("z_m", half[0], {"units": "m", "long_name": "radius of half intensity"}),
            "half_radius_stderr_m": ("z_m", half_error, {"units": "m"}),
            "half_radius_formula_m": ("z_m", half[1], {"units": "m"}),
            **pose_sigmas(known, at, z),
        },
        coords={"z_m": ("z_m", z, {"units": "m"})},
        attrs={
            "reference_m": first,
            "asked_to_m": asked,
            "ends": end if to_m is not None and asked < to_m else "",
            "noise": noise,
            "traced": int(trace is not None),
        },
    )
    reaches = _reaches(dataset, fine, share, noise, snr)
    return WorkingRange(
        dataset, reaches, _measured(readings, scene, first), scene, share, noise, snr, known[0].array,
        known[0].nuisances,
    )  # fmt: skip


def _reaches(data: xr.Dataset, fine: Array, share: float, noise: float, snr: float) -> tuple[Reach, ...]:
    """Every rule's distance, with scattered light and by the formula."""
    error = CubicSpline(data.z_m.values, data.light_stderr.values / data.light.values)
    light, formula = logarithm(data, "light"), logarithm(data, "formula")
    rules: list[Reach] = []
    for name, level in (("light", share), ("signal", snr * noise)):
        at = last_place(light, np.log(level), fine)
        stderr = place_error(error, light, at)
        rules.append(Reach(name, at, stderr, last_place(formula, np.log(level), fine)))
    return (*rules, *pose_reaches(data, fine))


def _as_far_as_told(
    scene: Scene, trace: DiffuseSource | None, first: float, last: float
) -> tuple[Array, SmoothField, LightAt]:
    """Distances up to where the photons tell the light, m, and the light there as `_field` has it."""
    nodes = _steps(first, last, _DISTANCES)
    field, light = _field(scene, trace, nodes)
    if (told_to := told_to_m(light, nodes)) < last:
        nodes = _steps(first, told_to, _DISTANCES)
        field, light = _field(scene, trace, nodes)
    return nodes, field, light


def _field(
    scene: Scene, trace: DiffuseSource | None, z: Array, about: AxisPlaces | None = None
) -> tuple[SmoothField, LightAt]:
    """Light around an axis, straight ahead of the lamp unless told otherwise, and at the places it was asked
    at: radii within distances, where a tank has most room."""
    lamp = lit(scene).lamp
    axis = about or (lambda z_m: (np.full(len(z_m), lamp.offset_x_m), np.full(len(z_m), lamp.offset_y_m)))
    beam = float(np.tan(np.radians(min(stated_width_deg(lamp), _WIDEST_DEG))))
    towards = 1.0

    def room_over_z(side: int, z_m: Array) -> Array:
        assert scene.tank is not None
        return (np.abs(scene.tank.box_m[0][side] - axis(z_m)[0]) - _BEFORE_WALL_M) / z_m

    if scene.tank is not None:
        towards = 1.0 if room_over_z(1, z).min() >= room_over_z(0, z).min() else -1.0

    def width(z_m: Array) -> Array:
        """Twice as far as the beam's half width, or up to the side: smoothly from one to the other."""
        if scene.tank is None:
            return np.full(len(z_m), beam)
        most = room_over_z(int(towards > 0), z_m) / RADII[-1]
        return np.asarray((beam**-_BETWEEN + most**-_BETWEEN) ** (-1 / _BETWEEN))

    along, radius = (v.ravel() for v in np.meshgrid(z, RADII, indexing="ij"))

    def aside(rho_m: Array, z_m: Array) -> tuple[Array, Array]:
        x, y = axis(z_m)
        return x + towards * rho_m, y

    light = light_at(scene, *aside(radius * width(along) * along, along), along, trace)

    def direct(rho_m: Array, z_m: Array) -> Array:
        return light_at(scene, *aside(rho_m, z_m), z_m, None).direct

    return SmoothField(z, width, smooth_excess(light, along, radius).reshape(len(z), -1), direct), light


def _half_error(light: LightAt, field: SmoothField, z: Array) -> Array:
    """Standard error of the radius of half intensity: the light's at the nearest radius over its slope."""
    modes = light.relative_modes.reshape(len(z), len(RADII), -1)
    brightest = light.total.reshape(len(z), -1).argmax(axis=1)
    found, half = np.full(len(z), np.nan), np.array([field.half_radius(at) for at in z])
    for k in np.flatnonzero(np.isfinite(half)):
        nearest = int(np.argmin(np.abs(RADII * field.width(z)[k] * z[k] - half[k])))
        error = float(np.linalg.norm(modes[k, nearest] - modes[k, brightest[k]]))
        r = half[k] + np.array([-_STEP_M, _STEP_M])
        low, high = np.log(np.maximum(field.at(r**2, np.full(2, z[k])), TINY))
        found[k] = error * 2 * _STEP_M / abs(high - low)
    return found


def _measured(readings: Readings | None, scene: Scene, reference_m: float) -> xr.Dataset | None:
    """Readings of the first band in water on the lamp's axis over that at the reference; None: none given."""
    if readings is None:
        return None
    r = _of_first_band(readings.usable(), scene)
    on_axis = _from_axis_m(r, scene) <= _ON_AXIS * r.z_m
    z = np.unique(np.round(r.z_m[on_axis], 4))
    near = np.isclose(z, reference_m, atol=1e-3)
    if not near.any() or len(z) < 2:
        raise MeasurementError(
            "no readings to show", where=readings.source or None,
            found=f"on the lamp's axis in water, in the first band, at {z.tolist()} m",
            rule=f"some there, among them at the reference, {reference_m:g} m",
            remedy="read there, or let the scene's first plane be a distance that was read",
        )  # fmt: skip
    value, error, half = np.zeros(len(z)), np.zeros(len(z)), np.full(len(z), np.nan)
    for k, at in enumerate(z):
        mine = on_axis & np.isclose(r.z_m, at, atol=1e-4)
        value[k] = r.value[mine].mean()
        error[k] = np.sqrt((r.stderr[mine] ** 2).sum()) / mine.sum()
        half[k] = _half_radius_read(r, scene, at)
    first = int(np.argmax(near))
    if not value[first] > 0:
        raise MeasurementError(
            "no light to compare with", where=readings.source or None,
            found=f"{value[first]:g} in the mean on the lamp's axis at the reference, {reference_m:g} m",
            rule="a reading there is positive",
            remedy="take off the dark, or let the scene's first plane be a distance with light",
        )  # fmt: skip
    # Of a ratio whose upper part may be nothing, or less by its noise; unknown where a reading states none.
    own, of_reference = error / value[first], value / value[first] ** 2 * error[first]
    stderr = np.where(near, 0.0, np.hypot(own, of_reference))
    columns = {"value": value / value[first], "stderr": stderr, "half_radius_m": half}
    return xr.Dataset({name: ("z_m", v) for name, v in columns.items()}, coords={"z_m": z})


def _of_first_band(r: Readings, scene: Scene) -> Readings:
    """Readings in water of what the light is told of."""
    low, high = scene.detector.bands_nm[0]
    inside = np.isnan(r.wavelength_nm) | ((r.wavelength_nm >= low) & (r.wavelength_nm <= high))
    return r.subset((r.medium == "water") & inside)


def _from_axis_m(r: Readings, scene: Scene) -> Array:
    """How far from the line straight ahead of the lamp, shape (n,), m."""
    return np.hypot(r.x_m - scene.lamp.offset_x_m, r.y_m - scene.lamp.offset_y_m)


def _half_radius_read(r: Readings, scene: Scene, z_m: float) -> float:
    """Radius of half intensity by a line through ln(value) over radius squared; NaN from one radius."""
    mine = np.isclose(r.z_m, z_m, atol=1e-4) & (r.value > 0)
    x, y = axis_at(lit(scene).lamp, r.z_m[mine])
    rho2 = (r.x_m[mine] - x) ** 2 + (r.y_m[mine] - y) ** 2
    if len(rho2) < 2 or not np.ptp(rho2) > 0:
        return float("nan")
    slope = -np.polyfit(rho2, np.log(r.value[mine]), 1)[0]
    return float(np.sqrt(np.log(2) / slope)) if slope > 0 else float("nan")


def _ends(scene: Scene, to_m: float | None) -> tuple[float, float, str]:
    """Nearest and farthest distance, m, and what ends them there."""
    read, end = scene.detector.distances_m, "as asked for"
    first, key = read[0], "planes_m" if scene.detector.positions_m is None else "positions_m"
    last = _BEYOND * read[-1] if to_m is None else to_m
    if to_m is None:
        end = f"{_BEYOND:g} times the last of them"
    if scene.tank is not None and last > (wall := scene.tank.box_m[2][1] - _BEFORE_WALL_M):
        last, end = wall, f"{_BEFORE_WALL_M:g} m before the end of the tank"
    if last > (side := sides_met_m(scene)):
        last, end = side, "where an array on the tilted beam's axis is next to a side of the tank"
    if not (np.isfinite(last) and 1.1 * first < last <= FARTHEST_M):
        listed = told(scene.detector, key) if key == "planes_m" else key
        raise SceneError(
            "no distances to compare",
            found=f"from {first:g} m, the first of detector.{listed}, to {last:g} m, {end}",
            rule=f"farther than the first by a tenth at least, at most {FARTHEST_M:g} m",
            remedy=f"give detector.{key} of which the first is nearer, or ask for a farther distance"
            if not last > FARTHEST_M
            else f"ask for a nearer distance, or give nearer detector.{key}",
        )  # fmt: skip
    remedy = f"ask for a nearer distance, or give nearer detector.{key}"
    refuse_dark(scene, (first, last), remedy=remedy)
    return first, last, end


def _steps(first: float, last: float, count: int) -> Array:
    """Distances in equal steps, or in equal ratios where equal steps would leave out all that is near."""
    return (np.geomspace if last > _FAR * first else np.linspace)(first, last, count)


def _read(scene: Scene, last: float) -> Array:
    """Distances of the scene's planes, or of its positions, as far as asked, m."""
    read = np.asarray(scene.detector.distances_m, float)
    return read[read <= last]


def _check(**numbers: tuple[float, float, float]) -> None:
    for name, (value, low, high) in numbers.items():
        if not low < value < high:
            raise UsageError(
                "impossible number",
                where=name,
                found=value,
                rule=f"above {low:g}, below {high:g}",
                remedy="a number in that range; a percentage over 100"
                if high == 1
                else "a number in that range",
            )
