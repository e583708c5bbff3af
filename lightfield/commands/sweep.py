"""`lightfield sweep`: vary parameters of a scene over a grid, into one Zarr store."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

from lightfield.commands.shared.console import console
from lightfield.commands.shared.options import add_option, add_tracing, given
from lightfield.commands.shared.progress import status_lines
from lightfield.errors import UsageError
from lightfield.memory import byte_size
from lightfield.progress import duration
from lightfield.render.limits import OF_SWEEPS, SEED
from lightfield.scene import Scene
from lightfield.storage.files import output_folder
from lightfield.sweep import estimate
from lightfield.sweep.axes import ALBEDO, ATTENUATION, FORMS, parse_axis, read_plan
from lightfield.sweep.cases import warn_of_idle
from lightfield.sweep.results import axes_of, case_label, case_values, open_store, verify
from lightfield.sweep.runner import Report, SweepProgress, run_sweep
from lightfield.sweep.sweep_plan import SweepPlan, SweepSettings, make_plan
from lightfield.sweep.zarrfile import size_on_disk

EPILOG = f"""\
RANGE is {FORMS}; both ends are included. Any scene parameter can be varied (`lightfield
scene SCENE` lists them), and two that set absorption and scattering together: {ATTENUATION} and
{ALBEDO}. Example:

  lightfield sweep scene.toml --vary water.scattering_per_m=0:0.5:11 --vary tank.wall_albedo=0,0.2 -o s.zarr

The same command continues an interrupted sweep and does again what is damaged; `lightfield sweep --verify
s.zarr` says whether anything is. `lightfield show s.zarr` draws it, `lightfield export` writes
cases as EXR, and xarray.open_zarr("s.zarr") opens it.

A plan file (TOML) holds `[[vary]]` tables: path with values = [...] or with start, stop, count and
scale = "log"; or name and together = {{ path = [...], path = [...] }} for parameters that change together.
`[settings]` may set rel_error, max_photons, seed and maps.

On a cluster, with the store on a disk that all machines share, start a scheduler and workers of one thread:

  dask scheduler --host 10.0.0.1                             # the address inside the cluster
  dask worker tcp://10.0.0.1:8786 --nthreads 1 --nworkers 16 # on every machine
  lightfield sweep ... -o /shared/s.zarr --scheduler tcp://10.0.0.1:8786

