"""Where a follower is by its readings, and where it would be by the formula: `lf.pose.estimate`, `.bias`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import xarray as xr

from lightfield.api.array import Medium, sigma_columns, space_and_light
from lightfield.api.given import AnyPath, checked
from lightfield.api.result import OverAxes, ToldByDetails
from lightfield.errors import UsageError
from lightfield.render.limits import FIELD_PHOTONS
from lightfield.scene import Scene
from lightfield.studies.defaults import HALF_WIDTH_M, MEDIUM
from lightfield.studies.follower import bias as biases
from lightfield.studies.follower.estimation import sequence
from lightfield.studies.follower.frames import POSE, in_degrees, with_units

if TYPE_CHECKING:
    from lightfield.report.style import Axes

__all__ = ["Bias", "Poses", "bias", "estimate"]


class Poses(ToldByDetails[sequence.Poses]):
    """Poses of a sequence of readings."""

    @property
    def headline(self) -> str:
        found = self.details
        fit = f"{found.lost} without light, {found.misfits} that do not fit, {found.ambiguous} ambiguous"
        return f"{found.last_known}{len(found.estimates)} readings: {fit}"

    def plot(self, ax: Axes | None = None) -> Axes:
        """Distance along the beam over time."""
        from lightfield.report.plots import plot_lines

        table = self.to_pandas()
        lines = {"z": (table.z_m.to_numpy(), table.sigma_z_m.to_numpy() if "sigma_z_m" in table else None)}
        return plot_lines(
            ax, table.time_s.to_numpy(), lines, ("time (s)", "z (m)", "Distance along the beam")
        )

    def to_pandas(self) -> pd.DataFrame:
        """A row per reading: pose with its standard deviations, m and degrees, whether it fits, and whether
        another pose does as well; with the filter its pose and standard deviations too (`filtered_`)."""
        found, units, rows = self.details, with_units(POSE), []
        for time, one in zip(found.time_s, found.estimates, strict=True):
            row: dict[str, Any] = {"time_s": float(time), "status": "light lost" if one.lost else one.status}
            if not one.lost and one.total is not None:
                row |= dict(zip(units, in_degrees(one.pose).tolist(), strict=True))
                row |= {**sigma_columns(one.total.sigma), "ambiguous": one.ambiguous}
            rows.append(row)
        for row, state in zip(rows, found.tracked or (), strict=False):
            sigma = dict(zip(found.names, np.sqrt(np.diag(state.total)), strict=True))
            track = dict(zip(units, in_degrees(state.pose).tolist(), strict=True)) | sigma_columns(sigma)
            row |= {f"filtered_{name}": value for name, value in track.items()}
        keys = [key for row in rows for key in row]
        return pd.DataFrame(rows, columns=list(dict.fromkeys(["time_s", "status", *units, *keys])))

    def _page(self) -> str:
        from lightfield.report.follower.pose_page import poses_page

        return poses_page(self.details)


class Bias(OverAxes[biases.BiasStudy], ToldByDetails[biases.BiasStudy]):
    """The error of a follower that believes the formula."""

    @property
    def headline(self) -> str:
        told = biases.told_bias(self.details.plane, "z")
        own = self.details.scene.water.scattering_per_m
        wrong = (
            f"is up to {float(np.abs(told).max()):.2f} m wrong" if told.notnull().any() else "tells nothing"
        )
        return f"In water that scatters {own:g} 1/m the formula {wrong} along the beam"

    def plot(self, ax: Axes | None = None) -> Axes:
        """Believed less true distance against scattering, at the first distance, a line per calibration."""
        from lightfield.report.plots import plot_lines

        one = self.details.axis.isel(z_m=0)
        at = [one.sel(calibration=name) for name in one.calibration.values]
        lines = {str(c.calibration.values): (c.bias_z.values, c.sigma_z.values) for c in at}
        words = (
            "scattering b (1/m)",
            "believed \N{MINUS SIGN} true distance (m)",
            f"z = {float(one.z_m):g} m",
        )
        return plot_lines(ax, one.scattering_per_m.values, lines, words)

    def to_xarray(self) -> xr.Dataset:
        """Bias and spread over (scattering_per_m, calibration, z_m), m and rad."""
        return self.details.axis

    def _page(self) -> str:
        from lightfield.report.follower.pose_page import bias_page

        return bias_page(self.details)


@checked
def estimate(
    readings: pd.DataFrame | AnyPath,
    scene: Scene | AnyPath,
    *,
    filter: bool = False,
    half_width: float = HALF_WIDTH_M,
    medium: Medium = MEDIUM,
    max_photons: float = FIELD_PHOTONS,
    seed: int = 0,
    trace: bool = True,
) -> Poses:
    """Poses from the readings of an array.

    Parameters
    ----------
    readings : DataFrame or path-like
        Table or CSV, a column per element: e1, e2, ..., and time_s. Over the array's gain they are irradiance
        over the lamp's intensity on its axis, 1/m2.
    scene : Scene or path-like
        With an [array].
    filter : bool
        Follow a sequence with a Kalman filter, too.
    half_width, medium, max_photons, seed, trace
        As `lightfield.array.show` takes them.

    Raises
    ------
    MeasurementError, SceneError, RenderError
        Readings that cannot be read; no array; a space that is not in the water.
    """
    known, where = space_and_light(scene, half_width, medium, max_photons, seed, trace)
    return Poses(sequence.poses_of(readings, known, filtered=filter, **where))


@checked
def bias(
    scene: Scene | AnyPath,
    *,
    scattering: Sequence[float] | None = None,
    half_width: float = HALF_WIDTH_M,
    medium: Medium = MEDIUM,
    max_photons: float = FIELD_PHOTONS,
    seed: int = 0,
    trace: bool = True,
) -> Bias:
    """The error of a follower that believes the formula.

    Parameters
    ----------
    scene : Scene or path-like
        With an [array].
    scattering : sequence of float, 1/m, optional
        Waters on the axis; default: 0 to 0.3, and in air 0.
    half_width, medium, max_photons, seed, trace
        As `lightfield.array.show` takes them.

    Raises
    ------
    SceneError, RenderError
        No array; a space that is not in the water.
    """
    known, where = space_and_light(scene, half_width, medium, max_photons, seed, trace)
    usual = biases.SCATTERING_PER_M if medium == "water" else (0.0,)
    waters = usual if scattering is None else tuple(scattering)
    if medium == "air" and any(waters):
        raise UsageError("air does not scatter", where="scattering", found=waters, rule="water")
    return Bias(biases.bias_study(known, scattering_per_m=waters, **where))
