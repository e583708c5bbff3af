"""How far a lamp carries data, and how far it is seen: power, errors per bit, bandwidth by the traced paths.

    P(z)                                        received power, by the lamp's light in the band: `arrival`
    Q, BER                                      errors per bit: `receiver`
    h(t) = sum R(e) at t = e n_g / c_0          impulse response: e is the path in excess of the straight line

The trace keeps e of every history, so h(t) costs no second one. The formula knows only exp(-cz), and loses
every scattered photon.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from lightfield.arrays import TINY, Array
from lightfield.errors import UsageError
from lightfield.formula.closed_form import refuse_pencil
from lightfield.formula.own_formulas import lit
from lightfield.progress import step
from lightfield.render.settings import CachedTracing
from lightfield.scene import Scene
from lightfield.scene.acts import Acts
from lightfield.scene.all_parameters import without
from lightfield.scene.lamp.profile import solid_angle_sr
from lightfield.studies import defaults
from lightfield.studies.attenuation.excess import grey
from lightfield.studies.defaults import LINK_WATERS
from lightfield.studies.light_at import FARTHEST_M, refuse_dark
from lightfield.studies.link.arrival import Colours, along_axis
from lightfield.studies.link.receiver import SEEN_SNR, Receiver
from lightfield.studies.regime import AIMED
from lightfield.studies.working_range.reaches import SURE, Reach, docking_reach, last_place

if TYPE_CHECKING:
    from typing_extensions import Unpack

#: Waters to compare with, a and b in 1/m, as they are called for docking: c = 0.1 and 0.35.
#: Farthest distance at which the accuracy of poses is asked about, m, and photons for it.
_DOCKING_TO_M, DOCKING_PHOTONS = 20.0, 1e6
#: Nearest distance, m.
_FROM_M = 4.0
#: Distances asked at, and on which ranges are looked for.
_DISTANCES, _SCAN = 18, 800


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
    data_sure_m, seen_sure_m : float
        Up to where it surely holds of a range beyond the farthest distance whose light few photons tell; else
        NaN.
    """

    data_m: float
    data_stderr_m: float
    data_formula_m: float
    data_with_echoes_m: float
    seen_m: float
    seen_stderr_m: float
    seen_formula_m: float
    docking: Reach
    data_sure_m: float = float("nan")
    seen_sure_m: float = float("nan")


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
    def in_band_w(self) -> float:
        """Radiant power of the lamp that is read in the first band, W."""
        return Colours.of(self.scene).w_per_sr * solid_angle_sr(lit(self.scene).lamp)

    @property
    def docking_to_m(self) -> float:
        """Farthest distance at which docking was asked about, m."""
        return min(_DOCKING_TO_M, float(self.dataset.z_m[-1]))


