"""How far a lamp carries data, and how far it is seen: power, errors per bit, bandwidth by the traced paths.

    P(z) = I0 E(z) A                            received power, I0 = lamp power / solid angle of the beam
    i1 = 2 R P, i0 = 0                          photocurrent of a mark and of a space (on-off keying)
    sigma^2 = 2 q (i + i_b) B + i_n^2 B         shot noise, background, amplifier; B = bit rate / 2
    Q = (i1 - i0) / (sigma1 + sigma0),  BER = erfc(Q / sqrt(2)) / 2
    h(t) = sum R(e) at t = e n_g / c_0          impulse response: e is the path in excess of the straight line

(Agrawal 2010, Fiber-Optic Communication Systems, 4th ed., eq. 4.6.8 to 4.6.11.) The trace keeps e of every
history, so h(t) costs no second one. The formula knows only exp(-cz), and loses every scattered photon.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq
from scipy.special import erfc, erfcinv

from lightfield.arrays import Array
from lightfield.errors import UsageError
from lightfield.formula.closed_form import direct_field, refuse_pencil
from lightfield.progress import step
from lightfield.render.diffuse.bending import surrounded
from lightfield.render.diffuse.shift import Shift
from lightfield.render.maps import render_scene
from lightfield.render.response.grid import positions_grid
from lightfield.render.response.response import Reference
from lightfield.scene import Scene
from lightfield.scene.acts import Acts
from lightfield.scene.all_parameters import without
from lightfield.scene.bands import molecular_share
from lightfield.scene.lamp.profile import solid_angle_sr
from lightfield.scene.water.coefficients import absorption_per_m, molecular_per_m, scattering_per_m
from lightfield.studies.attenuation.excess import grey
from lightfield.studies.light_at import FARTHEST_M, refuse_dark
from lightfield.studies.link.bandwidth import (
    GROUP_INDEX,
    LIGHT_M_PER_S,
    PATH_NODES,
    bandwidth_of,
    between_nodes,
)
from lightfield.studies.working_range.reaches import Reach, docking_reach

#: Charge of the electron, C (exact in the SI).
ELECTRON_C = 1.602176634e-19
#: Waters to compare with, a and b in 1/m, as they are called for docking: c = 0.1 and 0.35.
WATERS = {"clear": (0.05, 0.05), "turbid": (0.05, 0.30)}
#: Farthest distance at which the accuracy of poses is asked about, m, and photons for it.
DOCKING_TO_M, DOCKING_PHOTONS = 20.0, 1e6
#: A lamp is seen where its signal is so many times the noise in this bandwidth (ten readings a second).
SEEN_SNR, SEEN_HZ = 10.0, 10.0
#: What receivers there are, and room beside them: least, largest and unit.
RANGES = {
    "area_mm2": (1e-6, 1e8, "mm²"),
    "responsivity_a_per_w": (1e-6, 1e9, "A/W"),
    "noise_a_per_sqrt_hz": (1e-30, 1.0, "A/√Hz"),
    "background_a": (0.0, 1e3, "A"),
    "bit_rate_per_s": (1e-3, 1e12, "bit/s"),
}
#: Nearest distance, m, unless told otherwise.
FROM_M = 4.0
#: Width of the cells on the axis, m: their bending is known from those beside them.
_CELL_M = 0.3
#: Distances asked at, and on which ranges are looked for.
_DISTANCES, _SCAN = 18, 800


@dataclass(frozen=True)
class Receiver:
    """What turns light into bits.

    Parameters
    ----------
    area_mm2 : float
        Of the photodiode.
    responsivity_a_per_w : float
    noise_a_per_sqrt_hz : float
        Of the amplifier, referred to its input.
    background_a : float
        Photocurrent of ambient light, and dark current.
    bit_rate_per_s : float
    ber : float
        Errors per bit that are accepted.
    """

    area_mm2: float = 13.0
    responsivity_a_per_w: float = 0.25
    noise_a_per_sqrt_hz: float = 5e-12
    background_a: float = 0.0
    bit_rate_per_s: float = 1e6
    ber: float = 1e-6

    def __post_init__(self) -> None:
        for name, (low, high, unit) in RANGES.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise UsageError(f"impossible {name}", found=value, rule=f"{low:g} to {high:g} {unit}")
        if not 0 < self.ber < 0.5:
            raise UsageError("impossible ber", found=self.ber, rule="above 0, below 0.5")

    def q(self, power_w: Array, eye: Array | float = 1.0) -> Array:
        """Q of received power, W; `eye` is the part of the swing that neighbouring bits leave."""
        B = self.bit_rate_per_s / 2
        mark = 2 * self.responsivity_a_per_w * power_w
        one, zero = (np.sqrt(self._variance(i, B)) for i in (mark, 0.0 * mark))
        return np.asarray(mark * eye / (one + zero))

    def error_rate(self, power_w: Array) -> Array:
        """Errors per bit."""
        return np.asarray(0.5 * erfc(self.q(power_w) / np.sqrt(2)))

    @property
    def needed_q(self) -> float:
        """Q that the accepted error rate asks for."""
        return float(np.sqrt(2) * erfcinv(2 * self.ber))

    def seen_snr(self, power_w: Array) -> Array:
        """Signal over noise of a slow reading."""
        current = self.responsivity_a_per_w * power_w
        return np.asarray(current / np.sqrt(self._variance(current, SEEN_HZ)))

    def _variance(self, current: Array, bandwidth: float) -> Array:
        shot = 2 * ELECTRON_C * (current + self.background_a)
        return np.asarray((shot + self.noise_a_per_sqrt_hz**2) * bandwidth)


@dataclass(frozen=True)
class Reaches:
    """Ranges in one water, m; infinite where they end beyond the farthest distance asked.

    Parameters
    ----------
    data_m, data_stderr_m : float
        For data, with scattered light.
    data_formula_m : float
        By exp(-cz).
    data_with_echoes_m : float
        With scattered light that comes late into the next bits.
    seen_m, seen_stderr_m, seen_formula_m : float
        For seeing the lamp at all.
    docking : Reaches of a pose
        Up to where an array knows its pose as well as docking asks, see `working_range.reaches`.
    """

    data_m: float
    data_stderr_m: float
    data_formula_m: float
    data_with_echoes_m: float
    seen_m: float
    seen_stderr_m: float
    seen_formula_m: float
    docking: Reach


@dataclass(frozen=True, eq=False)
class Link:
    """The answer.

    Parameters
    ----------
    dataset : xarray.Dataset
        Over (water, z_m): `power_w` with `power_stderr_w`, `power_formula_w`, `ber`, `ber_formula`,
        `scattered_over_direct`, `bandwidth_hz` with `bandwidth_stderr_hz`, `eye`.
    reaches : dict of Reaches, by water
    receiver : Receiver
    scene : Scene
    """

    dataset: xr.Dataset
    reaches: dict[str, Reaches]
    receiver: Receiver
    scene: Scene

    @property
    def docking_to_m(self) -> float:
        """Farthest distance at which docking was asked about, m."""
        return docking_to_m(*(float(self.dataset.z_m[k]) for k in (0, -1)))


def link(
    scene: Scene,
    receiver: Receiver | None = None,
    *,
    waters: Mapping[str, tuple[float, float]] | None = None,
    from_m: float = FROM_M,
    to_m: float = 60.0,
    **tracing: Any,
) -> Link:
    """Received power, errors and bandwidth along the axis in unbounded water.

    Parameters
    ----------
    scene : Scene
        Lamp (all of its power counts), phase function, receiver; a tank is left out. Its water at the middle
        of the first band is the first to be asked.
    receiver : Receiver, optional
    waters : mapping of (a, b), optional, 1/m
        To compare with; default `WATERS`.
    from_m, to_m : float, m
    **tracing
        Of `lightfield.render.maps.render_scene`: rel_error, max_photons, seed, cache, progress.

    Raises
    ------
    UsageError
        Numbers that make no sense; no light is left at the farthest distance.
    SceneError
        A lamp that is no beam.
    """
    receiver = receiver or Receiver()
    if not 0 < from_m < to_m <= FARTHEST_M:
        begins = f"{from_m:g} m{' (the default of from_m)' if from_m == FROM_M else ''}"
        raise UsageError(
            "impossible distances", found=f"from {begins} to {to_m:g} m",
            rule=f"from above 0 m to farther than that, at most {FARTHEST_M:g} m",
            remedy=f"let the farthest distance lie between {from_m:g} and {FARTHEST_M:g} m",
        )  # fmt: skip
    refuse_pencil(scene.lamp)
    at = np.array([np.mean(scene.detector.bands_nm[0])])
    own = float(absorption_per_m(scene.water, at)[0]), float(scattering_per_m(scene.water, at)[0])
    every = {"scene": own, **(WATERS if waters is None else waters)}
    for name, pair in every.items():
        if not all(0 <= v < np.inf for v in pair):
            raise UsageError("impossible water", where=name, found=pair, rule="a and b of 0 or more, 1/m")
    for name, (a, b) in every.items():
        water = _water(scene, a, b, own=(a, b) == own)
        refuse_dark(
            water, (from_m, to_m), where=f"water {name}", remedy="a nearer distance, or clearer water"
        )
    nodes, fine = np.geomspace(from_m, to_m, _DISTANCES), np.linspace(from_m, to_m, _SCAN)
    parts, reaches = [], {}
    for k, (name, (a, b)) in enumerate(every.items()):
        with step(2 * k, 2 * len(every), f"data, {name}"):
            water = _water(scene, a, b, own=(a, b) == own)
            parts.append(_along(water, receiver, a, b, nodes, fine, tracing))
        with step(2 * k + 1, 2 * len(every), f"docking, {name}"):
            docking = docking_reach(
                water, from_m, docking_to_m(from_m, to_m),
                photons=min(DOCKING_PHOTONS, tracing.get("max_photons", np.inf)) if b > 0 else 0.0,
            )  # fmt: skip
        reaches[name] = _reach(parts[-1], receiver, docking)
    pairs = list(every.values())
    waters_read = xr.Dataset(
        {name: ("water", [pair[k] for pair in pairs]) for k, name in enumerate(("absorption", "scattering"))}
    )
    dataset = xr.concat(parts, xr.DataArray(list(every), dims="water", name="water")).merge(waters_read)
    return Link(dataset, reaches, receiver, scene)


def docking_to_m(from_m: float, to_m: float) -> float:
    """Farthest distance at which the accuracy of poses is asked about, m: no farther than all else."""
    return min(max(DOCKING_TO_M, 1.5 * from_m), to_m)


def _water(scene: Scene, a: float, b: float, own: bool) -> Scene:
    """The scene in uniform, unbounded water of these coefficients; its own keeps its molecules."""
    unbounded = scene.model_copy(update={"tank": None})
    if own and molecular_share(scene):
        return without(unbounded, Acts.LAYERS | Acts.HARDENING)
    return grey(unbounded, a, b)


def _along(
    water: Scene,
    receiver: Receiver,
    a: float,
    b: float,
    nodes: Array,
    fine: Array,
    tracing: Mapping[str, Any],
) -> xr.Dataset:
    """Everything along the axis in one water."""
    zero = np.zeros(len(fine))
    x, y = zero + water.lamp.offset_x_m, zero + water.lamp.offset_y_m
    direct = direct_field(water, x, y, fine)
    ratio, error = zero, zero
    bandwidth, spread, eye = np.full(len(fine), np.inf), np.full(len(fine), np.nan), np.ones(len(fine))
    if b > 0:
        late = _late_light(water, nodes, a, b, receiver, tracing)
        near = direct_field(water, x[: len(nodes)], y[: len(nodes)], nodes)
        ln = PchipInterpolator(nodes, np.log(np.maximum(late.diffuse, 1e-300) / near))
        ratio = np.exp(ln(fine))
        error = np.exp(np.interp(fine, nodes, np.log(np.maximum(late.relative_error, 1e-6))))
        bandwidth, spread = between_nodes(fine, nodes, late.bandwidth_hz, late.bandwidth_stderr_hz)
        eye = np.interp(fine, nodes, late.eye)
    intensity = water.lamp.power_w / solid_angle_sr(water.lamp)
    scale = intensity * receiver.area_mm2 * 1e-6
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
        coords={"z_m": ("z_m", fine, {"units": "m"})},
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
    water: Scene, nodes: Array, a: float, b: float, receiver: Receiver, tracing: Mapping[str, Any]
) -> _Late:
    """Trace, and sort the light by its delay."""
    zero = np.zeros(len(nodes))
    x, y = zero + water.lamp.offset_x_m, zero + water.lamp.offset_y_m
    grid = positions_grid(x, y, nodes, _CELL_M, water.lamp.hwhm_deg, None, detector=water.detector)
    grid = surrounded(grid)
    at = np.array([np.mean(water.detector.bands_nm[0])])
    reference = Reference(a, b, 0.0, molecular_share=float(molecular_per_m(water.water, at)[0]) / b)
    rendering = render_scene(
        water, grid=grid, reference=reference, symmetry=True, path_nodes=PATH_NODES, **tracing
    )
    response, shift = rendering.response, Shift.on(grid, x, y, nodes)
    mean, stderr = (v.ravel() for v in response.evaluate(a, b, part="diffuse"))
    diffuse = shift.apply(mean)
    relative = np.sqrt(
        shift.shares.power(2) @ np.where(mean > 0, stderr / np.maximum(mean, 1e-300), 0.0) ** 2
    )
    late = ~response.is_direct
    # The mean over a cell, [batches, rows, nodes], scaled to the light in its middle.
    tally = response.tally[:, late][:, :, response.read_from(shift.cell)].astype(float)
    tally *= diffuse / np.maximum(tally.mean(axis=0).sum(axis=0), 1e-300)
    excess, of = np.unique(response.excess_m[late], return_inverse=True)
    which = (of[:, None] == np.arange(len(excess))).astype(float)  # [rows, steps]
    by_path = np.stack([which.T @ part for part in tally])
    direct = direct_field(water, x, y, nodes)
    bandwidth, error = bandwidth_of(direct, by_path, excess)
    scattered = by_path.mean(axis=0)
    in_time = np.clip(1 - excess * GROUP_INDEX / LIGHT_M_PER_S * receiver.bit_rate_per_s, 0, 1)
    eye = np.clip(2 * (direct + in_time @ scattered) / (direct + scattered.sum(axis=0)) - 1, 0, 1)
    return _Late(diffuse, relative, bandwidth, error, eye)


def _reach(data: xr.Dataset, receiver: Receiver, docking: Reach) -> Reaches:
    """Farthest distances at which the receiver does with its light."""
    z, power, formula = data.z_m.values, data.power_w.values, data.power_formula_w.values
    need, relative = receiver.needed_q, data.power_stderr_w.values / power

    def last(ratio: Array) -> float:
        return _last(z, ratio)

    data_m, seen_m = last(receiver.q(power) / need), last(receiver.seen_snr(power) / SEEN_SNR)
    slope = np.abs(np.gradient(np.log(power), z))
    errors = [
        float(np.interp(at, z, relative / slope)) if np.isfinite(at) else float("nan")
        for at in (data_m, seen_m)
    ]
    return Reaches(
        data_m, errors[0], last(receiver.q(formula) / need),
        last(receiver.q(power, data.eye.values) / need),
        seen_m, errors[1], last(receiver.seen_snr(formula) / SEEN_SNR), docking,
    )  # fmt: skip


def _last(z: Array, ratio: Array) -> float:
    """Where a ratio first falls below 1; infinite if never, NaN if it never was above."""
    beyond = np.flatnonzero(~(ratio >= 1))
    if not beyond.size:
        return float("inf")
    k = int(beyond[0])
    if k == 0:
        return float("nan")
    log = np.log(np.maximum(ratio, 1e-300))
    return float(brentq(lambda at: np.interp(at, z, log), z[k - 1], z[k]))
