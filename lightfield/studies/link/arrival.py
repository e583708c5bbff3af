"""Light of one water along the axis: how much arrives, by the lamp's spectrum in the band, and how late.

    P(z) = A sum over colours  I_k [E_k(z) + S_k(z)]     received power; of a radiance times its cone

I_k is the radiant intensity on the axis in a part of the scene's first band, weighed by the detector's
response over its mean there (`scene.bands.over_band`, W/sr): what the lamp sends outside the band counts
nowhere. E_k and S_k are direct and scattered light for unit intensity, in the water's coefficients there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy.interpolate import PchipInterpolator

from lightfield.arrays import TINY, Array
from lightfield.errors import UsageError
from lightfield.formula.closed_form import direct_field
from lightfield.formula.own_formulas import lit
from lightfield.render.diffuse.bending import surrounded
from lightfield.render.diffuse.shift import Shift
from lightfield.render.maps import render_scene
from lightfield.render.response.grid import positions_grid
from lightfield.render.response.response import Reference, Waters
from lightfield.render.settings import CachedTracing
from lightfield.scene import Scene
from lightfield.scene.bands import first_band_w_per_sr, over_first_band
from lightfield.scene.lamp.colour import in_colour
from lightfield.scene.lamp.width import core_width_deg
from lightfield.scene.receiver import cone_sr
from lightfield.scene.water.coefficients import (
    absorption_per_m,
    coefficients_in,
    molecular_per_m,
    scattering_per_m,
)
from lightfield.studies.link.bandwidth import (
    GROUP_INDEX,
    LIGHT_M_PER_S,
    PATH_NODES,
    bandwidth_of,
    between_nodes,
)
from lightfield.studies.link.receiver import Receiver

#: Width of the cells on the axis, m: their bending is known from those beside them.
_CELL_M = 0.3
#: A bandwidth is told where the photons tell scattered light to this part of it. Chosen.
_BANDWIDTH_KNOWN = 0.2
#: Parts of the band, over each of which the water is taken to be the same: where its optical depths part by d
#: from one end of the band to the other, (d / _PARTS)^2 / 24 of the light is missed.
_PARTS = 20


class Colours(NamedTuple):
    """The lamp's light in the scene's first band, as it is read.

    Parameters
    ----------
    wavelength_nm : array, shape (n,), nm
    share : array, shape (n,)
        Of that light, 1 in all.
    w_per_sr : float
        Radiant intensity on the axis.
    """

    wavelength_nm: Array
    share: Array
    w_per_sr: float

    @classmethod
    def of(cls, scene: Scene) -> Colours:
        """Of a scene.

        Raises
        ------
        UsageError
            The lamp sends nothing that is read in the band.
        """
        scene = lit(scene)
        at, intensity = over_first_band(scene, _PARTS)
        if not intensity.sum() > 0:
            low, high = scene.detector.bands_nm[0]
            raise UsageError(
                "no light of the lamp is read in the first band", where="lamp.spectrum",
                found=f"0 W from {low:g} to {high:g} nm", rule="some of the lamp's light in the band",
                remedy="correct lamp.spectrum, detector.bands_nm or detector.response",
            )  # fmt: skip
        return cls(at, intensity / intensity.sum(), first_band_w_per_sr(scene))

    def water_of(self, scene: Scene) -> tuple[float, float]:
        """Absorption and scattering coefficient of a scene's water, means over this light, 1/m."""
        both = (f(scene.water, self.wavelength_nm) for f in (absorption_per_m, scattering_per_m))
        a, b = (self.mean(v) for v in both)
        return a, b

    def mean(self, values: Array) -> float:
        """Mean over this light, exact where all are alike."""
        return max(float(values[0] + self.share @ (values - values[0])), 0.0)

    def direct(self, water: Scene, x_m: Array, y_m: Array, z_m: Array) -> Array:
        """Direct light for unit intensity, shape (n_places,), 1/m^2."""
        each = [direct_field(water, x_m, y_m, z_m, np.full(len(z_m), w)) for w in self.wavelength_nm]
        return np.asarray(self.share @ np.array(each))


