"""Where the closed-form model can be trusted: `regime`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd
import xarray as xr

from lightfield.api.given import AnyPath, checked, scene_of
from lightfield.api.notebook import told_in_notebook
from lightfield.api.result import OverAxes
from lightfield.render.limits import OF_REGIME
from lightfield.scene import Scene
from lightfield.storage.files import locked_folder
from lightfield.studies import regime as regimes
from lightfield.sweep.sweep_plan import SweepSettings

if TYPE_CHECKING:
    from lightfield.report.style import Axes


class Regime(OverAxes[xr.Dataset]):
    """Where the closed-form model can be trusted."""

    @property
    def headline(self) -> str:
        return regimes.as_text(self.details)

    def as_data(self) -> dict[str, Any]:
        return {"sentence": self.headline, "rows": self.to_pandas().to_dict("records")}

    def plot(self, ax: Axes | None = None) -> Axes:
        """Error of the formula on the axis against optical thickness, of the first receiver."""
        from lightfield.report.plots import plot_lines

        one = self.details.isel(receiver=0)
        error = one.formula_error.values
        lines = {f"albedo {a:g}": (error[k], None) for k, a in enumerate(one.albedo.values)}
        words = ("optical thickness c z", "error of the formula", str(one.receiver.values))
        return plot_lines(ax, one.optical_depth.values, lines, words)

    def to_xarray(self) -> xr.Dataset:
        """Over (receiver, albedo, optical_depth): `formula_error` with its standard error."""
        return self.details

    def summary(self) -> pd.DataFrame:
        """Optical thickness up to which the formula holds."""
        head = ["receiver", "albedo", "within 5 %", "within 10 %", "within 25 %"]
        return pd.DataFrame(regimes.rows(self.details), columns=head)

    def _page(self) -> str:
        from lightfield.report.regime import regime_figure
        from lightfield.report.result import result_page

        return result_page(self, "Where the formula holds", regime_figure)


@checked
@told_in_notebook("regime")
def regime(
    output: AnyPath,
    scene: Scene | AnyPath | None = None,
    *,
    rel_error: float = OF_REGIME.rel_error,
    max_photons: float = OF_REGIME.max_photons,
    seed: int = 0,
    workers: int = 0,
) -> Regime:
    """Where the closed-form model can be trusted.

    Parameters
    ----------
    output : path-like
        Folder of the sweep that is made for it; one that was stopped is continued.
    scene : Scene or path-like, optional
        Lamp and phase function to use; default: the paper's lamp.
    rel_error, max_photons, seed
        How well to trace.
    workers : int
        Local processes; 0: this one.

    Raises
    ------
    OutputError
        A folder of another sweep, or a full disk.
    """
    known = Scene.from_dict({"name": "the paper's lamp"}) if scene is None else scene_of(scene)
    settings = SweepSettings(rel_error, max_photons, seed, maps=False)
    with locked_folder(output) as folder:
        *_, found = regimes.run_regime(known, settings, folder / "regime.zarr", workers=workers)
    return Regime(found)
