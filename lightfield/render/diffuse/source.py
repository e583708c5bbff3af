"""Tracing the response of the diffuse light at the places of a measurement, or fetching it from the cache."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from lightfield.arrays import Array
from lightfield.errors import RenderError
from lightfield.render.diffuse.bending import surrounded
from lightfield.render.diffuse.between_g import SHAPES, BetweenG
from lightfield.render.diffuse.dense_water import CLEAR_PER_M
from lightfield.render.diffuse.diffuse_response import DiffuseResponse
from lightfield.render.diffuse.directed import DirectedTrace, Keeper
from lightfield.render.diffuse.on_planes import on_planes, planes_for
from lightfield.render.diffuse.shift import SMOOTH_RATIOS, SMOOTH_WALLS, Shift, smoother
from lightfield.render.diffuse.traced import Traced, TracedLight, TracedWater
from lightfield.render.reflected.panes import diffuse_part
from lightfield.render.reflected.reflected_light import ReflectedLight, applies
from lightfield.render.response.beam_tallies import BeamTallies, Sent
from lightfield.render.response.directed_tallies import DirectedTallies
from lightfield.render.response.grid import Grid, fineness, positions_grid, straight_path
from lightfield.render.response.light_classes import CLASSES, NEVER_SCATTERED
from lightfield.render.response.response import Reference, TransportResponse
from lightfield.render.response.symmetry import mirror_images
from lightfield.scene import Scene
from lightfield.scene.acts import Acts
from lightfield.scene.all_parameters import without
from lightfield.scene.bands import middles_nm
from lightfield.scene.water.coefficients import molecular_per_m

#: Water and walls of a trace. Walls of 0.5 answered for those of 0.9 with a noise of 6 to 70 % per reading in
#: a tank of 1.2 m by 1.2 m; of 0.8, with 0.8 to 2 %, and as well as before for dim ones.
_REFERENCE_ABSORPTION, REFERENCE_ALBEDO = 0.1, 0.8
#: Photons sent into dense water, times b, as a part of those into clear water: there they walk longer.
_SENT_PER_M = 0.16
#: Width of the beam that photons are sent in, as a part of what the readings look like: water that scatters
#: widens what is seen of a beam (to 1.4 of its width at b = 0.2 per m, 1.8 at 1.1). Sent at 0.5 to 0.9 of a
#: beam's own width the light of that beam is known best; at 1.3 its variance is twice that, at 2 three times.
_SENT_WIDTH = 0.55
#: Steps in which the lamp of a trace is moved, in half widths of the beam on the nearest plane: from there
#: light is followed to the lamp of a fit by its slope and bending (moved by 2.7, it was twice what it is).
_OFFSET_STEP, _WIDEST_DEG, _LEAST_STEP_M = 0.35, 60.0, 0.01
#: What walls and surface send back does not follow the lamp: beside such as reflect the steps are no longer
#: than this part of the way to the nearest. A lamp that was taken for one 0.12 m higher under a surface 0.6 m
#: above it made light of fits 8 % too bright.
_STEP_OF_ROOM = 0.03
PHOTONS = 2_000_000
#: Part of the photons for the first and last node of g, which count little between the others, and for light
#: that was reflected under a water surface: most that was not scattered is known without a trace. Of the
#: middle node alone, with a third, it missed 100 readings near a surface by chi-square 70 (by 20 now).
_AT_THE_ENDS, _UNDER_SURFACE = 0.5, 0.6
#: Largest cell of the tally: the scattered field bends over half a metre, and its bending is corrected for.
CELL_M = 0.2
#: So many cells may be finer than that bending asks for, because readings are.
_MOST_FINE = 1500


#: Photons for receivers of a narrow view, whose cells are small: so many times more at most (chosen: 2 % of
#: noise behind a collimator of 2 degrees, 4.5 m away, for 6 s of one processor).
_MOST_SENT = 8.0
_CACHED = Keeper()


def response_for(
    scene: Scene,
    x_m: Array,
    y_m: Array,
    z_m: Array,
    *,
    photons: int = PHOTONS,
    share: float = 1.0,
    dense_per_m: float | None = None,
    under_surface: float = _UNDER_SURFACE,
    g_nodes: Sequence[float] | None = None,
    seed: int = 0,
    keeper: Keeper = _CACHED,
) -> DiffuseResponse:
    """Trace, or fetch from the cache, the diffuse light of a scene at the places of a measurement.

    Parameters
    ----------
    scene : Scene
        Tank, detector, phase function, apparent source; the beam's width and place only decide where photons
        are sent, and from where.
    x_m, y_m, z_m : arrays, shape (n,), m
    photons : int
        Per inner node of g in clear water.
    share : float
        Part of them that is sent out.
    dense_per_m : float, optional, m^-1
        Trace in water that scatters so much, for `DiffuseResponse.with_denser`.
    under_surface : float
        Photons for what was reflected under a water surface that the scene does not state, over the others.
    g_nodes : sequence of float, optional
        Of what shapes the phase function, in place of those of `between_g.SHAPES`.
    keeper : Keeper
        Where traces come from.

    Returns
    -------
    DiffuseResponse

    Raises
    ------
    RenderError
        The lamp has no beam of finite width: its emission cannot be shared between nodes of direction.
    """
    if scene.lamp.profile in ("isotropic", "pencil"):
        raise RenderError(
            "the scattered light of this lamp cannot be followed in a fit",
            where="lamp.profile",
            found=scene.lamp.profile,
            rule="a beam of finite width",
            remedy="render the scene instead",
        )
    places = (np.asarray(x_m, float), np.asarray(y_m, float), np.asarray(z_m, float))
    shape = SHAPES.get(scene.water.phase.type)
    nodes = () if shape is None else shape.nodes_for(scene) if g_nodes is None else tuple(sorted(g_nodes))
    open_top = scene.surface_reflects
    reflected = ReflectedLight.at(scene, *places) if applies(scene) else None
    known: tuple[int, ...] = NEVER_SCATTERED if reflected is not None else ()
    if scene.tank is not None and scene.tank.panes != "none":
        known = known[1:]  # what walls send by way of panes is not
    needed = [kind for kind in range(CLASSES) if kind not in known]

    width = sent_width_deg(scene.lamp.hwhm_deg)
    scattering, sent = CLEAR_PER_M, share * photons * _for_view(scene, places[2], width)
    if dense_per_m is not None:
        scattering, sent = dense_per_m, sent * _SENT_PER_M / dense_per_m
    # As in the first water: the scene's own scattering is not known yet.
    molecules = min(float(molecular_per_m(scene.water, middles_nm(scene).mean())) / CLEAR_PER_M, 1.0)
    # Of a floor, or an end, that is brighter than the walls.
    albedo = REFERENCE_ALBEDO / scene.tank.brightest_over_walls if scene.tank else 0.0
    panes = (scene.tank.bare_panes, diffuse_part(scene.tank)) if scene.tank else (0.0, 0.0)
    reference = Reference(_REFERENCE_ABSORPTION, scattering, albedo, 1.0, molecules, *panes)
    lamp_m = _lamp_m(scene, places[2], width)
    grid = _grid_for(scene, places, width, lamp_m)
    walls, ratios = smoother(grid, *SMOOTH_WALLS), smoother(grid, *SMOOTH_RATIOS)

    def one(of: Scene, shapes: tuple[float, ...], classes: Sequence[int], photons: int) -> TracedLight:
        sent_to = _sent(shapes, photons)
        trace = DirectedTrace(of, grid, reference, shapes, tuple(classes), sent_to, seed)
        return _light(trace, keeper, walls, ratios)

    traced = _traced_scene(scene, width, open_top, lamp_m)
    own_top, mirrored = one(traced, nodes, needed, round(sent)), None
    if scene.tank is not None and not open_top:
        # Light that was only scattered is the same under either top.
        few, surface = round(under_surface * sent), _traced_scene(scene, width, True, lamp_m)
        mirrored = one(surface, nodes, needed[1:], few)
    water = TracedWater(own_top, mirrored)
    shift = Shift.on(grid, *places, lamp_m, scene.tank)
    return DiffuseResponse(shift, straight_path(traced, grid), walls, water, reflected)


def cells_for(scene: Scene, x_m: Array, y_m: Array, z_m: Array) -> int:
    """How many cells a trace for places of a measurement keeps in memory; see `response_for`."""
    width = sent_width_deg(scene.lamp.hwhm_deg)
    lamp_m = _lamp_m(scene, np.asarray(z_m, float), width)
    traced = _traced_scene(scene, width, False, lamp_m)
    return len(mirror_images(traced, _grid_for(scene, (x_m, y_m, z_m), width, lamp_m)).kept)


def _grid_for(
    scene: Scene, places: tuple[Array, Array, Array], width: float, lamp_m: tuple[float, float]
) -> Grid:
    told = on_planes(planes_for(places[2], scene.tank), *places, lamp_m, scene.tank)
    grid = positions_grid(*told.places, CELL_M, width / _SENT_WIDTH, scene.tank, _MOST_FINE, scene.detector)
    return surrounded(grid, scene.tank)


def _for_view(scene: Scene, z_m: Array, width: float) -> float:
    """Factor on the photons where the receiver's view makes cells smaller."""
    wide, narrow = (fineness(z_m, width / _SENT_WIDTH, scene.tank, d) for d in (None, scene.detector))
    return min(_MOST_SENT, (wide / narrow) ** 2)


