"""Which effect is missing: `diagnose`, and `plan` before anything is measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lightfield.api.given import AnyPath, checked, diffuse_source, names_in, readings_of, scene_of
from lightfield.api.notebook import told_in_notebook
from lightfield.api.result import Result, ToldByDetails
from lightfield.diagnosis import diagnose as diagnosing
from lightfield.diagnosis import expected
from lightfield.diagnosis import plan as planning
from lightfield.diagnosis.adequacy.level import ALPHA
from lightfield.diagnosis.search.told_apart import DETECTABLE_SIGMA, SAME_CLASS_SIGMA
from lightfield.diagnosis.together import together
from lightfield.diagnosis.verdict.speech import join
from lightfield.diagnosis.verdict.verdict import Verdict
from lightfield.errors import UsageError
from lightfield.readings import Readings
from lightfield.report.diagnosis.drawn import view_of
from lightfield.scene import Scene

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from lightfield.report.style import Axes

#: Of a rung, what a notebook shows.
_LADDER = {
    "label", "error_percent", "chi2_per_dof", "held_out_percent", "removed_percent",
    "rendered_error_percent", "rendered_stderr_percent",
}  # fmt: skip


class Diagnosis(Result[diagnosing.Diagnosis]):
    """What `diagnose` found."""

    _sent_instead = "its .verdict or .scene, and write its .report(path) where it was made"

    @property
    def verdict(self) -> Verdict:
        """All that it says, as data: `verdict.effects`, `verdict.found`, `verdict.ladder`, ..."""
        return self.details.verdict

    @property
    def effects(self) -> list[str]:
        """The best explanation; empty where nothing is named."""
        return self.verdict.effects

    @property
    def scene(self) -> Scene:
        """The explained scene: that of the last rung of the ladder, with its fitted values."""
        return self.details.scene

    @property
    def headline(self) -> str:
        return self.verdict.headline

    def as_text(self) -> str:
        return self.details.as_text()

    def as_data(self) -> dict[str, Any]:
        return self.verdict.model_dump(mode="json")

    def plot(self, ax: Axes | None = None) -> Axes:
        """The ladder: the error of every rung, and the noise."""
        from lightfield.report.plots import plot_ladder

        return plot_ladder(ax, self.verdict.ladder, self.verdict.noise_floor_percent)

    def to_pandas(self) -> pd.DataFrame:
        """A row per reading: place, value with the error used, base and explained model, what is left."""
        import pandas as pd

        found, readings = self.details, self.details.readings
        steps = found.steps
        return readings.to_pandas().assign(
            sigma=found.sigma,
            base_model=steps[0].fit.prediction,
            model=steps[-1].fit.prediction,
            residual_sigma=(readings.value - steps[-1].fit.prediction) / found.sigma,
            left_out=pd.Series(found.prepared.problem.keep == 0),
        )

    def summary(self) -> pd.DataFrame:
        """The ladder."""
        import pandas as pd

        rows = [rung.model_dump(include=_LADDER) for rung in self.verdict.ladder]
        return pd.DataFrame(rows).dropna(axis="columns", how="all")

    def _page(self) -> str:
        from lightfield.report.diagnosis.page import diagnosis_page

        return diagnosis_page(view_of(self.details))

    @checked
    def save(self, folder: AnyPath) -> Diagnosis:
        """Write verdict, one scene per rung and fitted curves, and add the run to the folder's ledger.

        Returns
        -------
        Diagnosis
            The same, with its number in the ledger.
        """
        return Diagnosis(self.details.save(Path(folder)))


@checked
def diagnose(
    readings: Readings | AnyPath,
    scene: Scene | AnyPath,
    *,
    effects: str | Sequence[str] | None = None,
    effects_file: AnyPath | None = None,
    alpha: float = ALPHA,
    seed: int = 0,
    trace: bool = True,
    render: bool = True,
) -> Diagnosis:
    """Find the physical effect that readings show and the model lacks.

    Parameters
    ----------
    readings : Readings or path-like
    scene : Scene or path-like
        What the experimenter believes. Gain, beam half width and absorption are refitted; an effect that the
        scene switches on stays on.
    effects : str or sequence of str, optional
        Names of the effects to consider; default: the whole table.
    effects_file : path-like, optional
        Effects of your own, beside those of the table (TOML).
    alpha : float
        False-alarm probability of the test of the base model.
    seed : int
        Of the bootstrap.
    trace : bool
        False: leave out what only the renderer knows: scattering, walls, surface.
    render : bool
        Render the explained scene afresh at the end, and add its error to the ladder.

    Raises
    ------
    FitError
        Too few readings, or too many for one diagnosis.
    MeasurementError, SceneError
        Readings or a scene that cannot be read, or that do not belong together.
    UsageError
        Unknown effect.
    """
    if effects is not None and not names_in(effects):
        raise UsageError(
            "no effect is named", where="effects", rule="names of effects, or none for all of them"
        )
    known = scene_of(scene, effects_file)
    with told_in_notebook("diagnose") as stage:
        found = diagnosing.diagnose(
            readings_of(readings, known), known, diffuse="trace" if trace else None,
            only=None if effects is None else names_in(effects), alpha=alpha, seed=seed, progress=stage,
        )  # fmt: skip
        if trace and render and found.steps[1:]:
            stage("rendering the explained scene afresh")
            found = found.rendered()
    return Diagnosis(found)


class Plan(Result[planning.LayoutPlan]):
    """What a layout can detect and tell apart."""

    @property
    def headline(self) -> str:
        limits, classes = self.details.limits.values(), self.details.isolability.classes()
        seen = sum(limit.reachable for limit in limits)
        alike = "; not told apart: " + "; ".join(map(join, classes)) if classes else ""
        return f"{self.details.readings} readings can show {seen} of {len(limits)} effects{alike}"

    def as_text(self) -> str:
        return planning.as_text(self.details)

    def as_data(self) -> dict[str, Any]:
        return planning.as_data(self.details)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Which effects are not surely told apart, and by how many sigma: row true, column fitted."""
        from lightfield.report.plots import plot_distances

        found = self.details.isolability
        return plot_distances(ax, found.names, found.D, found.delta, SAME_CLASS_SIGMA, DETECTABLE_SIGMA)

    def to_pandas(self) -> pd.DataFrame:
        """A row per effect: the smallest size that would be found with 95 % probability."""
        import pandas as pd

        rows = [
            {
                "effect": name,
                "parameter": limit.path,
                "smallest": limit.value,
                "unit": self.details.units.get(limit.path, "1"),
                "within_range": limit.reachable,
            }
            for name, limit in sorted(self.details.limits.items())
        ]
        return pd.DataFrame(rows, columns=["effect", "parameter", "smallest", "unit", "within_range"])

    def to_xarray(self) -> xr.Dataset:
        """Distances `D_sigma` between the effects (true, fitted), and `delta_sigma` from the base model."""
        import xarray as xr

        found = self.details.isolability
        names = list(found.names)
        return xr.Dataset(
            {
                "D_sigma": (("true", "fitted"), np.asarray(found.D)),
                "delta_sigma": ("true", np.asarray(found.delta)),
                "size": ("true", np.asarray(found.sizes)),
            },
            coords={"true": names, "fitted": names},
        )

    def _page(self) -> str:
        from lightfield.report.result import result_page

        return result_page(self, "What the layout can tell")


