"""Rendered light: on every plane, and as a camera sees it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from lightfield.arrays import Array, evenly
from lightfield.maps.dataset import brightest
from lightfield.maps.exr import write_rgb_exr
from lightfield.render.picture import Picture, as_seen, exposure
from lightfield.report.style import MUTED, NARROW, SHORT_UNITS, extent_of, figure, save_pixels
from lightfield.version import __version__
from lightfield.wording import plain

_DECADES = 4.0
_PARTS = (0.5, 0.1, 0.01)
#: Height over width that a map is given room for at least.
_LEAST_TALL = 0.3


def planes_figure(dataset: xr.Dataset, narrow: bool = False) -> Figure:
    """Maps on a common logarithmic scale, up to three wavelengths as rows, up to five planes as columns.

    What is left out is said. `narrow`: the brightest wavelength, up to three planes as rows.

    Parameters
    ----------
    dataset : xarray.Dataset
        From `lightfield.maps.dataset.to_dataset`.
    """
    quantity = dataset.attrs["quantity"]
    planes = evenly(dataset.sizes["z_m"], 3 if narrow else 5)
    waves = [brightest(dataset[quantity])] if narrow else evenly(dataset.sizes["wavelength_nm"], 3)
    values = dataset[quantity].values
    x, y, top = dataset.x_m.values, dataset.y_m.values, float(np.nanmax(values))
    shape = (len(planes), 1) if narrow else (len(waves), len(planes))
    tall = _LEAST_TALL if x.size < 2 or y.size < 2 else max(np.ptp(y) / np.ptp(x), _LEAST_TALL)
    size = (
        (NARROW, 0.9 + (0.5 + 2.1 * tall) * len(planes))
        if narrow
        else (max(4.4, 1.4 + 1.74 * len(planes)), 0.9 + (0.35 + 1.25 * tall) * len(waves))
    )
    with figure(*size) as fig:
        axes = fig.subplots(*shape, squeeze=False, sharex=True, sharey=True)
        axes = axes.reshape(len(waves), len(planes))
        for row, wave in enumerate(waves):
            for column, plane in enumerate(planes):
                axis, light = axes[row, column], values[wave, plane]
                shown = light_map(axis, x, y, light, top)
                least, most = float(np.nanmin(light)), float(np.nanmax(light))
                levels = sorted(part * most for part in _PARTS)
                if x.size > 1 and y.size > 1 and least < levels[-1] < most:
                    axis.contour(x, y, light, levels=levels, colors="white", linewidths=0.7, alpha=0.8)
                axis.tick_params(labelsize=8.5)
                if row == 0 or narrow:
                    axis.set_title(f"z = {float(dataset.z_m[plane]):g} m", loc="center")
            axes[row, 0].set_ylabel(f"{float(dataset.wavelength_nm[wave]):g} nm\n\ny (m)")
        for axis in axes[-1, -1:] if narrow else axes[-1]:
            axis.set_xlabel("x (m)")
        bar = fig.colorbar(shown, ax=axes, extend="min", pad=0.015, aspect=20)
        unit = dataset[quantity].attrs["units"]
        bar.set_label(f"{plain(quantity)}, {SHORT_UNITS.get(unit, unit)}", fontsize=9)
        words = ["Looking at the lamp", "contours: 50 %, 10 % and 1 % of the plane's maximum"]
        for shown_, there, name in (
            (len(planes), dataset.sizes["z_m"], "planes"),
            (len(waves), dataset.sizes["wavelength_nm"], "wavelengths"),
        ):
            words += [f"{shown_} of {there} {name}"] if shown_ < there else []
        fig.supxlabel(("\n" if narrow else "; ").join(words), fontsize=9, color=MUTED)
    return fig


def light_map(axis: Axes, x_m: Array, y_m: Array, light: Array, top: float) -> AxesImage:
    """Draw light on a plane, on a logarithmic scale that ends at the top."""
    axis.grid(False)
    return axis.imshow(
        np.maximum(light, top / 10 ** (_DECADES + 1)) if top > 0 else light, origin="lower", cmap="magma",
        norm=LogNorm(top / 10**_DECADES, top) if top > 0 else None, extent=extent_of(x_m, y_m),
    )  # fmt: skip


def write_picture(taken: Picture, path: Path) -> tuple[Path, Path]:
    """Write a camera view as PNG and, exposed alike, its linear light as EXR beside it, each whole."""
    about = {
        "orientation": "seen along the beam (+z) from behind the lamp: first row is up, columns run with -x",
        "wavelength_nm": ", ".join(f"{nm:.1f}" for nm in taken.wavelength_nm),
        "lightfield_version": __version__,
    }
    return (
        save_pixels(as_seen(taken), path),
        write_rgb_exr(taken.rgb, exposure(taken.rgb), path, [str(note) for note in taken.notes], about),
    )
