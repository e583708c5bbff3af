"""Light that has met nothing, at every detector cell, from straight lines between places in it and the lamp.

A photon tells little of the light in one cell, which lies in its way by chance. The light along a straight
line is known, and the mean over a cell is that over places in it: a few lines tell more than many photons.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from lightfield.render.tracer.absorption import Absorption
from lightfield.render.tracer.flight import TransportProblem, deposit, from_lamp, tally_flight
from lightfield.render.tracer.sobol import ScrambledSobol
from lightfield.scene.lamp.frame import beyond_window

#: Lines of a launch are as many as its photons, which cost many times as much; but of a cell at least so
#: many, and at most: in single precision a sum of many equal numbers drifts.
FEWEST_LINES, MOST_LINES = 4, 256


def tally_straight(
    tally: mi.Float,
    problem: TransportProblem,
    absorption: Absorption,
    b0: mi.Float,
    photons: int,
    seed: int,
    first: int,
    mirror_x: bool,
) -> None:
    """Add to the tally what the first flights of so many photons bring, on average.

    Parameters
    ----------
    photons : int
        Of the launch; how many lines are drawn for them is chosen here.
    seed, first : int
        As `walk.trace` takes them: other photons, other lines.
    mirror_x : bool
        The tally is of twice as many photons, each at its mirror image, too.
    """
    tallied = by_flights if problem.emission.lamp.profile == "pencil" else by_cells
    tallied(tally, problem, absorption, b0, photons, seed, first, mirror_x)


def by_cells(
    tally: mi.Float,
    problem: TransportProblem,
    absorption: Absorption,
    b0: mi.Float,
    photons: int,
    seed: int,
    first: int,
    mirror_x: bool,
) -> None:
    """The mean over every cell, from lines to places in it."""
    planes, histories = problem.planes, problem.histories
    cells = len(planes.listed)
    digits = min(max(photons // cells, FEWEST_LINES), MOST_LINES).bit_length() - 1
    index = dr.arange(mi.UInt32, cells << digits)
    number = dr.gather(mi.UInt32, planes.listed, index >> digits)
    rng = _streams(seed, first, index)
    u, v = _spread(index & ((1 << digits) - 1), digits, number, seed, first, rng)
    place, cell = planes.place(number, u, v)
    window = problem.emission.on_window(rng.next_float32(), rng.next_float32())
    ray = place - window
    full = dr.norm(ray)
    direction = mi.Vector3f(ray / full)
    in_water = beyond_window(full, place.z, planes.apparent)
    start = mi.Point3f(place.x - direction.x * in_water, place.y - direction.y * in_water, 0)
    reach = problem.surfaces.meet(start, direction, mi.Bool(True)).distance
    crossing = planes.straight_to(place, cell, direction, reach)
    light = problem.emission.towards(direction) * direction.z / (full * full * planes.per_area)
    responses, straight = planes.reading(crossing, direction)
    depth = absorption.depth(start, direction, crossing.distance)
    per_line = dr.opaque(mi.Float, photons * (2 if mirror_x else 1) / (1 << digits))
    value = light * dr.exp(-depth - b0 * crossing.distance) * per_line
    none = mi.UInt32(0)
    excess = dr.maximum(crossing.distance - straight, 0)
    row = histories.row(histories.channel(none, none, none, mi.Float(0)), excess, rng.next_float32(), none)
    deposit(tally, row, planes, cell, value, responses, crossing.hits)


def by_flights(
    tally: mi.Float,
    problem: TransportProblem,
    absorption: Absorption,
    b0: mi.Float,
    photons: int,
    seed: int,
    first: int,
    mirror_x: bool,
) -> None:
    """A beam without width lights points: no line from a place in a cell finds it."""
    index = dr.arange(mi.UInt32, photons) + dr.opaque(mi.UInt32, first)
    rng = _streams(seed, first, index)
    photon = from_lamp(problem.emission.sample(index, ScrambledSobol(seed), rng))
    reach = problem.surfaces.meet(photon.position, photon.direction, mi.Bool(True)).distance
    tally_flight(tally, problem, absorption, b0, photon, reach, mirror_x, rng)


def _spread(
    index: mi.UInt32, digits: int, cell: mi.UInt32, seed: int, first: int, rng: mi.PCG32
) -> tuple[mi.Float, mi.Float]:
    """Points number `index` of 2^digits in the unit square, evenly spread.

    Hammersley's: every rectangle of one part in so many has one, here anywhere in it. Which has which is
    drawn anew for every cell and launch: errors are independent.
    """
    turn_u, turn_v = mi.sample_tea_32(dr.opaque(mi.UInt32, _key(seed, first)), cell)
    u, v = index << (32 - digits), dr.brev(index)
    kept = ((1 << digits) - 1) << (32 - digits)
    u, v = ((at ^ turn) & kept for at, turn in ((u, turn_u), (v, turn_v)))
    part = 2.0**-digits
    return tuple(mi.Float(at) * 2.0**-32 + part * rng.next_float32() for at in (u, v))


def _streams(seed: int, first: int, index: mi.UInt32) -> mi.PCG32:
    """Random numbers of their own for every line."""
    low, high = mi.sample_tea_32(dr.opaque(mi.UInt32, _key(seed, first)), index)
    return mi.PCG32(
        size=dr.width(index), initstate=(mi.UInt64(high) << 32) + mi.UInt64(low), initseq=mi.UInt64(index)
    )


def _key(*numbers: int) -> int:
    """A hash that no stream of the walk has."""
    return int(np.random.SeedSequence([0x6C696E65, *numbers]).generate_state(1)[0])
