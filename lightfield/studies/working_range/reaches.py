"""Distances up to which something holds, and those up to which a pose is known as well as docking asks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.optimize import brentq

from lightfield.arrays import Array, Mask
from lightfield.scene import Scene
from lightfield.studies.follower.information import Bound
from lightfield.studies.follower.survey import DOCKING
from lightfield.studies.working_range.poses import Known, known_poses

#: Directions of a pose that are asked about: coordinates, unit, and what docking asks of them (`DOCKING`).
POSE_RULES = {
    "across": (("x", "y"), "m", DOCKING["x"]),
    "along": (("z",), "m", DOCKING["z"]),
    "turned": (("yaw", "pitch"), "deg", float(np.degrees(DOCKING["yaw"]))),
}
#: Ends of the names of what is known by relative readings only.
RELATIVE = "_relative"
#: Part of a bound by which two ways of smoothing one trace differ (0.5 % at 9 m, 1.3 % at 15 m): beside what
#: the photons leave.
_SMOOTHED = 0.01
#: A bound is surely good where it is with so many of its errors more: one in forty is worse by chance.
SURE = 2.0
#: What cannot be known at all, in m and rad, for logarithms.
_UNKNOWN = 1e6
#: Steps on which distances are looked for, and distances at which poses are asked about.
SCAN, POSES = 600, 13


@dataclass(frozen=True)
class Reach:
    """A distance up to which something holds.

    Parameters
    ----------
    name : str
        "light", "signal", "pose" or "pose_" and one of `POSE_RULES`, these also with `RELATIVE`.
    z_m, stderr_m : float
        With scattered and reflected light; infinite where it still holds at the farthest distance asked. NaN
        with an infinite error: too few photons tell whether it holds anywhere.
    formula_m : float
        By direct light alone.
    from_m, formula_from_m : float
        Where it begins to hold, if not at the nearest distance asked; else NaN.
    from_stderr_m : float
        Error of `from_m`.
    sure_m : float
        Where `z_m` is infinite, and photons leave the farthest distances in doubt: up to where it holds all
        the same; else NaN.
    near_m, formula_near_m : float
        Where it begins to hold away from the lamp, and surely holds at the nearest distance asked as well: up
        to where it does there; else NaN.
    """

    name: str
    z_m: float
    stderr_m: float
    formula_m: float
    from_m: float = float("nan")
    formula_from_m: float = float("nan")
    from_stderr_m: float = float("nan")
    sure_m: float = float("nan")
    near_m: float = float("nan")
    formula_near_m: float = float("nan")

    @property
    def is_told(self) -> bool:
        """Do the photons tell whether it holds anywhere?"""
        return not (np.isnan(self.z_m) and np.isinf(self.stderr_m))


def docking_reach(scene: Scene, from_m: float, to_m: float, *, photons: float) -> Reach:
    """Farthest distance on the axis at which an array knows its pose as well as docking asks.

    Parameters
    ----------
    scene : Scene
        See `known_poses`.
    from_m, to_m : float, m
    photons : float
        Zero: the formula alone.
    """
    z = np.linspace(from_m, to_m, POSES)
    data = xr.Dataset(pose_sigmas(known_poses(scene, z, photons=photons), z, z), coords={"z_m": z})
    return next(r for r in pose_reaches(data, np.linspace(from_m, to_m, SCAN)) if r.name == "pose")


def logarithm(data: xr.Dataset, name: str) -> CubicSpline:
    """Of a variable over distance, between its distances."""
    return CubicSpline(data.z_m.values, np.log(data[name].values))


def pose_reaches(data: xr.Dataset, fine: Array) -> list[Reach]:
    """By the standard errors of `sigmas`, one rule after the other and all together."""
    z, rules = data.z_m.values, list[Reach]()
    for suffix in ("", RELATIVE):
        over, doubts, straight = [], [], []
        for axis, (_, unit, limit) in POSE_RULES.items():
            name = f"sigma_{axis}{suffix}"
            own, formula = (
                logarithm(data, f"{name}{which}_{unit}")(fine) - np.log(limit) for which in ("", "_formula")
            )
            relative = data[f"{name}_stderr_{unit}"].values / data[f"{name}_{unit}"].values
            over.append(own)
            straight.append(formula)
            doubts.append(np.interp(fine, z, relative))
            rules.append(_within(f"pose_{axis}{suffix}", fine, own, doubts[-1], formula))
        worst = np.argmax(over, axis=0), np.arange(len(fine))
        whole = np.array(over)[worst], np.array(doubts)[worst], np.max(straight, axis=0)
        rules.append(_within(f"pose{suffix}", fine, *whole))
    return rules


def _within(name: str, z: Array, over: Array, doubt: Array, formula: Array) -> Reach:
    """The last stretch of distances on which a logarithm is surely below 0, and one that begins at once.

    `doubt` is its relative error. What few photons leave of far light looks like information: a stretch that
    is not good with an error `SURE` times as large as well is none.
    """
    nothing = float("nan")
    formula_near, formula_far = _stretch(z, formula, formula <= 0)
    of_formula, near_of_formula = nothing, nothing
    if formula_near > z[0]:
        of_formula, near_of_formula = formula_near, _first_end(z, formula, formula[0] <= 0)
    worse = over + np.log1p(SURE * doubt)
    if (over <= 0).any() and not (worse <= 0).any():
        return Reach(
            name,
            nothing,
            float("inf"),
            formula_far,
            formula_from_m=of_formula,
            formula_near_m=near_of_formula,
        )
    near, far = _stretch(z, over, worse <= 0)
    sure = _stretch(z, worse, worse <= 0)[1]

    def error(at: float) -> float:
        return float(np.interp(at, z, doubt) / np.abs(np.interp(at, z, np.gradient(over, z))))

    begins, ends = near > z[0], np.isfinite(far)
    return Reach(
        name, far, error(far) if ends else nothing, formula_far, near if begins else nothing, of_formula,
        error(near) if begins else nothing, nothing if ends or np.isinf(sure) else sure,
        _first_end(z, over, begins and worse[0] <= 0), near_of_formula,
    )  # fmt: skip


def _first_end(z: Array, over: Array, counts: bool | np.bool_) -> float:
    """Where the stretch that begins at once ends, if it counts; else NaN."""
    return _stretch(z, over, z == z[0])[1] if counts else float("nan")


def _stretch(z: Array, over: Array, counts: Mask) -> tuple[float, float]:
    """Ends of the farthest stretch on which `over` is not above 0, and which counts somewhere; NaN: none."""
    if not counts.any():
        return float("nan"), float("nan")
    within = int(np.flatnonzero(counts)[-1])
    bad = np.flatnonzero(over > 0)
    before, after = bad[bad < within], bad[bad > within]

    def crossing(k: int) -> float:
        return float(z[k] + (z[k + 1] - z[k]) * over[k] / (over[k] - over[k + 1]))

    near = crossing(int(before[-1])) if before.size else float(z[0])
    return near, crossing(int(after[0]) - 1) if after.size else float("inf")


def pose_sigmas(known: Sequence[Known], at: Array, z: Array) -> dict[str, tuple[str, Array, dict[str, str]]]:
    """Standard errors of poses at distances, from those that were asked about; smooth in between."""
    found = {}
    for which, one in zip(("", "_formula"), known, strict=True):
        for gain, bounds in (("", one.as_stated), (RELATIVE, one.relative)):
            for axis, (names, unit, _) in POSE_RULES.items():
                sigma, doubt = np.array([_worst(bound, names) for bound in bounds]).T
                scale = 1.0 if unit == "m" else 180 / np.pi
                curve = np.exp(PchipInterpolator(at, np.log(scale * sigma))(z))
                name = f"sigma_{axis}{gain}{which}"
                found[f"{name}_{unit}"] = ("z_m", curve, {"units": unit})
                if not which:
                    error = curve * np.interp(z, at, doubt)
                    found[f"{name}_stderr_{unit}"] = ("z_m", error, {"units": unit})
    return found


def _worst(bound: Bound, names: tuple[str, ...]) -> tuple[float, float]:
    """Largest standard error of some coordinates, and its relative doubt by the trace."""
    name = max(names, key=bound.sigma.__getitem__)
    doubt = bound.doubt.get(name, 0.0)
    return min(bound.sigma[name], _UNKNOWN), float(np.hypot(doubt, _SMOOTHED)) if doubt else 0.0


def place_error(error: CubicSpline, curve: CubicSpline, z_m: float) -> float:
    """Error of the distance where a curve meets a level: that of ln(light) by the slope."""
    return float(error(z_m)) / abs(float(curve(z_m, 1))) if np.isfinite(z_m) else float("nan")


def last_place(curve: Callable[[Array], Array | np.float64], level: float, fine: Array) -> float:
    """Where a curve first falls below a level; infinite if never, NaN if it begins there."""
    beyond = curve(fine) < level
    if not beyond.any():
        return float("inf")
    k = int(np.argmax(beyond))
    if k == 0:
        return float("nan")
    return float(brentq(lambda z: float(curve(np.array(z))) - level, fine[k - 1], fine[k]))