def _light(trace: DirectedTrace, keeper: Keeper, walls: csr_array, ratios: csr_array) -> TracedLight:
    """The light of a trace, which is made when it is first asked for."""

    def tell() -> Traced:
        stored, images = keeper.of(trace), trace.images
        histories = np.asarray(stored["histories"], int)
        straight = straight_path(trace.scene, trace.grid)
        rows, rows_of_kept = (
            TransportResponse(
                np.zeros((1, 0, 0)), histories, stored["excess_m"], way, trace.reference, max(trace.photons)
            )
            for way in (straight, straight.ravel()[images.kept])
        )
        sent = Sent(np.asarray(stored["density"], float), trace.scene.lamp)
        z = trace.grid.centres()[2].ravel()
        tallies = DirectedTallies.unpacked(stored, histories)
        beams = BeamTallies(tallies, trace.beam_nodes, sent, z, images, walls)
        return Traced(beams, stored["relative_stderr"] * images.error, rows, rows_of_kept)

    shape = SHAPES.get(trace.scene.water.phase.type, SHAPES["henyey-greenstein"])
    between = BetweenG(trace.shapes, np.array(trace.photons) / sum(trace.photons), ratios, shape)
    return TracedLight(functools.cache(tell), trace.classes, trace.reference, between)


def _sent(shapes: tuple[float, ...], photons: int) -> tuple[int, ...]:
    """Photons of the trace in each shape: fewer at the ends, which count little."""
    few = round(_AT_THE_ENDS * photons) if len(shapes) > 2 else photons
    return (few, *[photons] * (len(shapes) - 2), few)[: max(len(shapes), 1)]


