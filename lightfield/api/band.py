"""Which band of wavelengths serves best: `band`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from os import fspath
from typing import TYPE_CHECKING

import pandas as pd
import xarray as xr

from lightfield.api.given import AnyPath, checked, scene_of
from lightfield.api.notebook import told_in_notebook
from lightfield.api.result import OverAxes, ToldInWords
from lightfield.render.limits import ON_AXIS
from lightfield.scene import Scene
from lightfield.studies import defaults
from lightfield.studies.band import study, text

if TYPE_CHECKING:
    from lightfield.report.style import Axes


class Band(OverAxes[study.Bands], ToldInWords[study.Bands]):
    """Which band of wavelengths serves best."""

    _words = text

    def plot(self, ax: Axes | None = None) -> Axes:
        """What is left of the lamp's light over wavelength, at every distance."""
        from lightfield.report.plots import plot_lines

        data = self.details.spectrum
        lines = {f"at {z:g} m": (data.signal.values[k], None) for k, z in enumerate(data.z_m.values)}
        words = ("wavelength (nm)", "of the largest", "What the detector sees of the lamp")
        return plot_lines(ax, data.wavelength_nm.values, lines, words)

    def to_xarray(self) -> xr.Dataset:
        """Over (z_m, low_nm): what each band is worth, by every rule."""
        return self.details.bands

    def summary(self) -> pd.DataFrame:
        """The best band by every rule."""
        return pd.DataFrame([asdict(best) for best in self.details.best])

    def _page(self) -> str:
        from lightfield.report.band import band_page

        return band_page(self.details)


@told_in_notebook("band")
@checked
def band(
    scene: Scene | AnyPath,
    *,
    distances: Sequence[float] | None = None,
    width: float = defaults.WIDTH_NM,
    between: tuple[float, float] = defaults.BETWEEN_NM,
    response: AnyPath | None = None,
    electrons: float = defaults.ELECTRONS,
    read_noise: float = defaults.READ_NOISE,
    mismatch: float = defaults.MISMATCH,
    trace: bool = True,
    rel_error: float = ON_AXIS.rel_error,
    max_photons: float = ON_AXIS.max_photons,
    seed: int = 0,
) -> Band:
    """Which band of wavelengths serves best.

    Parameters
    ----------
    scene : Scene or path-like
    distances : sequence of float, m, optional
        Default: the scene's first and last plane.
    width : float, nm
        Of the bands.
    between : (float, float), nm
        Where they may lie.
    response : path-like, optional
        CSV (wavelength_nm, response) of the detector; default: the scene's, or a typical silicon photodiode.
    electrons : float
        Of the brightest band at the nearest distance.
    read_noise : float
        Electrons.
    mismatch : float
        Spread of gains.
    trace : bool
        False: leave out what only the renderer knows.
    rel_error, max_photons, seed
        How well to trace.

    Raises
    ------
    UsageError, SceneError
        Numbers that make no sense; water, lamp or detector that are not known at these wavelengths.
    """
    noise = study.CountNoise(electrons, read_noise, mismatch)
    return Band(
        study.best_band(
            scene_of(scene), trace, noise, distances_m=distances, width_nm=width, low_nm=between[0],
            high_nm=between[1], response=None if response is None else fspath(response),
            rel_error=rel_error, max_photons=max_photons, seed=seed,
        )
    )  # fmt: skip
