"""One flight of a photon: how far it is free, what planes on its way see of it, how the next one begins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from lightfield.render.tracer.absorption import Absorption, ReferenceWater
from lightfield.render.tracer.emission import Emission, FirstFlights
from lightfield.render.tracer.histories import Histories
from lightfield.render.tracer.planes import Planes
from lightfield.render.tracer.scattering import Turn
from lightfield.render.tracer.surfaces import FAR, Met, Surfaces

_ROULETTE_BELOW = 0.2  # survival weight under which a photon plays
_ROULETTE_SURVIVAL = 0.25
_FORCED = 0.9  # share of the first flights that scatter before the last plane, where they would pass it


@dataclass(frozen=True)
class TransportProblem:
    """What a trace solves.

    Parameters
    ----------
    surfaces, turn
        What light meets, and how a scattering turns it.
    emission, planes, histories, water
        Lamp, detectors, cells of the tally, reference water.
    """

    surfaces: Surfaces
    turn: Turn
    emission: Emission
    planes: Planes
    histories: Histories
    water: ReferenceWater


@dataclass
class Photon:
    """Photons at the beginning of a flight.

    Parameters
    ----------
    position, direction
        Where it starts, and its unit vector.
    weight : mi.Float
        Reference weight: emission, absorption, wall albedo, roulette. A photon without any is no more.
    survival : mi.Float
        The part of the weight that the roulette looks at.
    length : mi.Float
        Path so far, m.
    node : mi.UInt32
        Of the direction of emission.
    scatterings, walls, mirrors, panes : mi.UInt32
        What it has met: mirrors are the water surface.
    """

    position: mi.Point3f
    direction: mi.Vector3f
    weight: mi.Float
    survival: mi.Float
    length: mi.Float
    node: mi.UInt32
    scatterings: mi.UInt32
    walls: mi.UInt32
    mirrors: mi.UInt32
    panes: mi.UInt32


def from_lamp(start: FirstFlights) -> Photon:
    """Photons as they leave the lamp."""
    position, direction = mi.Point3f(start.position), mi.Vector3f(start.direction)
    weight, node = mi.Float(start.weight), mi.UInt32(start.node)
    return Photon(
        position, direction, weight, mi.Float(1), mi.Float(0), node, *(mi.UInt32(0) for _ in range(4))
    )


@dataclass
class Ledger:
    """Where weight of photons went, and what of it roulette and steering invented."""

    absorbed: mi.Float
    at_walls: mi.Float
    escaped: mi.Float
    invented: mi.Float


def free_flight(b0: mi.Float, u: mi.Float) -> mi.Float:
    """Length of a free flight, m."""
    return -dr.log(1 - u) / dr.maximum(b0, 1e-9)


def first_free_flight(
    b0: mi.Float, ahead: mi.Float, to_surface: mi.Float, u: mi.Float
) -> tuple[mi.Float, mi.Float]:
    """Length of a first free flight, and the weight that makes up for how it was drawn.

    In clear water most light leaves the lamp and passes the last plane without a scattering; after that it
    is of no more use. So a first flight that meets no surface before is mostly made to scatter on the way.
    """
    chance = 1 - dr.exp(-b0 * ahead)
    steered = (ahead > 0) & (ahead < to_surface) & (chance > 1e-5)
    share = dr.select(steered, dr.maximum(chance, _FORCED), 0)
    inside, least = u < share, dr.select(steered, ahead, 0)
    over, under = chance / dr.maximum(share, _FORCED), (1 - chance) / (1 - share)
    v = dr.select(inside, u * over, (u - share) / (1 - share))
    free = dr.select(inside, 0, least) + free_flight(b0, v)
    bias = dr.select(inside, over, under)
    return free, dr.select(steered, bias, 1)


def deposit(
    tally: mi.Float,
    row: mi.UInt32,
    planes: Planes,
    cell: mi.UInt32,
    value: mi.Float,
    responses: Sequence[mi.Float],
    active: mi.Bool,
) -> None:
    """Add to the tally what each component of the receiver makes of a crossing."""
    for number, response in enumerate(responses):
        at = row * planes.row_length + number * planes.component_length + cell
        dr.scatter_add(tally, value * response, at, active, mode=dr.ReduceMode.Direct)


@dr.syntax
def tally_flight(
    tally: mi.Float,
    problem: TransportProblem,
    absorption: Absorption,
    b0: mi.Float,
    photon: Photon,
    reach: mi.Float,
    mirror_x: bool,
    rng: mi.PCG32,
) -> None:
    """Add the expected light of a flight, at most `reach` long, at every plane that it would cross."""
    planes, histories = problem.planes, problem.histories
    position, direction, length, node = photon.position, photon.direction, photon.length, photon.node
    weight = photon.weight
    u = rng.next_float32() if histories.wall_nodes is not None else mi.Float(0)
    channel = histories.channel(photon.scatterings, photon.walls, photon.mirrors, photon.panes, u)
    counts = (weight > 0) & histories.holds(channel)
    plane = mi.UInt32(0)
    while plane < planes.count:
        u = rng.next_float32() if planes.is_slab else mi.Float(0)
        crossing = planes.crossing(plane, position, direction, reach, mirror_x, u)
        if counts & (crossing.hits | crossing.mirror_hits):
            responses, straight = planes.reading(crossing, direction)
            depth = absorption.depth(position, direction, crossing.distance)
            value = weight * dr.exp(-depth - b0 * crossing.distance)
            excess = dr.maximum(length + crossing.distance - straight, 0)
            row = histories.row(channel, excess, rng.next_float32(), node)
            deposit(tally, row, planes, crossing.cell, value, responses, crossing.hits)
            if dr.hint(mirror_x, mode="scalar"):
                image = row - node + histories.mirrored(node)
                deposit(tally, image, planes, crossing.mirror_cell, value, responses, crossing.mirror_hits)
        plane += 1


def after(
    problem: TransportProblem,
    absorption: Absorption,
    photon: Photon,
    ledger: Ledger,
    met: Met,
    free: mi.Float,
    rng: mi.PCG32,
) -> tuple[Photon, Ledger]:
    """Photons after a flight: scattered, reflected, or no more; and the ledger with what it cost.

    Parameters
    ----------
    met : Met
        The next surface.
    free : mi.Float
        Distance to the next scattering, m.
    """
    surfaces, planes = problem.surfaces, problem.planes
    position, direction, weight = photon.position, photon.direction, photon.weight
    active = weight > 0
    # -------------------------------------------------------------- fly
    scatters = free < met.distance
    t = dr.minimum(free, met.distance)
    kept = dr.exp(-absorption.depth(position, direction, dr.select(t < FAR, t, 0)))
    absorbed = ledger.absorbed + dr.select(active, weight * (1 - kept), 0)
    weight, survival = weight * kept, photon.survival * kept
    position = mi.Point3f(dr.fma(direction, t, position))
    gone = active & ~scatters & met.leaves
    escaped = ledger.escaped + dr.select(gone, weight, 0)
    active &= ~gone

    # -------------------------------------------------------------- scatter (the same numbers serve a bounce)
    u = mi.Point2f(rng.next_float32(), rng.next_float32())
    turned = problem.turn(direction, rng.next_float32(), u, active & scatters)
    scatterings = photon.scatterings + dr.select(active & scatters, mi.UInt32(1), 0)

    # -------------------------------------------------------------- reflect
    walls, mirrors, panes, at_walls = photon.walls, photon.mirrors, photon.panes, ledger.at_walls
    bounces = active & ~scatters
    if surfaces.reflecting:
        bounce = surfaces.bounce(met, position, direction, u, bounces)
        reflected = dr.select(bounces, bounce.reflected, 1)
        lost = dr.select(bounces, weight * (1 - reflected), 0)
        escaped += dr.select(bounce.smooth, lost, 0)
        at_walls = at_walls + dr.select(bounce.smooth, 0, lost)
        weight, survival = weight * reflected, survival * reflected
        position = mi.Point3f(dr.select(bounces, bounce.position, position))
        turned = mi.Vector3f(dr.select(bounces, bounce.direction, turned))
        mirrors = mirrors + dr.select(bounces & bounce.smooth & ~bounce.pane, mi.UInt32(1), 0)
        panes = panes + dr.select(bounces & bounce.pane, mi.UInt32(1), 0)
        walls = walls + dr.select(bounces & ~bounce.smooth, mi.UInt32(1), 0)
    else:
        at_walls = at_walls + dr.select(bounces, weight, 0)
        active &= scatters
    direction = mi.Vector3f(dr.normalize(dr.select(active, turned, direction)))
    weight = dr.select(active, weight, 0)

    # -------------------------------------------------------------- roulette
    hopeless = planes.behind(position, direction)
    plays = (weight > 0) & (survival < dr.select(hopeless, 2.0, _ROULETTE_BELOW))
    lives = rng.next_float32() < _ROULETTE_SURVIVAL
    before = weight
    weight = dr.select(plays, dr.select(lives, weight / _ROULETTE_SURVIVAL, 0), weight)
    survival = dr.select(plays & lives, survival / _ROULETTE_SURVIVAL, survival)
    invented = ledger.invented + (weight - before)
    length, node = photon.length + t, photon.node
    return (
        Photon(position, direction, weight, survival, length, node, scatterings, walls, mirrors, panes),
        Ledger(absorbed, at_walls, escaped, invented),
    )
