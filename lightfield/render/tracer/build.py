"""From a scene file to the Mitsuba scene, the sampler of the lamp, the detector grid and the tally layout."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from math import atan, ceil, hypot, log, pi, sqrt
from typing import Any

import mitsuba as mi
import numpy as np

from lightfield.render.response.grid import COMPONENTS, AngleNodes, Grid, scene_grid, straight_path
from lightfield.render.response.open_ended import HELD_FROM, HELD_FROM_IN_FITS
from lightfield.render.response.response import Reference
from lightfield.render.response.symmetry import MirrorImages
from lightfield.render.settings import PATH_NODES
from lightfield.render.tracer.absorption import ReferenceWater
from lightfield.render.tracer.emission import Emission
from lightfield.render.tracer.flight import TransportProblem
from lightfield.render.tracer.histories import Histories, TallyLayout, WallNodes
from lightfield.render.tracer.planes import FluxPlanes, Planes, open_water_m
from lightfield.render.tracer.scattering import by_plugin, henyey_greenstein, with_molecules
from lightfield.render.tracer.surfaces import Box, OpenWater, beckmann
from lightfield.scene import Scene
from lightfield.scene.tank import WATER_INDEX, walls_m
from lightfield.scene.water.phase import of_scene
from lightfield.scene.water.phase.spec import HenyeyGreenstein

#: Attenuation by which water that a tally for fits is asked for is clearer than that of the trace. Without,
#: light of walls of 0.9 in clear water came out 2 to 3 % too bright in a short tank; with it 1.1 +- 1.2 %.
_CLEARER_PER_M = 0.1
#: Wall hits that a tally for fits tells apart, and the brightest walls that it is asked for: up to there its
#: light is right to about 1 % in scattering water (`benchmarks/reuse`); with two orders it was 0.70 of the
#: truth in a narrow tank.
_WALL_HITS, _BRIGHTEST_WALLS = (0, 1, 2, 3, 4, 6, 9, 14, 22, 34), 0.9
#: Reflections by panes that a tally tells apart: of a map, whether there were any, as it answers for its own
#: panes alone; of one for fits so many, the last with all beyond.
_PANES, _PANES_IN_FITS = 1, 3
#: Of diffuse light panes send so much back that paths are as long as beside walls of this albedo. Chosen.
_AS_WALLS = 0.7
#: Those of a tally of so many cells, which would take gigabytes. Beside the others (2400 cells in the tow
#: tank) its light is the same to 0.1 % at albedos from 0.2 to 0.8.
_FEWER_HITS, _MANY_CELLS = (0, 1, 3, 9, 34), 1000


@dataclass(frozen=True)
class Setup(TransportProblem):
    """Everything a trace needs, and what its tally becomes a response with."""

    mitsuba_scene: Any
    reference: Reference
    grid: Grid
    straight_m: np.ndarray


#: Steps in which paths are tallied, of a tally that is asked near its reference only.
_COARSE_NODES = 8


def histories_of(
    scene: Scene,
    reference: Reference,
    grid: Grid,
    surface: bool,
    nodes: AngleNodes | None = None,
    coarse: bool = False,
    path_nodes: int | None = None,
) -> Histories:
    """Tally layout fine enough for the scene: scattering classes up to the tail of their Poisson number.

    `coarse` is for tallies that are kept by more than history and cell, and asked near their reference only.
    """
    far = float(grid.z_m.max())
    mean = reference.scattering_per_m * far * 1.2
    scatterings = ceil(mean + 4 * sqrt(mean) + 1) if mean > 0 else 0
    walls = 0 if reference.wall_albedo == 0 else 3
    surfaces = 2 if surface else 0
    panes = (_PANES if nodes is None else _PANES_IN_FITS) if scene.pane_reflectance else 0
    told = None
    if walls and nodes is not None:
        assert scene.tank is not None
        brightest = _BRIGHTEST_WALLS / scene.tank.brightest_over_walls
        many = len(grid.centres()[0].ravel()) > _MANY_CELLS
        told = WallNodes(_FEWER_HITS if many or panes else _WALL_HITS, reference.wall_albedo, brightest)
    layout = TallyLayout(
        scatterings,
        walls,
        surfaces,
        panes,
        max_reflections=2 if (walls and surfaces) or coarse else 3,
        max_scatterings_reflected=HELD_FROM_IN_FITS if coarse else HELD_FROM,
        longest_excess_m=_longest_excess(scene, reference, far),
        path_nodes=path_nodes or (_COARSE_NODES if coarse else PATH_NODES),
        wall_nodes=told,
        clearer_per_m=_CLEARER_PER_M if nodes is not None else 0.0,
        nodes=nodes,
    )
    return Histories(layout)


def _longest_excess(scene: Scene, reference: Reference, far_m: float) -> float:
    """Path in excess of the straight line beyond which next to nothing is left, m."""
    tank, albedo = scene.tank, max(reference.wall_albedo, _AS_WALLS * scene.pane_reflectance)
    if tank is None or albedo == 0:
        return max(far_m, 4.0)
    w, d, z = tank.width_m, tank.depth_m, tank.length_m
    between_walls = 2 * w * d * z / (w * d + w * z + d * z)  # mean chord of a box, 4 V / S
    decay = reference.absorption_per_m - log(albedo) / between_walls
    return float(np.clip(7 / max(decay, 1e-6), max(2 * far_m, 8.0), 8 * max(far_m, 8.0)))


def assembled(
    scene: Scene,
    grid: Grid,
    reference: Reference,
    *,
    nodes: AngleNodes | None = None,
    images: MirrorImages | None = None,
    wide_share: float | None = None,
    flux: bool = False,
    path_nodes: int | None = None,
) -> Setup:
    """Assemble a trace of `scene` on `grid`.

    Parameters
    ----------
    images : MirrorImages, optional
        Tally the cells that these `traced` alone.
    flux : bool
        Tally the flux vector, see `FluxPlanes`, instead of what the scene's detector reads: the maps of the
        components follow each other.
    path_nodes : int, optional
        Steps in which paths are tallied; default: as many as another water's absorption asks for.
    """
    reflects, lamp = scene.surface_reflects, scene.lamp
    half_x = np.abs(grid.x_m).max() + 0.5 * grid.pitch_x_m + abs(lamp.offset_x_m)
    half_y = np.abs(grid.y_m).max() + 0.5 * grid.pitch_y_m + abs(lamp.offset_y_m)
    cone = atan(hypot(half_x, half_y) / grid.z_m.min()) + np.radians(hypot(lamp.tilt_x_deg, lamp.tilt_y_deg))
    if wide_share is None:
        # Where much is scattered, scattered core light outshines the direct skirt, and needs the photons.
        wide_share = 0.1 if reference.scattering_per_m * grid.z_m.max() > 0.2 else 0.4
    emission = Emission(lamp, min(cone, 0.45 * pi), wide_share, nodes)
    position = (lamp.offset_x_m, lamp.offset_y_m, 0.0)
    ends = walls_m(scene.tank)[2]
    # Maps are means over cells, in whatever water; paths that are asked for themselves lead to the point.
    whole_cells = nodes is None and not flux and path_nodes is None
    straight = straight_path(scene, grid, whole_cells)
    if flux:
        planes: Planes = FluxPlanes(grid, position, lamp.apparent_distance_m, ends)
        straight = np.tile(straight, (len(COMPONENTS), 1, 1))
    else:
        tallied = grid if images is None else images.traced(grid)
        grid = grid if images is None else replace(grid, merged=images.told_by)
        behind, window = lamp.apparent_distance_m, lamp.radius_m
        planes = Planes(tallied, scene.detector, position, behind, ends, whole_cells, window)
    histories = histories_of(scene, reference, grid, reflects, nodes, flux or nodes is not None, path_nodes)
    reference_water = ReferenceWater(reference.absorption_per_m, reference.scattering_per_m, scene.water)
    # Open water has no geometry to search: the walk itself ends far out.
    top = reference.surface_reflectance if reflects else None
    parts = shapes(scene, reference.wall_albedo, top) if scene.tank else {}
    loaded = mi.load_dict({"type": "scene", **parts})
    met = Box(scene.tank, reference.wall_albedo, top) if scene.tank else OpenWater(planes)
    phase = scene.water.phase
    if isinstance(phase, HenyeyGreenstein):
        turn = henyey_greenstein(phase.g)
    else:
        turn = by_plugin(mi.load_dict(phase_dict(scene)))
    if reference.molecular_share:
        turn = with_molecules(turn, reference.molecular_share)
    return Setup(met, turn, emission, planes, histories, reference_water, loaded, reference, grid, straight)


def phase_dict(scene: Scene, molecules: float = 0.0) -> dict[str, Any]:
    """Mitsuba description of the scene's phase function, where molecules have a share of the scattering."""
    phase = of_scene.with_molecules(scene.water.phase, molecules)
    if phase.type == "henyey-greenstein":
        return {"type": "hg", "g": phase.g}
    return {"type": "lightfield_phase", "model": json.dumps(phase.model_dump(mode="json"))}


