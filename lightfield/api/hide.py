"""Readings with an effect hidden in them, to test a diagnosis or a person: `hide`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lightfield.api.given import AnyPath, checked, names_in, scene_of
from lightfield.api.notebook import told_in_notebook
from lightfield.api.result import Result
from lightfield.experiments import hide as hiding
from lightfield.experiments.layouts import layout_named
from lightfield.experiments.measure import Instrument
from lightfield.readings import Readings
from lightfield.render.limits import MADE_PHOTONS
from lightfield.scene import Scene
from lightfield.storage.files import locked_folder
from lightfield.studies.defaults import HIDDEN_NOISE

if TYPE_CHECKING:
    import pandas as pd

    from lightfield.report.style import Axes

__all__ = ["Riddle", "hide"]


class Riddle(Result[hiding.Hidden]):
    """Readings, and the scene that their experimenter believes; what it says gives no secret away."""

    @property
    def readings(self) -> Readings:
        """What was read."""
        return self.details.readings

    @property
    def scene(self) -> Scene:
        """What the experimenter believes."""
        return self.details.believed

    @property
    def truth(self) -> dict[str, Any]:
        """What was hidden, with all parameters: what the command writes to truth.json."""
        return dict(self.details.truth)

    @property
    def headline(self) -> str:
        readings = self.details.readings
        planes = np.unique(readings.z_m).size
        at = f"{planes} distance{'s' * (planes != 1)}"
        return f"{len(readings)} readings at {at}; what is hidden in them stands in .truth"

    def as_text(self) -> str:
        known = f"the light is known to {self.details.truth['light_error_percent']:.2g} %"
        doubt = self.details.in_doubt
        warned = "" if doubt is None else f"\nwarning: {doubt} (max_photons)"
        return f"{self.headline}\n{known}, stated with the errors{warned}"

    def as_data(self) -> dict[str, Any]:
        """Table, scene and where the render's own error is larger than the noise; not the truth."""
        doubt = self.details.in_doubt
        return {
            "light_in_doubt": None if doubt is None else doubt.as_data(),
            "scene_toml": self.details.believed.to_toml(),
            "readings": self.to_pandas().to_dict("records"),
        }

    def plot(self, ax: Axes | None = None) -> Axes:
        """The readings against their distance from the lamp."""
        from lightfield.report.plots import plot_readings

        return plot_readings(ax, self.details.readings)

    def to_pandas(self) -> pd.DataFrame:
        """The table of readings."""
        return self.details.readings.to_pandas()

    def _page(self) -> str:
        from lightfield.report.result import result_page

        return result_page(self, "A riddle", scene_toml=self.details.believed.to_toml())

    @checked
    def save(self, folder: AnyPath) -> Path:
        """Write scene.toml and data.csv, and beside them truth.json, which says what was hidden.

        Raises
        ------
        OutputError
            Files of an experiment that is no riddle are there, or the folder cannot be written.
        """
        with locked_folder(folder) as target:
            return self.details.save(target)


@checked
@told_in_notebook("hide")
def hide(
    scene: Scene | AnyPath,
    *,
    effect: str | Sequence[str] = (),
    lamp: AnyPath | None = None,
    size: Mapping[str, float] | None = None,
    effects_file: AnyPath | None = None,
    strength: float | None = None,
    seed: int = 0,
    layout: AnyPath | Readings | None = None,
    noise: float = HIDDEN_NOISE,
    plane_gain: float = 0.0,
    position: float = 0.0,
    plane_order: bool = False,
    to_and_fro: bool = False,
    max_photons: float = MADE_PHOTONS,
) -> Riddle:
    """Make readings with effects hidden in them, through the full render.

    Parameters
    ----------
    scene : Scene or path-like
        What the experimenter believes; every band is read.
    effect : str or sequence of str
        Effects to hide, "name" or "name:form", or "unknown:ripple" and the like. Without any, what every
        measurement has: a guess of width and absorption that is 10 to 25 % wrong.
    lamp : path-like, optional
        Table of the true lamp's intensity against the angle, whatever the scene believes.
    size : mapping of str to float, optional
        By dotted path, sizes that would be drawn.
    effects_file : path-like, optional
        Effects of your own, beside those of the table (TOML).
    strength : float, optional
        Size over the effect's typical size, else drawn.
    seed : int
    layout : str, path-like or Readings, optional
        line, half, grid, fine, column or air, or a table (CSV) with the places to read; default: line, or the
        positions that the scene lists.
    noise : float
        Relative noise of a reading.
    plane_gain : float, %
        Error of every stay at a plane, stated with the readings.
    position : float, mm
        Error of every position, stated with the readings.
    plane_order : bool
        Read plane by plane instead of in random order.
    to_and_fro : bool
        So too, every other row along x from its other end.
    max_photons : float
        Of the render; what it leaves unknown is stated with the errors.

    Raises
    ------
    UsageError
        Unknown effect or layout, an effect that cannot act here, a size that hides one more, or numbers that
        no measurement has.
    SceneError, RenderError, BackendError
        A scene that cannot be read or rendered.
    """
    names, believed = names_in(effect), scene_of(scene, effects_file)
    hiding.check_request(names, strength, noise, plane_gain, position)
    secret = hiding.Secret(names, strength, dict(size or {}), None if lamp is None else fspath(lamp))
    made = hiding.hide(
        believed,
        secret,
        seed,
        Instrument(noise, plane_gain=plane_gain / 100, position_m=position / 1000),
        layout=layout if isinstance(layout, Readings) else layout_named(layout, believed),
        order="rows" if to_and_fro else "plane" if plane_order else "random",
        max_photons=max_photons,
    )
    return Riddle(made)
