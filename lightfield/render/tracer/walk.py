"""The photon walk: one Dr.Jit loop through water and whatever surfaces there are.

What is estimated, at every detector cell, is the power of the light that crosses it, split by its history:

    R[h] = sum over flights  W  T(t)  1[flight crosses the cell, history h] / A
    W    = w_0  rho_0^m  exp(-a_0 L)

A photon flies freely with the *reference* scattering coefficient b_0; absorption never ends a walk but
weighs it by exp(-a_0 L). Each flight is tallied at every plane that it would cross before the next surface,
with the expected value T(t) = exp(-b_0 t) instead of the yes or no of a real crossing. Histories are the
numbers of scatterings n, wall hits m, surface reflections k, the excess path over the straight line, and
(for fits) the direction of emission.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import wraps
from typing import NamedTuple, ParamSpec, TypeVar

import drjit as dr
import mitsuba as mi
import numpy as np

from lightfield.render.response.response import Bookkeeping
from lightfield.render.tracer.absorption import Absorption, ReferenceWater
from lightfield.render.tracer.emission import Emission
from lightfield.render.tracer.histories import Histories
from lightfield.render.tracer.planes import Planes
from lightfield.render.tracer.scattering import Turn
from lightfield.render.tracer.sobol import ScrambledSobol
from lightfield.render.tracer.surfaces import FAR, Surfaces

ROULETTE_BELOW = 0.2  # survival weight under which a photon plays
ROULETTE_SURVIVAL = 0.25
FORCED = 0.9  # share of the first flights that scatter before the last plane, where they would pass it
MAX_FLIGHTS = 4000
PHOTONS_PER_LANE = 64
Given = ParamSpec("Given")
Result = TypeVar("Result")


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


class _Start(NamedTuple):
    """What a launch begins with."""

    tally: mi.Float  # of every history in every cell
    number: mi.UInt32  # of each lane's first photon
    stride: mi.UInt32  # to the number of its next
    rng: mi.PCG32
    points: ScrambledSobol


def first_or_free_flight(
    b0: mi.Float, ahead: mi.Float, to_surface: mi.Float, is_first: mi.Bool, u: mi.Float
) -> tuple[mi.Float, mi.Float]:
    """Length of a free flight, and the weight that makes up for how it was drawn.

    In clear water most light leaves the lamp and passes the last plane without a scattering; after that it
    is of no more use. So a first flight that meets no surface before is mostly made to scatter on the way.
    """
    chance = 1 - dr.exp(-b0 * ahead)
    steered = is_first & (ahead > 0) & (ahead < to_surface) & (chance > 1e-5)
    share = dr.select(steered, dr.maximum(chance, FORCED), 0)
    inside, least = u < share, dr.select(steered, ahead, 0)
    over, under = chance / dr.maximum(share, FORCED), (1 - chance) / (1 - share)
    v = dr.select(inside, u * over, (u - share) / (1 - share))
    free = dr.select(inside, 0, least) - dr.log(1 - v) / dr.maximum(b0, 1e-9)
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


def _as_raised(walk: Callable[Given, Result]) -> Callable[Given, Result]:
    """Interrupts come out of a loop as such: Dr.Jit turns whatever stops one into an error of its own."""

    @wraps(walk)
    def walked(*args: Given.args, **settings: Given.kwargs) -> Result:
        try:
            return walk(*args, **settings)
        except RuntimeError as error:
            cause: BaseException | None = error
            while isinstance(cause, RuntimeError):
                cause = cause.__cause__
            if isinstance(cause, KeyboardInterrupt | SystemExit):
                raise cause from None
            raise

    return walked


@_as_raised
@dr.syntax
def trace(
    problem: TransportProblem,
    photons: int,
    seed: int,
    first: int = 0,
    mirror_x: bool = False,
    direct: bool = True,
) -> tuple[np.ndarray, Bookkeeping]:
    """Trace one batch of photons.

    Parameters
    ----------
    problem : TransportProblem
    photons : int
        Number of photons of the batch.
    seed : int
        Same seed, same result.
    first : int
        Number of the first photon: a longer batch can be traced in parts.
    mirror_x : bool
        Also tally the mirror image at -x (only right in a scene that is symmetric in x).
    direct : bool
        Tally light that has met nothing.

    Returns
    -------
    sums : array, shape (histories.size, planes.cells), per m^2 (per m^2 sr for radiance)
        For unit on-axis radiant intensity, summed over as many photons as `counted` says.
    bookkeeping : Bookkeeping
        Per photon.
    """
    surfaces, turn, emission = problem.surfaces, problem.turn, problem.emission
    planes, histories, water = problem.planes, problem.histories, problem.water
    each, lanes = _launch(photons)
    tally, number, stride, rng, points = _start(histories.size * planes.cells, lanes, seed, first)
    absorption, b0 = Absorption(water), dr.opaque(mi.Float, water.scattering_per_m)

    # -------------------------------------------------------------- loop state
    started = mi.UInt32(0)  # photons that this lane has begun: a lane never waits for its neighbours
    alive = dr.zeros(mi.Bool, lanes)  # the lane's photon is under way
    position = dr.zeros(mi.Point3f, lanes)  # where the flight starts
    direction = mi.Vector3f(0, 0, 1)  # unit vector of the flight
    weight = mi.Float(0)  # reference weight: emission, absorption, wall albedo, roulette
    survival = mi.Float(1)  # the part of the weight that the roulette looks at
    length = mi.Float(0)  # path so far, m
    node = mi.UInt32(0)  # node of the direction of emission
    scatterings = mi.UInt32(0)
    walls = mi.UInt32(0)
    mirrors = mi.UInt32(0)
    flights = mi.UInt32(0)
    emitted, absorbed, at_walls = mi.Float(0), mi.Float(0), mi.Float(0)
    escaped, invented, unfinished = mi.Float(0), mi.Float(0), mi.Float(0)

    while alive | (started < each):
        # ---------------------------------------------------------- a new photon
        if ~alive:
            start = emission.sample(started * stride + number, points, rng)
            position, direction = mi.Point3f(start.position), mi.Vector3f(start.direction)
            weight, node = mi.Float(start.weight), mi.UInt32(start.node)
            survival, length = mi.Float(1), mi.Float(0)
            scatterings, walls, mirrors, flights = mi.UInt32(0), mi.UInt32(0), mi.UInt32(0), mi.UInt32(0)
            emitted += weight
            started += 1
        active = weight > 0

        # ---------------------------------------------------------- the next surface and the next scattering
        met = surfaces.meet(position, direction, active)
        to_surface, leaves = met.distance, met.leaves
        free, bias = first_or_free_flight(
            b0, planes.ahead(position, direction), to_surface, flights == 0, rng.next_float32()
        )
        u = rng.next_float32() if histories.wall_nodes is not None else mi.Float(0)
        channel = histories.channel(scatterings, walls, mirrors, u)

        # ---------------------------------------------------------- expected tally at every plane on the way
        counts = active if direct else active & (flights > 0)
        plane = mi.UInt32(0)
        while plane < planes.count:
            u = rng.next_float32() if planes.is_slab else mi.Float(0)
            crossing = planes.crossing(plane, position, direction, to_surface, mirror_x, u)
            if counts & (crossing.hits | crossing.mirror_hits):
                responses, straight = planes.reading(crossing, direction)
                depth = absorption.depth(position, direction, crossing.distance)
                value = weight * dr.exp(-depth - b0 * crossing.distance)
                excess = dr.maximum(length + crossing.distance - straight, 0)
                row = histories.row(channel, excess, rng.next_float32(), node)
                deposit(tally, row, planes, crossing.cell, value, responses, crossing.hits)
                if dr.hint(mirror_x, mode="scalar"):
                    image = row - node + histories.mirrored(node)
                    deposit(
                        tally, image, planes, crossing.mirror_cell, value, responses, crossing.mirror_hits
                    )
            plane += 1

        # ---------------------------------------------------------- fly
        invented += dr.select(active, weight * (bias - 1), 0)
        weight *= bias
        scatters = free < to_surface
        t = dr.minimum(free, to_surface)
        gone = active & ~scatters & leaves
        depth = absorption.depth(position, direction, dr.select(t < FAR, t, 0))
        kept = dr.exp(-depth)
        absorbed += dr.select(active, weight * (1 - kept), 0)
        weight *= kept
        survival *= kept
        length += t
        position = mi.Point3f(dr.fma(direction, t, position))
        escaped += dr.select(gone, weight, 0)
        active &= ~gone

        # ---------------------------------------------------------- scatter (the same numbers serve a bounce)
        u = mi.Point2f(rng.next_float32(), rng.next_float32())
        turned = turn(direction, rng.next_float32(), u, active & scatters)

        # ---------------------------------------------------------- reflect
        if dr.hint(surfaces.reflecting, mode="scalar"):
            bounces = active & ~scatters
            bounce = surfaces.bounce(met, position, direction, u, bounces)
            reflected = dr.select(bounces, bounce.reflected, 1)
            lost = dr.select(bounces, weight * (1 - reflected), 0)
            escaped += dr.select(bounce.smooth, lost, 0)
            at_walls += dr.select(bounce.smooth, 0, lost)
            weight *= reflected
            survival *= reflected
            position = mi.Point3f(dr.select(bounces, bounce.position, position))
            turned = mi.Vector3f(dr.select(bounces, bounce.direction, turned))
            mirrors += dr.select(bounces & bounce.smooth, 1, 0)
            walls += dr.select(bounces & ~bounce.smooth, 1, 0)
        else:
            at_walls += dr.select(active & ~scatters, weight, 0)
            weight = dr.select(scatters, weight, 0)
        direction = mi.Vector3f(dr.normalize(dr.select(active, turned, direction)))
        scatterings += dr.select(active & scatters, 1, 0)
        active &= weight > 0

        # ---------------------------------------------------------- roulette
        hopeless = planes.behind(position, direction)
        limit = dr.select(hopeless, 2.0, ROULETTE_BELOW)
        plays = active & (survival < limit)
        lives = rng.next_float32() < ROULETTE_SURVIVAL
        before = dr.select(plays, weight, 0)
        weight = dr.select(plays, dr.select(lives, weight / ROULETTE_SURVIVAL, 0), weight)
        survival = dr.select(plays & lives, survival / ROULETTE_SURVIVAL, survival)
        invented += dr.select(plays, weight - before, 0)
        active &= ~plays | lives
        flights += 1
        unfinished += dr.select(active & (flights >= MAX_FLIGHTS), weight, 0)
        alive = active & (flights < MAX_FLIGHTS)

    # All outputs in one kernel: a sum asked for alone would walk every photon again.
    outputs = (emitted, absorbed, at_walls, escaped, unfinished, invented)
    dr.eval(tally, *outputs)
    books = [float(dr.sum(v)[0]) / (lanes * each) for v in outputs]
    sums = tally.numpy().reshape(histories.size, planes.cells)  # no copy
    if planes.images is not None:
        sums /= planes.images.astype(np.float32)
    return sums, Bookkeeping(*books)


def _launch(photons: int) -> tuple[int, int]:
    """Photons of each lane, and lanes."""
    each = min(PHOTONS_PER_LANE, photons)
    return each, -(-photons // each)


def _start(size: int, lanes: int, seed: int, first: int) -> _Start:
    """The tally, all photons' numbers and all random numbers of a launch."""
    tally = dr.zeros(mi.Float, size)
    # A literal would be written out anew for every launch, and copied to be read.
    dr.make_opaque(tally)
    # What differs from batch to batch or from layout to layout is a variable: one kernel serves them all.
    number = dr.arange(mi.UInt32, lanes) + dr.opaque(mi.UInt32, first)
    stride = dr.opaque(mi.UInt32, lanes)
    # Hashed, because neighbouring streams of this generator are not independent in their first numbers.
    low, high = mi.sample_tea_32(
        dr.opaque(mi.UInt32, int(np.random.SeedSequence(seed).generate_state(1)[0])), number
    )
    rng = mi.PCG32(size=lanes, initstate=(mi.UInt64(high) << 32) + mi.UInt64(low), initseq=mi.UInt64(number))
    return _Start(tally, number, stride, rng, ScrambledSobol(seed))


def counted(photons: int, mirror_x: bool = False) -> int:
    """What to divide the sums of `trace` by: photons that a launch really traces, and their images."""
    each, lanes = _launch(photons)
    return each * lanes * (2 if mirror_x else 1)