def shapes(scene: Scene, wall_albedo: float, surface: float | None) -> dict[str, Any]:
    """Mitsuba shapes: black sphere round open water, or the tank's walls with a lid or a water surface.

    Parameters
    ----------
    surface : float, optional
        Factor on the Fresnel reflectance of the water surface; None: a lid.
    """
    tank = scene.tank
    if tank is None:
        black = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}
        reach = open_water_m(scene_grid(scene))
        return {"open_water": {"type": "sphere", "radius": reach, "flip_normals": True, "bsdf": black}}
    wall, ground, far = map(_diffuse, wall_albedo * np.array([1.0, tank.floor_share, tank.end_share]))
    sides, ends, top = wall, (wall, far), wall
    if tank.pane_reflectance:
        sides = _mirror(tank.pane_reflectance)
        if tank.panes == "all":
            ground, ends = sides, (sides, sides)
    if surface is not None:
        top = _mirror(surface)
        if tank.surface_slope_deg:
            waves = {"distribution": "beckmann", "alpha": beckmann(tank), "sample_visible": True}
            top |= {"type": "roughdielectric", **waves}
    (_, half), (floor, ceiling), (back, end) = tank.box_m
    mid_y, mid_z = 0.5 * (ceiling + floor), 0.5 * (back + end)
    turn = mi.ScalarTransform4f
    size_x, size_y, size_z = half, 0.5 * tank.depth_m, 0.5 * tank.length_m

    def rectangle(
        centre: list[float], axis: list[float], angle: float, u: float, v: float, bsdf: Any
    ) -> dict[str, Any]:
        pose = turn().translate(centre) @ turn().rotate(axis, angle) @ turn().scale([u, v, 1])
        return {"type": "rectangle", "to_world": pose, "bsdf": bsdf}

    return {
        # Normals into the air: the inside of a dielectric is water; diffuse faces are the same on both sides.
        "left": rectangle([-half, mid_y, mid_z], [0, 1, 0], -90, size_z, size_y, sides),
        "right": rectangle([half, mid_y, mid_z], [0, 1, 0], 90, size_z, size_y, sides),
        "floor": rectangle([0, floor, mid_z], [1, 0, 0], 90, size_x, size_z, ground),
        "back": rectangle([0, mid_y, back], [0, 1, 0], 180, size_x, size_y, ends[0]),
        "end": rectangle([0, mid_y, end], [0, 1, 0], 0, size_x, size_y, ends[1]),
        "surface": rectangle([0, ceiling, mid_z], [1, 0, 0], -90, size_x, size_z, top),
    }


def _diffuse(albedo: float) -> dict[str, Any]:
    """What a wall is made of."""
    reflectance = {"type": "uniform", "value": float(albedo)}
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": reflectance}}


def _mirror(part: float) -> dict[str, Any]:
    """What water meets air with, of that part of its Fresnel reflectance."""
    scale = {"type": "uniform", "value": part}
    return {"type": "dielectric", "int_ior": WATER_INDEX, "ext_ior": 1.0, "specular_reflectance": scale}
