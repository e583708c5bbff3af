"""Where Gaussian x inverse square x Beer-Lambert holds: the published regime map, as table, figure and text.

Run from the root: `python benchmarks/regime/run.py [--max-photons N] [--workers N] [--store STORE.zarr]`.
It is the sweep that `lightfield regime` runs, with more photons; a run that was stopped continues in the same
store. `--redraw` makes the figure anew of the values that `regime.csv` has, and computes nothing.
"""

from __future__ import annotations

import argparse
import tempfile
import textwrap
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from lightfield import __version__
from lightfield.commands.sweep import as_text, cases_bar
from lightfield.report.regime import regime_figure
from lightfield.report.style import save_png
from lightfield.scene import Scene
from lightfield.storage.files import write_text
from lightfield.studies.regime import ERRORS, depth_within, rows, run_regime
from lightfield.sweep.sweep_plan import SweepSettings

HERE = Path(__file__).resolve().parent
WIDE, NARROW = "irradiance", "2 degree collimator"
# Petzold (1972), station HAOCE 11: c = 0.398 per m, b / c = 0.551; 0.6 is the nearest albedo of the map.
COASTAL_PER_M, COASTAL_ALBEDO = 0.398, 0.6

TEXT = """\
# Where the formula holds

Error of Gaussian x inverse square x Beer-Lambert, with c = a + b, against the render: on the axis of the
paper's lamp (3.81 degrees), 5 m away in unbounded water with the Henyey-Greenstein phase function, g =
0.924. `regime.csv` has every value with its Monte Carlo standard error; a `?` in the figure marks values
whose class noise leaves open.

![regime map](regime.png)

Optical thickness c z up to which the formula is within a level:

{table}

## What it means in a tank

{meaning}

Made by `benchmarks/regime/run.py`, lightfield {version}: up to {photons:.2g} photons in each of {traces}
traces, seed {seed}; median standard error of a value {noise:.2g} (largest {worst:.2g}).
"""

MEANING = """\
A detector that sees the whole hemisphere collects much of the light that water scatters forward, while
the formula counts all of it as lost. Take coastal water (c = {c:g} per m, b / c = {albedo:g}): on the
axis the formula is 10 % too low from {wide_m:.1f} m on (c z = {wide:.2f}). A 2 degree collimator rejects
most of that light and follows the formula to {narrow_m:.1f} m (c z = {narrow:.1f}). Over the paper's 4.5
to 8.5 m (c z = {near:.1f} to {far:.1f}) neither holds to 10 %: the error runs from {wide_near:.0f} to
{wide_far:.0f} % for irradiance, from {narrow_near:.0f} to {narrow_far:.0f} % for the collimator. In
clearer water, with a fifth of the attenuation by scattering, the collimator is within 10 % up to c z =
{clean:.1f}, irradiance up to {clean_wide:.1f}. Hence a K fitted to the decay that a wide detector sees is
not c = a + b, nor can it be carried to other distances. For a tank: use a narrow collimator, say which of
a, c or K a number is, and keep c z below the table's value for the accuracy wanted; beyond it, render.
"""


def main() -> None:
    """Run the sweep, or what is left of it, and write the pages."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--max-photons", type=float, default=4e6)
    parser.add_argument("--workers", type=int, default=0)
    parser.add_argument("--store", type=Path, help="keep the sweep here")
    parser.add_argument("--output", type=Path, default=HERE)
    parser.add_argument("--redraw", action="store_true", help="only the figure, of regime.csv")
    args = parser.parse_args()
    if args.redraw:
        save_png(regime_figure(read_values(args.output / "regime.csv")), args.output / "regime.png")
        return
    settings = SweepSettings(rel_error=0.002, max_photons=args.max_photons, maps=False)
    scene = Scene.from_dict({"name": "regime map"})
    with tempfile.TemporaryDirectory() as scratch:
        store = args.store or Path(scratch) / "regime.zarr"
        with cases_bar("regime map") as report:
            plan, done, data = run_regime(scene, settings, store, workers=args.workers, report=report)
        print(as_text(plan, done, store))
    write_table(data, args.output / "regime.csv")
    save_png(regime_figure(data), args.output / "regime.png")
    noise = data.formula_error_stderr.values
    page = TEXT.format(
        table=reach_table(data), meaning=meaning(data), version=__version__, photons=settings.max_photons,
        traces=len(plan.traces), seed=settings.seed, noise=np.median(noise), worst=np.nanmax(noise),
    )  # fmt: skip
    write_text(args.output / "README.md", page)
    print(page)


def write_table(data: xr.Dataset, path: Path) -> None:
    """Every value and its error."""
    table = data[["formula_error", "formula_error_stderr"]].to_dataframe()
    told = table.assign(
        formula_error=table.formula_error.map("{:.5g}".format),
        formula_error_stderr=table.formula_error_stderr.map("{:.2g}".format),
    )
    write_text(path, told.to_csv(lineterminator="\r\n"))


def read_values(path: Path) -> xr.Dataset:
    """What `write_table` wrote."""
    values = pd.read_csv(path)
    places = ["receiver", "albedo", "optical_depth"]
    return values.set_index(places).to_xarray().sel(receiver=values.receiver.unique())


def reach_table(data: xr.Dataset) -> str:
    """Markdown table of the optical thickness reached."""
    head = ["receiver", "albedo b / c", *(f"{100 * level:g} %" for level in ERRORS)]
    lines = [head, ["---", *["---:"] * (len(head) - 1)], *rows(data)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def meaning(data: xr.Dataset) -> str:
    """The paragraph for people with a tank, with the numbers of this run."""
    c, depth = COASTAL_PER_M, data.optical_depth.values

    def error(receiver: str, albedo: float) -> np.ndarray:
        return np.asarray(data.formula_error.sel(receiver=receiver, albedo=albedo).values)

    def percent(receiver: str, z_m: float) -> float:
        return float(100 * np.interp(np.log(c * z_m), np.log(depth), error(receiver, COASTAL_ALBEDO)))

    wide, narrow = (depth_within(depth, error(receiver, COASTAL_ALBEDO), 0.1) for receiver in (WIDE, NARROW))
    clean_wide, clean = (depth_within(depth, error(receiver, 0.2), 0.1) for receiver in (WIDE, NARROW))
    text = MEANING.format(
        wide=wide, wide_m=wide / c, narrow=narrow, narrow_m=narrow / c, c=c, near=4.5 * c, far=8.5 * c,
        wide_near=percent(WIDE, 4.5), wide_far=percent(WIDE, 8.5), narrow_near=percent(NARROW, 4.5),
        narrow_far=percent(NARROW, 8.5), clean=clean, clean_wide=clean_wide, albedo=COASTAL_ALBEDO,
    )  # fmt: skip
    return textwrap.fill(" ".join(text.split()), 118)


if __name__ == "__main__":
    main()
