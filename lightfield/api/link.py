"""How far the lamp carries data, and is seen: `link`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import xarray as xr

from lightfield.api.given import AnyPath, checked, scene_of
from lightfield.api.notebook import told_in_notebook
from lightfield.api.result import OverAxes, ToldInWords
from lightfield.errors import UsageError
from lightfield.render.limits import ON_AXIS
from lightfield.scene import Scene
from lightfield.studies import defaults
from lightfield.studies.link import study as linking
from lightfield.studies.link import text as link_text
from lightfield.studies.link.receiver import Receiver

if TYPE_CHECKING:
    from lightfield.report.style import Axes


class Link(OverAxes[linking.Link], ToldInWords[linking.Link]):
    """How far the lamp carries data, and is seen."""

    _words = link_text

    def plot(self, ax: Axes | None = None) -> Axes:
        """Received power against distance, a line per water; dashed: the formula."""
        from lightfield.report.plots import plot_lines

        data, lines, dashed = self.details.dataset, {}, []
        for k, name in enumerate(str(n) for n in data.water.values):
            lines[name] = (data.power_w.values[k], data.power_stderr_w.values[k])
            lines[f"{name}, formula"] = (data.power_formula_w.values[k], None)
            dashed.append(f"{name}, formula")
        words = ("z (m)", "W", "Received power")
        return plot_lines(ax, data.z_m.values, lines, words, log=True, dashed=dashed)

    def to_xarray(self) -> xr.Dataset:
        """Over (water, z_m): power, errors per bit, bandwidth, of the render and of the formula."""
        return self.details.dataset

    def summary(self) -> pd.DataFrame:
        """How far, in every water."""
        rows = []
        for name, reach in self.details.reaches.items():
            told, dock = {"water": name, **asdict(reach)}, reach.docking
            del told["docking"]
            docking = {"docking_m": dock.z_m, "docking_stderr_m": dock.stderr_m}
            rows.append({**told, **docking, "docking_formula_m": dock.formula_m})
        return pd.DataFrame(rows)

    def _page(self) -> str:
        from lightfield.report.link import link_page

        return link_page(self.details)


@checked
@told_in_notebook("link")
def link(
    scene: Scene | AnyPath,
    *,
    area: float = Receiver.area_mm2,
    responsivity: float = Receiver.responsivity_a_per_w,
    amplifier_noise: float = Receiver.noise_a_per_sqrt_hz,
    background: float = Receiver.background_a,
    bit_rate: float = Receiver.bit_rate_per_s,
    ber: float = Receiver.ber,
    water: Mapping[str, tuple[float, float]] | None = None,
    to: float = defaults.LINK_TO_M,
    rel_error: float = ON_AXIS.rel_error,
    max_photons: float = ON_AXIS.max_photons,
    seed: int = 0,
) -> Link:
    """How far the lamp carries data, and is seen, in clear and turbid water.

    Parameters
    ----------
    scene : Scene or path-like
        A tank is left out. Of the lamp's power that part counts which is read in the detector's first band.
    area : float, mm2
        Of the photodiode.
    responsivity : float, A/W
        Mean over the band.
    amplifier_noise : float, A Hz^-0.5
    background : float, A
        Photocurrent of ambient light, and dark current.
    bit_rate : float, bits per second
    ber : float
        Errors per bit that are accepted.
    water : mapping of str to (absorption, scattering), 1/m, optional
        To compare with; default: a clear and a turbid one.
    to : float, m
        Farthest distance.
    rel_error, max_photons, seed
        How well to trace.

    Raises
    ------
    UsageError, SceneError
        Numbers that make no sense; a lamp that is no beam.
    """
    for name, pair in (water or {}).items():
        if isinstance(pair, str) or np.shape(pair) != (2,):
            rule = "absorption and scattering in 1/m: {name: (0.1, 0.2)}"
            raise UsageError("not a water", where=f"water {name}", found=pair, rule=rule)
    receiver = Receiver(area, responsivity, amplifier_noise, background, bit_rate, ber)
    found = linking.link(
        scene_of(scene), receiver, waters=water, to_m=to,
        rel_error=rel_error, max_photons=max_photons, seed=seed,
    )  # fmt: skip
    return Link(found)
