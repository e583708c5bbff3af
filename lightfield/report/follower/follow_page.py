"""Page of `follow`: how a follower fares that believes in this light, in that water."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import xarray as xr

from lightfield.report.follower.follow_figures import (
    MOST_ROWS,
    all_figure,
    events_in_words,
    metrics_in,
    strip_figure,
    sweep_figure,
    way_figure,
)
from lightfield.report.follower.page import light_in_words, page, section
from lightfield.report.page import Section, Table, page_figure
from lightfield.scene import Scene
from lightfield.studies.following.metrics import COUNTED, METRICS, OF_DOCKING
from lightfield.studies.following.study import Followed, Following
from lightfield.sweep.results import axes_of
from lightfield.wording import capital, minus, plain, with_error

#: Metrics of the table, beside those of docking.
_SHOWN = (
    "standoff", "across_rms", "yaw_rms", "belief_less_truth", "belief_scatter", "nearest", "doubtful",
)  # fmt: skip
_STANDOFF = "follower.mission.standoff_m"
#: Shown where they are not zero, or exist.
_ON_OCCASION = ("standoff_at_end", "overshoot", "without_light", "lost", "back_after", "outside")


def following_page(found: Following) -> str:
    """The page."""
    cases = found.cases
    first = cases[0]
    docking = any(one.mission.task == "dock" for one in cases)
    names = [name for name in (*OF_DOCKING, *_SHOWN) if any(name in one.runs for one in cases)]
    names += [name for name in _ON_OCCASION if any(_matters(one, name) for one in cases)]
    rows = [[f"{plain(n)} ({METRICS[n][0]})", *(_cell(one, n) for one in cases)] for n in names]
    count = len(first.track.contact)
    kept = ", without those that lost their way" if any(one.lost.any() for one in cases) else ""
    cut = f" The first {MOST_ROWS} of {len(cases)} followers." if len(cases) > MOST_ROWS else ""
    sections = [
        section(
            "From above",
            [
                page_figure(
                    "strip",
                    "The most typical run of every follower. Circle: the lamp, with its light; green: where "
                    "the follower should be; filled: where it is; dashed outline: where it takes itself to "
                    "be. Across is stretched, and the vehicle is drawn larger than it is." + cut,
                    "Film strip of the followers from above",
                    strip_figure,
                    cases,
                )
            ],
        ),
        Section(
            "Over time",
            [
                page_figure(
                    "way",
                    f"Thin: each of {count} runs, with noise, gain, water and lamp of its own as far as the "
                    f"scene says that they are not known. {_thick(cases, kept)}{events_in_words(cases)}",
                    "Distance and offset over time",
                    way_figure,
                    cases,
                )
            ],
            tables=[
                Table(
                    f"Mean of the runs ± scatter from run to run{kept}.",
                    ["", *(f"{one.name}: {one.believed_short}" for one in cases)],
                    rows,
                ),
                _meanings(names),
            ],
        ),
    ]
    alike = dict[str, list[str]]()
    for one in cases:
        alike.setdefault(_run_by(one), []).append(one.name)
    run_by = "; ".join(
        words if len(alike) == 1 else f"{', '.join(dict.fromkeys(whose))}: {words}"
        for words, whose in alike.items()
    )
    lead = [f"{run_by}. The pose comes from the readings alone, by maximum likelihood and a Kalman filter."]
    origin = [("light", light_in_words(first.traced)), ("runs of each follower", str(count))]
    title = "Docking" if docking else "Following"
    return page(title, f"{found.verdict}.", lead, sections, first.scene, origin)


def _meanings(names: Iterable[str]) -> Table:
    """What the numbers of a following are."""
    return Table("What these are.", ["", "meaning"], [[plain(n), METRICS[n][1]] for n in names], (1,))


def _thick(cases: Sequence[Followed], kept: str) -> str:
    """What the thick lines are, and who has none."""
    if all(one.lost.all() for one in cases):
        return "All lost their way: no run is left for a mean."
    none = " None of a follower of which no run is left." if any(one.lost.all() for one in cases) else ""
    return f"Thick: their mean{kept}.{none}"


def _run_by(one: Followed) -> str:
    """Vehicle, law, rate and leader."""
    mission, array = one.mission, one.scene.array
    return (
        f"{mission.vehicle} with {mission.degrees_of_freedom} degrees of freedom, law {mission.law}, "
        f"{array.sample_hz if array else 0:g} readings a second, leader: {mission.leader}"
    )


def follow_sweep_page(data: xr.Dataset) -> str:
    """The page of runs over parameters; `data` as `sweep.results.open_store` gives it."""
    data = data.compute()  # a few numbers a case, each of which is asked for several times
    scene, axes = Scene.from_toml(data.attrs["scene_toml"]), axes_of(data)
    metric = _first_asked(scene)
    unit, meaning = METRICS[metric]
    shown = [name for name in metrics_in(data) if name == metric or np.nan_to_num(data[name].values).any()]
    rows = []
    for steps in np.ndindex(*(data.sizes[name] for name in axes)):
        one = data.isel(dict(zip(axes, steps, strict=True)))
        cells = [_words(float(one[name]), float(one[f"{name}_stderr"])) for name in shown]
        failed = str(one.message.values)
        where = [f"{data[name].values[k]}" for name, k in zip(axes, steps, strict=True)]
        rows.append([*where, *(cells if not failed else [failed, *[""] * (len(shown) - 1)])])
    mean = f"Mean of {int(data.attrs['runs'])} runs ± its standard error."
    beside = [name for name in shown if name != metric]
    none = [plain(name) for name in metrics_in(data) if name not in shown]
    sections = [
        section(
            f"{capital(plain(metric))} over {axes[0]}",
            [
                page_figure(
                    "sweep", f"{capital(meaning)} ({unit}); bars: standard errors of the mean.",
                    "A metric over parameters", sweep_figure, data, metric,
                )
            ],
        ),
        Section(
            "All that was measured",
            [
                page_figure(
                    "all", "The other numbers of the same runs; colours and bars as above.",
                    "All metrics over parameters", all_figure, data, beside,
                )
            ] if beside else [],
            tables=[
                Table(
                    mean + (f" Zero in every case: {', '.join(none)}." if none else ""),
                    [*(plain(name.rpartition(".")[2]) for name in axes),
                     *(f"{plain(n)} ({METRICS[n][0]})" for n in shown)],
                    rows,
                ),
                _meanings(shown),
            ],
        ),
    ]  # fmt: skip
    return page("Following over parameters", _sweep_verdict(data, metric), [], sections, scene)


def _first_asked(scene: Scene) -> str:
    """The metric that a mission is about."""
    return "docked" if scene.follower_here.mission.task == "dock" else "standoff"


def _sweep_verdict(data: xr.Dataset, metric: str) -> str:
    """Least and largest of a metric over the cases, and where; how many were run."""
    axes, values = axes_of(data), data[metric].values
    done = f"{int((data.status == 1).sum())} of {data.status.size} cases"
    if not np.isfinite(values).any():
        return f"{done}: no {plain(metric)} to tell."
    ends, unit = [], "" if METRICS[metric][0] == "1" else f" {METRICS[metric][0]}"
    for flat in (np.nanargmin(values), np.nanargmax(values)):
        at = np.unravel_index(flat, values.shape)
        steps = zip(axes, at, strict=True)
        where = ", ".join(f"{plain(name.rpartition('.')[2])} {data[name].values[k]}" for name, k in steps)
        mean = _words(float(values[at]), float(data[f"{metric}_stderr"].values[at]))
        ends.append(f"{mean}{unit} ({where})")
    mission = Scene.from_toml(data.attrs["scene_toml"]).follower_here.mission
    alike = metric == "standoff" and _STANDOFF not in axes
    goal = f"asked for {mission.standoff_m:g} m: " if alike else ""
    return capital(f"{goal}{plain(metric)} from {ends[0]} to {ends[1]}; {done}.")


def _matters(one: Followed, name: str) -> bool:
    return name in one.runs and bool(np.any(np.nan_to_num(one.runs[name], nan=1.0) != 0))


def _cell(one: Followed, name: str) -> str:
    if name not in one.runs:
        return "–"
    if name in COUNTED:
        return f"{int(one.runs[name].sum())} of {len(one.runs[name])}"
    if one.lost.all():
        return "no run left"
    over = one.spreads[name]
    return _words(over.mean, over.scatter)


def _words(mean: float, off: float) -> str:
    if np.isnan(mean):
        return "never"
    return minus(with_error(mean, off))
