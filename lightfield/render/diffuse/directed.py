"""A trace of the diffuse light with the direction of emission kept, made or fetched from the cache."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from lightfield.arrays import Array
from lightfield.progress import Listener, heard_by, step
from lightfield.render.backend import use_backend
from lightfield.render.diffuse.between_g import SHAPES
from lightfield.render.maps import transport_key
from lightfield.render.response import response_cache
from lightfield.render.response.beam_nodes import BeamNodes
from lightfield.render.response.directed_tallies import DirectedTallies, Entries
from lightfield.render.response.grid import Grid, angle_nodes
from lightfield.render.response.light_classes import NEVER_SCATTERED, light_classes
from lightfield.render.response.response import Reference
from lightfield.render.response.symmetry import MirrorImages, mirror_images
from lightfield.scene import Scene

#: Runs work that can be pickled, in another process, and waits for it; the work is given a `Listener`, which
#: is told what is traced, and which part of it is done.
Elsewhere = Callable[[Callable[[Listener], None]], None]


@dataclass(frozen=True)
class DirectedTrace:
    """A trace that keeps the direction of emission, and all that its tallies depend on.

    Parameters
    ----------
    scene : Scene
        With everything neutral that is reweighed afterwards.
    shapes : tuple of float
        Of the phase function: a trace in each; none where it has no shape.
    classes : tuple of int
        Of light, that are kept.
    photons : tuple of int
        Sent for each shape.
    """

    scene: Scene
    grid: Grid
    reference: Reference
    shapes: tuple[float, ...]
    classes: tuple[int, ...]
    photons: tuple[int, ...]
    seed: int

    @functools.cached_property
    def beam_nodes(self) -> BeamNodes:
        """Nodes over the direction of emission."""
        width = self.scene.lamp.hwhm_deg
        return BeamNodes(angle_nodes(width), width)

    @functools.cached_property
    def images(self) -> MirrorImages:
        """Which cells share their photons."""
        return mirror_images(self.scene, self.grid)

    @property
    def key(self) -> dict[str, Any]:
        """In the cache."""
        return {
            "kind": "diffuse",
            **transport_key(self.scene, self.grid, self.reference),
            "g": self.shapes,
            "classes": list(self.classes),
            "photons": list(self.photons),
            "seed": self.seed,
            "nodes": asdict(self.beam_nodes.nodes),
        }

    def made(self, told: Listener | None) -> dict[str, Array]:
        """Tallies, errors and histories, by name."""
        use_backend()
        from lightfield.render.tracer.accumulate import free_memory, trace_by_direction

        scene, nodes, images = self.scene, self.beam_nodes, self.images
        seen: list[Entries] = []
        errors = []
        under = " under the water surface" if scene.surface_reflects else ""

        def follow(words: str, part: float) -> None:
            if told is not None:
                told(f"tracing scattered and reflected light{under}", part)

        for k, (g, sent) in enumerate(zip(self.shapes or (None,), self.photons, strict=True)):
            path = SHAPES[scene.water.phase.type].path if g is not None else ""
            one = scene if g is None else scene.with_values({path: g}, validate=False)
            listening = nullcontext() if told is None else heard_by(follow)
            with listening, step(k, len(self.photons), "" if g is None else f"g = {g:g}"):
                tally, lit, stderr, histories, excess, density = trace_by_direction(
                    one, self.grid, self.reference, nodes, sent, self.seed, images, self.classes
                )
            seen.append(Entries.of(tally, lit))
            errors.append(stderr)
            del tally
        free_memory()
        used = np.unique(np.concatenate([each.row for each in seen]))
        rows = used[np.argsort(light_classes(histories)[used], kind="stable")]
        place, relative = np.zeros(len(histories), np.int32), np.array(errors)
        place[rows] = np.arange(len(rows))
        # Light that was never scattered knows no g: the traces are one.
        part, kinds = np.array(self.photons) / sum(self.photons), list(NEVER_SCATTERED)
        relative[:, kinds] = np.sqrt(np.tensordot(part**2, relative[:, kinds] ** 2, axes=1))
        entries = [each._replace(row=place[each.row]) for each in seen]
        tallies = DirectedTallies.of(entries, part, histories[rows], len(images.kept), nodes.nodes.size)
        return tallies.packed() | {
            "relative_stderr": relative,
            "histories": histories[rows],
            "excess_m": excess[rows],
            "density": density,
        }


@dataclass(frozen=True)
class Keeper:
    """Where traces come from.

    Parameters
    ----------
    cache : bool
        Look for them, and leave them, on disk.
    told : callable, optional
        Follows a trace that is made here.
    elsewhere : callable, optional
        Makes traces in another process, so that their memory and Mitsuba's are not this one's; what comes of
        them comes by the cache, without which they are made here.
    """

    cache: bool = True
    told: Listener | None = None
    elsewhere: Elsewhere | None = None

    def of(self, trace: DirectedTrace) -> dict[str, Array]:
        """What a trace gives, made only where it is not kept."""
        key = trace.key
        stored = response_cache.recall(key) if self.cache else None
        if stored is None and self.cache and self.elsewhere is not None:
            self.elsewhere(functools.partial(_keep, key, trace.made))
            stored = response_cache.recall(key)
        if stored is None:
            stored = trace.made(self.told)
            if self.cache:
                response_cache.keep(key, stored)
        return stored


def _keep(key: Mapping[str, Any], traced: Callable[[Listener], dict[str, Array]], told: Listener) -> None:
    """Trace into the cache."""
    response_cache.keep(key, traced(told))