def along_axis(
    water: Scene, receiver: Receiver, nodes_m: Array, z_m: Array, tracing: CachedTracing
) -> xr.Dataset:
    """Everything along the axis in one water.

    Parameters
    ----------
    water : Scene
        Unbounded.
    receiver : Receiver
    nodes_m, z_m : array, m
        Distances at which scattered light is traced, and at which all is told.
    tracing : mapping
        Of `lightfield.render.maps.render_scene`.
    """
    colours, zero = Colours.of(water), np.zeros(len(z_m))
    x, y = zero + water.lamp.offset_x_m, zero + water.lamp.offset_y_m
    direct = colours.direct(water, x, y, z_m)
    ratio, error = zero, zero
    bandwidth, spread, eye = np.full(len(z_m), np.inf), np.full(len(z_m), np.nan), np.ones(len(z_m))
    if colours.water_of(water)[1] > 0:
        late = _late_light(water, colours, nodes_m, receiver, tracing)
        near = colours.direct(water, x[: len(nodes_m)], y[: len(nodes_m)], nodes_m)
        ln = PchipInterpolator(nodes_m, np.log(np.maximum(late.diffuse, TINY) / near))
        ratio = np.exp(ln(z_m))
        error = np.exp(np.interp(z_m, nodes_m, np.log(np.maximum(late.relative_error, 1e-6))))
        # Light of a few photons has the paths of these few.
        known = (late.diffuse > 0) & (late.relative_error < _BANDWIDTH_KNOWN)
        told = np.where(known, late.bandwidth_hz, np.inf)
        bandwidth, spread = between_nodes(z_m, nodes_m, told, late.bandwidth_stderr_hz)
        bandwidth[z_m > nodes_m[known].max(initial=0.0)] = np.nan
        eye = np.interp(z_m, nodes_m, late.eye)
    scale = colours.w_per_sr * receiver.area_mm2 * 1e-6 * cone_sr(water.detector)
    power, formula = scale * direct * (1 + ratio), scale * direct
    return xr.Dataset(
        {
            "power_w": ("z_m", power),
            "power_stderr_w": ("z_m", scale * direct * ratio * error),
            "power_formula_w": ("z_m", formula),
            "ber": ("z_m", receiver.error_rate(power)),
            "ber_formula": ("z_m", receiver.error_rate(formula)),
            "scattered_over_direct": ("z_m", ratio),
            "bandwidth_hz": ("z_m", bandwidth),
            "bandwidth_stderr_hz": ("z_m", spread),
            "eye": ("z_m", eye),
        },
        coords={"z_m": ("z_m", z_m, {"units": "m"})},
    )


@dataclass(frozen=True)
class _Late:
    """Scattered light at the nodes, and what its delay does, arrays of shape (n_nodes,)."""

    diffuse: Array
    relative_error: Array
    bandwidth_hz: Array
    bandwidth_stderr_hz: Array
    eye: Array


def _late_light(
    water: Scene, colours: Colours, nodes_m: Array, receiver: Receiver, tracing: CachedTracing
) -> _Late:
    """Trace in the mean water of the light, weigh for its colours, and sort by delay."""
    zero = np.zeros(len(nodes_m))
    water = in_colour(water, float(colours.mean(colours.wavelength_nm)))
    x, y = zero + water.lamp.offset_x_m, zero + water.lamp.offset_y_m
    width = core_width_deg(lit(water).lamp)
    grid = positions_grid(x, y, nodes_m, _CELL_M, width, None, detector=water.detector)
    grid = surrounded(grid)
    a, b = colours.water_of(water)
    molecular = colours.mean(molecular_per_m(water.water, colours.wavelength_nm))
    reference = Reference(a, b, 0.0, molecular_share=molecular / b)
    rendering = render_scene(
        water, grid=grid, reference=reference, symmetry=True, path_nodes=PATH_NODES, **tracing
    )
    response, shift = rendering.response, Shift.on(grid, x, y, nodes_m)
    a_k, b_k = coefficients_in(water.water, colours.wavelength_nm, reference.molecular_share)
    # One trace for all colours: their errors are one error, and add up.
    each = response.evaluate(a_k, b_k, part="diffuse")
    mean, stderr = (np.tensordot(colours.share, v, 1).ravel() for v in each)
    diffuse, error = shift.of_traced(mean, stderr)
    relative = np.divide(error, diffuse, out=np.zeros_like(error), where=diffuse > 0)
    late = ~response.is_direct
    # The mean over a cell, [batches, rows, nodes], scaled to the light in its middle.
    tally = response.tally[:, late][:, :, response.read_from(shift.cell)].astype(float)
    rows = response.row_weights(Waters(a_k, b_k, 0 * a_k, 0 * a_k))[:, late]
    straight = np.exp(np.outer(a + b - a_k - b_k, response.straight_m.ravel()[shift.cell]))
    tally *= np.einsum("k,kr,kn->rn", colours.share, rows, straight)
    tally *= diffuse / np.maximum(tally.mean(axis=0).sum(axis=0), TINY)
    excess, of = np.unique(response.excess_m[late], return_inverse=True)
    which = (of[:, None] == np.arange(len(excess))).astype(float)  # [rows, steps]
    by_path = np.stack([which.T @ part for part in tally])
    direct = colours.direct(water, x, y, nodes_m)
    bandwidth, error = bandwidth_of(direct, by_path, excess)
    scattered = by_path.mean(axis=0)
    in_time = np.clip(1 - excess * GROUP_INDEX / LIGHT_M_PER_S * receiver.bit_rate_per_s, 0, 1)
    eye = np.clip(2 * (direct + in_time @ scattered) / (direct + scattered.sum(axis=0)) - 1, 0, 1)
    return _Late(diffuse, relative, bandwidth, error, eye)
