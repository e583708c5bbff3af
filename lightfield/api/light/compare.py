"""Light against the closed-form model: `compare`, with the render of a scene or with readings."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any, cast, overload

import numpy as np
import pandas as pd
import xarray as xr

from lightfield.api.given import AnyPath, checked, diffuse_source, names_in, readings_of, scene_of
from lightfield.api.light.maps import Maps, nearest_index, render
from lightfield.api.notebook import told_in_notebook
from lightfield.api.result import Result
from lightfield.errors import UsageError
from lightfield.maps.dataset import lacking
from lightfield.readings import Readings
from lightfield.render.limits import SEED
from lightfield.render.settings import Tracing
from lightfield.scene import Scene
from lightfield.studies.compare import maps as comparing
from lightfield.studies.compare import readings as fitting
from lightfield.studies.compare import text
from lightfield.studies.compare.in_a_sentence import in_a_sentence
from lightfield.studies.defaults import SOLVER
from lightfield.wording import rounded

if TYPE_CHECKING:
    from lightfield.report.style import Axes


class Comparison(Result[comparing.Comparison]):
    """Render against formula, plane by plane."""

    def __init__(self, details: comparing.Comparison, maps: Maps) -> None:
        super().__init__(details)
        self.maps = maps

    @property
    def headline(self) -> str:
        return in_a_sentence(self.details)

    def as_data(self) -> dict[str, Any]:
        return self.details.as_data()

    def plot(self, ax: Axes | None = None, *, wavelength_nm: float | None = None) -> Axes:
        """Error of the formula against the radius, a line per plane, with three standard errors.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
        wavelength_nm : float, optional
            The wavelength nearest to this; default: the brightest.
        """
        from lightfield.report.plots import plot_formula_error

        known, wave = np.array(self.details.wavelengths_nm), self.details.brightest_nm
        if wavelength_nm is not None:
            wave = float(known[nearest_index(known, wavelength_nm)])
        return plot_formula_error(ax, self.details.at(wave))

    def to_pandas(self) -> pd.DataFrame:
        """A row per plane and wavelength: errors on the axis, lost light, spots, each with its error."""
        return pd.DataFrame([plane.as_data() for plane in self.details.planes])

    def to_xarray(self) -> xr.Dataset:
        """The maps with `formula`, in the unit of the maps, beside them."""
        data, dims = self.maps.details, ("wavelength_nm", "z_m", "y_m", "x_m")
        waves, depths = data.wavelength_nm.values, data.z_m.values
        planes = {(p.wavelength_nm, p.z_m): p.formula for p in self.details.planes}
        formula = np.array([[planes[float(w), float(z)] for z in depths] for w in waves])
        about = {"units": self.details.units, "long_name": "closed-form model, mean over each cell"}
        return data.assign(formula=(dims, formula, about))

    def summary(self) -> pd.DataFrame:
        """Errors on the axis and lost light."""
        names = ["wavelength_nm", "z_m", "axis_error", "axis_error_stderr", "lost", "lost_stderr"]
        return self.to_pandas()[names]

    def _page(self) -> str:
        from lightfield.report.compare.page import comparison_page

        return comparison_page(self.details, self.maps.details.attrs)


class Fit(Result[fitting.FitReport]):
    """A model refitted to readings, and where it fails."""

    _sent_instead = "its .scene, .as_data() or .to_pandas(), and write its .report(path) where it was made"

    @property
    def scene(self) -> Scene:
        """The fitted scene."""
        return self.details.model.scene

    @property
    def headline(self) -> str:
        model, found = self.details.model, self.details.statistics
        name = " + ".join(["base", *model.effects])
        error, misfit = found.error_percent, f"chi-square per degree of freedom {found.chi2_per_dof:.3g}"
        if np.isnan(error):
            return f"{name} is dark where the readings are bright, {misfit}"
        return f"{name} follows the readings to {rounded(error)} %, {misfit}"

    def as_text(self) -> str:
        return text.as_text(self.details)

    def as_data(self) -> dict[str, Any]:
        return text.as_data(self.details)

    def plot(self, ax: Axes | None = None) -> Axes:
        """What is left of every reading, in standard errors, against the distance from the lamp."""
        from lightfield.report.plots import plot_residuals

        return plot_residuals(ax, self.details.model.forward.readings, self.details.residuals.sigma)

    def to_pandas(self) -> pd.DataFrame:
        """A row per reading: place, value, fitted model, what is left."""
        left = self.details.residuals
        return self.details.model.forward.readings.to_pandas().assign(
            model=self.details.model.fit.prediction, residual_percent=left.percent, residual_sigma=left.sigma
        )

    def summary(self) -> pd.DataFrame:
        """The fitted parameters."""
        found = self.details.estimates.items()
        return pd.DataFrame([{"parameter": path, **estimate.model_dump()} for path, estimate in found])

    def _page(self) -> str:
        from lightfield.report.result import result_page

        return result_page(self, "Model against readings", scene_toml=self.scene.to_toml())


@overload
def compare(
    what: Scene | Maps | xr.Dataset | AnyPath, scene: None = None, *, rel_error: float | None = None,
    max_photons: float | None = None, seed: int | None = None, cache: bool = True,
) -> Comparison: ...  # fmt: skip
@overload
def compare(
    what: Readings | AnyPath, scene: Scene | AnyPath, *, with_: str | Sequence[str] = (),
    effects_file: AnyPath | None = None, solver: str = SOLVER, trace: bool = True,
    rel_error: float | None = None, max_photons: float | None = None, seed: int | None = None,
    cache: bool = True,
) -> Fit: ...  # fmt: skip
@told_in_notebook("compare")
@checked
def compare(
    what: Scene | Maps | xr.Dataset | Readings | AnyPath,
    scene: Scene | AnyPath | None = None,
    *,
    with_: str | Sequence[str] = (),
    effects_file: AnyPath | None = None,
    solver: str = SOLVER,
    trace: bool = True,
    rel_error: float | None = None,
    max_photons: float | None = None,
    seed: int | None = None,
    cache: bool = True,
) -> Comparison | Fit:
    """The closed-form model against the render of a scene; with `scene`, a model against readings.

    Parameters
    ----------
    what : Scene, Maps, xarray.Dataset, Readings or path-like
        A scene to render, maps (or their data set) as they are, or readings of `scene`; or the file (.toml,
        .nc, .csv) of one.
    scene : Scene or path-like, optional
        Scene that readings belong to.
    with_ : str or sequence of str
        Effects to set free in a fit to readings, "name" or "name:form".
    effects_file : path-like, optional
        Effects of your own, beside those of the table (TOML).
    solver : "analytic" or "render"
        "render" corrects the fast model by fresh traces of the fitted scene.
    trace : bool
        False: fit to readings without what only the renderer knows: scattering, walls, surface.
    rel_error, max_photons, seed, optional
        How well to trace; default 0.02, 1e8 and 0, for a fit with the solver "render" 0.01, 3e6 and 0.
    cache : bool
        Look for responses on disk, and leave them there.

    Returns
    -------
    Comparison, or Fit where readings are given

    Raises
    ------
    UsageError
        Arguments that do not belong together; single positions, which have no planes.
    FitError, MeasurementError, SceneError
        Readings or a scene that cannot be used.
    """
    if not isinstance(what, Scene | Maps | xr.Dataset | Readings | str | PathLike):
        raise UsageError(
            "not what this argument takes", where="what", found=type(what).__name__,
            rule="a Scene, Maps or their data set, Readings, or the path of a file of one of them",
        )  # fmt: skip
    if isinstance(what, xr.Dataset):
        what = _maps_of(what)
    asked = _asked(rel_error, max_photons, seed)
    if scene is None and not isinstance(what, Readings):
        if with_ or effects_file is not None or solver != SOLVER or not trace:
            raise UsageError(
                "nothing is fitted here",
                rule="with_, effects_file, solver and trace belong to readings",
                remedy="give readings and their scene",
            )
        return _maps_compared(what, asked, cache)
    if scene is None or isinstance(what, Scene | Maps):
        raise UsageError("readings need the scene that they belong to, and it alone", remedy="give both")
    if asked and solver != "render":
        raise UsageError(
            "nothing is traced afresh here",
            found=", ".join(asked),
            rule='these belong to solver "render"',
            remedy="choose that solver, or leave them out",
        )
    if solver == "render" and not trace:
        raise UsageError(
            "a render that traces nothing", rule='the solver "render" traces', remedy="leave one of them out"
        )
    if "seed" in asked:  # another than that of the response which the render is to check
        asked["seed"] = asked["seed"] % int(SEED.high) + 1
    known, light = scene_of(scene, effects_file), diffuse_source(trace, cache)
    report = fitting.fit_readings(
        readings_of(what, known), known, names_in(with_), solver=solver, tracing=asked,
        diffuse=light,
    )  # fmt: skip
    return Fit(report)


def _maps_of(dataset: xr.Dataset) -> Maps:
    if (lacks := lacking(dataset)) is not None:
        raise UsageError(
            "this data set is no rendering", where="what", rule=lacks,
            remedy="give what `render` returns, whole or a slice that keeps its dimensions",
        )  # fmt: skip
    return Maps(dataset)


def _asked(rel_error: float | None, max_photons: float | None, seed: int | None) -> Tracing:
    """How well to trace, as far as it is said."""
    given = {"rel_error": rel_error, "max_photons": max_photons, "seed": seed}
    return cast(Tracing, {name: value for name, value in given.items() if value is not None})


def _maps_compared(what: Scene | Maps | AnyPath, asked: Tracing, cache: bool) -> Comparison:
    if not isinstance(what, Scene | Maps) and fspath(what).endswith(".nc"):
        what = Maps.load(what)
    if isinstance(what, Maps) and (asked or not cache):
        raise UsageError(
            "maps are compared as they are", rule="how well to trace belongs to scenes", remedy="leave it out"
        )
    if not isinstance(what, Maps):
        known = scene_of(what)
        if known.detector.positions_m is not None:
            raise UsageError(
                "this scene has single positions, no planes",
                rule="render and formula are compared on planes",
                remedy="give planes_m instead of positions_m",
            )
        what = render(known, cache=cache, **asked)
    return Comparison(comparing.compare(what.details), what)
