"""How far the lamp can be used: `range`."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import pandas as pd
import xarray as xr

from lightfield.api.given import AnyPath, checked, diffuse_source, readings_of, scene_of
from lightfield.api.notebook import told_in_notebook
from lightfield.api.result import OverAxes, ToldInWords
from lightfield.readings import Readings
from lightfield.render.limits import AXIS_PHOTONS
from lightfield.scene import Scene
from lightfield.studies import defaults
from lightfield.studies.working_range import study as ranging
from lightfield.studies.working_range import text as range_text
from lightfield.studies.working_range.poses import with_array

if TYPE_CHECKING:
    from lightfield.report.style import Axes


class Range(OverAxes[ranging.WorkingRange], ToldInWords[ranging.WorkingRange]):
    """How far the lamp can be used, and how wide its spot is."""

    _words = range_text

    def plot(self, ax: Axes | None = None) -> Axes:
        """Light on the axis over that at the first plane, with and without scattered light."""
        from lightfield.report.plots import plot_lines

        data = self.details.dataset
        lines = {"formula": (data.formula.values, None)}
        if self.details.traced:
            lines = {"with scattered light": (data.light.values, data.light_stderr.values), **lines}
        words = ("z (m)", f"light over that at {self.details.reference_m:g} m", "On the axis")
        return plot_lines(ax, data.z_m.values, lines, words)

    def to_xarray(self) -> xr.Dataset:
        """Over z_m: light, spot and accuracy of a pose, of the render and of the formula."""
        return self.details.dataset

    def summary(self) -> pd.DataFrame:
        """How far, by every rule."""
        rules = range_text.rules(self.details)
        return pd.DataFrame([
            {"name": reach.name, "rule": rules[reach.name], **asdict(reach)} for reach in self.details.reaches
        ])  # fmt: skip

    def _page(self) -> str:
        from lightfield.report.working_range import range_page

        return range_page(self.details)


@checked
@told_in_notebook("range")
def range(
    scene: Scene | AnyPath,
    *,
    readings: Readings | AnyPath | None = None,
    share: float = defaults.PAPER_SHARE,
    noise: float = defaults.NOISE,
    snr: float = defaults.SNR,
    to: float | None = None,
    array: int | None = None,
    array_side: float | None = None,
    array_radius: float | None = None,
    max_photons: float = AXIS_PHOTONS,
    trace: bool = True,
) -> Range:
    """How far the lamp can be used, and how wide its spot is.

    Parameters
    ----------
    scene : Scene or path-like
        Its first plane is the reference; its array is the follower's.
    readings : Readings or path-like, optional
        To show beside it.
    share : float
        Part of the light at the first plane that must be left.
    noise : float
        Of one reading, over the reading at the first plane.
    snr : float
        Signal over noise.
    to : float, m, optional
        Farthest distance; default: twice the last plane.
    array : int, optional
        Receivers on a side; default: the scene's array.
    array_side, array_radius : float, m, optional
        Its side, and its radius of curvature (0: flat).
    max_photons : float
        Traced for the accuracy of poses.
    trace : bool
        False: leave out what only the renderer knows.

    Raises
    ------
    UsageError, SceneError
        Numbers that make no sense; no room in the tank.
    """
    known = with_array(scene_of(scene), array, array_side, array_radius)
    table = None if readings is None else readings_of(readings, known)
    found = ranging.working_range(
        known, diffuse_source(trace), table, share=share, noise=noise, snr=snr, to_m=to,
        photons=max_photons,
    )  # fmt: skip
    return Range(found)
