"""A camera view of the lit tank: `picture`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import xarray as xr

from lightfield.api.given import AnyPath, checked, scene_of
from lightfield.api.result import Result
from lightfield.errors import OutputError
from lightfield.render import picture as camera
from lightfield.render.settings import PICTURE_PATHS, PICTURE_SIZE
from lightfield.scene import Scene

if TYPE_CHECKING:
    from lightfield.report.style import Axes

_COLOURS = ("red", "green", "blue")


class Picture(Result[camera.Picture]):
    """A camera view: linear light, relative, for people to look at; no measurement."""

    @property
    def headline(self) -> str:
        return "; ".join([self._size, *map(str, self.details.notes)])

    @property
    def _size(self) -> str:
        height, width, _ = self.details.rgb.shape
        return f"a camera view of {width} x {height} pixels"

    def as_text(self) -> str:
        return "\n".join([self._size, *(f"note: {n}" for n in self.details.notes)])

    def as_data(self) -> dict[str, Any]:
        height, width, _ = self.details.rgb.shape
        return {
            "width": width,
            "height": height,
            "exposure": camera.exposure(self.details.rgb),
            "notes": [str(note) for note in self.details.notes],
            "shown_as": [note.as_data() for note in self.details.notes],
        }

    def plot(self, ax: Axes | None = None) -> Axes:
        """The view as the PNG shows it."""
        from lightfield.report.plots import plot_picture

        return plot_picture(ax, self.details)

    def to_xarray(self) -> xr.Dataset:
        """Linear light `rgb` over (row, column, colour), row 0 at the top, column 0 at the side of +x."""
        about = {
            "long_name": "linear light",
            "units": "1",
            "wavelengths_nm": self.details.wavelength_nm.tolist(),
        }
        light = xr.DataArray(
            self.details.rgb, dims=("row", "column", "colour"), coords={"colour": list(_COLOURS)}, attrs=about
        )
        return light.to_dataset(name="rgb").assign_attrs(notes="; ".join(map(str, self.details.notes)))

    def to_pandas(self) -> pd.DataFrame:
        """A row per pixel: row, column, and a column per colour."""
        row, column = (index.ravel() for index in np.indices(self.details.rgb.shape[:2]))
        colours = dict(zip(_COLOURS, self.details.rgb.reshape(-1, 3).T, strict=True))
        return pd.DataFrame({"row": row, "column": column} | colours)

    def summary(self) -> pd.DataFrame:
        """A row per colour: wavelength, middle and largest light."""
        flat = self.details.rgb.reshape(-1, 3)
        return pd.DataFrame({
            "colour": _COLOURS,
            "wavelength_nm": self.details.wavelength_nm,
            "median": np.median(flat, axis=0),
            "largest": flat.max(axis=0),
        })  # fmt: skip

    def _page(self) -> str:
        from lightfield.report.result import result_page

        return result_page(self, "Camera view")

    @checked
    def save(self, path: AnyPath) -> Path:
        """Write the view as PNG and, beside it, its linear light as EXR.

        Raises
        ------
        OutputError
            The name does not end in .png, or it cannot be written.
        """
        from lightfield.report.light_figures import write_picture

        target = Path(path)
        if target.suffix.lower() != ".png":
            raise OutputError("the picture is a PNG file", where=str(target), remedy="end it in .png")
        return write_picture(self.details, target)[0]


@checked
def picture(
    scene: Scene | AnyPath,
    *,
    size: tuple[int, int] = PICTURE_SIZE,
    samples: int = PICTURE_PATHS,
    seed: int = 0,
    as_is: bool = False,
) -> Picture:
    """Look along the lit tank from behind the lamp.

    Parameters
    ----------
    scene : Scene or path-like
    size : (int, int)
        Width and height, pixels.
    samples : int
        Paths per pixel and colour.
    seed : int
    as_is : bool
        Lend nothing: black walls stay black, clear water stays clear.

    Raises
    ------
    SceneError
        A scene that cannot be read.
    RenderError
        Impossible numbers.
    BackendError
        Nothing to render on.
    """
    width, height = size
    return Picture(
        camera.take_picture(
            scene_of(scene), width=width, height=height, samples=samples, seed=seed, lend=not as_is
        )
    )
