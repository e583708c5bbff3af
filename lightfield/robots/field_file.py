"""The light of a lamp on a grid, for simulators: flux vector and direct light, as NetCDF with CF attributes.

A cosine receiver of outward normal n, somewhere in the grid, reads

    E = I0 [max(-n . F_direct, 0) + max(-n . F_diffuse, 0) + E_back (1 + |n_z|) / 2]

with F interpolated, best as F z^2; E_back, what flies back, is `backward` in the file (`seen_of_back`). I0 is
the lamp's radiant intensity on its axis (an attribute, W/sr within the band). Frame: lamp at the origin, z
along the beam, x horizontal, y up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from lightfield.arrays import Array, jackknife_stderr
from lightfield.errors import RenderError, UsageError
from lightfield.formula.own_formulas import lit
from lightfield.formula.vector import direct_flux
from lightfield.maps.dataset import CONVENTIONS, PLACE
from lightfield.render.flux.traced_field import Region, traced_field
from lightfield.render.limits import FIELD_PHOTONS
from lightfield.scene import Scene
from lightfield.scene.bands import middles_nm, over_band, refuse_unlit
from lightfield.scene.lamp.section import section_widths
from lightfield.scene.lamp.width import stated_width_deg
from lightfield.scene.water.coefficients import absorption_per_m, scattering_per_m
from lightfield.studies.defaults import FIELD_STEP_M
from lightfield.version import __version__

#: Places of a grid at most: more would be a file of gigabytes.
_MOST_PLACES = 4_000_000
#: Components of the flux vector.
#: A beam that is wider is resolved everywhere, deg. Chosen: its tangent is large.
_WIDEST_DEG = 80.0
_AXES = ("x", "y", "z")
#: Steps by which cells of a trace reach beyond the grid, see `Region.grid`; and what is rounding, m.
_BEYOND, _ROUNDING_M = 1.5, 1e-9


@dataclass(frozen=True)
class Asked:
    """Where a field is asked for.

    Parameters
    ----------
    half_width_m : float, m
        |x| and |y| at most.
    near_m, far_m : float, m
    step_m : float, m
        Between places across the beam; along it at most four times that.
    """

    half_width_m: float
    near_m: float
    far_m: float
    step_m: float = FIELD_STEP_M

    def region(self, half_width_m: float) -> Region:
        """Where light is traced for it."""
        return Region(half_width_m, self.near_m, self.far_m, self.step_m)

    def axes(self) -> tuple[Array, Array]:
        """Places across the beam, and along it, m."""
        low = 0 < self.near_m < self.far_m < np.inf
        if not (low and 0 < self.step_m < np.inf and self.step_m <= self.half_width_m < np.inf):
            raise UsageError(
                "impossible grid",
                found=f"{self.half_width_m:g} m to each side, {self.near_m:g} to {self.far_m:g} m, steps of "
                f"{self.step_m:g} m",
                rule="distances rising and above 0, a step above 0 and no larger than the half width",
                remedy="the nearer distance first, and a step that fits",
            )
        sides = self.half_width_m / self.step_m
        length = (self.far_m - self.near_m) / (4 * self.step_m)
        traced = (self.far_m - self.near_m) / self.region(self.half_width_m).longest_step_m()
        if not (2 * sides + 3) ** 2 * (traced + 3) <= _MOST_PLACES:
            raise UsageError(
                "too many places", found=f"steps of {self.step_m:g} m", rule=f"at most {_MOST_PLACES:,}",
                remedy="take larger steps, or a smaller part of the water, or begin farther from the lamp",
            )  # fmt: skip
        half = int(np.floor(sides + 1e-9))
        return (
            self.step_m * np.arange(-half, half + 1.0),
            np.linspace(self.near_m, self.far_m, int(np.ceil(length - 1e-9)) + 1),
        )


def field_dataset(scene: Scene, asked: Asked, *, photons: float = FIELD_PHOTONS, seed: int = 0) -> xr.Dataset:
    """Light of a scene on a grid.

    Parameters
    ----------
    scene : Scene
        Light in the middle of its first band, for unit radiant intensity on the axis.
    photons : float
        Zero: direct light alone.

    Returns
    -------
    xarray.Dataset
        Over (z, y, x): `flux_direct_x` and so on, `flux_diffuse_x` and so on and
        `backward`, the diffuse irradiance of a plane that faces away from the lamp, with `..._stderr`, 1/m^2.
        CF attributes.

    Raises
    ------
    UsageError, RenderError
        An impossible grid, or one that is not all in the water.
    SceneError
        No light in any band.
    """
    refuse_unlit(scene)
    across, along = asked.axes()
    _refuse_walls(scene, across, along, _BEYOND * asked.step_m if photons else 0.0)
    z, y, x = np.meshgrid(along, across, across, indexing="ij")
    place = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    direct = direct_flux(scene, place)
    diffuse: Array = np.zeros((len(place), 4))
    stderr: Array = np.zeros((len(place), 4))
    if photons:
        field = traced_field(scene, asked.region(float(across[-1])), photons=photons, seed=seed)
        diffuse = field.diffuse_flux(place)
        parts = np.stack([one.diffuse_flux(place) for one in field.leave_one_out()])
        stderr = jackknife_stderr(parts)
    variables = {}
    for k, axis in enumerate(_AXES):
        variables[f"flux_direct_{axis}"] = _variable(
            direct[:, k], x.shape, f"flux vector of light straight from the lamp, {axis} component"
        )
    traced = {
        f"flux_diffuse_{axis}": f"flux vector of scattered and reflected light, {axis} component"
        for axis in _AXES
    }
    traced["backward"] = "irradiance by scattered and reflected light on a plane that faces away"
    for k, (name, meaning) in enumerate(traced.items()):
        error = f"{name}_stderr"
        variables[name] = _variable(diffuse[:, k], x.shape, meaning)
        variables[name][2]["ancillary_variables"] = error
        variables[error] = _variable(stderr[:, k], x.shape, f"standard error of {name} by the photons")
    coords = {
        name: (name, values, {"units": "m", "long_name": words})
        for name, values, words in (
            ("z", along, "distance from the lamp's window along the beam's axis"),
            ("y", across, PLACE["y_m"]),
            ("x", across, PLACE["x_m"]),
        )
    }
    known_m = resolved_from_m(scene, asked.step_m)
    return xr.Dataset(variables, coords, {"resolved_from_m": known_m, **_attributes(scene, photons, seed)})


def resolved_from_m(scene: Scene, step_m: float) -> float:
    """The distance from which on a beam is as wide as its steps: its half width where it is narrowest, m.

    Nearer to the lamp scattered light is up to 20 % off, of which no error tells; from there on 1.5 %.
    """
    lamp = lit(scene).lamp
    half_deg = min(section_widths(lamp)[0] * stated_width_deg(lamp), _WIDEST_DEG)
    return max(step_m / float(np.tan(np.radians(half_deg))) - lamp.apparent_distance_m, 0.0)


def _refuse_walls(scene: Scene, across: Array, along: Array, beyond_m: float) -> None:
    """A grid that reaches into a wall, or above the surface, is refused; where light is traced, or not.

    Parameters
    ----------
    beyond_m : float
        How far cells of a trace reach beyond the grid, across.
    """
    if scene.tank is None:
        return
    ends = [(float(v[0]), float(v[-1])) for v in (across, across, along)]
    *sides, length = scene.tank.box_m
    room = [*((low + beyond_m, high - beyond_m) for low, high in sides), length]
    told = zip(ends, room, strict=True)
    if all(low - _ROUNDING_M <= a and b <= high + _ROUNDING_M for (a, b), (low, high) in told):
        return
    step_m, widest = float(across[1] - across[0]), min(min(-low, high) for low, high in room[:2])
    widest = step_m * np.floor(widest / step_m + _ROUNDING_M)
    remedy = f"a half width of {widest:g} m at most" if widest > 0 else "take smaller steps"
    along_fits = length[0] <= along[0] and along[-1] <= length[1]
    raise RenderError(
        "the grid reaches out of the water",
        found=f"|x|, |y| up to {ends[0][1]:g} m, z from {ends[2][0]:g} to {ends[2][1]:g} m",
        rule="; ".join(
            f"{low:.4g} <= {axis} <= {high:.4g}" for axis, (low, high) in zip(_AXES, room, strict=True)
        )
        + (f" ({beyond_m:g} m away from walls, for cells of the trace)" if beyond_m else ""),
        remedy=remedy if along_fits else "ask for a smaller part of the water",
    )


def _variable(
    values: Array, shape: tuple[int, ...], meaning: str
) -> tuple[tuple[str, ...], Array, dict[str, str]]:
    found = values.reshape(shape).astype(np.float32)
    return ("z", "y", "x"), found, {"units": "m-2", "long_name": meaning}


def _attributes(scene: Scene, photons: float, seed: int) -> dict[str, str | float]:
    """What the numbers mean, and what a simulator needs for the direct light in closed form."""
    at = middles_nm(scene)[0].mean(keepdims=True)
    low, high = (at_nm + scene.detector.wavelength_shift_nm for at_nm in scene.detector.bands_nm[0])
    intensity = over_band(lit(scene).lamp, low, high).intensity.mean() * (high - low)
    return {
        "Conventions": CONVENTIONS,
        "title": f"Light field of {scene.name or 'a lamp'}",
        "source": f"lightfield {__version__}: direct light in closed form; "
        + ("Monte Carlo light transport" if photons else "nothing traced, no scattered or reflected light"),
        "comment": "For unit radiant intensity on the lamp's axis. A cosine receiver of outward unit normal "
        "n reads max(-n . flux_direct, 0) + max(-n . flux_diffuse, 0) + backward (1 + |n_z|) / 2. "
        "Right-handed frame, lamp at the origin: z along the beam, x horizontal, y up. Interpolate light "
        "times z squared.",
        "radiant_intensity_on_axis_w_per_sr": float(intensity),
        "band_nm": f"{low:g} {high:g}",
        "wavelength_nm": float(at[0]),
        "absorption_per_m": float(absorption_per_m(scene.water, at)[0]),
        "scattering_per_m": float(scattering_per_m(scene.water, at)[0]),
        "lamp_profile": str(scene.lamp.profile),
        "lamp_half_width_deg": stated_width_deg(lit(scene).lamp),
        "photons": float(photons),
        "seed": float(seed),
        "scene": scene.to_toml(),
    }
