"""The response of the diffuse light for one beam and one phase function, as plain arrays.

What is left to choose is water and walls:

    in cells    E = sum over classes  M(w) S [W(w) / M(w)],    M(w) = sum over histories h  w_h M_h
    w_h         (b/b_0)^n (rho/rho_0)^m s^k e^{-dc e_h},    then along straight lines  e^{-dc r}
    at places   the local quadratic of ln E, as `Shift.apply` evaluates it

and light that was reflected and never scattered, which is no sum over histories: the lamp's image in the
surface, and light from walls over nodes of attenuation and albedo.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial.chebyshev import chebpts1
from numpy.typing import NDArray
from scipy.sparse import csr_array

from lightfield.arrays import Array, Mask
from lightfield.errors import RenderError
from lightfield.render.diffuse.diffuse_response import REFLECTED, DiffuseResponse
from lightfield.render.diffuse.shift import ShiftParts
from lightfield.render.diffuse.traced import TracedLight, TracedWater
from lightfield.render.reflected.orders import DARKEST
from lightfield.render.reflected.room import C_STEP
from lightfield.render.response.open_ended import Lengths
from lightfield.scene import Scene
from lightfield.scene.acts import Acts
from lightfield.scene.parameters import switched_off
from lightfield.scene.water.layers import layers_depth

#: Light from walls is told at so many albedos, Chebyshev's nodes: a polynomial between them is exact to 1e-4
#: of the light up to albedos of 0.9 (tests/system/test_saved_page.py).
_ALBEDOS = 7
#: Attenuations that it is told at: of those at which it is known every fourth, or second.
_STEP_PER_M = 4 * C_STEP


@dataclass(frozen=True)
class LightClass:
    """One class of light.

    Parameters
    ----------
    counts : array of int, shape (n_rows, 3)
        Scatterings, reflections by walls and by the surface.
    excess_m : array, shape (n_rows,), m
    open_ended : array of bool, shape (n_rows,)
        Rows that hold all higher numbers of scatterings as well.
    mean : array, shape (n_rows, n_cells)
    wanted : array, shape (n_rows, n_cells), optional
        At the asymmetry parameter; absent for light that knows none: then the mean is all.
    """

    counts: NDArray[np.int_]
    excess_m: Array
    open_ended: Mask
    mean: Array
    wanted: Array | None


@dataclass(frozen=True)
class Reflections:
    """Reflected light that was never scattered, at the places.

    Parameters
    ----------
    image, way_m : arrays, shape (n,)
        The lamp's image in the surface, without attenuation, m^-2, and its way in water.
    step_per_m : float
    albedos : array, shape (_ALBEDOS,)
    walls : array, shape (n_nodes, _ALBEDOS, n)
        Logarithm of light from walls over the albedo.
    """

    image: Array
    way_m: Array
    step_per_m: float
    albedos: Array
    walls: Array


@dataclass(frozen=True)
class Portable:
    """The response for one beam and phase function.

    Parameters
    ----------
    absorption_per_m, scattering_per_m, wall_albedo, surface_reflectance : float
        Of the trace.
    lengths : Lengths
        Of the straight lines, for open-ended histories.
    surface : float
        Factor on the surface's reflectance, which stays.
    classes : list of LightClass
    straight_m, through : arrays, shape (n_cells,)
        Straight line from the lamp; what layers let through.
    smoother : sparse array, shape (n_cells, n_cells)
    """

    absorption_per_m: float
    scattering_per_m: float
    wall_albedo: float
    surface_reflectance: float
    lengths: Lengths
    surface: float
    classes: list[LightClass]
    straight_m: Array
    through: Array
    smoother: csr_array
    shift: ShiftParts
    reflections: Reflections | None


def portable(response: DiffuseResponse, scene: Scene, most_per_m: float, most_albedo: float) -> Portable:
    """The response for the beam and the phase function of a scene.

    Parameters
    ----------
    most_per_m, most_albedo : float
        Attenuation and albedo up to which reflected light will be asked for.

    Raises
    ------
    RenderError
        The scene has light that more than water and walls decide, or its water was traced twice.
    """
    _refuse_more(response, scene)
    lights, classes = _lights(response.clear, scene), []
    for light, kinds in lights:
        if not any(kind in light.kinds for kind in kinds):
            continue
        traced = light.trace()
        beams, rows = traced.beams, traced.rows
        shares = light.between_g.shares(scene)
        for kind in kinds:
            if kind in light.kinds and kind in beams.rows_of:
                mine = beams.rows_of[kind]
                tallies = beams.at_cells(beams.contracted(kind, scene.lamp))
                several = len(tallies) > 1
                mean = np.tensordot(light.between_g.part, tallies, axes=1) if several else tallies[0]
                wanted = np.tensordot(shares, tallies, axes=1) if several else None
                counts, open_ended = rows.histories[mine], rows.open_ended[mine]
                classes.append(LightClass(counts, rows.excess_m[mine], open_ended, mean, wanted))
    light = lights[-1][0]
    reference = light.reference
    shift = response.shift
    depth = layers_depth(scene.water, shift.cell_z_m, response.straight_m, shift.cell_y_m)
    return Portable(
        reference.absorption_per_m,
        reference.scattering_per_m,
        reference.wall_albedo,
        reference.surface_reflectance or 1.0,
        Lengths.of(response.straight_m),
        scene.reflectances[1],
        classes,
        response.straight_m,
        np.exp(-depth) * np.ones(len(response.straight_m)),
        light.between_g.smoother,
        shift.parts,
        _reflections(response, scene, most_per_m, most_albedo),
    )


def _refuse_more(response: DiffuseResponse, scene: Scene) -> None:
    """Refuse what the arrays do not hold."""
    tank = scene.tank
    changes = not switched_off(scene.water, Acts.AGEING | Acts.HARDENING)
    shares = tank is not None and (tank.floor_share, tank.end_share) != (1, 1) and scene.reflects
    for refused, found, rule in (
        (
            changes or scene.lamp.apparent_distance_m or response.denser is not None,
            "water that changes in time or within the band, an apparent source, or two traces",
            "one trace, in steady water, from a lamp at the window",
        ),
        (
            shares,
            "a floor or a far end of another albedo than the walls",
            "walls, floor and ends of one albedo",
        ),
        (tank is not None and tank.panes != "none", "panes of glass", "walls that mirror nothing"),
    ):
        if refused:
            raise RenderError("this light is not to be had as plain arrays", found=found, rule=rule)


def _lights(water: TracedWater, scene: Scene) -> list[tuple[TracedLight, range]]:
    """What tells of which classes of light, as `TracedWater.classes` chooses."""
    last = REFLECTED.stop if scene.reflects else 1
    if water.under_surface is None or not scene.surface_reflects:
        return [(water.own_top, range(last))]
    return [(water.own_top, range(1)), (water.under_surface, range(1, last))]


def _reflections(
    response: DiffuseResponse, scene: Scene, most_per_m: float, most_albedo: float
) -> Reflections | None:
    """Light from walls at nodes between which `Room.light` itself interpolates, and of a few albedos."""
    if response.reflected is None or scene.tank is None or not scene.reflects:
        return None

    # As layers let it, but for what they let through on the straight way.
    more = response.mean_of_layers_per_m(scene)
    longer = response.shift.pick(np.exp(more * response.straight_m))

    def at(c: float, rho: float) -> Array:
        assert response.reflected is not None
        walls = scene.with_values({"tank.wall_albedo": rho}, validate=False)
        return np.asarray(response.reflected.evaluate(walls, c + more) * longer)

    dark, dim = at(0.0, 0.0), at(1.0, 0.0)
    seen = dark > 0
    way = np.where(seen, np.log(np.where(seen, dark, 1.0) / np.where(dim > 0, dim, 1.0)), 0.0)
    nodes = _STEP_PER_M * np.arange(int(np.ceil(most_per_m / _STEP_PER_M)) + 4)
    albedos = 0.5 * most_albedo * (1 + chebpts1(_ALBEDOS))
    if scene.reflectances[0] == 0:
        return Reflections(dark, way, _STEP_PER_M, albedos, np.zeros((0, _ALBEDOS, len(dark))))
    walls = [
        [(at(c, rho) - dark * np.exp(-c * way)) / rho for rho in albedos.tolist()] for c in nodes.tolist()
    ]
    return Reflections(dark, way, _STEP_PER_M, albedos, np.log(np.maximum(walls, DARKEST)))
