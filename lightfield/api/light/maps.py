"""Light on the detectors: `render`."""

from __future__ import annotations

from collections.abc import Sequence
from os import fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import xarray as xr

from lightfield.api.given import AnyPath, checked, scene_of
from lightfield.api.notebook import told_in_notebook
from lightfield.api.result import Result
from lightfield.errors import UsageError
from lightfield.maps.dataset import brightest, read_netcdf, to_dataset, write_netcdf
from lightfield.render.at_readings import render_positions
from lightfield.render.limits import OF_MAPS, check_wavelengths
from lightfield.render.maps import render_scene
from lightfield.scene import Scene
from lightfield.scene.bands import refuse_unlit_wavelengths
from lightfield.wording import plain

if TYPE_CHECKING:
    from lightfield.report.style import Axes


class Maps(Result[xr.Dataset]):
    """Rendered light on planes, or at single positions, with its Monte Carlo errors."""

    @classmethod
    @checked
    def load(cls, path: AnyPath) -> Maps:
        """Maps of a file that `save` or `lightfield render` wrote (NetCDF).

        Raises
        ------
        OutputError
            Not such a file.
        """
        return cls(read_netcdf(fspath(path)))

    @property
    def quantity(self) -> str:
        """Name of the variable: irradiance, scalar_irradiance or radiance."""
        return str(self.details.attrs["quantity"])

    @property
    def scene(self) -> Scene:
        """The scene that was rendered."""
        return Scene.from_toml(self.details.attrs["scene_toml"], where="scene of the maps")

    @property
    def headline(self) -> str:
        data = self.details
        several = data.sizes["wavelength_nm"] > 1
        at = data.wavelength_nm.values
        colours = f"{len(at)} wavelengths, {at[0]:g} to {at[-1]:g} nm" if several else f"{at[0]:g} nm"
        place, along = ("plane", "z_m") if "z_m" in data.dims else ("position", "position")
        places = f"{data.sizes[along]} {place}{'s' * (data.sizes[along] != 1)}"
        error = data.attrs.get("reached_relative_error")
        known = "" if error is None else f", relative error {float(f'{100 * float(error):.2g}'):g} %"
        return f"{plain(self.quantity)} on {places} at {colours}{known}"

    def _relative_error(self) -> np.ndarray:
        value, stderr = (self.details[name].values for name in (self.quantity, f"{self.quantity}_stderr"))
        return np.divide(stderr, value, out=np.full(value.shape, np.nan), where=value > 0)

    def as_data(self) -> dict[str, Any]:
        return {"attributes": dict(self.details.attrs), "places": self.summary().to_dict("records")}

    def plot(
        self, ax: Axes | None = None, *, z_m: float | None = None, wavelength_nm: float | None = None
    ) -> Axes:
        """Draw one plane, or the light of single positions against z.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
        z_m, wavelength_nm : float, optional
            The plane and the wavelength nearest to these; default: the first plane, the brightest wavelength.
        """
        from lightfield.report.plots import plot_map, plot_positions

        wave = brightest(self.details[self.quantity])
        if wavelength_nm is not None:
            wave = nearest_index(self.details.wavelength_nm.values, wavelength_nm)
        data = self.details.isel(wavelength_nm=wave)
        if "z_m" not in data.dims:
            return plot_positions(ax, data)
        return plot_map(ax, data.isel(z_m=0 if z_m is None else nearest_index(data.z_m.values, z_m)))

    def to_xarray(self) -> xr.Dataset:
        """The maps with coordinates, units, parts, errors and provenance."""
        return self.details

    def to_pandas(self) -> pd.DataFrame:
        """A row per cell and wavelength."""
        names = [str(name) for name in self.details.data_vars if str(name).startswith(self.quantity)]
        return self.details[names].to_dataframe().reset_index()

    def summary(self) -> pd.DataFrame:
        """A row per plane or position and wavelength: brightest cell, and the cells' median error."""
        data, error = self.details[self.quantity], self._relative_error()
        places = ("z_m",) if "z_m" in self.details.dims else ("x_m", "y_m", "z_m")
        at = np.stack([np.atleast_1d(self.details[name].values) for name in places], axis=1)
        unit = data.attrs["units"]
        rows = []
        for w, wavelength in enumerate(self.details.wavelength_nm.values):
            for k, place in enumerate(at.tolist()):
                rows.append({
                    "wavelength_nm": float(wavelength),
                    **dict(zip(places, place, strict=True)),
                    f"largest ({unit})": float(np.nanmax(data.values[w, k])),
                    "median_error_percent": 100 * float(np.nanmedian(error[w, k])),
                })  # fmt: skip
        return pd.DataFrame(rows)

    def _page(self) -> str:
        from lightfield.report.light_figures import planes_figure
        from lightfield.report.result import result_page

        draw = [planes_figure] if "z_m" in self.details.dims else []
        return result_page(self, "Rendered light", *draw, scene_toml=self.details.attrs["scene_toml"])

    @checked
    def save(self, path: AnyPath) -> Path:
        """Write the maps as NetCDF; `Maps.load` reads them back."""
        return write_netcdf(self.details, Path(path))


def nearest_index(values: np.ndarray, wanted: float) -> int:
    """Where in an array the value lies that is nearest to the wanted one.

    Raises
    ------
    UsageError
        No number.
    """
    if not np.isscalar(wanted) or not np.isreal(wanted):
        raise UsageError("not what this argument takes", where="plot", found=wanted, rule="a number")
    return int(np.abs(values - wanted).argmin())


@told_in_notebook("render")
@checked
def render(
    scene: Scene | AnyPath,
    *,
    wavelengths: Sequence[float] | None = None,
    rel_error: float = OF_MAPS.rel_error,
    max_photons: float = OF_MAPS.max_photons,
    seed: int = 0,
    cache: bool = True,
) -> Maps:
    """Trace a scene: its light on the detector's planes or at its single positions.

    Parameters
    ----------
    scene : Scene or path-like
    wavelengths : sequence of float, nm, optional
        Default: one map per band of the detector, averaged over the band.
    rel_error : float
        Relative standard error asked of a trace, in 95 % of its lit cells.
    max_photons : float
        A trace ends there even if the error is not reached; filled up to whole batches.
    seed : int
        Same seed, same result: to the last bit on one thread, to single precision on several.
    cache : bool
        Look for the response on disk, and leave it there.

    Raises
    ------
    SceneError
        A scene that cannot be read.
    RenderError
        Impossible settings.
    BackendError
        Nothing to render on.
    """
    known = scene_of(scene)
    if wavelengths is not None:
        check_wavelengths(np.asarray(wavelengths, float).tolist(), "wavelengths", wavelengths)
        refuse_unlit_wavelengths(known, np.asarray(wavelengths, float), "wavelengths")
    single = known.detector.positions_m is not None
    made = (render_positions if single else render_scene)(
        known, rel_error=rel_error, max_photons=max_photons, seed=seed, cache=cache
    )
    return Maps(to_dataset(made, None if wavelengths is None else np.asarray(wavelengths, float)))
