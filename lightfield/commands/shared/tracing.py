"""Options and progress of commands that trace a scene."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

from lightfield.commands.shared.console import console
from lightfield.commands.shared.options import add_tracing, given
from lightfield.commands.shared.progress import status_lines
from lightfield.progress import heard_by, part_of_trace
from lightfield.render.limits import OF_MAPS
from lightfield.render.maps import Rendering
from lightfield.render.settings import OnProgress
from lightfield.scene import Scene

Made = TypeVar("Made")


def add_tracing_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare how well to trace."""
    group = parser.add_argument_group("tracing")
    add_tracing(group, OF_MAPS)
    group.add_argument("--no-cache", action="store_true", help="trace even if the response is on disk")


def traced(scene: Scene, args: argparse.Namespace, render: Callable[..., Made]) -> Made:
    """Trace a scene as the options say, and say how far it is."""
    options = given(args)
    limit = float(options.get("max_photons", OF_MAPS.max_photons))
    with progress_bar(scene.name or "scene", limit) as report:
        return render(
            scene,
            **options,
            cache=not args.no_cache,
            progress=report,
        )


@contextmanager
def progress_bar(name: str, max_photons: float = OF_MAPS.max_photons) -> Iterator[OnProgress]:
    """Progress of a trace on standard error: a bar on a terminal, elsewhere a line every ten seconds."""
    output = console(stderr=True)
    if not output.is_terminal:
        with status_lines(name) as note, heard_by(note):  # the tracer tells it, batch by batch
            yield lambda *_: None
        return
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Bar(*columns, console=output, transient=True) as bar:
        task = bar.add_task(f"tracing {name}", total=1.0)

        def report(photons: int, reached: float, requested: float) -> None:
            bar.update(
                task,
                completed=part_of_trace(photons, reached, requested, max_photons),
                description=f"{name}: {photons:.3g} photons, error {100 * reached:.2g} %",
            )

        yield report


def as_text(rendering: Rendering) -> str:
    """Photons, error and energy balance in two lines."""
    energy = rendering.energy
    unit = energy.emitted if energy.emitted else 1.0
    reached = f"{100 * rendering.reached:.2g} %"
    if rendering.reached > rendering.settings.rel_error:
        reached += f" (asked for {100 * rendering.settings.rel_error:.2g} %: raise --max-photons)"
    return (
        f"{rendering.response.photons:.3g} photons, relative error {reached}\n"
        f"energy: water {100 * energy.absorbed / unit:.2f} %, walls {100 * energy.walls / unit:.2f} %, "
        f"escaped {100 * energy.escaped / unit:.2f} %, unfinished {100 * energy.unfinished / unit:.3f} %, "
        f"roulette {-100 * energy.roulette / unit:+.3f} %, closure {energy.closure:+.1e}"
    )
