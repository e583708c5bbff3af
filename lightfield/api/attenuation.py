"""What readings in water against air tell of the water: `attenuation`."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import TYPE_CHECKING

import xarray as xr

from lightfield.api.given import AnyPath, checked, diffuse_source, readings_of, scene_of
from lightfield.api.notebook import told_in_notebook
from lightfield.api.result import ToldInWords
from lightfield.readings import Readings
from lightfield.scene import Scene
from lightfield.studies.attenuation import study as attenuating
from lightfield.studies.attenuation import text as attenuation_text

if TYPE_CHECKING:
    import pandas as pd

    from lightfield.report.style import Axes


class Attenuation(ToldInWords[attenuating.Attenuation]):
    """What readings in water against air tell of the water."""

    _words = attenuation_text

    def plot(self, ax: Axes | None = None) -> Axes:
        """Apparent attenuation over wavelength, with one standard error."""
        from lightfield.report.plots import plot_lines

        one = self.details.apparent[0]
        lines = {"K": (one.K_per_m, one.K_stderr)}
        words = ("wavelength (nm)", "K (1/m)", "Apparent attenuation")
        return plot_lines(ax, one.ratios.wavelength_nm, lines, words)

    def to_xarray(self) -> xr.Dataset:
        """Apparent attenuation, loss per metre and over distances, of the first table."""
        return self.details.apparent[0].dataset()

    def to_pandas(self) -> pd.DataFrame:
        """A row per wavelength: K and loss per metre, with their errors."""
        names = ["attenuation", "attenuation_stderr", "percent_per_metre", "percent_per_metre_stderr"]
        return self.to_xarray()[names].to_dataframe().reset_index()

    def _page(self) -> str:
        from lightfield.report.attenuation.page import attenuation_page

        return attenuation_page(self.details)


@told_in_notebook("attenuation")
@checked
def attenuation(
    readings: Readings | AnyPath | Sequence[Readings | AnyPath],
    scene: Scene | AnyPath | Sequence[Scene | AnyPath],
    *,
    air: bool | None = None,
    trace: bool = True,
) -> Attenuation:
    """What readings in water against air tell of the water.

    Parameters
    ----------
    readings : Readings or path-like, or several
        Table with the media water and air; several tables of one water, one per receiver.
    scene : Scene or path-like, or several
        Lamp, tank, receiver; one for each table, or one for all.
    air : bool, optional
        Divide by readings in air, or by what the formula says of lossless water; default: if there are any.
    trace : bool
        False: leave out what only the renderer knows.

    Raises
    ------
    MeasurementError, SceneError
        Readings or scenes that cannot be read, or that do not belong together.
    """
    tables = [readings] if isinstance(readings, Readings | str | PathLike) else list(readings)
    scenes = [scene] if isinstance(scene, Scene | str | PathLike) else list(scene)
    found = attenuating.attenuation(
        [readings_of(table) for table in tables],
        [scene_of(one) for one in scenes],
        diffuse_source(trace),
        air,
    )
    return Attenuation(found)
