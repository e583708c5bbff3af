"""Many cases of a scene: `sweep`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from lightfield.api.given import AnyPath, checked, scene_of
from lightfield.api.result import Result
from lightfield.errors import UsageError
from lightfield.scene import Scene
from lightfield.sweep.axes import FORMS, Axis, axis_of, parse_axis
from lightfield.sweep.cases import warn_of_idle
from lightfield.sweep.results import axes_of, open_store
from lightfield.sweep.runner import run_sweep
from lightfield.sweep.sweep_plan import SweepSettings, make_plan

if TYPE_CHECKING:
    import pandas as pd

    from lightfield.report.style import Axes

_DEFAULT = SweepSettings()
#: Dimensions of a map; what has them is no derived quantity.
_CELLS = {"y_m", "x_m", "row", "column"}


class Sweep(Result[xr.Dataset]):
    """A finished sweep: a data set whose values are read from its store when they are asked for."""

    def __init__(self, details: xr.Dataset, path: Path) -> None:
        super().__init__(details)
        self.path = path

    @classmethod
    @checked
    def load(cls, path: AnyPath) -> Sweep:
        """A store that `sweep` or `lightfield sweep` wrote.

        Raises
        ------
        OutputError
            Not such a store, or a damaged one.
        """
        return cls(open_store(Path(path)), Path(path))

    @property
    def headline(self) -> str:
        status, axes = self.details.status.values, axes_of(self.details)
        varied = ", ".join(f"{name} ({self.details.sizes[name]})" for name in axes)
        failed = int(np.sum(status == 2))
        return f"{status.size} cases over {varied}" + (f"; {failed} failed" if failed else "")

    def as_text(self) -> str:
        return f"{self.headline}\nstore: {self.path}"

    def as_data(self) -> dict[str, Any]:
        axes = {name: self.details[name].values.tolist() for name in axes_of(self.details)}
        table = self.to_pandas()
        cases = table.astype(object).where(table.notna(), None).to_dict("records")
        return {"store": str(self.path), "axes": axes, "cases": cases}

    def plot(self, ax: Axes | None = None, *, quantity: str | None = None) -> Axes:
        """A derived quantity on the first plane against the longest axis, a line per step of the next.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
        quantity : str, optional
            Name of a variable of the data set; default: light on the axis.
        """
        from lightfield.report.plots import plot_sweep

        name = quantity or f"on_axis_{self.details.attrs['quantity']}"
        if name not in self.details or not set(self.details[name].dims).isdisjoint(_CELLS):
            known = [str(n) for n in self.details if _CELLS.isdisjoint(self.details[n].dims)]
            raise UsageError("no such derived quantity", found=name, rule="one of " + ", ".join(known))
        return plot_sweep(ax, self.details, axes_of(self.details), name)

    def to_xarray(self) -> xr.Dataset:
        """Dimensions named after the varied parameters; maps, derived quantities, errors, status."""
        return self.details

    def to_pandas(self) -> pd.DataFrame:
        """A row per case, plane and band: derived quantities with their errors, no maps."""
        data = self.details
        small = [name for name in data if _CELLS.isdisjoint(data[name].dims)]
        return data[small].to_dataframe().reset_index()

    def _page(self) -> str:
        from lightfield.report.result import result_page
        from lightfield.report.sweep import figures_of

        return result_page(self, "Sweep", *figures_of(self.details).values())


@checked
def sweep(
    scene: Scene | AnyPath,
    vary: Mapping[str, str | Sequence[Any]],
    output: AnyPath,
    *,
    rel_error: float = _DEFAULT.rel_error,
    max_photons: float = _DEFAULT.max_photons,
    seed: int = _DEFAULT.seed,
    maps: bool = _DEFAULT.maps,
    workers: int = 0,
    scheduler: str | None = None,
    memory: float | None = None,
) -> Sweep:
    """Vary parameters of a scene over a grid, into one Zarr store.

    Parameters
    ----------
    scene : Scene or path-like
    vary : mapping of str to range
        Of each dotted path its values, or a range as the command takes it: "0:0.5:11", "0.01:1:9:log".
    output : path-like
        The store. One that was stopped is continued, a finished one is opened.
    rel_error, max_photons : float
        Asked of every trace, and where it ends even so.
    seed : int
    maps : bool
        False: keep the derived quantities alone.
    workers : int
        Local processes; 0: this one.
    scheduler : str, optional
        Address of an existing Dask scheduler. It runs the code of anyone who reaches it.
    memory : float, GB, optional
        Limit of a local worker.

    Raises
    ------
    UsageError
        Nothing is varied, an impossible range, or workers that cannot be had.
    OutputError
        A store of another sweep, or a full disk: then the same call continues later.
    """
    axes = [_axis(path, values) for path, values in vary.items()]
    if not axes:
        raise UsageError("nothing is varied", rule=f"vary = {{path: values}}, values {FORMS} or a list")
    plan = make_plan(scene_of(scene), axes, SweepSettings(rel_error, max_photons, seed, maps))
    warn_of_idle(plan.cases)
    run_sweep(plan, Path(output), workers=workers, scheduler=scheduler, memory_gb=memory)
    return Sweep.load(output)


def _axis(path: str, values: str | Sequence[Any]) -> Axis:
    if isinstance(values, str):
        return parse_axis(f"{path}={values}", "vary")
    if not isinstance(values, Iterable) or isinstance(values, Mapping):
        raise UsageError(
            "not a range", where=f"vary {path}", found=values, rule=f"{FORMS}, or a list of values",
            remedy=f"for one value [{values}], or set it in the scene",
        )  # fmt: skip
    steps = [v.item() if isinstance(v, np.generic) else v for v in values]
    return axis_of(path, {path: steps}, f"vary {path}")
