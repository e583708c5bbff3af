"""What a follower's detectors can know of its pose: `lf.array.show`, `.compare`, `.optimise`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal, TypedDict

import numpy as np
import pandas as pd
import xarray as xr

from lightfield.api.given import AnyPath, by_name, checked, scene_of
from lightfield.api.result import OverAxes, ToldByDetails
from lightfield.errors import UsageError
from lightfield.formula.in_air import in_air
from lightfield.render.limits import FIELD_PHOTONS
from lightfield.scene import Scene
from lightfield.studies import defaults
from lightfield.studies.follower import survey
from lightfield.studies.follower.array_light import Space
from lightfield.studies.follower.design import compared, exchange
from lightfield.studies.follower.frames import printed
from lightfield.studies.follower.survey import DOCKING, DOCKING_ASKS

if TYPE_CHECKING:
    from lightfield.report.style import Axes

__all__ = ["Arrays", "Survey", "compare", "optimise", "show"]

Medium = Literal["water", "air"]


class SpaceAndLight(TypedDict):
    """Where the follower may be and how its light is traced, as keywords of the studies."""

    space: Space
    photons: float
    seed: int


def space_and_light(
    scene: Scene | AnyPath,
    half_width: float = defaults.HALF_WIDTH_M,
    medium: Medium = defaults.MEDIUM,
    max_photons: float = FIELD_PHOTONS,
    seed: int = 0,
    trace: bool = True,
) -> tuple[Scene, SpaceAndLight]:
    """A scene, and where the follower may be and how its light is traced, as the studies take it."""
    known = scene_of(scene)
    known = in_air(known) if medium == "air" else known
    space = Space.of_scene(known, half_width)
    return known, {"space": space, "photons": max_photons if trace else 0.0, "seed": seed}


def sigma_columns(sigma: Mapping[str, float]) -> dict[str, float]:
    """Standard deviations of a pose, given in m and rad, as columns in m and degrees."""
    return {f"sigma_{name}": value for name, value in printed(sigma).items()}


class Survey(OverAxes[survey.Survey], ToldByDetails[survey.Survey]):
    """What an array can know of its pose, here and over the formation space."""

    @property
    def headline(self) -> str:
        found = self.details
        return (
            f"{len(found.elements)} elements: docking ({DOCKING_ASKS}) is met in "
            f"{100 * found.reaches:.0f} % of the space"
        )

    def plot(self, ax: Axes | None = None) -> Axes:
        """The bound at the scene's pose over what docking allows."""
        from lightfield.report.plots import plot_ratios

        sigma = self.details.here.sigma
        parts = np.array([value / DOCKING[name] for name, value in sigma.items()])
        return plot_ratios(ax, list(sigma), parts, ("bound over what docking allows", "At the scene's pose"))

    def to_xarray(self) -> xr.Dataset:
        """Standard deviations over the formation space, dimensions (z_m, x_m), m and rad."""
        return self.details.space

    def _page(self) -> str:
        from lightfield.report.follower.page import survey_page

        return survey_page(self.details)


class Arrays(ToldByDetails[compared.Arrays]):
    """Arrays side by side, best first."""

    @property
    def headline(self) -> str:
        return self.details.verdict

    def plot(self, ax: Axes | None = None) -> Axes:
        """A, the sum of the variances of the pose, over that of the worst."""
        from lightfield.report.plots import plot_ratios

        arrays = self.details.arrays
        parts = np.array([one.criterion for one in arrays]) / arrays[-1].criterion
        return plot_ratios(ax, [one.name for one in arrays], parts, ("A over that of the worst", "Arrays"))

    def to_pandas(self) -> pd.DataFrame:
        """A row per array: A and the root mean square bounds over the poses of the task."""
        rows = [
            {
                "array": one.name,
                "elements": len(one.elements),
                "A": one.criterion,
                "A_relative_error": one.doubt,
            }
            | sigma_columns(one.sigma)
            for one in self.details.arrays
        ]
        return pd.DataFrame(rows)

    def _page(self) -> str:
        from lightfield.report.follower.page import arrays_page

        return arrays_page(self.details)


@checked
def show(
    scene: Scene | AnyPath,
    *,
    half_width: float = defaults.HALF_WIDTH_M,
    medium: Medium = defaults.MEDIUM,
    max_photons: float = FIELD_PHOTONS,
    seed: int = 0,
    trace: bool = True,
) -> Survey:
    """What the array can know of its pose, here and over the formation space.

    Parameters
    ----------
    scene : Scene or path-like
        With an [array].
    half_width : float, m
        Of the formation space in x and y; in z from the first to the last plane.
    medium : "water" or "air"
        "air": the tank empty, as a rehearsal on the bench has it.
    max_photons, seed
        Of the trace.
    trace : bool
        False: leave out what only the renderer knows.

    Raises
    ------
    SceneError, RenderError
        No array; a space that is not in the water.
    """
    known, where = space_and_light(scene, half_width, medium, max_photons, seed, trace)
    return Survey(survey.survey(known, **where))


@checked
def compare(
    scene: Scene | AnyPath,
    with_: Mapping[str, Scene | AnyPath],
    *,
    task: compared.Task = defaults.TASK,
    half_width: float = defaults.HALF_WIDTH_M,
    medium: Medium = defaults.MEDIUM,
    max_photons: float = FIELD_PHOTONS,
    seed: int = 0,
    trace: bool = True,
) -> Arrays:
    """Arrays of several scenes in the light of the first.

    Parameters
    ----------
    with_ : mapping of str to Scene or path-like
        By what they shall be called; only their arrays count.
    task : "formation" or "docking"
        Poses that count.
    scene, half_width, medium, max_photons, seed, trace
        As `show` takes them.

    Raises
    ------
    SceneError, RenderError
        No array; a space that is not in the water.
    """
    if not with_:
        raise UsageError("nothing to compare with", where="with_", rule='{"flat": "flat.toml"} and the like')
    known, where = space_and_light(scene, half_width, medium, max_photons, seed, trace)
    others = {name: scene_of(other) for name, other in with_.items()}
    by_name(
        [
            ("scene", known.name or "this array", known),
            *(("with_", name, other) for name, other in others.items()),
        ]
    )
    return Arrays(compared.compare_arrays(known, others, task=task, **where))


@checked
def optimise(
    scene: Scene | AnyPath,
    *,
    elements: int = defaults.ELEMENTS,
    box: float = defaults.BOX_M,
    tilt_max: float = defaults.TILT_MAX_DEG,
    spacing: float = defaults.SPACING_M,
    task: compared.Task = defaults.TASK,
    half_width: float = defaults.HALF_WIDTH_M,
    medium: Medium = defaults.MEDIUM,
    max_photons: float = FIELD_PHOTONS,
    seed: int = 0,
    trace: bool = True,
) -> Arrays:
    """The best places and tilts of so many elements.

    Parameters
    ----------
    elements : int
    box : float, m
        Side of the square they lie in.
    tilt_max : float, deg
        Largest tilt in x and in y.
    spacing : float, m
        Least distance of two.
    task : "formation" or "docking"
        Poses that count.
    scene, half_width, medium, max_photons, seed, trace
        As `show` takes them.

    Raises
    ------
    SceneError, RenderError
        No array; a space that is not in the water.
    """
    known, where = space_and_light(scene, half_width, medium, max_photons, seed, trace)
    room = exchange.Mounting(box, tilt_max, spacing)
    return Arrays(exchange.optimise_array(known, elements, room, task=task, **where))