def sent_width_deg(hwhm_deg: float) -> float:
    """Half width of the beam that photons are sent in, for one that looks so wide.

    In steps of a factor 1.5, so that guesses that differ a little share a response.
    """
    return float(4.0 * 1.5 ** np.round(np.log(_SENT_WIDTH * hwhm_deg / 4.0) / np.log(1.5)))


def _lamp_m(scene: Scene, z_m: Array, width_deg: float) -> tuple[float, float]:
    """Where the lamp of a trace stands, x and y, m: in whole steps, which traces share, towards the scene's
    and no nearer to a wall."""
    spot = float(z_m.min()) * np.tan(np.radians(min(width_deg / _SENT_WIDTH, _WIDEST_DEG)))
    step = _OFFSET_STEP * spot
    if scene.tank is not None and scene.reflects:
        step = min(step, _STEP_OF_ROOM * min(scene.tank.room_m))
    step = max(step, _LEAST_STEP_M)
    lamp = scene.lamp
    return float(step * np.trunc(lamp.offset_x_m / step)), float(step * np.trunc(lamp.offset_y_m / step))


def _traced_scene(
    scene: Scene, width_deg: float, surface: bool, lamp_m: tuple[float, float] = (0.0, 0.0)
) -> Scene:
    """The scene with everything neutral that is reweighed afterwards."""
    lamp = type(scene.lamp)(
        hwhm_deg=width_deg, offset_x_m=lamp_m[0], offset_y_m=lamp_m[1], radius_m=scene.lamp.radius_m
    )
    values: dict[str, Any] = {}
    if scene.tank:
        values |= {"tank.surface_reflectance": float(surface)}
        values |= {"tank.pane_reflectance": scene.tank.bare_panes}
    shape = SHAPES.get(scene.water.phase.type)
    if shape is not None:
        values[shape.path] = shape.usual
    plain = without(scene, Acts.LAYERS).model_copy(update={"lamp": lamp})
    return plain.with_values(values, validate=False)