class Together(ToldByDetails[expected.Together]):
    """Which of several effects that act at once a layout would make certain."""

    @property
    def headline(self) -> str:
        return self.details.headline

    def plot(self, ax: Axes | None = None) -> Axes:
        """The chance of every effect to be certain."""
        from lightfield.report.plots import plot_chances

        found = self.details.expected
        chances = np.array([one.certain for one in found])
        return plot_chances(ax, [one.effect for one in found], chances, "chance to be certain")

    def to_pandas(self) -> pd.DataFrame:
        """A row per effect: sigma to remove, gap, chances, level."""
        import pandas as pd

        chances = ["chance_of_certain", "chance_of_certain_or_simplest"]
        columns = ["effect", "sigma_to_remove", "gap", *chances, "level"]
        return pd.DataFrame(self.as_data()["effects"])[columns]

    def _page(self) -> str:
        from lightfield.report.together import together_page

        return together_page(self.details)


@checked
@told_in_notebook("plan")
def plan(
    layout: Readings | AnyPath,
    scene: Scene | AnyPath,
    *,
    effects: str | Sequence[str] | None = None,
    size: Mapping[str, float] | None = None,
    effects_file: AnyPath | None = None,
    trace: bool = True,
) -> Plan | Together:
    """What a measurement layout can detect and tell apart, before measuring.

    Parameters
    ----------
    layout : Readings or path-like
        Positions, times and, if known, standard errors; values are not used and may be absent.
    scene : Scene or path-like
        Its lamp, water and tank are taken to be true.
    effects : str or sequence of str, optional
        Which of these, all acting at once, would be certain? Default: every effect alone, and pairs.
    size : mapping of str to float, optional
        Values of parameters of these effects; default: twice the typical size.
    effects_file : path-like, optional
        Effects of your own, beside those of the table (TOML).
    trace : bool
        False: leave out what only the renderer knows: scattering, walls, surface.

    Raises
    ------
    FitError
        No light of the scene reaches the layout.
    UsageError
        An effect that is unknown or cannot act here; a size without effects.
    MeasurementError, SceneError
        A layout or a scene that cannot be read, or that do not belong together.
    """
    known = scene_of(scene, effects_file)
    table = readings_of(layout, known, layout=True)
    if effects is not None:
        if not effects:
            raise UsageError("no effect is named", where="effects", rule="one at least")
        return Together(together(table, known, names_in(effects), size, diffuse_source(trace)))
    if size:
        raise UsageError("a size of no effect", where="size", rule="together with effects")
    return Plan(planning.plan(table, known, diffuse_source(trace)))