def link(
    scene: Scene,
    receiver: Receiver | None = None,
    *,
    waters: Mapping[str, tuple[float, float]] | None = None,
    to_m: float = defaults.LINK_TO_M,
    **tracing: Unpack[CachedTracing],
) -> Link:
    """Received power, errors and bandwidth along the axis in unbounded water.

    Parameters
    ----------
    scene : Scene
        Lamp, of whose power that part counts which is read in the first band, phase function, receiver; a
        tank is left out, and where the lamp stands and points in it. Its own water is the first to be asked,
        grey ones in the same light.
    receiver : Receiver, optional
    waters : mapping of (a, b), optional, 1/m
        To compare with; default `LINK_WATERS`.
    to_m : float, m
        Farthest distance; the nearest is `_FROM_M`.
    **tracing
        Of `lightfield.render.maps.render_scene`: rel_error, max_photons, seed, cache.

    Raises
    ------
    UsageError
        Numbers that make no sense; no light of the lamp in the band, or none left at the farthest distance.
    SceneError
        A lamp that is no beam.
    """
    receiver = receiver or Receiver()
    if not _FROM_M < to_m <= FARTHEST_M:
        raise UsageError(
            "impossible farthest distance", found=f"{to_m:g} m",
            rule=f"above {_FROM_M:g} m, where ranges begin, at most {FARTHEST_M:g} m",
        )  # fmt: skip
    refuse_pencil(scene.lamp)
    every = {"scene": Colours.of(scene).water_of(scene), **(LINK_WATERS if waters is None else waters)}
    if "scene" in (waters or ()):
        raise UsageError(
            "a water of another name is wanted", where="scene", rule="the scene's own is called so"
        )
    for name, pair in every.items():
        if not all(0 <= v < np.inf for v in pair):
            raise UsageError("impossible water", where=name, found=pair, rule="a and b of 0 or more, 1/m")
    for name, (a, b) in every.items():
        water = _water(scene, name, a, b)
        refuse_dark(
            water, (_FROM_M, to_m), where=f"water {name}", remedy="a nearer distance, or clearer water"
        )
    nodes, fine = np.geomspace(_FROM_M, to_m, _DISTANCES), np.linspace(_FROM_M, to_m, _SCAN)
    parts, reaches = [], {}
    for k, (name, (a, b)) in enumerate(every.items()):
        with step(2 * k, 2 * len(every), f"data, {name}"):
            water = _water(scene, name, a, b)
            parts.append(along_axis(water, receiver, nodes, fine, tracing))
        with step(2 * k + 1, 2 * len(every), f"docking, {name}"):
            docking = docking_reach(
                water, _FROM_M, min(_DOCKING_TO_M, to_m),
                photons=min(DOCKING_PHOTONS, tracing.get("max_photons", np.inf)) if b > 0 else 0.0,
            )  # fmt: skip
        reaches[name] = _reach(parts[-1], receiver, docking)
    pairs = list(every.values())
    waters_read = xr.Dataset(
        {name: ("water", [pair[k] for pair in pairs]) for k, name in enumerate(("absorption", "scattering"))}
    )
    dataset = xr.concat(parts, xr.DataArray(list(every), dims="water", name="water")).merge(waters_read)
    return Link(dataset, reaches, receiver, scene)


def _water(scene: Scene, name: str, a: float, b: float) -> Scene:
    """The scene in uniform, unbounded water of these coefficients; its own keeps its colours.

    The lamp looks along the axis that is asked about, as the receiver does: docking is.
    """
    unbounded = scene.model_copy(update={"tank": None, "lamp": scene.lamp.model_copy(update=AIMED)})
    if name == "scene":
        return without(unbounded, Acts.LAYERS | Acts.HARDENING)
    return grey(unbounded, a, b)


def _reach(data: xr.Dataset, receiver: Receiver, docking: Reach) -> Reaches:
    """Farthest distances at which the receiver does with its light."""
    z, power, formula = data.z_m.values, data.power_w.values, data.power_formula_w.values
    need, relative = receiver.needed_q, data.power_stderr_w.values / power

    def last(ratio: Array) -> float:
        return last_place(partial(np.interp, xp=z, fp=np.log(np.maximum(ratio, TINY))), 0.0, z)

    data_m, seen_m = last(receiver.q(power) / need), last(receiver.seen_snr(power) / SEEN_SNR)
    low = power * np.maximum(1 - SURE * relative, 0)
    lows = last(receiver.q(low) / need), last(receiver.seen_snr(low) / SEEN_SNR)
    sure = [
        end if np.isinf(at) and np.isfinite(end) else float("nan")
        for at, end in zip((data_m, seen_m), lows, strict=True)
    ]
    slope = np.abs(np.gradient(np.log(power), z))
    errors = [
        float(np.interp(at, z, relative / slope)) if np.isfinite(at) else float("nan")
        for at in (data_m, seen_m)
    ]
    return Reaches(
        data_m, errors[0], last(receiver.q(formula) / need),
        last(receiver.q(power, data.eye.values) / need),
        seen_m, errors[1], last(receiver.seen_snr(formula) / SEEN_SNR), docking, *sure,
    )  # fmt: skip
