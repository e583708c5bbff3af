"""Options and progress of commands that trace a scene."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import TypeVar

from lightfield.commands.shared.options import add_tracing, given
from lightfield.commands.shared.progress import progress_of
from lightfield.render.limits import OF_MAPS
from lightfield.render.maps import Rendering
from lightfield.scene import Scene
from lightfield.scene.all_parameters import unused_words
from lightfield.wording import rounded

Made = TypeVar("Made")


def add_tracing_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare how well to trace."""
    group = parser.add_argument_group("tracing")
    add_tracing(group, OF_MAPS)
    group.add_argument("--no-cache", action="store_true", help="trace even if the response is on disk")


def traced(scene: Scene, args: argparse.Namespace, render: Callable[..., Made]) -> Made:
    """Trace a scene as the options say, and say how far it is."""
    with progress_of(scene.name or "scene"):
        return render(scene, **given(args), cache=not args.no_cache)


def as_text(rendering: Rendering) -> str:
    """Photons, error and energy balance in two lines, and what the scene states without effect."""
    energy = rendering.energy
    unit = energy.emitted if energy.emitted else 1.0
    reached = f"{rounded(100 * rendering.reached)} %"
    if rendering.reached > rendering.settings.rel_error:
        reached += f" (asked for {rounded(100 * rendering.settings.rel_error)} %: raise --max-photons)"
    unused = unused_words(rendering.scene)
    return (
        f"{rendering.response.photons:.3g} photons, relative error {reached}\n"
        f"energy: water {100 * energy.absorbed / unit:.2f} %, walls {100 * energy.walls / unit:.2f} %, "
        f"escaped {100 * energy.escaped / unit:.2f} %, unfinished {100 * energy.unfinished / unit:.3f} %, "
        f"roulette {-100 * energy.roulette / unit:+.3f} %, closure {energy.closure:+.1e}"
        + f"\n{unused}"
        * bool(unused)
    )