A scheduler runs the code of anyone who reaches it: keep it behind a firewall, or use TLS
(--protocol tls, tls://10.0.0.1:8786 and keys: docs/sweeps.md of the manual has the commands).

With dask-jobqueue (SLURMCluster, PBSCluster, ...: cores=1, processes=1) or dask-kubernetes give
cluster.scheduler_address. All machines need the same version of lightfield.
"""

#: What a store calls the status of a case that failed.
_FAILED = 2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    add_option(parser, "scene", nargs="?")
    add_option(parser, "--vary")
    parser.add_argument(
        "--plan", type=Path, metavar="FILE", help="dimensions and settings from a file (TOML)"
    )
    add_option(parser, "--output", metavar="STORE.zarr", help="the store")
    parser.add_argument("--dry-run", action="store_true", help="print the plan and what it costs, and stop")
    parser.add_argument(
        "--verify",
        type=Path,
        metavar="STORE.zarr",
        help="say whether every file of a store is as it was written, and stop",
    )
    group = parser.add_argument_group("tracing")
    add_tracing(group, OF_SWEEPS)
    group.add_argument("--no-maps", action="store_true", help="keep the derived quantities alone")
    group = parser.add_argument_group("workers")
    add_option(group, "--workers", "this one")
    group.add_argument("--scheduler", metavar="ADDRESS", help="an existing Dask scheduler")
    group.add_argument(
        "--memory", type=float, metavar="GB", help="memory limit of a local worker (default: its share)"
    )


def run(args: argparse.Namespace) -> int:
    """Plan, and run or continue; 1 when cases failed."""
    if args.verify is not None:
        found = verify(args.verify)
        print(
            f"{args.verify}: {found.files} files, all as they were written; {found.blocks} blocks, "
            + ("complete" if found.complete else "not complete: the same sweep continues")
        )
        return 0
    if args.scene is None:
        raise UsageError("no scene given", remedy="lightfield sweep SCENE --vary PATH=RANGE -o STORE.zarr")
    scene = Scene.load(args.scene)
    axes, settings = read_plan(args.plan) if args.plan else ([], {})
    axes = [*axes, *(parse_axis(text, "--vary") for text in args.vary or [])]
    if not axes:
        remedy = f"--vary PATH=RANGE with RANGE {FORMS}, or --plan FILE"
        raise UsageError("nothing is varied", where=str(args.scene), remedy=remedy)
    plan = make_plan(scene, axes, _settings(args, settings))
    warn_of_idle(plan.cases)
    if args.dry_run:
        print(estimate.as_text(plan))
        return 0
    if args.output is None:
        raise UsageError("no store given", remedy="-o STORE.zarr, or --dry-run")
    output_folder(args.output.parent)
    needed = estimate.sweep_cost(plan).memory_bytes
    if args.memory is not None and needed > 1e9 * args.memory:
        raise UsageError(
            "a worker needs more memory", where="--memory", found=f"{args.memory:g} GB",
            rule=f"about {byte_size(needed)} for these maps", remedy="allow more, or fewer pixels or planes",
        )  # fmt: skip
    try:
        with cases_bar() as report:
            done = run_sweep(
                plan,
                args.output,
                workers=args.workers or 0,
                scheduler=args.scheduler,
                memory_gb=args.memory,
                report=report,
            )
    except KeyboardInterrupt:
        print(
            f"{args.output}: what is finished is kept; the same command goes on from there", file=sys.stderr
        )
        raise
    print(as_text(plan, done, args.output))
    return 1 if done.failed else 0


def _settings(args: argparse.Namespace, planned: dict[str, Any]) -> SweepSettings:
    known = {field.name: type(field.default) for field in fields(SweepSettings)}
    for name, value in planned.items():
        number = known.get(name) is float and isinstance(value, int | float) and not isinstance(value, bool)
        if not number and type(value) is not known.get(name):
            raise UsageError(
                "not a setting",
                where=f"{args.plan}, [settings]",
                found=f"{name} = {value!r}",
                rule=", ".join(f"{n} ({t.__name__})" for n, t in known.items()),
            )
    chosen = {**planned, **given(args), **({"maps": False} if args.no_maps else {})}
    if not SEED.holds(chosen.get("seed", 0)):
        raise UsageError("impossible seed", found=chosen["seed"], rule=SEED.rule)
    return SweepSettings(**chosen)


def as_text(plan: SweepPlan, done: SweepProgress, path: Path) -> str:
    """What was done, and how much less that was than tracing each case."""
    cases, traces = (
        f"{n} {word}{'s' * (n != 1)}" for n, word in ((plan.cases.count, "case"), (len(plan.traces), "trace"))
    )
    lines = [f"{path}: {cases} from {traces}, {byte_size(size_on_disk(path))}"]
    if done.failed:
        lines.append(failures(done, path))
    if done.again:
        lines.append(f"{done.again} of them may do with more memory: the same sweep continues")
    if done.repaired:
        shown = ", ".join(done.repaired[:3]) + (", ..." if len(done.repaired) > 3 else "")
        lines.append(f"{len(done.repaired)} damaged files were made good: {shown}")
    if not done.cases_done:
        lines.append("nothing was left to do")
        return "\n".join(lines)
    kept = f", {done.cases_before} were there already" if done.cases_before else ""
    made = done.traced - done.found
    lines.append(
        f"this run: {made} traced ({done.photons:.3g} photons), {done.cases_done} evaluated in "
        f"{duration(done.seconds)}{kept}"
    )
    if gain := done.gain(plan):
        rate = done.photons / max(done.trace_seconds, 1e-9)
        lines.append(
            f"computing: tracing {duration(done.trace_seconds)} ({rate:.3g} photons/s per core), "
            f"evaluating {duration(done.block_seconds)}; tracing each case would take "
            f"{gain:.3g} times as long"
        )
    if done.workers:
        many = "process" if len(done.workers) == 1 else "processes"
        lines.append(
            f"memory: {len(done.workers)} {many}, at most {byte_size(max(done.workers.values()))} each"
        )
    return "\n".join(lines)


def failures(done: SweepProgress, path: Path, quantity: str | None = None) -> str:
    """How many cases of a store failed, which first, and why; see `open_store`."""
    return f"{done.failed} case{'s' * (done.failed != 1)} failed{_first_failure(path, quantity)}"


def _first_failure(path: Path, quantity: str | None) -> str:
    data = open_store(path, quantity)
    axes = axes_of(data)
    where = np.argwhere(data.status.transpose(*axes).values == _FAILED)
    if not len(where):
        return ""
    steps = dict(zip(axes, map(int, where[0]), strict=True))
    why = str(data.message.isel(steps).values)
    rest = "; `message` in the store says why others did" if len(where) > 1 else ""
    return f": {case_label(case_values(data, steps))}: {why}{rest}"


@contextmanager
def cases_bar(name: str = "sweep") -> Iterator[Report]:
    """Cases done, photons per second and time left on standard error; else a line now and then."""
    output = console(stderr=True)
    if not output.is_terminal:
        with status_lines(name) as note:
            yield lambda progress: note(progress_in_words(progress), progress.part)
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[cases]}"),
        TimeRemainingColumn(),
    )
    with Bar(*columns, console=output) as bar:
        task = bar.add_task("starting", total=1.0, cases="")

        def report(progress: SweepProgress) -> None:
            rate = progress.photons / max(progress.seconds, 1e-9)
            failed = f", {progress.failed} failed" if progress.failed else ""
            done = progress.cases_before + progress.cases_done
            bar.update(
                task,
                completed=progress.part,
                description=f"{progress.traced}/{progress.traces} traces, {rate:.3g} photons/s{failed}",
                cases=f"{done}/{progress.cases} cases",
            )

        yield report


def progress_in_words(progress: SweepProgress) -> str:
    """How far a sweep is."""
    done = progress.cases_before + progress.cases_done
    told = [f"{done} of {progress.cases} cases"]
    if progress.traces:
        parts = ", ".join(f"{100 * part:.0f} %" for part in list(progress.underway.values()))
        told.append(
            f"{progress.traced} of {progress.traces} traces" + (f" and {parts} of the next" if parts else "")
        )
    return ", ".join(told + ([f"{progress.failed} failed"] if progress.failed else []))
