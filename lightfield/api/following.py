"""How a follower fares that finds its way by the light: `follow`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import pandas as pd
import xarray as xr

from lightfield.api.given import AnyPath, by_name, checked, names_in, scene_of
from lightfield.api.notebook import told_in_notebook
from lightfield.api.result import ToldByDetails
from lightfield.arrays import finite
from lightfield.errors import UsageError, did_you_mean
from lightfield.render.limits import FIELD_PHOTONS
from lightfield.scene import Scene
from lightfield.studies.defaults import RUNS
from lightfield.studies.following import study

if TYPE_CHECKING:
    from lightfield.report.style import Axes


class Following(ToldByDetails[study.Following]):
    """Runs of the closed loop, of one follower or of several."""

    @property
    def headline(self) -> str:
        return self.details.verdict

    def plot(self, ax: Axes | None = None) -> Axes:
        """Distance from the lamp over time, of every follower's typical run."""
        from lightfield.report.plots import plot_lines

        cases = self.details.cases
        lines = {
            f"{one.name}, {one.mission.believes}": (one.track.pose[:, one.typical, 2], None) for one in cases
        }
        words = ("time (s)", "distance from the lamp (m)", "Typical runs")
        return plot_lines(ax, cases[0].track.time_s, lines, words)

    def to_xarray(self) -> xr.Dataset:
        """The first follower's runs over (time_s, run, coordinate)."""
        return self.details.cases[0].dataset()

    def to_pandas(self) -> pd.DataFrame:
        """A row per follower, run and metric; units beside it."""
        rows = [
            {
                "scene": one.name,
                "believes": one.mission.believes,
                "run": run,
                "metric": name,
                "value": finite(value),
                "unit": study.METRICS[name][0],
            }
            for one in self.details.cases
            for name, values in one.runs.items()
            for run, value in enumerate(values)
        ]
        return pd.DataFrame(rows)

    def _page(self) -> str:
        from lightfield.report.follower.follow_page import following_page

        return following_page(self.details)


def beliefs_in(names: str | Sequence[str]) -> list[str]:
    """Kinds of light that a follower believes in; with commas between them in one string.

    Raises
    ------
    UsageError
        One that does not exist.
    """
    beliefs = names_in(names)
    for name in beliefs:
        if name not in study.BELIEFS:
            raise UsageError(
                "no such belief", where="believe", found=name, rule=", ".join(study.BELIEFS),
                remedy=did_you_mean(name, study.BELIEFS) or "one or more of these",
            )  # fmt: skip
    return beliefs


@checked
@told_in_notebook("follow")
def follow(
    scene: Scene | AnyPath,
    *,
    with_: Sequence[Scene | AnyPath] = (),
    believe: str | Sequence[str] = (),
    runs: int = RUNS,
    duration: float | None = None,
    max_photons: float = FIELD_PHOTONS,
    seed: int = 0,
    trace: bool = True,
) -> Following:
    """Let a follower run the mission of a scene in the closed loop.

    Parameters
    ----------
    scene : Scene or path-like
        With an array; its `follower.mission` says what is to be done.
    with_ : sequence of Scene or path-like
        Other scenes to run beside it.
    believe : str or sequence of str
        Light it believes in: "field", "fitted", "exact", "clear", "relative"; default: as each scene says.
    runs : int
        With noise, gain, water and lamp's direction of their own, as far as the scene says that they
        are not known.
    duration : float, s, optional
        Of a run; default: as each scene says.
    max_photons : float
    seed : int
    trace : bool
        False: the formula's light alone.

    Raises
    ------
    UsageError
        A belief that does not exist, no run, or two scenes of one name.
    SceneError, RenderError
        No array; a follower or a way that is not in the water.
    """
    beliefs = beliefs_in(believe)
    every = [study.with_belief(scene_of(one), "") for one in (scene, *with_)]
    if duration is not None:
        every = [one.with_values({"follower.mission.duration_s": duration}) for one in every]
    scenes = by_name(
        ("with_" if number > 1 else "scene", one.name or f"scene {number}", one)
        for number, one in enumerate(every, 1)
    )
    photons = max_photons if trace else 0.0
    return Following(study.follow(scenes, beliefs, runs=runs, seed=seed, photons=photons))
